"""The numbers that decide what an identified Stribeck curve is called and how uncertain it is."""

#: The normal quantile of a two-sided 90 % interval: estimate ± Z90 standard errors. Derived: Φ^-1(0.95).
Z90 = 1.6448536269514722

#: A fit with an error of eq. 5 below this is acceptable [%]. Chosen: the reference calls its fits of some percent good.
ACCEPTABLE_MSE = 5.0

#: Noise where it cannot be estimated, as a share of the root mean square torque. Chosen; no table.
ASSUMED_NOISE = 0.05

#: A pressure law is fitted through at least this many pressures. Derived: the falling law has three coefficients.
FEWEST_PRESSURES = 3
