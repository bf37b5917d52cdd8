"""One file an answer; none changes what is stored.

In: the database, a clutch's name and the arguments of a request. Out: dictionaries and lists in the shapes of `api/`.
Open `remaining_life.py` first; `cache.py` keeps computed answers as bytes.
"""
