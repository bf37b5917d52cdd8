"""Whether a run is plausible, before it changes anything.

In: a run, its own results, and the clutch's state without it. Out: doubts, each a code and a sentence; none for an honest
run. Open `doubts.py` first.
"""
