"""Uncatalogued rig faults: templates that compete with the catalogue's effects and are never named as a cause.

A design's facts go in, templates come out. Open catalogue.py first; then fault.py (what one is), and one file a fault.
"""
