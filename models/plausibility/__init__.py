"""Which runs of a clutch slipped on their way in: one joint judgement over all of them, the doubtful ones included.

In: runs as numbers (`slips`): what each shows as it was sent, and as it would be without each slip that it may suffer.
Out: the probability of a slip for each run, and which slip. Open `judgement.py` first; then `course.py` (mean COF over a
life, on the tracker's courses) and `pace.py` (at which cycles runs are made).
"""
