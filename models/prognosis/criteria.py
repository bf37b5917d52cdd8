"""The numbers that decide what a prognosis states and what a fleet teaches. What ends a life is a setting of its clutch, and
`first_passage.py` finds when that is reached."""

import numpy as np

#: The levels of the quantiles that are stated. Fixed by the public contract.
QUANTILES = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95)
#: The quantiles of a band that a plot shows: a 90 % interval and its median.
BAND = (0.05, 0.5, 0.95)
#: Cycles beyond which an end of life is not distinguished from never. Fixed by the public contract.
HORIZON = 1_000_000.0
#: Nothing is predicted from fewer tests at different progress. Chosen; no table: eq. 6 has four coefficients.
FEWEST_TESTS = 3

# Where a clutch was new (`stated_end`)

#: The probability that the counter of a clutch that is first tested late began with another one. Chosen: with 2, 5, 10 and
#: 20 % 71, 86, 90 and 100 % of the ends of clutches whose counter began a life early are held at 80 % of their life, and all
#: of those whose counter began five lives early; the CRPS of the end's logarithm of lives of eq. 6 that are first tested at
#: 30 % of their life is 1.02, 1.05, 1.11 and 1.26 times as large (docs/appendix/prognosis.md, Where the first test is late).
COUNTED_ELSEWHERE = 0.05
#: The share of what was measured before which a first test is not late. Derived: its end is off by less than that.
LATE_START = 0.05

# What earlier forecasts said about the tests since (`back_cast`)

#: Multiples of its progress at which a forecast is kept. Chosen; no table.
AHEAD = (1.0, 1.25, 1.5, 2.0, 3.0)
#: The share of the tests that intervals are to hold. Fixed: they are those of 90 %.
COVERAGE = 0.9

# What a fleet teaches (`fleet`)

#: A clutch with fewer tests than this says too little to teach anything. Chosen; no table.
FEWEST_TESTS_TO_LEARN = 6
#: Fewer clutches than this are no fleet [-]. Chosen; no table.
FEWEST_CLUTCHES = 3
#: A fleet of n has the share TRUST n/(n + DOUBT) of the mixture: most of it stays weak, for the evidence soon speaks for a
#: fleet that is right, and slowly against one that is wrong. Chosen: `make score PARTS=fleets` shows what it achieves.
TRUST, DOUBT = 0.25, 3.0

# What ended lives say of one that has not (`ended_lives`): what it achieves: docs/appendix/prognosis.md, A fleet's prior

#: Fewer lives than this tell no exponent of their work. Derived: two lie on any power.
FEWEST_SEVERITIES = 3
#: Of a course that an ended life has taken: the deviation q of δ at the end and that of the scatter, in shares of the way
#: to the threshold, each as probable; the deviation of a, and for each q that of the logarithm of what remains where all of
#: it does. Chosen on the half for developing of `make real`: with q of 0.3 and 1 % besides, intervals hold 85 %; with 80 %
#: they score 5 % worse; scatter below 0.6 %, that of the ended life's own tests, makes a straight course fit better than any
#: measured one, from 1.2 % on knees are predicted a fifth worse; a of 0.2 and 0.4 score alike; 0.2 for the last, whatever q,
#: holds 80 %, 0.45 as many as 0.35 with a worse score, and by q the score is 2 % better.
COURSE_DISCREPANCIES, COURSE_SCATTERS = np.array([0.03, 0.1, 0.3]), np.array([0.006, 0.012, 0.03, 0.08, 0.2])
COURSE_SIZE_SD, COURSE_STRETCH_SD = 0.1, np.array([0.2, 0.35, 0.5])
#: What is known before of the share of a kind that follows a law of the filters with the least discrepancy, worth so many
#: ended lives that do, and that do not: Jeffreys'. Chosen on 4 fleets of each kind of `make score PARTS=ended` and the half
#: for developing of `make real` (ad hoc): CRPS at 80 % of life over the filter's own, with two ended lives, is 1.0 for
#: eq. 6, 0.7 for a straight line and 0.6 for a logarithm, where a share of eq. 6 alone, and no evidence of the clutch's
#: tests, had 1.1, 1.8 and 2.5; real lives, powers and knees stay as they were, within 1 %. With (1, 0.5) the first stay, and
#: powers cost 2 to 11 % more.
LAWFUL_WORTH = (0.5, 0.5)
#: How often a clutch is of another kind than its fleet, before its tests have spoken. Chosen: what is left to another kind
#: may reach the horizon and then decides the mean CRPS. With 0.02 and 0.05 it is 5.6 and 7.3 % of life on real lives with
#: ten ended ones (ends alone 9.7); a fleet that lived four times as long costs lives of eq. 6 3.5 and 2.7 times the CRPS of
#: their own filter, nearly all of it before 60 % of life.
OTHER_KIND = 0.02
#: How early a life is declared worn: the mean of log(end by its criterion / declared), and the odds that its tests show
#: nothing of what ended it. Chosen on the filters of `make real`. Stopped at 98 % of their threshold, the first of 0.03, 0.1
#: and 0.3 scatters by 0.5, 0.6 and 0.8 % of the end; the second of 0.1, 0.02 and 0.005 errs by 1.4, 0.9 and 0.8 %, and
#: states 4.3, 2.2 and 1.4 %.
DECLARED_EARLY, DECLARED_UNSEEN = 0.1, 0.005
#: How far the mean of the log ends may lie from their median, in deviations. Chosen: nothing is known of it.
VAGUE = 10.0
#: What is known of the variance of log ends before: shape and scale of an inverse gamma, a sixth of a life apart. Chosen: a
#: third of the scale holds 87 % in place of 90 % with three ended lives (`make real`).
END_WORTH = (1.0, 0.03)
