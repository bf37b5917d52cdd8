"""Raw records: a campaign's raw records go in; evidence of shaft ripple, stick-slip and unsettled dwells comes out.

Open evidence.py first. Then, in order: whitened_torque.py (the matched filter), swing.py (evidence of a swing of unknown
phase), shaft_orders.py, fixed_frequency.py, settling_transient.py; numbers in criteria.py.
"""
