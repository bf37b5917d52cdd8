"""`make load`: one test field's rigs and clients against a running service, and what is left of their runs afterwards.

In: how many rigs and clients, for how long. Out: a table of latencies, memory and losses, and whether the demands hold.
Open `__main__.py` first; `field.py` is the load itself.
"""
