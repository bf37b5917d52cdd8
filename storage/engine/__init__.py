"""One SQLite file: opened, read and written in transactions, watched over and copied.

In: the URL of a database, `sqlite:///path`. Out: a `Database`, whose `reading` and `writing` hand out connections.
Open `database.py` first; then `connect.py` (opening), `transactions.py`, `health.py`, `backup.py`.
"""
