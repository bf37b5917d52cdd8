"""The numbers by which a run and a track are judged on arrival.

Each says what it means, its unit, and whether it is derived or chosen.
"""

#: Distinct speeds below which a curve gives no mean COF [-]. Derived: four parameters cannot be told from fewer, and a mean
#: over the protocol would be an extrapolation.
FEWEST_SPEEDS = 4
#: Share of a level's pressure [-] beyond which its rows are reported as more than one level. Chosen; no table.
WIDE_LEVEL = 0.06
#: RMSE as a share of the static torque, or of the highest torque where that is open, [-] below which a fit is not reported
#: as poor. Chosen; no table.
POOR_FIT = 0.02
#: A stationary test whose mean oil temperature is further than this from that of its life's first one [K] is not tracked.
#: Chosen: by Hersey's similarity the simulated rig's mean COF moves by 0.05 to 0.15 % a kelvin about 85 °C, so by at most
#: 1.5 % within this span, as a few hundred cycles of use do; the reference's rig, at 80 to 90 °C, never leaves it.
OTHER_OIL = 10.0
#: Least deviation of a mean torque, as a share of the torque [-]: a smaller one that was sent counts as this. Chosen; no
#: table.
MIN_TORQUE_SD = 1e-4
#: Pressure levels of one test [-]; more is a continuous pressure and no stationary test. Chosen: above any known protocol.
MAX_LEVELS = 100
#: Mean COFs at two pressures whose ratio has changed by more than this since the first test [-] are a question to the rig.
#: Chosen: of 14 simulated lives it changes by up to 0.06 until COF has halved, by a gauge that is 0.4 bar off by 0.11.
LEVELS_APART = 0.1
#: The earliest date that is believed [s since 1970], and how far a rig's clock may be ahead of the service's [s]. Chosen:
#: clocks that have lost the time begin at 1904, 1970, 1980 or 2000; time zones that were left out are at most 14 hours.
EARLIEST, CLOCKS_APART = 978_307_200.0, 86_400.0
#: Weighted draws of eq. 6's coefficients behind a stored prediction [-]. Chosen: `make score PARTS=exact`.
PREDICTION_DRAWS = 1000
#: Particles of a filter at least, however many draws of an adopted model they are shared among [-]. Chosen; no table: the
#: tails come from the mixture.
FEWEST_PARTICLES = 60
#: A prediction warns where the probability of eq. 6 is below this [-]. Chosen: odds of ten to one.
EQ_6_DOUBTED = 0.1
#: Exponents of a cycle's work that are weighed by the tests of one life [-]. Chosen: none, and from less than in proportion
#: to the cube; no table.
SEVERITY_EXPONENTS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)
#: They are weighed where the largest work of a cycle is more than so many times the smallest [-]. Chosen: a tenth more work
#: changes ζ by a tenth at exponent 1; no table.
VARIED_WORK = 1.1
#: An exponent in force is doubted where its probability is below this [-]. Chosen: odds of ten to one.
SEVERITY_DOUBTED = 0.1
#: Draws behind a trajectory's band [-], and the lattice of the exact filter behind it (nodes, rows, levels).
#: Chosen; no table.
TRAJECTORY_DRAWS, TRAJECTORY_LATTICE = 400, (13, 13, 7)
#: Cycles [-] at which a course is evaluated to see whether it is zero throughout. Chosen; no table.
COURSE_PROBES = 40
#: Samples of sampled records that are kept in memory at 40 bytes each: of one record, and of all of a campaign together.
#: Chosen: 80 MB and 240 MB, within the memory that a diagnosis is given.
MAX_OF_RECORD, MAX_OF_CAMPAIGN = 2_000_000, 6_000_000
#: Points of mean COF in the short line of a list [-]. Chosen: its width in pixels.
MAX_LINE_POINTS = 32

#: How often a clutch is computed again by `replay` or `fleet refresh` where runs come meanwhile. Chosen: at a run each time
#: it could go on for ever.
MAX_ATTEMPTS = 3

#: A clutch's state is "maintenance required" where less than this share of its life is left at the safe bound. Chosen, on 40
#: simulated lives of eq. 6 and 39 real filters, at every test from the third on: 0.2 calls for maintenance in 213 of
#: the 214 assessments with less than a fifth left, and in 7 of the 312 with more than half left; 0.1 misses 25 of the first.
SOON = 0.2
#: And where a quantity is nearer to its limit than this share of the way from its initial value. Chosen, on the same lives:
#: 0.1 calls in 14 % of the simulated assessments with 30 to 50 % left, 0.2 in 64 %.
NEAR_LIMIT = 0.1
#: Fewer safe cycles than this are stated as "fewer than". Chosen: nobody plans by the single cycle; no table.
FEW_CYCLES = 10
#: Characters of an advised test that the line above a clutch's page shows whole. Chosen: two lines of a phone; no table.
LONGEST_TEST = 80
