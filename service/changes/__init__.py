"""One file a change of what is stored: load, compute without any lock, store in one short transaction.

In: the database and what was sent. Out: rows, and a receipt or the names of what changed. Open `ingest_run.py` first: the
others follow its order, and none knows another.
"""
