"""Numbers that decide what raw records show, and how many are analysed. All are chosen, and no command prints the
alternatives.
"""

import numpy as np

# ---- what counts as evidence, evidence.py

#: Log likelihood ratio [nats] from which a line or a settling transient counts as evidence. Noise alone reaches it in one
#: campaign of a thousand or fewer.
LEAST_EVIDENCE = 4.5
#: A line at low speed is no stick-slip where it is seen at more than this many times [-] the speed below which it was found,
#: within this distance [Hz] of its frequency.
FASTER_SHAFT = 2.0
SAME_LINE = 1.0

# ---- pieces of a record that are analysed, pieces.py

#: A speed that goes this share [-] of its highest the other way reverses; torque has settled so long [s] after.
REVERSES = 0.03
SETTLED_AFTER_REVERSAL = 1.0
#: Samples that may be missing in a row.
LONGEST_GAP = 5
#: Records are averaged down to about this rate [Hz].
RATE = 250.0
#: A piece is at least this long: [s], and in samples.
SHORTEST_PIECE = 1.0
FEWEST_SAMPLES = 48

# ---- whitening, whitened_torque.py

#: Knots of the spline through slow torque lie at most so far apart [s], and by this share [-] of the speed's own period.
KNOT_SPACING = 0.25
KNOT_SHARE = 1 / 40
#: Samples between knots, at least: with fewer the spline leaves nothing to be analysed.
FEWEST_BETWEEN_KNOTS = 5
#: The lowest frequency that the spline leaves untouched [cycles between knots]. Highest: as a share [-] of the rate.
LOWEST_CYCLES = 1.25
HIGHEST_SHARE = 0.45
#: Order of the autoregression; samples of each segment of the spectrum from which it is estimated.
AUTOREGRESSION_ORDER = 6
SEGMENT = 256
#: Time [s] over which the local deviation of the noise is averaged.
LOCAL_TIME = 2.0
#: Squares count in the local deviation for at most this many times the mean [-].
LARGEST_SQUARE = 12.0
#: The local variance is at least this share [-] of the usual one: a coarse recorder may write one value for long.
LEAST_VARIANCE_SHARE = 0.25
#: Noise below this share [-] of the recorder's count does not blur its steps, which then look like a swing; the count is
#: taken from so many samples.
BLURRED = 0.45
COUNT_SAMPLES = 5000
#: A speed that swings by less than this share [-] of its highest is constant.
CONSTANT_SPEED = 0.05

# ---- evidence of a swing of unknown phase, incoherent.py

#: Amplitudes tried, as multiples of the one at which all stretches together show about FAINT nats ...
AMPLITUDES = np.array([0.9, 1.1, 1.35, 1.65, 2.0, 2.5, 3.2, 4.5, 7.0, 12.0, 25.0, 60.0])
FAINT = 4.0
#: ... and their prior weights: a loud swing is evident with any.
AMPLITUDE_WEIGHTS = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.2, 0.1, 0.1, 0.1]) / 8.0
#: One stretch counts for at most so many nats: one burst is not an order.
MOST_PER_STRETCH = 10.0
#: The noise level beside a line is taken for 1 unless more than so many stretches show another.
PRIOR_STRETCHES = 40.0

# ---- order tracking, shaft_orders.py

#: Orders looked for [per revolution] and their prior probabilities.
ORDERS = {
    0.5: 0.05,
    1.0: 0.25,
    1.5: 0.03,
    2.0: 0.20,
    3.0: 0.08,
    4.0: 0.07,
    5.0: 0.03,
    6.0: 0.05,
    8.0: 0.04,
    10.0: 0.02,
    12.0: 0.03,
}
#: The first and second order together, and their prior probability.
PAIRED_ORDERS = (1.0, 2.0)
PAIRED_PROBABILITY = 0.15
#: Offsets [per revolution] of the orders beside one, which give the noise level: it does not show there.
BELOW_ORDER, ABOVE_ORDER = (-0.3, -0.2), (0.2, 0.3)
#: Length of a stretch [s], and numbers of stretches over which the phase may be kept.
STRETCH = 1.25
COHERENT_STRETCHES = (1, 2, 4, 12)
#: Stretches (groups of them) that an order needs.
FEWEST_STRETCHES = 4
#: Share [-] of a stretch's samples in which the order's frequency must be visible.
LEAST_VISIBLE = 0.25
#: Samples are left out where a line lies within this distance [Hz] of the order or of half of it, up to this many times [-]
#: the speed below which the line acts.
LINE_WIDTH = 1.0
LINE_SPEED = 1.2

# ---- lines of fixed frequency, windows.py and fixed_frequency.py

#: Shares [-] of the highest speed below which stick-slip is looked for.
SLOW_SHARES = (0.05, 0.08, 0.125, 0.2, 0.4)
#: Below this share [-] of the highest speed, on average over a window, the shaft stands still.
STANDSTILL_SHARE = 0.004
#: Length of a window [s]: at least; at most at low speed; at most at any speed.
SHORTEST_WINDOW = 0.5
LONGEST_SLOW_WINDOW = 2.5
LONGEST_WINDOW = 2.0
#: The speed is averaged over this time [s] before it is compared with a bound.
SPEED_AVERAGE = 0.1
#: Rise time [s] of the envelope of a swing after the shaft enters a window: between none and some of its own periods.
RISE_TIME = 0.12
#: Spacing of the frequencies [Hz]; stick-slip is looked for up to this frequency [Hz].
SPACING = 0.125
HIGHEST_SLOW = 45.0
#: Bins on either side of a frequency that give the noise level: from, to; farther in short windows.
NEAREST_BIN = 10
FARTHEST_BIN = 34
#: A noise level beside a line above this [-] is not noise alone.
LOUD = 1.3
#: Relative amplitude [-] of a second harmonic, and the prior probability of one.
SECOND_HARMONIC = 0.33
SECOND_PROBABILITY = 0.4
#: Windows in which a frequency must be visible: at least this number, and this share [-] of all.
FEWEST_WINDOWS = 3
LEAST_WINDOW_SHARE = 0.3
#: Frequencies at which the second harmonic's phase is tied to the first's: the most promising ones.
TIED_FREQUENCIES = 4
#: Lowest frequency of a line, and of the bins beside it, as shares [-] of the lowest that the spline leaves.
LOWEST_LINE = 0.8
LOWEST_BESIDE = 0.4

# ---- settling transients, settling_transient.py

#: Time constants [s] of friction's own lag and of filters, whose share of a step may have any size.
FAST_TIMES = (0.1, 0.25)
#: Time constants [s] that are tried.
SLOW_TIMES = (0.8, 1.3, 2.0, 3.2, 5.0)
#: Usual share [-] of a step that remains after it.
USUAL_SHARE = 0.2
#: Time after a step [s] from which torque is used: before, the rig's ramp is not over.
FIRST_USED = 0.3
#: Samples are at the dwell's own speed within this share of it [-] and so much [rad/s].
SPEED_SHARE = 0.01
SPEED_DISTANCE = 0.2
#: Samples that a dwell needs.
FEWEST_DWELL_SAMPLES = 20


#: Records analysed, taken evenly over life: at least so many, more where they hold fewer than so many samples in all.
FEW_RECORDS = 8
MANY_SAMPLES = 300_000
#: Windows in which a fixed frequency is looked for, at most, taken evenly.
MOST_WINDOWS = 400
