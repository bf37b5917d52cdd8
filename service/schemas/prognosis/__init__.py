"""The prognosis over the wire: what ends a life, how much of it remains, and under which planned duty.

In: criteria of a clutch's record and a programme of planned duty. Out: remaining life. Open `life.py` first; then
`criteria.py` and `programme.py`.
"""
