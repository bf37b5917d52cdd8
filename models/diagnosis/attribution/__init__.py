"""Chapter 7, attribution: which effect, or which two, and whether one may be named.

In go a baseline, its alarms and raw records' evidence; out comes a `Judgement`. Open `investigate.py`, then `decide.py`: the
verdict is decided there and nowhere else.
"""
