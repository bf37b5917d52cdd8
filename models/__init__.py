"""Numerics, and nothing else: arrays and values in, values out; randomness is an argument.

In reading order: `clutch` (geometry), `friction` (stationary curves), `records` (raw tests), `loops` (dynamic tests),
`engagements`, `degradation` (eq. 6), `tracking` (one quantity along a life), `prognosis` (end of life, fleets), `diagnosis`
(what the baseline model does not explain) and `rig` (the simulated rig that makes all of it).
"""
