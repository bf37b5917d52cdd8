"""One engagement on the rig: `capacity` (what the clutch can transfer), then `simulation` (the shaft that it stops).

In: Stribeck parameters by pressure, a profile of pressure and a drive. Out: the trace of one engagement.
"""
