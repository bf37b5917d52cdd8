"""A database that is one SQLite file: opened, read and written in transactions, watched over and copied.

In: the path of the file, or its address. Out: a `FileDatabase`, whose `reading` and `writing` hand out connections.
Open `database.py` first; then `connect.py` (opening), `transactions.py`, `watch.py`, the locks `write_lock.py` and
`service_lock.py`, `backup.py` and `restore.py`, `health.py` and `integrity.py`.
"""
