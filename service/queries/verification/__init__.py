"""What is stored, held against itself: nothing is changed.

In: a database and a clutch's name. Out: findings, a sentence each, none where all is as it should be. Open `content.py`
first (runs as they were sent), then `results.py` (what was computed of them) and `surfaces.py` (inspections and their
photographs).
"""
