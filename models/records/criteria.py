"""The numbers that decide how a raw record is cleaned, cut and described. Values are SI; a share and a count have no unit.

A deviation is one standard deviation of the noise unless another one is named. "Chosen; no table" says honestly that the
value was chosen on simulated and real records and that no table compares it with others; what all of them together
achieve is held by `tests/statistical/test_plateaus.py`.
"""

# Levels of pressure (`pressure_levels`, `runs`)

#: Pressures further apart than this [Pa] belong to different levels: 0.12 bar, or the share of the pressure where that is
#: more. Chosen: about a quarter of the reference's steps of 0.5 bar (section 2.3.3).
LEVEL_GAP, LEVEL_GAP_SHARE = 0.12e5, 0.025
#: Below this [Pa] the clutch is open: what is measured does not depend on the lining's friction. Chosen; no table.
UNLOADED = 0.05e5
#: A level within LEVEL_SNAP [Pa] of a multiple of LEVEL_STEP [Pa] is called by that multiple. Chosen; no table.
LEVEL_STEP, LEVEL_SNAP = 0.05e5, 0.02e5

# Cleaning (`cleaning`)

#: A record with fewer samples is refused. Chosen; no table.
FEWEST_SAMPLES = 16
#: Values beyond this, in SI units, are no measurements. Chosen; no table.
LARGEST_VALUE = 1e15
#: Samples lie this far apart [s], at the least and at the most. Chosen; no table.
FASTEST, SLOWEST = 1e-6, 10.0
#: A clock may fall back by this much [s], or by ten samples: neighbours written in the wrong order. Chosen; no table.
LARGEST_SWAP = 0.1
#: The clock jitters where intervals scatter by more than this share of their median. Chosen; no table.
JITTER = 0.01
#: A spike is off the median of its surroundings by more than SPIKE deviations, and its edge jumps by more than SPIKE_EDGE
#: of them. Chosen; no table.
SPIKE, SPIKE_EDGE = 10.0, 6.0
#: The longest spike [s]. Chosen; no table.
SPIKE_DURATION = 0.006

# Dwells (`dwells`)

#: A block, whose samples are averaged [s]. Chosen; no table.
BLOCK_DURATION = 0.01
#: The windows before and after a block that are compared [s], at least so many blocks. Chosen; no table.
WINDOW_DURATION, FEWEST_WINDOW_BLOCKS = 0.2, 4
#: Deviations that make a step of a difference of windows, and those that make a block leave its level. Chosen; no table.
STEP_DEVIATIONS, LEAVING_DEVIATIONS = 6.0, 5.0
#: Changes below the first share of the highest speed or pressure are never steps, above the second always. Chosen; no table.
NO_STEP_SHARE, PLAIN_STEP_SHARE = 5e-4, 0.02
#: No lining is loaded below this share of the highest pressure, nothing slides below this share of the highest speed.
#: Chosen; no table.
NO_PRESSURE_SHARE, STANDSTILL_SHARE = 0.02, 1e-3
#: A dwell ends at a gap in the record longer than this [s] and than so many blocks. Chosen; no table.
GAP_DURATION, GAP_BLOCKS = 0.25, 6
#: Speed or pressure whose means over RAMP_PIECES pieces of a dwell change by more than this share is a slow ramp. Chosen;
#: no table.
RAMP_SHARE, RAMP_PIECES = 0.01, 6
#: Blocks below which a dwell gives no mean. Chosen; no table.
SHORTEST_DWELL = 8
#: A crest of an overshoot is shorter than this share of the dwell that follows, and off its level by this share of the step
#: to it at most; so many may follow each other. Chosen; no table.
CREST_SHARE, OVERSHOOT_SHARE, MOST_CRESTS = 0.25, 0.3, 4

# Settling (`settling`)

#: Time constants that make a settling time. Derived: e^-4 = 1.8 % of the transient is left then.
SETTLING = 4.0
#: The longest time constant that is tried: in durations of the longest dwell, and in s. Chosen; no table.
SLOWEST_TRANSIENT_SHARE, SLOWEST_TRANSIENT = 2.0, 6.0
#: Beside a transient faster than this share of its dwell, torque may drift; a slower one cannot be distinguished from a
#: drift. Chosen; no table.
DRIFT_SHARE = 1 / 6
#: How far (in its logarithm, one deviation) a dwell's time constant lies from the record's at most and at least, and how
#: many dwells it takes to estimate that. Chosen; no table.
MOST_SPREAD, LEAST_SPREAD, FEWEST_FOR_SPREAD = 0.5, 0.1, 8
#: Deviations by which all dwells together must gain from a transient. Chosen; no table.
POOLED_GAIN = 5.0
#: Squared deviations by which a single dwell must gain from a transient. Derived: five deviations.
OWN_GAIN = 25.0
#: No dwell counts for more than this among all, in squared deviations. Chosen; no table.
GAIN_CAP = 1e3
#: What a discarded transient may leave in the mean, in deviations of the mean. Chosen; no table.
LEFT_IN_MEAN = 0.1
#: Shares of a dwell that are dropped at the least and at the most. Chosen; no table.
LEAST_DROPPED, MOST_DROPPED = 0.05, 0.75
#: Deviations of amplitude and of the time constant that are allowed for. Chosen; no table.
LATE = 2.0

# The deviation of a mean (`mean_deviation`, `slow_noise`)

#: The window of the sum of correlations, in integrated correlation times 1 + 2 Σ ρ. Chosen: Sokal's rule asks for a few.
SOKAL = 2.5
#: The longest lag: the share of the sum that removing a mean and a trend may take off, and in averages. Chosen; no table.
LOST_SHARE, LONGEST_LAG = 0.6, 400
#: A correlation below this at the longest lag has faded. Chosen; no table.
FADED = 0.1
#: Batches of a dwell, each at least so many correlation times long. Chosen; no table.
BATCHES, BATCH_TIMES = 16, 3.0
#: Dwells that it takes to estimate how much their variances differ. Chosen; no table.
FEWEST_FOR_MODERATION = 8
#: Anticorrelated noise averages out faster, but the factor of a mean's variance is not taken below this. Chosen; no table.
LEAST_FACTOR = 0.2
#: The prior of slow noise: correlation times up to so many times the longest dwell, and its shares of the variance, all
#: equally probable. Chosen; no table.
LONGEST_SLOW_TIME = 2.0
SLOW_SHARES = (0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.95, 1.0)

# Plateaus (`plateaus`)

#: A drift of more deviations than this is reported. Chosen; no table.
DRIFTING = 4.0

# Outliers of a fit (`outliers`)

#: A sample further off a fit than so many deviations, and than this share of the largest value, is an outlier. Chosen; no
#: table.
OUTLIER, OUTLIER_SHARE = 6.0, 0.005
#: Samples whose median a sample is compared with. Chosen; no table.
NEIGHBOURS = 5

# Periods of a swinging speed (`periods`)

#: Harmonics of the speed. Chosen; no table.
SPEED_HARMONICS = 4
#: A period counts as whole where this share of it was sampled: a fit of harmonics bridges the rest. Chosen; no table.
WHOLE = 0.99
#: A speed off its fit by more than this share of its swing (RMS) does not swing periodically. Chosen; no table.
PERIODIC = 0.15
#: Standing still for longer than this share of a period before or after is no part of the swing. Chosen; no table.
REST_SHARE = 0.1
#: Away from the swing's ends (between these shares of it) the limit is this share of the record. Chosen; no table.
REST_INSIDE, INSIDE = 0.02, (0.1, 0.9)
#: At an end of the swing the limit is so many times as long as a sine lingers there. Chosen; no table.
LINGERS = 1.6
#: Speed stands still within this share of the swing, and moves beyond the second, or the third with noise. Chosen; no table.
STILL_SHARE, SWING_SHARE, MOST_SWING_SHARE = 1e-3, 0.02, 0.05
#: Where speed at a record's ends is further off the swing than OUTLIER deviations and this share of its amplitude, it does
#: not swing yet, or no more. Chosen; no table.
OFF_SWING = 0.02
#: Harmonics of motions with corners, tried one after the other ...
CORNERS = (8, 16, 32)
#: ... while the residual (RMS) is more than the first share of the swing and falls to the second share of itself. Chosen;
#: no table.
FOLLOWED, TAKEN = 0.002, 0.7

# Stretches of constant pressure (`pressure_stretches`)

#: Pressure is looked at in medians over this long [s], and a stretch lasts so many of them or more. Chosen; no table.
MEDIAN_DURATION, SHORTEST_STRETCH = 0.25, 8
#: Pressure still moves where it is off its level by more deviations and more of a level's width than these. Chosen; no
#: table.
OFF_LEVEL, OFF_LEVEL_SHARE = 4.0, 0.05
#: A stretch that spans so many level widths, with at least this correlation of pressure and time, is a ramp. Chosen; no
#: table.
RAMP_WIDTHS, STRAIGHT = 1.5, 0.98
