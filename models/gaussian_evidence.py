"""The marginal likelihood of a linear model with normal coefficients, from its information and its score.

    ln ∫ p(data | c) N(c; 0, Λ) dc - ln p(data | 0) = ½ sᵀ (I + Λ⁻¹)⁻¹ s - ½ ln det(1 + Λ^½ I Λ^½)        [nats]

with s the gradient of the log likelihood at c = 0 and I its negative curvature; exact where the likelihood is normal.
Source: Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), eq. 2.43.
"""

import numpy as np
from scipy.special import log_ndtr

from models.arrays import FloatArray


def log_sum(logs: FloatArray | list[float]) -> float:
    """ln Σ e^logs, -inf without any; for a few numbers ten times as fast as scipy's."""
    return float(np.logaddexp.reduce(np.asarray(logs, dtype=np.float64))) if len(logs) else -np.inf


def log_mean(logs: FloatArray | list[float]) -> float:
    """ln of the mean of e^logs, for one or more."""
    return log_sum(logs) - float(np.log(len(logs)))


def log_normal(off: FloatArray, variance: FloatArray) -> FloatArray:
    """Log density of a normal distribution at a deviation `off` from its mean, any shape."""
    return np.asarray(-0.5 * (np.log(2.0 * np.pi * variance) + off**2 / variance))


def log_gain(info: FloatArray, score: FloatArray, sd: FloatArray | float) -> float:
    """Log Bayes factor [nats] by the formula for coefficients of prior deviations sd [m] together, from info [m, m] and
    score [m]; 0 without coefficients.

    >>> round(log_gain(np.eye(1), np.array([2.0]), 1.0), 4)  # ½ 4/2 - ½ ln 2
    0.6534
    """
    if not score.size:
        return 0.0
    sd = np.broadcast_to(sd, score.shape)
    values, vectors = independent(sd[:, None] * info * sd)
    return float(log_gain_alone(values, vectors.T @ (sd * score), 1.0).sum())


def independent(info: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Eigenvectors [m, m] (columns) of an information matrix, and its eigenvalues [m], set to 0 where rounding made
    them negative."""
    values, vectors = np.linalg.eigh(info)
    return np.maximum(values, 0.0), vectors


def log_gain_alone(info: FloatArray, score: FloatArray, sd: FloatArray | float) -> FloatArray:
    """Log Bayes factors [nats] by the formula for each coefficient by itself, from info [m] >= 0, score [m] and prior
    deviations sd (broadcast)."""
    unit = np.square(sd) * info
    return np.asarray(0.5 * (np.square(sd) * np.square(score) / (1 + unit) - np.log1p(unit)), dtype=np.float64)


def log_positive(info: FloatArray, score: FloatArray, sd: FloatArray | float) -> FloatArray:
    """Addition to `log_gain_alone` [nats] for coefficients that cannot be negative: ln 2Φ(s/√(I + sd⁻²))."""
    return np.asarray(np.log(2.0) + log_ndtr(score / np.sqrt(info + np.power(sd, -2.0))), dtype=np.float64)
