"""Evidence of a swing whose phase no stretch knows of another, its size one law for all.

With u = |D|²/N of a stretch (`whitened_torque`), exponential of mean 1 where nothing swings, and λ = a² N/4,

    log L(a)/L(0) = Σ_j ln I0(2 √(λ_j u_j)) - λ_j                                          (Rice)

averaged over a (`SHARES`). Where nothing swings, the mean of u is taken for what it is around the place looked at.
"""

import numpy as np
from scipy.special import i0e

from models.arrays import FloatArray

#: Sizes tried, as multiples of the one at which all stretches together show about FAINT nats.
SIZES = np.array([0.9, 1.1, 1.35, 1.65, 2.0, 2.5, 3.2, 4.5, 7.0, 12.0, 25.0, 60.0])
FAINT = 4.0
#: How likely each is beforehand: what is loud shows in any case.
SHARES = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.5, 0.2, 0.1, 0.1, 0.1]) / 8.0
#: No stretch counts for more [nats]: one burst is no order.
MOST_A_STRETCH = 10.0
#: A level around is taken for 1 unless more than so many stretches say otherwise.
PRIOR_STRETCHES = 40.0
_TABLE_STEP, _TABLE_END = 0.02, 60.0
_GRID = np.arange(0.0, _TABLE_END + 2 * _TABLE_STEP, _TABLE_STEP)
_TABLE = np.log(i0e(_GRID)) + _GRID
_TABLE_SLOPE = np.diff(_TABLE, append=_TABLE[-1])


def rice(power: FloatArray, lam: FloatArray) -> FloatArray:
    """log L(a)/L(0) of power u >= 0 at λ >= 0, broadcast."""
    root = 2.0 * np.sqrt(power * lam)
    return np.asarray(_log_bessel(root) - lam, dtype=np.float64)


def _log_bessel(x: FloatArray) -> FloatArray:
    """ln I0(x) of x >= 0, within 1e-4: drawn through a table, beyond it x - ½ ln(2π x)."""
    place = np.minimum(x, _TABLE_END) * (1.0 / _TABLE_STEP)
    row = place.astype(np.intp)
    found = _TABLE[row] + (place - row) * _TABLE_SLOPE[row]
    beyond = x > _TABLE_END
    if beyond.any():
        found[beyond] = x[beyond] - 0.5 * np.log(2 * np.pi * x[beyond])
    return np.asarray(found, dtype=np.float64)


def sizes(weight: FloatArray) -> FloatArray:
    """a [s] worth trying for stretches of weight N [j] or, columns on their own, N [j, f]: [s] or [s, f]."""
    # λ is worth λ²/2 where it is small, and itself where it is large
    small = np.sqrt(2 * FAINT / np.maximum(np.square(weight).sum(axis=0), 1e-300))
    return np.asarray(2.0 * np.sqrt(np.multiply.outer(SIZES**2, small)))


def level(*sides: tuple[float, float]) -> float:
    """The mean of u around, from (sum, count) on either side: the louder side's."""
    return max((total + PRIOR_STRETCHES) / (count + PRIOR_STRETCHES) for total, count in sides)


def likelihoods(power: FloatArray, weight: FloatArray, tried: FloatArray) -> FloatArray:
    """log L [s] (or [s, f]) of u and N [j] (or [j, f]) at a [s] (or [s, f])."""
    return np.stack([np.minimum(rice(power, 0.25 * weight * one**2), MOST_A_STRETCH).sum(axis=0) for one in tried])


def amplitude(power: FloatArray, weight: FloatArray) -> float:
    """a of u and N [j] by their means: E u = 1 + a² N/4."""
    return float(2.0 * np.sqrt(max(float((power - 1.0).sum()), 0.0) / max(float(weight.sum()), 1e-300)))
