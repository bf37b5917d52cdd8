"""Chapter 8, validation: does the extended model predict runs that it was not fitted to.

In go the baseline's fit and a judgement; out come the extended fit and its gain on held-out runs. Open `extended_model.py`.
"""
