"""A clutch's history as values, and all that is computed of it: no SQL, no HTTP.

In: runs as they were sent, and what was computed of earlier ones. Out: fits, tracks, predictions, receipts, reports. Open
`recomputation.py` first, which computes all of it; then `analysis.py`, `timeline.py`, `assumptions.py`, `tracking.py`.
"""
