"""Engagements, simulated and measured: what the clutch can transfer, the shaft that it brings to a stop, and its indicators.

In: Stribeck parameters by pressure, a profile of pressure and a drive; or the record of one engagement. Out: the trace of a
simulated engagement; the indicators of a measured one, how far it is from the first ones, and from a model's. Open
`simulation.py` first; of measured ones `slip.py`, `measured.py`, `comparison.py`, `discrepancy.py`.
"""
