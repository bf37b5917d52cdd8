"""One file an effect: its formula, its source, its shape grid, its prior. `catalogue.py` one floor up lists them.

In: points, with the baseline's prediction there, and an effect's amplitude and shape. Out: the change of torque. Open
`pressure_offset.py` first, a short one; what an effect is stands in `effect.py` one floor up.
"""
