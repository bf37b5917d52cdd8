"""A database that is one SQLite file: opened, read and written in transactions, watched over and copied.

In: the path of the file, or its address. Out: a `FileDatabase`, whose `reading` and `writing` hand out connections.
Open `database.py` first; then `connect.py` (how the file is opened, and its locks) and `backup.py` (whole copies).
"""
