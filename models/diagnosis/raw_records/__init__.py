"""Chapter 6, raw records: finds evidence of shaft ripple, stick-slip and unsettled dwells in raw records. In go a campaign's
raw records; out comes evidence.

Open evidence.py first. Then, in order: whitened_torque.py (the matched filter), swing.py (a swing of unknown phase, at an
order of the shaft or at a fixed frequency), settling_transient.py.
"""
