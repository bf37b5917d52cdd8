"""What is kept of clutches, their raw runs, and what was computed from them: in a SQLite file or on PostgreSQL. No HTTP.

In: rows (frozen dataclasses, SI units) and a connection. Out: the same rows, in a stated order; functions never commit.
Open `tables.py` first, the schema, then `rows.py`, how values become rows; each other file holds the rows of one table,
`dialects.py` what the two databases say differently; `engine/` opens them.
"""
