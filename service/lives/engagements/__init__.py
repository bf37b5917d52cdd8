"""Measured engagements: the record that a block of duty carries, evaluated, and its indicators over a life.

In: the channels of a run, or what is stored of several. Out: a receipt's part, rows over cycles, and columns by indicator
for whoever tracks one. Open `evaluation.py` first, then `over_life.py`.
"""
