"""Dynamic Stribeck tests: `loops` first, then `loop_area` (eq. 8) and `lag_fit` with the two `lag_laws`.

In: a record of a swinging speed at one or several pressures, and the stationary curves. Out: for each pressure the area and
direction of the loop of torque over speed, and how far friction lags. Where torque is higher while accelerating, two laws
can be the cause: an attractor that torque runs after (GMS), whose loop is negative wherever the curve rises, or a
squeezed film that takes time to follow the speed, whose loop is positive everywhere. Both are laws of one number.
"""
