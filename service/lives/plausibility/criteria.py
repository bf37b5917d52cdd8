"""The numbers of reading a run: how it is compared with the reference test of its life, and when a channel is dead.

Those of the judgement are in `models.plausibility.criteria`.
"""

import math

# Mean COF of runs that are no stationary tests

#: Deviation of a dynamic test's and of an engagement's COF from a stationary test's mean. Chosen.
DYNAMIC_SD, ENGAGEMENT_SD = 0.03, 0.35
#: The same of a COF taken from the rows, where no curve was fitted. Chosen: on the rigs it is off by 1 to 3 %.
ROWS_SD = 0.05
#: The same where pressures are not the reference's, a unit of their logarithm: torque is not quite in proportion.
OTHER_PRESSURE_SD = 0.35
#: The same a kelvin of oil temperature beyond `lives.criteria.OTHER_OIL`. Chosen: some three times what Hersey's similarity
#: makes of the simulated rig's oil, 0.05 to 0.15 % a kelvin, for linings and additives differ.
OTHER_OIL_SD = 0.004

# Pressures, speeds and oil

#: Share of tests made at other pressures or speeds than the reference test, deviation of the same and of others' logarithm.
#: Chosen: a diagnosis advises such tests.
OTHER_PROTOCOL, SAME_PROTOCOL_SD, OTHER_PROTOCOL_SD = 0.05, 0.03, 1.0
#: Highest pressure [Pa] and speed [rad/s] of a rig of which nothing is known, and the deviations of their logarithms.
#: Chosen: slow rigs are many.
PRESSURE, LOG_PRESSURE_SD, SPEED, LOG_SPEED_SD = 8e5, 1.2, 200.0, 2.0
#: Oil temperature [K] of a test and its deviation. Chosen: wet clutches are tested at 40 to 120 °C.
OIL, OIL_SD = 273.15 + 80.0, 25.0

# Dead channels (`dead_channels`). Chosen; an honest channel is far from each.

#: Rows below which nothing is said of a channel [-].
FEWEST_ROWS = 8
#: A channel whose middle 90 % differ by less than this share of its size stands still.
STILL = 2e-3
#: Speed whose middle 90 % differ by less than this share of the highest is no Stribeck test.
SPEED_STILL = 0.02
#: Highest over lowest loaded pressure from which torque must follow, and the least exponent of torque over pressure.
PRESSURE_SPAN, MIN_EXPONENT = 1.25, 0.4
#: Scatter of torque [-] at one speed and one pressure from which pressure was not one: loops and stick-slip are less.
SINGLE_LEVEL_SPREAD = 0.1
#: A mean COF below this is no friction where torque scatters about zero by half of itself and more.
NO_FRICTION = 0.004
#: Oil temperatures [K] that no sensor in oil shows: below what pours, above what K under the name of °C may be.
COLDEST, HOTTEST = 273.15 - 60.0, 273.15 + 450.0

#: An open clutch's drag as a COF: the mean of its logarithm, and the deviation. Chosen: some 3 % of a pressed one's torque.
LOG_DRAG = (math.log(0.003), 1.4)
#: Deviation of log COF of a torque that was measured while the pressure sensor was dead, for the pressure is not known.
PRESSED_SD = 0.5
