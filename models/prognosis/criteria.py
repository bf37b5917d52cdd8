"""The numbers that decide what a prognosis states and what a fleet teaches."""

import numpy as np

#: The levels of the quantiles that are stated. Fixed by the public contract.
QUANTILES = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95)
#: The quantiles of a band that a plot shows: a 90 % interval and its median.
BAND = (0.05, 0.5, 0.95)
#: Cycles beyond which an end of life is not distinguished from never. Fixed by the public contract.
HORIZON = 1_000_000.0
#: Nothing is predicted from fewer tests at different progress. Chosen; no table: eq. 6 has four coefficients.
FEWEST_TESTS = 3

# What earlier forecasts said about the tests since (`back_cast`)

#: Multiples of its progress at which a forecast is kept. Chosen; no table.
AHEAD = (1.0, 1.25, 1.5, 2.0, 3.0)
#: The share of the tests that intervals are to hold. Fixed: they are those of 90 %.
COVERAGE = 0.9

# Mean COF from the parameters' tracks (`from_parameters`)

#: Mean COF from the parameters and its direct track disagree where they are further apart than this many deviations. Chosen;
#: no table.
FAR_APART = 3.0

# What a fleet teaches (`fleet`)

#: A clutch with fewer tests than this says too little to teach anything. Chosen; no table.
FEWEST_TESTS_TO_LEARN = 6
#: Fewer clutches than this are no fleet [-]. Chosen; no table.
FEWEST_CLUTCHES = 3
#: The hyperprior: the deviations of (Δ/ξ0, log φ, log ε, log s/ξ0) among clutches of one kind. Chosen; no table.
HYPER_SD = np.array([0.15, 0.6, 0.4, 0.5])
#: How many clutches that is worth, and how many the centre of the weak prior is worth as the population's mean. Chosen; no
#: table.
HYPER_CLUTCHES, HYPER_CENTRE = 6.0, 0.03
#: A fleet of n has the share TRUST n/(n + DOUBT) of the mixture: most of it stays weak, for the evidence soon speaks for a
#: fleet that is right, and slowly against one that is wrong. Chosen: `make score PARTS=fleets` shows what it achieves.
TRUST, DOUBT = 0.25, 3.0

# What ended lives say of one that has not (`ended_lives`): what it achieves: docs/appendix/prognosis.md, A fleet's prior

#: More ended lives than this say no more: their predictive is within 3 % of the normal's width, and each costs every answer
#: 0.1 ms. Chosen; no table.
MOST_ENDED = 40
#: And fewer lives than this tell no exponent of their work. Derived: two lie on any power.
FEWEST_SEVERITIES = 3
#: Of a course that an ended life has taken: the deviation q of δ at the end and that of the scatter, in shares of the way
#: to the threshold, each as probable; the deviation of a, and for each q that of the logarithm of what remains where all of
#: it does. Chosen on the half for developing of `make real`: with q of 0.3 and 1 % besides, intervals hold 85 %; with 80 %
#: they score 5 % worse; scatter below 0.6 %, that of the ended life's own tests, makes a straight course fit better than any
#: measured one, from 1.2 % on knees are predicted a fifth worse; a of 0.2 and 0.4 score alike; 0.2 for the last, whatever q,
#: holds 80 %, 0.45 as many as 0.35 with a worse score, and by q the score is 2 % better.
COURSE_DISCREPANCIES, COURSE_SCATTERS = np.array([0.03, 0.1, 0.3]), np.array([0.006, 0.012, 0.03, 0.08, 0.2])
COURSE_SIZE_SD, COURSE_STRETCH_SD = 0.1, np.array([0.2, 0.35, 0.5])
#: What is known before of the share of a kind that follows eq. 6 with nothing beside it, worth so many ended lives that do,
#: and that do not: Jeffreys' beta. By whole courses simulated kinds of eq. 6 then have 0.92 with ten ended lives and 0.81
#: with two, real ones of the half for developing 0.06 and 0.17. CRPS at 80 % of a life of eq. 6 falls from 2.1 times that of
#: its filter alone to 1.0 times with ten ended lives, from 2.8 to 1.1 with three; that of real lives stays. A fixed share of
#: a half costs the former 1.3 times, and real lives a sixth; (1, 0.5) forecasts four lives that accelerate 2 % later.
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
