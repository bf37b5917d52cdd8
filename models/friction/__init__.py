"""Stationary Stribeck curves, eq. 2-5: `stribeck` first, then `identification`, whose halves follow it.

In: the plateaus of a stationary test as curves of torque over sliding velocity. Out: the four parameters of every pressure
with covariance and status, the mean torque, and how the parameters depend on pressure.
"""
