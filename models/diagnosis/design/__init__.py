"""Chapter 1, the rows: turns a campaign into a `Design`, which lists the measured torques and the points where torque is
predicted. It also holds facts beside the rows: states, maintenance, rests, duty. Open design.py first; then loop_bins.py (a
dynamic record as phase bins) and facts.py.
"""
