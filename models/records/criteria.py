"""The numbers that several steps of the way from a raw record to plateaus and periods share; what one step alone needs
stands there. Values are SI; a share and a count have no unit.

All but where it is said were chosen on simulated and real records, and no table compares them with others; what all of them
together achieve is held by `tests/statistical/test_plateaus.py`.
"""

#: Pressures further apart than this [Pa] belong to different levels: 0.12 bar, or the share of the pressure where that is
#: more. Chosen: about a quarter of the reference's steps of 0.5 bar (section 2.3.3).
LEVEL_GAP, LEVEL_GAP_SHARE = 0.12e5, 0.025
#: Below this [Pa] the clutch is open: what is measured does not depend on the lining's friction.
UNLOADED = 0.05e5
#: Pressures that repeat are levels of their own where they are so far apart [Pa]; closer ones are counts of one sensor.
LEVEL_STEP = 0.05e5
#: A level is called by the nearest multiple of the first of these [Pa] that is within 0.02 bar, or this share of it: 9.977
#: bar is 10. Chosen: the error of a gauge of class 0.4.
LEVEL_NAMES = (1e5, 0.5e5, 0.1e5, 0.05e5)
NAMED_WITHIN, NAMED_WITHIN_SHARE = 0.02e5, 0.004

#: A record is refused that has fewer samples, values beyond this in SI units, or samples that lie nearer or farther [s].
FEWEST_SAMPLES, LARGEST_VALUE, FASTEST, SLOWEST = 16, 1e15, 1e-6, 10.0
#: Rows were stored only when a value changed where more than the share SPARSE of even samples is missing, in more gaps than
#: the share SPARSE_GAPS of the rows. Chosen: of dwells stored by a dead band 82 % and 11 %; a recorder that is started for
#: each dwell leaves a gap in fifty rows or more.
SPARSE, SPARSE_GAPS = 0.5, 0.02

#: A block leaves its level by so many deviations of one; below this share of the highest speed nothing slides; a dwell of
#: fewer blocks gives no mean.
LEAVING_DEVIATIONS, STANDSTILL_SHARE, SHORTEST_DWELL = 5.0, 1e-3, 8

#: Beside a transient faster than this share of its dwell, torque may drift; a slower one cannot be distinguished from a
#: drift.
DRIFT_SHARE = 1 / 6
#: Squared deviations by which a single dwell must gain from a transient. Derived: five deviations.
OWN_GAIN = 25.0
#: The share of a dwell that is dropped at most; deviations of amplitude and of the time constant that are allowed for.
MOST_DROPPED, LATE = 0.75, 2.0
#: The share of the sum of correlations that removing a mean and a trend may take off.
LOST_SHARE = 0.6

#: A sample further off a fit than so many deviations, and than this share of the largest value, is an outlier; samples whose
#: median it is compared with.
OUTLIER, OUTLIER_SHARE, NEIGHBOURS = 6.0, 0.005, 5

#: Harmonics of the speed; of motions with corners, tried one after the other while the residual falls to the share TAKEN.
SPEED_HARMONICS, CORNERS, TAKEN = 4, (8, 16, 32), 0.7
#: Standing still for longer than this share of a period before or after is no part of the swing.
REST_SHARE = 0.1
#: Pressure is looked at in medians over this long [s], and a stretch lasts so many of them or more.
MEDIAN_DURATION, SHORTEST_STRETCH = 0.25, 8
