"""A pure function of each of many inputs, computed in this process, in a pool of processes, or on a Dask cluster.

In: a function that a module defines, its inputs one after the other, and the one option `--scheduler`. Out: an `Outcome` for
each input, the same whichever executor made it. Open `executor.py` first, then `choice.py`, which makes one of the option;
`bounded.py` is what `processes.py` and `cluster.py` share, `progress.py` what is shown meanwhile.
"""
