"""Chapter 6, raw records: finds evidence of shaft ripple, stick-slip and unsettled dwells in raw records. In go a campaign's
raw records; out comes evidence.

Open evidence.py first. Then, in order: whitened_torque.py (the matched filter), swing.py (evidence of a swing of unknown
phase), shaft_orders.py, fixed_frequency.py, settling_transient.py; numbers in criteria.py.
"""
