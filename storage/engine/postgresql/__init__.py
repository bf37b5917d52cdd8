"""A database on a PostgreSQL server: opened, read and written in transactions, and watched over.

In: its address, `postgresql+psycopg://user@host/database`. Out: a `ServerDatabase`, whose `reading` and `writing` hand out
connections. Open `database.py` first; then `connect.py` (its address, and the settings of every connection), `watch.py`,
`locks.py` and `driver_errors.py`.
"""
