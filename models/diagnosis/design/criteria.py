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


# ---- loops in phase bins

#: A loop is in its periodic state after this share of a period [-] and at least this time [s], less where no whole period
#: would follow. The time: friction lags by S/C; where C is a tenth of the nominal clutch's that is 0.6 s, and after a second
#: what was left of a start at rest passed for a C that is 4 % too small and a channel that is 6 ms early. Of 1, 2, 3, 4 and
#: 5 s the shortest that leaves a tenth of the noise of a rig of 0.1 % (tests/models/diagnosis/design/test_points.py).
SETTLING_SHARE = 0.06
SETTLING_TIME = 3.0

# ---- autocorrelation of a loop's samples

#: Harmonics of a loop that are taken for signal, the rest for noise.
SIGNAL_HARMONICS = 8


#: Plateaus taken from one stationary run, at most.
MOST_PLATEAUS = 2000
#: Rows of a whole campaign, about; beyond, states are taken evenly.
MOST_ROWS = 40_000
#: States whose loops are used, at most, the first and the last among them: further ones add no evidence in practice.
MOST_LOOP_STATES = 12
#: Change points tried along a life, at most: further ones between them would look the same.
MOST_ONSETS = 20
