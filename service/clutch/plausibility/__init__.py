"""Is a run what it says it is? Runs that a slip of the hand or of a cable explains better are doubted, and held.

In: a run, its own results, the run as the history sees it, and the clutch's state without it. Out: doubts in words, none
for most runs. Open `doubts.py` first; then `reading.py`. The judgement itself is `models.plausibility`.
"""
