"""What is kept: one SQLite file with clutches, their raw runs, and what was computed from them. Knows no HTTP.

In: rows (frozen dataclasses, SI units) and a connection. Out: the same rows, in a stated order; functions never commit.
Open `tables.py` first, the schema; each other file holds the rows of one table, `engine/` opens the file.
"""
