"""Is a run what it says it is? Runs that a slip of the hand or of a cable explains better are doubted, and held.

In: a run, its own results, the run as the history sees it, and the clutch's state without it. Out: doubts in words, none
for most runs. Open `doubts.py` first; then `slips.py` (what may have gone wrong), `likelihood.py` with `pace.py` and
`course.py` (how well a run goes with the history), `dead_channels.py` and `wording.py`.
"""
