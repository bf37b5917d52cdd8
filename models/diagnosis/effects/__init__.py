"""Chapter 4, the effects: the possible causes, each one value in the file of its family. The files are thermal.py (oil and
heat), readings.py (gauges and channels), moving.py (what only motion shows), history.py (use). faults.py holds what rigs do
and nobody may name.

In go points and the baseline's prediction there; out comes a change of torque. Open `effect.py`, then `catalogue.py`.
"""
