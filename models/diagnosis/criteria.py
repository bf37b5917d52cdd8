"""Every number on which a diagnosis decides from the effects on: its meaning, its unit, and where it is from.

Design, baseline, noise, uncatalogued effects and raw records have their own `criteria.py`, the templates of single effects
their priors beside them. "chosen; no table" says that no record was kept of what else was tried;
What the whole does on hidden effects (`make blind`): docs/appendix/diagnosis.md.
 λ is the expected log-likelihood ratio [nats]
of an effect (`pooled_fit.projection`), for the best hypothesis estimated by the drop of its cost.
"""

# --- effects -------------------------------------------------------------------------------------------------------------

#: Deviation of each coefficient of a template's model discrepancy [-] (chosen; no table).
DISCREPANCY_SD = 0.25

# --- pooled fit ----------------------------------------------------------------------------------------------------------

#: Fewest plateaus of stationary tests under pressure, and fewest distinct speeds among them, for a baseline (chosen; no
#: table: a Stribeck curve has four parameters and the laws over pressure and life multiply them).
FEWEST_ROWS, FEWEST_SPEEDS = 24, 6
#: Torques [Nm] outside this range are no clutch's (chosen; no table).
LEAST_TORQUE, MOST_TORQUE = 1e-6, 1e7
#: Noise of plateaus or of loops [-], a share of the usual torque, below which there is none to weigh anything by. Derived:
#: with gains of MOST_GAIN over 1,000 rows (2e-2/1e-6)² · 1e3 is 4e11, a ten-thousandth of what 64 bits can tell from 1; a
#: 16-bit channel rounds at 1.5e-5.
LEAST_NOISE_SHARE = 1e-6
#: From so many plateaus on every curve is determined and one start is enough (chosen; no table).
MANY_PLATEAUS = 8000
#: Deviation of the difference of the two shares of one law, which are expected to drift alike [-]; the open clutch's
#: drag as a share of the usual torque [-] (chosen; no table).
ALIKE_SD, DRAG_SD = 0.1, 0.3
#: Scatter of the runs' gains that is considered [-], lowest and highest, and its prior: log-normal about a usual one,
#: narrower above it, for a rig that repeats that badly would not be used; larger differences from test to test are
#: structure (chosen).
LEAST_GAIN, MOST_GAIN = 2e-4, 2e-2
USUAL_GAIN, GAIN_SD_BELOW, GAIN_SD_ABOVE = 2.5e-3, 1.0, 0.6
#: What the data must say of the runs' scatter beyond its prior [nats] for the estimate to be theirs (derived: a deviation of
#: ln σ_g half the prior's, about the same mean, is ln 2 - 3/8 = 0.32).
LEAST_SCATTER_INFORMATION = 0.32
#: Scatter of the curves' gains within a run, and the size from which its prior falls [-] (chosen; a controller that
#: comes back to 0.005 bar makes 0.1 %).
CURVE_GAINS, SMALL_CURVE_GAIN = (0.0, 4e-4, 1e-3, 2.5e-3, 6e-3), 1e-3
#: Curves' gains up to this multiple of the noise's own are considered: its own and the next above (derived: CURVE_GAINS'
#: steps).
MORE_CURVE_GAIN = 2.6
#: Evidence [nats] by which a scatter of the curves' gains must be likelier than none to be taken (chosen; no table).
LEAST_CURVE_GAIN_EVIDENCE = 0.5

# --- detection -----------------------------------------------------------------------------------------------------------

#: False alarms allowed to each statistic, shares of campaigns without an effect (chosen: they sum to about 1 %; measured
#: 1.2 % in 400 campaigns, `make blind SEED=191 SIZE=0.25 ONLY=none`).
EFFECTS_FALSE_ALARMS, CONTRASTS_FALSE_ALARMS, LINES_FALSE_ALARMS = 0.006, 0.0025, 0.001
#: A change of which less than this share is left after the baseline took up the rest is invisible (derived: rounding).
LEAST_VISIBLE_SHARE = 1e-6
#: Deviations τ of a contrast's coefficient that are averaged over, shares of the torque (chosen; no table).
CONTRAST_SIZES = (0.001, 0.003, 0.01, 0.03)

# --- attribution: which hypotheses are refitted --------------------------------------------------------------------------

#: Twice λ [nats] of an effect of usual size: an effect that shows less cannot be judged (chosen; no table).
LEAST_INFORMATION = 0.01
#: An effect is searched from so many of its shapes, no two of which share more than this of their visible part [-] (chosen;
#: no table).
SHAPES_TRIED, MOST_ALIKE = 4, 0.9
#: So many single effects and pairs of the linear screens are refitted at most (chosen; no table: it bounds the time).
SINGLES_REFITTED, PAIRS_REFITTED = 5, 4
#: ... where the screen has them this close [nats] to the best, and this share of λ more (chosen; no table).
SCREEN_MARGIN, SCREEN_MARGIN_SHARE = 9.0, 0.2
#: So many of them are searched from other shapes as well, and from other laws where λ [nats] would be so much if the
#: baseline absorbed nothing: so far off, nothing is linear (chosen; no table).
SINGLES_RESTARTED, MUCH_ABSORBED = 1, 1000.0
#: Evidence [nats] over the best single that a pair of the linear screen must promise to be refitted (chosen; no table).
LEAST_PAIR_PROMISE = -1.0
#: A second effect is searched beside so many of the best singles, so many of each are refitted, and each must promise this
#: much evidence [nats] (chosen; no table).
FIRSTS_OF_PAIRS, SECONDS_OF_PAIRS, LEAST_SECOND_PROMISE = 2, 3, 3.0
#: A pair is refitted from its other half as well where that promises at most so much less [nats] (chosen; no table).
OTHER_HALF_MARGIN = 6.0
#: A baseline whose evidence is better by so much [nats] replaces the first one (chosen; no table).
BETTER_BASELINE = 1.0
#: So many uncatalogued rig faults are refitted at most, where they promise to come near the best (chosen; no table: it
#: bounds the time).
FAULTS_REFITTED = 2
#: Deviation of ln ν in a test whose oil temperature varies by some 3 K (derived: about what ASTM D341 gives near 85 °C),
#: and the factors on it that are averaged over from test to test and within a test (chosen; no table).
USUAL_VISCOSITY_CHANGE = 0.06
CHANGES_BETWEEN_TESTS, CHANGES_WITHIN_TESTS = (0.5, 1.5, 4.0), (0.0, 0.5, 1.5, 4.0)

# --- attribution: the check of a case ------------------------------------------------------------------------------------

#: What a right template may leave behind, as a share of λ; and what different amplitudes in parts of the data may be
#: worth, as a share of λ (parts that differ by δ cost about δ² λ/4) (chosen; no table).
TOLERANCE, PARTS_TOLERANCE = 0.05, 0.15
#: False alarms allowed in checking a case: structure that is left, and amplitudes that differ between parts (chosen; no
#: table).
LEFT_FALSE_ALARMS, PARTS_FALSE_ALARMS = 5e-3, 3e-3
#: Two effects worth so much more separately than together (Σ λ_i/λ) cancel each other, and then miss the check by so many
#: nats (chosen: grooves that clog had been named drag together with an exponent).
MOST_UNDONE, UNDONE_EXCESS = 2.5, 8.0

# --- attribution: the verdict --------------------------------------------------------------------------------------------

#: An alarm that neither an effect nor an axis of structure confirms must be so much [nats] beyond its threshold
#: (derived: ln 5, about five times rarer by chance). That of the effects more: where no effect has evidence once
#: refitted, the shape that raised it was one of many (chosen; no table).
UNCONFIRMED, UNCONFIRMED_EFFECTS = 1.6, 6.0
#: Evidence [nats] over no effect from which a cause is considered (chosen; no table).
LEAST_EVIDENCE = 3.0
#: Hypotheses within this evidence [nats] of the best belong to the credible set (derived: 4.6 = ln 100; pairs, of which
#: each half has evidence of its own, within less: chosen), and this share of λ more (chosen; no table).
CREDIBLE_MARGIN, CREDIBLE_MARGIN_PAIRS, CREDIBLE_MARGIN_SHARE = 4.6, 3.0, 0.005
#: At most so many hypotheses of the credible set are checked (chosen; no table: it bounds the time).
MOST_CHECKED = 4
#: Log prior odds [nats] against two effects at once, and further against two of one family: the second may correct the
#: template of the first (chosen; no table).
PAIR_LOG_ODDS, SAME_FAMILY_LOG_ODDS = 4.0, 8.0
#: Structure that no effect explains may lead by this share of λ beyond so many nats (below, no template's error shows)
#: (chosen).
STRUCTURE_SHARE, STRUCTURE_FROM = 0.05, 20.0
#: ... and by so many nats in any case (derived: about ln 8, the choice among some eight axes).
AXES_LOG_ODDS = 2.0
#: Probability from which a cause is named, and from which the second of two is (chosen; no table).
LEAST_NAMED, LEAST_SECOND_NAMED = 0.85, 0.8
#: Probability that the explanations hold among which an ambiguous case leaves the choice (chosen; no table), that below
#: which one is left out, and that of a doubt where what a cause leaves is no noise (chosen: it must stay below a half).
CREDIBLE_MASS, LEAST_EXPLANATION, DOUBT = 0.95, 1e-4, 0.4
#: Prior probability that anything is wrong, by which an alarm's p-value counts where the model is adequate (chosen).
WRONG = 0.1
#: A cause whose remainder would be this odd by chance in fewer cases (p-value) is not named; however large λ, the right
#: template explains no more than so many nats of that (chosen; no table).
LEAST_REMAINDER_P_VALUE, MOST_LEFT = 0.05, 3.0
#: Probability of a vibration that raw records show: its evidence is already reduced by the search (chosen; no table).
VIBRATION_PROBABILITY = 0.98
#: Evidence [nats] from which a line of one frequency at all speeds is structure by itself (chosen; no table).
LEAST_LINE = 14.0
#: A slow vibration leaves a trace in averages. Up to this share of its own evidence no other cause is named beside it,
#: and up to the larger share unexplained structure counts as its trace (chosen; no table).
VIBRATION_TRACE, VIBRATION_TRACE_UNEXPLAINED = 0.1, 0.5
#: An extension whose held-out error is more than this times the baseline's is withheld (chosen; no table).
MOST_WORSE = 1.02

# --- attribution: sizes ---------------------------------------------------------------------------------------------------

#: Gauss-Newton steps of a refit under another course at most, from the fit under its neighbour (chosen; no table: it bounds
#: the time), and nats behind the best from which a course, and those beyond it, do not count (derived: e^-10).
COURSE_STEPS, COURSE_NEGLIGIBLE = 12, 10.0
#: Degrees of freedom of a size's prior once its effect is held to be at work [-]: p ∝ 1/|a| but for the smallest. Chosen:
#: with the search's 2, eight of eight offsets of 0.7 to 1.5 bar came out small, by 15 % in the mean.
SIZE_TAILS = 0.1
#: Samples that sizes are stated by, and draws of them that an extension carries (chosen; no table).
SIZES_SAMPLED, DRAWS = 2000, 12
#: The probability of the less likely sign from which a size is not determined (chosen: `make adoption` wants no wrong sign).
SIGN_UNDETERMINED = 0.02

# --- validation ----------------------------------------------------------------------------------------------------------

#: Folds of states and of pressures, and the share of the states that is predicted from those before (chosen; no table).
STATE_FOLDS, PRESSURE_FOLDS, FORWARD_SHARE = 3, 2, 1 / 3
#: Fewest states and pressures of which some can be left out, and fewest states of which the last can be predicted.
FEWEST_STATES_HELD_OUT, FEWEST_PRESSURES_HELD_OUT, FEWEST_STATES_AHEAD = 3, 4, 4
#: A smooth correction: cosines along an axis, harmonics of a loop, axes at most (chosen; no table).
CORRECTION_COSINES, CORRECTION_HARMONICS, MOST_CORRECTION_AXES = 10, 5, 2
#: Its deviations τ that are tried, shares of the torque (chosen; no table).
CORRECTION_SIZES = (0.001, 0.003, 0.01, 0.03, 0.1)

# --- explanations -------------------------------------------------------------------------------------------------------

#: Prior probability that anything is wrong; the share of it that is nothing of the catalogue; the probability of a second
#: thing beside the first. With 0.1 that anything is, a zero shift whose refit has 3 nats was adequate.
ANYTHING_WRONG, UNCATALOGUED_SHARE, SECOND = 0.3, 0.25, 0.05
#: Shares by which a template is off along what its form is uncertain in, and along every other smooth factor, averaged over;
#: and those of another effect of its kind.
TEMPLATE_ERRORS = ((0.0, 0.0), (0.25, 0.0), (0.25, 0.05), (0.25, 0.2))
NEIGHBOUR_ERRORS = ((0.5, 0.5), (1.0, 1.0))
#: p(nothing) from which the model is adequate, and the share from which what is unknown dominates; the probability of what
#: is named.
LIKELY, SURE = 0.5, 0.9
#: Share of the posterior that may stay unexplored, share of the leader's lead by which a promise may underrate a rival, and
#: refits at most (time only).
NEGLIGIBLE, SLACK, MOST_REFITS = 0.01, 0.2, 14
#: Up to this share of a vibration's evidence [-] what has no name counts as its trace in averages.
VIBRATION_TRACE = 0.1

# --- experiments ---------------------------------------------------------------------------------------------------------

#: Tests advised at most; λ [nats] that one must bring to be worth its time, and that the best one must bring to be listed
#: where none is worth it (chosen; no table).
MOST_ADVISED, WORTHWHILE, LEAST_ADVISED = 3, 3.0, 0.1
#: Rivals that are compared at most, unless the credible set is larger (chosen; no table: it bounds the time).
MOST_RIVALS = 4
#: Hypotheses so much [nats] behind the best may become rivals again after another test (chosen; no table).
RIVAL_MARGIN = 8.0
#: Probability that a run must add for the work that it is (chosen; no table).
COST_OF_RUN = 0.005
#: Relative deviation of a predicted λ (chosen; no table).
PREDICTION_ERROR = 0.4
#: Noise at zero torque is at least this share of the usual: data under torque hardly determine it (chosen; no table).
LEAST_NOISE = 0.2

# --- report --------------------------------------------------------------------------------------------------------------

#: Probability with which a stated visible amplitude raises the alarm (chosen; `make visible` counts it at twice that).
VISIBLE_POWER = 0.9
#: Candidates below this probability are not listed (chosen).
LEAST_LISTED = 1e-3
#: A run is outlying that makes this share of all error beyond noise, among at least so many runs, with an RMS error beyond
#: noise of so many deviations (chosen; no table).
OUTLYING_SHARE, OUTLYING_FEWEST_RUNS, OUTLYING_DEVIATIONS = 0.6, 4, 2.0
#: Evidence [nats] from which a test is said to add any (derived: Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773,
#: natural log of the Bayes factor: "positive" from 1).
WEAK_EVIDENCE = 1.0
#: Effects at most whose detectable amplitude the paragraph gives (chosen).
VISIBLE_MENTIONED = 3
#: Probability from which an effect that was fitted beside a cause and is not named is mentioned (chosen).
COMPANION_FROM = 0.3
#: Words of the paragraph at most (chosen: with what is said of the remaining life 120, which are read once).
MAX_WORDS = 105
#: Held-out errors of so many times the fit's are explained in the paragraph (chosen: less is what gains make).
FAR_FROM_FIT = 5.0
#: An amplitude beyond so many prior deviations is larger than expected (chosen).
LARGE_AMPLITUDE = 2.0
#: Fewer states of use say little of a course over life (chosen).
FEW_STATES = 3
