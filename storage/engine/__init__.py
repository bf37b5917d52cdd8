"""A database is opened, read and written in transactions, and watched over.

In: the address of a database, `sqlite:///path` or `postgresql+psycopg://user@host/database`. Out: a `Database`, whose
`reading` and `writing` hand out connections. Open `database.py` first, what the rest of the program holds; `opening.py`
makes one, `sqlite/` of a file, `postgresql/` of a database on a server.
"""
