"""Chapter 3, the noise: a design and a fit's residual go in; a `Noise` comes out (each row's deviation, the autocorrelation
of neighbouring rows, the scatter of gains), and functions that whiten rows by it.
Open covariance.py first (the model), then estimate.py (how it is estimated).
"""
