"""The numbers that decide what the filters believe before a clutch is measured, and when a test is off its track."""

import numpy as np

# The prior (`prior`)

#: The share of runs that are outlying, and how far off they are: the deviation of a further normal, as a share of the size
#: of the quantity. Chosen: a misread gain; `make score PARTS=outlying` has one run in ten off by 10 %.
OUTLYING_SHARE, OUTLYING_SIZE = 0.05, 0.1
#: The probability that a clutch whose course is eq. 6 has no discrepancy beside it. Chosen: with 90 %, small probabilities
#: of reaching the threshold were overstated (`make score PARTS=never`); no table of today.
LAW_SHARE = 0.95
#: The deviation of the level's step at an event, as a share of the size of the quantity. Chosen: `make score PARTS=events`
#: shows what it achieves, and no table compares it with others.
STEP_SIZE = 0.05
#: The same of a new level that tests show, declared or not: of friction that was lost or regained at once. Chosen: as the
#: judgement of runs, which finds the level, has its deviation; by STEP_SIZE two tests after a step of 0.4 are outlying.
LEVEL_SIZE = 0.3

#: The probability that the scatter is a share of the value, as that of a gain is, and not the same at every value. Chosen:
#: as probable as not; no table.
PROPORTIONAL_SHARE = 0.5

# The discrepancy beside eq. 6 (`discrepancy`)

#: The sizes q: the deviation of δ at the end of what was measured, as a share of the quantity. Chosen, as are the SHARES:
#: smaller or larger ones with more weight do not improve the forecasts (docs/appendix/prognosis.md: lives that do not
#: follow eq. 6).
SIZES = np.array([0.0, 0.01, 0.03, 0.1])
#: How the probability that there is a discrepancy is divided among the sizes that are not 0. Chosen: with SIZES.
SHARES = np.array([0.4, 0.35, 0.25])
#: The probability that a quantity known to fall takes the course of eq. 6, and the shares of the other courses (`courses`).
#: Chosen: the first by `make score PARTS=belief`; of some ten divisions of the rest none was better in all laws, no table.
EQ_6_SHARE, COURSE_SHARES = 0.55, np.array([0.2, 0.15, 0.15, 0.3, 0.2])
#: The sizes q beside the other courses, and their shares. Chosen: without 0.3, filters that clog are forecast late; no
#: table.
OTHER_SIZES, OTHER_SHARES = np.array([0.01, 0.03, 0.1, 0.3]), np.array([0.25, 0.25, 0.25, 0.25])
#: Beyond this many times the progress measured so far δ is level: what is seen over a tenth of a course must not make every
#: course pass every threshold in the end. Chosen; no table.
LEVELLING = 10.0

# A knee ahead (`discrepancy`)

#: The hazard of a knee per e-fold of progress, of a course that is a shape or has a discrepancy, and the median of how many
#: times its mean pace so far such a course goes faster from then on, with the deviation of its logarithm. Chosen:
#: `make score PARTS=knees`. On real lives (`make real`, the half for developing) 21 % of the intervals as stated begin after
#: the end without knees, in up to 64 % of a row; with hazards of 0.3, 0.4 and 0.6 and a median of 4 it is 5, 4 and 2 %, up
#: to 27, 20 and 20 %; with 0.3 and a median of 8 3 %, up to 20 %. By the last 8 % of lives of eq. 6 and 30 % of those of
#: other laws are said to be near their end at 60 % of it (7 and 2 % without knees); by 0.4 and 8 19 and 54 %.
KNEE_HAZARD, KNEE_PACE, LOG_KNEE_PACE_SD = 0.3, 8.0, 1.0
#: The share of the value when new up to which a course shows no wear, and which counts as worn beside what it has lost
#: where a knee comes. Chosen: `make score PARTS=starts` (200 simulated starts, 103 real ones, ad hoc): with no such share,
#: 0.03, 0.05 and 0.1 the safe bound lies beyond the end in 58, 17, 9 and 2 %, in the median at 7, 2.6, 2.2 and 1.8 times the
#: cycles tested.
UNSEEN_WEAR = 0.1
#: Up to how many times T eq. 6 alone may have a knee while it shows no wear. Chosen: 50 lives of eq. 6 and 80 that may
#: never end (ad hoc). By a reach of 3 and 10 the CRPS at 20 % of life stays, and the Brier score of an end is 0.10 and 0.14
#: (0.07 without). With knees to all of a probability of 0.3 or 0.6 in place of the hazard that CRPS is 1.6 and 1.25 times as
#: large, and the Brier score 0.09 and 0.14; without an end to their reach 88 % was told where 44 % ended.
KNEE_REACH = 2.0

# A test off the track (`innovation`)

#: Deviations beyond which a test is off the track. Derived: one test in 16,000 of a clutch that follows eq. 6.
FAR = 4.0
#: Tests that must have been before anything is off their track. Chosen; no table.
FEWEST_BEFORE = 4


# What the filters neglect (`outlying_runs`, `filters`)

#: Deviations to either side that count as a prior's range. Derived: 6e-5 of a normal lies beyond.
REACH = 4.0
#: A node belongs to the mass where its log density is less than this below the highest. Derived: 4.2 deviations of a normal.
DEPTH = 9.0
#: Sets of outlying runs that are kept, at most. Chosen; no table.
MOST = 6
#: Deviations from the prior mean that an unscented filter's state may reach. Chosen; no table.
DOMAIN = 6.0
#: A form of less probability before a test has no normal. Chosen: docs/appendix/prognosis.md (beside the exact posterior).
LEAST_FORM = 0.007

# Older tests of a long history (`merged_tests`)

#: Tests up to which none are merged, and how many of the newest never are. Chosen: docs/appendix/scale.md (one life).
UNMERGED, NEWEST = 100, 6
#: Bins across the measured progress, and bins for each e-fold of progress from the usual distance of tests on.
LINEAR, LOGARITHMIC = 12.0, 3.5
#: A test is not merged where the log odds that it is outlying are less than this either way, and of those so many at most.
DOUBTFUL, MAX_APART = 2.0, 12
#: A bin whose tests scatter more than is usual by so many deviations is split in halves, the worst first, so often at most.
SPLIT_FROM, MAX_SPLIT = 4.0, 12
