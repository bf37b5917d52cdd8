"""Numbers that decide about the uncatalogued rig faults."""

#: Usual size of all of them [-], as a share of the torque, of the speed or of the pressure. Chosen; no table.
USUAL_SIZE = 0.02
#: A pressure or speed that differs from the one before by less than this share [-] was held. Chosen; no table.
HELD_SHARE = 0.01
#: Least share [-] of the plateaus that must have been reached from above, and from below: with fewer the direction is only
#: another name for the level. Chosen; no table.
LEAST_EACH_WAY = 0.1
#: Time constants of a gain that settles [s], and the time [s] in which one that drifts reaches its size. Chosen; no table.
SETTLING_TIMES = (60.0, 150.0, 400.0)
DRIFT_TIME = 1800.0
#: Powers of the cycles in which a gain creeps [-]. Chosen; no table.
CREEP_POWERS = (0.5, 1.0, 2.0)
