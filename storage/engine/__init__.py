"""One SQLite file: opened, read and written in transactions, watched over and copied.

In: the URL of a database, `sqlite:///path`. Out: a `Database`, whose `reading` and `writing` hand out connections.
Open `database.py` first; then `connect.py` (opening), `transactions.py`, the locks `write_lock.py` and `service_lock.py`,
`backup.py` and `restore.py`, `health.py` and `integrity.py`.
"""
