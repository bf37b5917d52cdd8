"""Every quantity that is followed along a life beside mean COF, by any filter: parameters, slope, the lag of friction.

In: a life with its fitted curves and its receipts. Out: series, samples of eq. 6, items of `/degradation`, and the end of
life by any limit. Open `measured.py` first, which lists them; then `items.py` and `ends.py`.
"""
