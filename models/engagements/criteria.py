"""The numbers that decide which records hold an engagement and where on it an indicator is read.

Shares of the initial speed, of the highest torque and of the slip's duration. All but where it is said were chosen on the
closed-form engagements of tests/models/engagements, and no table compares them with others.
"""

#: Slowest sampling [Hz]. Derived: the channels are stated for 10 Hz on.
SLOWEST_RATE = 10.0
#: Fewer samples are no record, and fewer between contact and standstill show no slip: four indicators at least need seven
#: samples each, and a window is widened until it holds so many.
FEWEST_SAMPLES, FEWEST_SLIPPING, FEWEST_LOCAL = 16, 8, 7
#: Below this [rad/s] nothing slips: 10 rpm, above the noise of a shaft encoder. Below the share a shaft may stand.
LEAST_SPEED, SLOW = 1.0, 0.05
#: A shaft that stays within this share of its highest speed stands, and what is left is the sensor's zero: twice the error
#: of a tachometer of 1 %.
LARGEST_ZERO = 0.02
#: A torque that rises by fewer deviations of its noise than this is none: a false alarm in a million records.
LEAST_RISE = 6.0
#: The longest gap in the slip, as a share of its duration: the trapezoid over it is right to 1 % for a parabola.
LONGEST_GAP = 0.2
#: Slip starts where torque passes this share of its highest: above noise of 1 %, and early.
START = 0.10
#: Shares of the initial speed at which μ is initial, midpoint and endpoint.
INITIAL, MIDPOINT, ENDPOINT = 0.9, 0.5, 0.1
