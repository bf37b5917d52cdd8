"""Chapter 1, the rows: a campaign goes in, a `Design` comes out, which holds the points where torque is predicted, the rows
that are compared with measured torque, and facts beside them (states, maintenance, rests, duty).
Open design.py first; then loop_bins.py (a dynamic record as phase bins), facts.py and criteria.py.
"""
