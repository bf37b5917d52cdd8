"""A rig that hides effects, written apart from `models`: it shares no line and no functional form with the catalogue."""
