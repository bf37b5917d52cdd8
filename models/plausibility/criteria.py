"""The numbers by which a run is doubted. `make plausibility` leaves each mechanism out in turn.

A run is doubted where it is improbable as it was sent and a slip explains it: prior odds of a slip, times how much better
the other runs predict it without the slip.
"""

# How often which slip is made: prior odds against the run as it was sent [-]. Chosen: people mistype about one number in
# some hundred.

#: A zero too many, a zero lost, two digits swapped: of each.
DIGIT_SLIP = 4e-3
#: Any other wrong number of cycles.
OTHER_CYCLES = 1e-3
#: A channel in another unit, shared among the units.
OTHER_UNIT = 1e-2
#: Another clutch's file under this clutch's name: with its own cycles, and with those expected here.
OTHER_CLUTCH, OTHER_TEST = 1e-2, 2e-2
#: How much more seldom a run slipped that somebody confirmed [-].
CONFIRMED = 1e-2
#: Odds of a slip from which a run is held.
HELD = 0.1

# What may happen to a counter from some run on (`common_causes`): prior odds, a run. Chosen: a controller is replaced, or a
# logger unplugged, about once in some hundred tests; `make plausibility` shows what is found.

#: It restarts at zero; it rolls over, at each of the numbers below; another one takes over, or it counts in another unit; it
#: stands still; runs of another clutch come under this one's name.
COUNTER_RESTARTS, COUNTER_ROLLS_OVER, COUNTER_CHANGED, COUNTER_STANDS, TWO_CLUTCHES = 2e-3, 1e-3, 1e-3, 1e-3, 3e-4
#: What counters roll over at: 16 bits, and displays of three to seven digits.
ROLLS_OVER_AT = (65_536.0, 1e3, 1e4, 1e5, 1e6, 1e7)
#: How many cycles one of another unit is: thousands, and back; miles for kilometres, and back.
UNITS_OF_CYCLES = (1e3, 1e-3, 1.609_344, 0.621_371)
#: Steps between dates closer than this [s] say nothing of pace; nor do those before so many others; the deviation of a log
#: pace is this at least, and its degrees of freedom; one so many deviations faster than usual is asked about. Chosen: tests
#: last some minutes; with one degree of freedom, counters that jump were taken for rigs that run faster.
LEAST_SECONDS, FEWEST_RATES, LEAST_RATE_SD, RATE_FREEDOM, FAST = 60.0, 2, 0.35, 8.0, 3.0
#: So many times as fast as in every other step a rig does not suddenly run: a date is not believed (`dates`). Given.
FASTER = 20.0
#: Runs by date before and after a change that are looked at, and how many changes are asked about at once at most.
LOOKED_BACK, MOST_ASKED = 20, 4

# Mean COF that is possible at all

#: Median of a wet clutch's mean COF [-], and the deviation of its logarithm: two deviations cover 0.03 to 0.33. Chosen:
#: paper, sintered and carbon linings in oil run at 0.05 to 0.2, worn ones at half of that.
COF, LOG_COF_SD = 0.1, 0.6
#: Deviations from the median within which COF is usual, whatever the others show: 0.04 to 0.25.
USUAL = 1.5

# The course of mean COF (`course`)

#: What the runs choose among: φ as a share of the cycles of the latest test; the scatter from run to run of log COF. Chosen:
#: courses that slow down, go evenly and accelerate; sensors of 0.3 to 5 %.
SCALES, SCATTERS = (0.03, 0.3, 10.0), (0.003, 0.012, 0.05)
#: And the deviations of the change of log COF up to the latest test and of its discrepancy. Chosen: half of COF is lost
#: within some two deviations; or hardly any yet, as a life's second test often shows.
SIZES = ((0.02, 0.02), (0.3, 0.05), (0.3, 0.25), (0.3, 1.5))
#: One honest test in so many is off by more than its scatter, and the deviation of that. Chosen: gains that are misread, oil
#: that nobody logged.
OUTLYING_SHARE, OUTLYING_SD = 0.02, 0.06
#: Deviation of the level's step at an event of maintenance. As in `models.tracking.criteria`.
STEP_SD = 0.05
#: A new level from some test on: how often after an event that was declared (or a pause or gap of PAUSE times the usual),
#: how often without one, and the deviation of log COF that it steps by, as in `models.tracking.criteria`. Chosen: an oil
#: change may move COF by a fifth.
LEVEL_AFTER_EVENT, LEVEL_UNDECLARED, LEVEL_SD = 0.3, 3e-3, 0.3

# Cycles (`pace`): weights of how a run comes to its cycles. Chosen; only their orders of magnitude matter.

#: At the cycles of another kind's run; a block that begins where another run was made, at the start of the life, or that
#: is any of the equal blocks that fill a life.
JOINS, TILES, STARTS, EQUALS = 0.5, 0.5, 0.05, 0.25
#: A gap of exactly one of the last ones, a gap like one of them, a gap of their order; what is left: of any size.
SAME_GAP, LIKE_GAP, SIMILAR_GAP = 0.3, 0.3, 0.2
#: Share of the gaps like an earlier one that grow, or shrink, as the last one did.
GROWING = 0.2
#: Deviation of log gap about an earlier one [-]; how many gaps back.
LIKE_GAP_SD, MEMORY = 0.3, 5
#: A life's first run is made at its start.
AT_START = 0.5
#: Share of numbers of cycles that are planned as round ones.
ROUND = 0.5
#: Maintenance, or one of equal blocks, within the cycles that are known, and within as many again.
WITHIN, BEYOND = 0.5, 0.4
#: The most cycles that clutches see: a life may be counted in kilometres or in slips. Chosen: 10 to 1e8; a test of 3·10⁹
#: cycles is none.
MAX_CYCLES = 1e8
