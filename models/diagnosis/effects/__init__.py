"""Chapter 4, the effects: what could be wrong with a campaign, each effect one value in one file.

In go points and the baseline's prediction there; out comes a change of torque. Open `effect.py`, then `catalogue.py`.
"""
