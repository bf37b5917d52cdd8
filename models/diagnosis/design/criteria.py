"""Numbers that decide what becomes a row, what counts as a rest, what is taken for noise of samples, and how large a design
may be.

Each has its meaning and its unit; one without an origin was chosen, and no command prints the alternatives.
"""


# ---- physical defaults, where a campaign does not say

#: Oil temperature [K] to which everything refers where none was measured.
#: Derived: the middle of the 80 to 90 °C of Ompusunggu et al. 2013, section 2.3.
REFERENCE_TEMPERATURE = 273.15 + 85.0
#: Torque [Nm] and pressure [Pa] of the clutch in whose size the effects' priors are given.
#: Derived: the clutch of Ompusunggu et al. 2013.
USUAL_TORQUE = 25.0
USUAL_PRESSURE = 5e5
#: Time on one plateau [s] where none was sent. Derived: Ompusunggu et al. 2013, section 2.3.3.
PLATEAU_DURATION = 5.0

# ---- rests, read off the times of the runs

#: A gap between runs is a rest where it is longer than this [s] ...
LEAST_PAUSE = 8 * 3600.0
#: ... and than this many median gaps [-].
PAUSE_RATIO = 4.0
#: Timed runs needed before rests are looked for.
FEWEST_TIMED = 4
#: An engagement's duration is this quantile [-] of the blocks' gap per engagement: in slower blocks the rig rested as well.
PACE_QUANTILE = 0.2
#: Blocks needed to estimate that duration.
FEWEST_BLOCKS = 3
#: An engagement takes at most this long [s].
LONGEST_ENGAGEMENT = 120.0

# ---- loops in phase bins

#: Rows slower than this share [-] of the loop's highest speed are left out: there the clutch sticks, or is next to it.
LEAST_SPEED = 0.004
#: The same where the speed has corners: bins cannot resolve how fast the cusp of S at rest is passed there.
LEAST_SPEED_WITH_CORNERS = 0.012
#: A speed that falls below minus this share [-] of its highest reverses.
REVERSES = 0.03
#: A loop is in its periodic state after this share of a period [-] and at least this time [s], less where no whole period
#: would follow. The time: friction lags by S/C; where C is a tenth of the nominal clutch's that is 0.6 s, and after a second
#: what was left of a start at rest passed for a C that is 4 % too small and a channel that is 6 ms early. Of 1, 2, 3, 4 and
#: 5 s the shortest that leaves a tenth of the noise of a rig of 0.1 % (tests/models/diagnosis/design/test_points.py).
SETTLING_SHARE = 0.06
SETTLING_TIME = 3.0
#: Filled bins that a loop must have.
FEWEST_BINS = 24
#: The speed cycle of one pressure is used for the next one too where its residual there is no more than this many times
#: larger [-].
SAME_CYCLE_RESIDUAL = 1.3
#: A bin counts in a period where it holds at least this share [-] of the samples of its fullest period: where the record
#: begins or ends, samples lie elsewhere in the bin.
FULL_BIN = 2 / 3

# ---- autocorrelation of a loop's samples

#: Harmonics of a loop that are taken for signal, the rest for noise.
SIGNAL_HARMONICS = 8
#: Samples slower than this share [-] of the loop's highest speed are left out: a loop turns sharply there, which is not
#: noise.
LEAST_NOISE_SPEED = 0.08
#: Samples per bin needed; with fewer the bins themselves say as much.
FEWEST_PER_BIN = 4.0
#: Loops whose samples per bin differ by less than about this factor [-] are averaged together.
ALIKE_SAMPLING = 1.2
#: A correlation of neighbours below this [-] is taken for none.
LEAST_CORRELATION = 0.02

#: [K m²/W] A plate that warms by less with the heat flux counts as warming by so much: 1 K at 0.32 W/mm². Chosen, above what
#: thermometers drift with speed (some tenths of a kelvin). Friction that heats an interface does so by tens of K.
LEAST_PLATE_RISE = 1.0 / 0.32e6


#: Plateaus taken from one stationary run, at most.
MOST_PLATEAUS = 2000
#: Rows of a whole campaign, about; beyond, states are taken evenly.
MOST_ROWS = 40_000
#: States whose loops are used, at most, the first and the last among them: further ones add no evidence in practice.
MOST_LOOP_STATES = 12
#: Change points tried along a life, at most: further ones between them would look the same.
MOST_ONSETS = 20
#: Samples of a stretch at one pressure that are binned, at most.
MOST_SAMPLES = 4000
#: Samples of a stretch from which its speed cycle is fitted, at most (all where the cycle has corners).
CYCLE_SAMPLES = 400
