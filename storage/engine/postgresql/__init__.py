"""A database on a PostgreSQL server: opened, read and written in transactions, and watched over.

In: its address, `postgresql+psycopg://user@host/database`. Out: a `ServerDatabase`, whose `reading` and `writing` hand out
connections. Open `database.py` first; then `connect.py` (its address, and the settings of every connection), `locks.py`
and `driver_errors.py`; beside transactions `single_statements.py`, by which `watch.py` and `shared_answers.py` ask.
"""
