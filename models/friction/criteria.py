"""The numbers that decide what an identified Stribeck curve is called and how uncertain it is."""

#: The normal quantile of a two-sided 90 % interval: estimate ± Z90 standard errors. Derived: Φ^-1(0.95).
Z90 = 1.6448536269514722

#: A fit with an error of eq. 5 below this is acceptable [%]. Chosen: the reference calls its fits of some percent good.
ACCEPTABLE_MSE = 5.0

#: And one whose RMSE is below so many deviations of the points' noise [-]: of a flat curve eq. 5 is noise over noise.
#: Chosen on 300 flat curves each of 6 to 200 speeds: right for 99.7 % that follow eq. 3; of those that miss it smoothly by
#: twice the noise it refuses 34 % at 15 speeds, 79 % at 20 and 99 % at 40 (1.1: 97.7 %; 85, 98, 100 %; 1.5: all; 1, 12, 64).
ACCEPTABLE_ERROR = 1.25

#: A static torque below this share of the root mean square torque [-] is none. Derived: a fit sets it to a millionth where
#: it would be 0 (`identification`), and no sensor resolves a ten-thousandth.
NO_STATIC_TORQUE = 1e-4

#: Noise where it cannot be estimated, as a share of the root mean square torque. Chosen; no table.
ASSUMED_NOISE = 0.05

#: A pressure law is fitted through at least this many pressures. Derived: the falling law has three coefficients.
FEWEST_PRESSURES = 3
