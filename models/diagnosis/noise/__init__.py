"""Chapter 3, the noise: estimates the deviation of each row, the correlation of neighbouring rows and the scatter of gains.
In go a design and a fit's residual; out comes a `Noise`, and functions that whiten rows by it. Open covariance.py first (the
model), then estimate.py (how it is estimated).
"""
