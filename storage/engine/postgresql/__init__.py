"""A database on a PostgreSQL server: opened, read and written in transactions, and watched over.

In: its address, `postgresql+psycopg://user@host/database`. Out: a `ServerDatabase`, whose `reading` and `writing` hand out
connections. Open `database.py` first; then `connect.py` (its address, the settings of every connection, locks and errors).
"""
