"""One engagement on the rig: what the clutch can transfer, and the shaft that it brings to a stop.

In: Stribeck parameters by pressure, a profile of pressure and a drive. Out: the trace of one engagement. Open `capacity.py`
first, then `simulation.py`.
"""
