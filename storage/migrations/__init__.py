"""The schema's history, and how a file is brought to its newest state.

In: a connection in a writing transaction. Out: the same database with the tables of `storage/tables.py`.
Open `upgrade.py` first; the steps stand in `versions/`, in the order of their numbers.
"""
