"""Chapter 8, validation: tests whether the extended model predicts runs that it was not fitted to.

In go the baseline's fit and a judgement; out come the extended fit and its gain on held-out runs. Open `extended_model.py`.
"""
