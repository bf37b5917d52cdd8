"""Commands on the database itself, for the machine that holds it.

In: the address of a file. Out: a copy of it, a copy put in its place, what is wrong with it, or its results computed again.
Open `backup.py` first, then `verify.py`; `raw.py` is about what lies beside it.
"""
