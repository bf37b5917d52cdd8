"""A database's content in another database, of whichever kind: copied, compared, released.

In: two addresses. Out: the target with the same rows, which no service may use before all tables' digests agree. Open
`transfer.py` first; `digest.py` says what makes two tables the same.
"""
