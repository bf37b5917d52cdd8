"""Chapter 6, detection: is there anything beyond noise, and on which axes.

In goes the baseline's fit; out come alarms with their thresholds, misfits by axis, evidence from raw records. Open
`alarm.py`, then `lack_of_fit.py`.
"""
