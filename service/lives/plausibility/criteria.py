"""The numbers by which a run is doubted.

A run is doubted where the slips of `slips.py` together are more probable than the run as it was sent: prior odds of a
slip, times how much better the history and physics predict the run without it.
"""

# How often which slip is made: prior odds against the run as it was sent [-]. Chosen: people mistype about one number in
# some hundred; `make plausibility` shows what it achieves.

#: A zero too many, a zero lost, two digits swapped: of each.
DIGIT_SLIP = 4e-3
#: Any other wrong number of cycles.
OTHER_CYCLES = 1e-3
#: A channel in another unit, shared among the units of `slips.UNITS`.
OTHER_UNIT = 1e-2
#: Another clutch's file under this clutch's name: with its own cycles, and with those expected here.
OTHER_CLUTCH, OTHER_TEST = 1e-2, 2e-2
#: Odds of a slip from which a run is held. Chosen: of 0.2, 0.1, 0.07 and 0.05 the lowest that holds less than half of one
#: honest run in 200; `make plausibility` shows a half and twice of it.
HELD = 0.1

# Mean COF that is possible at all (`course`, `slips`)

#: Median of a wet clutch's mean COF [-], and the deviation of its logarithm: two deviations cover 0.03 to 0.33. Chosen:
#: paper, sintered and carbon linings in oil run at 0.05 to 0.2, worn ones at half of that.
COF, LOG_COF_SD = 0.1, 0.6

# The course of mean COF over cycles (`course`)

#: Progress s is SPAN at the latest test of a life [-], whatever its cycles; deviation of the slope of log COF over s [-].
#: Chosen: half of COF is lost over what was measured within two deviations.
SPAN, SLOPE_SD = 2.0, 0.15
#: What the history chooses among: φ as a share of the cycles of the latest test, the deviation by which the slope changes in
#: a unit of s, and the scatter from run to run of log COF. Chosen: courses that slow down, go evenly and accelerate; sensors
#: of 0.3 to 5 %.
SCALES, BENDS, SCATTERS = (0.03, 0.3, 10.0), (0.03, 0.15, 1.0), (0.003, 0.012, 0.05)
#: One honest test in so many is off by more than its scatter, and the deviation of that. Chosen: gains that are misread, oil
#: that nobody logged; the blind rig's hidden effects are honest.
OUTLYING_SHARE, OUTLYING_SD = 0.02, 0.06
#: Deviation of the level's step at an event of maintenance. As in `models.tracking.criteria`.
STEP_SD = 0.05
#: Deviation of the first level of a rebuilt clutch from that of the life before. Chosen.
REBUILT_SD = 0.3
#: So many tests of a life are looked at, those nearest to the cycles in question. Chosen: what they cost, 2 ms.
MOST_TESTS = 40
#: Deviation of a dynamic test's and of an engagement's COF from a stationary test's mean. Chosen.
DYNAMIC_SD, ENGAGEMENT_SD = 0.03, 0.35
#: The same of a COF taken from the rows, where no curve was fitted. Chosen: on the rigs it is off by 1 to 3 %.
ROWS_SD = 0.05
#: The same where pressures are not the reference's, a unit of their logarithm: torque is not quite in proportion.
OTHER_PRESSURE_SD = 0.35
#: The same a kelvin of oil temperature beyond `lives.criteria.OTHER_OIL`. Chosen: some three times what Hersey's similarity
#: makes of the simulated rig's oil, 0.05 to 0.15 % a kelvin, for linings and additives differ.
OTHER_OIL_SD = 0.004

# Cycles (`pace`): weights of what the next cycles may be. Chosen; only their orders of magnitude matter.

#: At the latest cycles, where this kind is still to come; at other known ones where it is; where this kind was made already.
JOINS_LATEST, JOINS, REPEATS_TEST = 0.4, 0.05, 0.02
#: A block that begins where the last known run ended; where any did.
TILES, TILES_EARLIER = 0.6, 0.1
#: The end of any of the equal blocks that fill a life from its start. Chosen: as a late run; with 0.1 a shuffled campaign of
#: them that began with its tenth block had odds of a slip above 0.1.
BLOCKS = 0.2
#: The very gap that was between two runs before; a gap like those before, a gap of another order, a late run.
SAME_GAP, LIKE_GAP, OTHER_GAP, LATE = 0.2, 0.15, 0.2, 0.2
#: Anything.
ANYWHERE = 0.03
#: Deviation of log gap around earlier ones, and of one of another order. Chosen.
LIKE_GAP_SD, OTHER_GAP_SD = 0.3, 2.0
#: Median and deviation of log(1 + cycles) of a run of which nothing else is known. Chosen: a test of 3·10⁹ cycles is none.
CYCLES, LOG_CYCLES_SD = 5_000.0, 2.5
#: Probability that an honest run's `started_at` is out of order with its cycles. Chosen: clocks are set wrongly at
#: times.
OUT_OF_ORDER = 2e-3

# Protocols (`likelihood`)

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
PRESSURE_SPAN, LEAST_EXPONENT = 1.25, 0.4
#: Scatter of torque [-] at one speed and one pressure from which pressure was not one: loops and stick-slip are less.
SINGLE_LEVEL_SPREAD = 0.1
#: A mean COF below this is no friction where torque scatters about zero by half of itself and more.
NO_FRICTION = 0.004
#: Oil temperatures [K] that no sensor in oil shows: below what pours, above what K under the name of °C may be.
COLDEST, HOTTEST = 273.15 - 60.0, 273.15 + 450.0

#: An open clutch's drag over the torque of the pressed one [-], and the deviation of its logarithm. Chosen: a few per cent.
DRAG, LOG_DRAG_SD = 0.03, 1.2
