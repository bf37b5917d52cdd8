"""The numbers that decide which records hold an engagement and where on it an indicator is read.

Shares of the initial speed, of the highest torque and of the slip's duration. "Chosen" says that a value was chosen on the
closed-form engagements of tests/models/engagements and that no table compares it with others.
"""

# Records that hold an engagement (`slip`)

#: Slowest sampling [Hz], and how far below it a recorder's clock may be [-]. Derived: the channels are stated for 10 Hz on.
SLOWEST_RATE, RATE_TOLERANCE = 10.0, 0.05
#: Fewer samples are no record, and fewer between contact and standstill show no slip. Chosen: four indicators at least need
#: seven samples each.
FEWEST_SAMPLES, FEWEST_SLIPPING = 16, 8
#: Below this [rad/s] nothing slips. Chosen: 10 rpm, above the noise of a shaft encoder.
LEAST_SPEED = 1.0
#: A shaft above the first share of its highest speed is before the slip, below the second it may stand. Chosen.
FAST, SLOW = 0.5, 0.05
#: A shaft that stays within this share of its highest speed stands, and what is left is the sensor's zero. Chosen: twice the
#: error of a tachometer of 1 %.
LARGEST_ZERO = 0.02
#: A torque that is never below this share of its highest before the slip shows no open clutch. Chosen: above a sensor's zero
#: and an open clutch's drag together.
LARGEST_OPEN_TORQUE = 0.2
#: A torque that rises by fewer deviations of its noise than this is none. Chosen: a false alarm in a million records.
LEAST_RISE = 6.0
#: The longest gap in the slip, as a share of its duration. Chosen: the trapezoid over it is right to 1 % for a parabola.
LONGEST_GAP = 0.2

#: Speed's way to rest is a polynomial of at most this power, of more than 2 where each exceeds so many deviations. Chosen:
#: a shaft that its drive almost keeps turning creeps to rest, and a parabola places that 3 % too early.
HIGHEST_POWER, CURVED_STOP = 4, 3.0

# The start of slip (`slip`)

#: Slip starts where torque passes START of its highest; a line between the other two shares refines it. Chosen: above noise
#: of 1 %, and early: 5 and 20 % of a torque that rises over the whole slip.
START, BELOW_START, ABOVE_START = 0.10, 0.05, 0.20

# Where indicators are read (`measured`)

#: Shares of the initial speed at which μ is initial, midpoint and endpoint. Chosen.
INITIAL, MIDPOINT, ENDPOINT = 0.9, 0.5, 0.1
#: Half-widths of the windows, shares of the slip's duration: of torque and pressure, and of power. Chosen: the widest at
#: which a torque that saturates in a fifth of the slip is biased by less than 0.2 %.
HALF_WIDTH, POWER_HALF_WIDTH = 0.08, 0.12
#: A window is widened until it holds so many samples, at most to this share of the duration. Chosen.
FEWEST_LOCAL, WIDEST = 7, 0.25
#: A window is fitted by a parabola where its curvature exceeds so many deviations, else by a line. Chosen.
CURVED = 2.0
#: Moments of the slip at which power is compared. Chosen.
POWER_MOMENTS = 61
#: Slip that begins again is a breakaway where the pressure has kept this share of that at the end of slip. Chosen: else the
#: clutch was opened.
KEPT_PRESSURE = 0.5

#: The highest pressure of a slip is this quantile of its samples. Chosen: a spike is none.
HIGHEST = 0.98

# Comparison with the first engagements (`comparison`)

#: Engagements that make the reference, and moments of its duration at which speeds are compared. Chosen.
REFERENCES, MOMENTS = 3, 50
#: Largest difference of initial speed and of highest pressure from the reference's, as a share. Chosen: beyond it an
#: engagement is of another duty.
SAME_DUTY = 0.1

# Comparison with a model (`discrepancy`)

#: A simulated engagement may last so many times the measured slip. Chosen.
LONGEST_SLIP = 4.0
#: The simulation begins this share of the slip before contact. Chosen.
LEAD = 0.1
#: Rate of the simulated trace [samples per measured slip]. Chosen.
TRACE_SAMPLES = 400
#: Moments of the slip at which torques are compared. Chosen.
TORQUES = 100

# A trace that is shown (`measured`)

#: Shares of the slip before contact and after its end, and points. Chosen: the width of a chart.
TRACE_BEFORE, TRACE_AFTER, TRACE_POINTS = 0.2, 0.3, 300
