"""The numbers that decide what an identified Stribeck curve is called and how uncertain it is."""

import math

#: The normal quantile of a two-sided 90 % interval: estimate ± Z90 standard errors. Derived: Φ^-1(0.95).
Z90 = 1.6448536269514722

# Identification (`identification`)

#: A fit with an error of eq. 5 below this is acceptable [%]. Chosen: the reference calls its fits of some percent good.
ACCEPTABLE_MSE = 5.0

# The uncertainty of a fit (`identification`)

#: Noise where it cannot be estimated, as a share of the root mean square torque. Chosen; no table.
ASSUMED_NOISE = 0.05
#: A parameter with a standard error above this share of its scale is undetermined. Chosen; no table.
UNDETERMINED_SHARE = 0.5
#: V_S is undetermined where values this far from the optimum in log V_S are as likely as the 90 % interval allows. Chosen: a
#: factor e.
STRAY = 1.0
#: Given deviations of the torque are disbelieved where the weighted residuals exceed the 1 - this quantile of χ². Chosen; no
#: table.
DISBELIEVED = 0.01

# Pressures and speeds (`pressure_laws`, `speed_protocol`)

#: A pressure law is fitted through at least this many pressures. Derived: the falling law has three coefficients.
FEWEST_PRESSURES = 3
#: A test has the reference's speeds where its ends lie this near to the reference's [rad/s]. Chosen: two steps of 50 rpm,
#: and 5 rpm of scatter.
END_TOLERANCE = 105.0 * (2 * math.pi / 60)
