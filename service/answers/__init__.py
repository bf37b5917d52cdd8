"""One file an answer; none changes what is stored.

In: the database, a clutch's name and the arguments of a request. Out: models of `api/`.
Open `remaining_life.py` first; `store.py` keeps computed answers as bytes.
"""
