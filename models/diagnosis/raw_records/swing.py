"""A swing that stands out of the noise, at an order of the shaft or at a fixed frequency: evidence without its phase.

The phase is unknown in every stretch, the size follows one law in all. With u = |D|²/N of a stretch (`whitened_torque`),
exponential of mean 1 where nothing swings, and λ = a² N/4,

    log L(a)/L(0) = Σ_j ln I0(2 √(λ_j u_j)) - λ_j                                          (Rice)

averaged over a with the prior AMPLITUDE_WEIGHTS. Where nothing swings, the mean of u is taken from beside the order or
frequency in question.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import i0e

from models.arrays import FloatArray
from models.diagnosis.raw_records import criteria


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """evidence [nats], averaged over everything tried; position, the order [per revolution] or the frequency [Hz];
    amplitude [Nm]; speed_share, the share of the highest speed below which it acts; peak, the largest log likelihood
    ratio [nats]. Without arguments: no line."""

    evidence: float = 0.0
    position: float = 0.0
    amplitude: float = 0.0
    speed_share: float = 1.0
    peak: float = 0.0


_TABLE_STEP, _TABLE_END = 0.02, 60.0
_GRID = np.arange(0.0, _TABLE_END + 2 * _TABLE_STEP, _TABLE_STEP)
_TABLE = np.log(i0e(_GRID)) + _GRID
_TABLE_SLOPE = np.diff(_TABLE, append=_TABLE[-1])


def rice(power: FloatArray, lam: FloatArray) -> FloatArray:
    """log L(a)/L(0) of power u >= 0 at λ >= 0, broadcast."""
    root = 2.0 * np.sqrt(power * lam)
    return np.asarray(_log_bessel(root) - lam, dtype=np.float64)


def _log_bessel(x: FloatArray) -> FloatArray:
    """ln I0(x) of x >= 0, within 1e-4: interpolated in a table, beyond it x - ½ ln(2π x)."""
    place = np.minimum(x, _TABLE_END) * (1.0 / _TABLE_STEP)
    row = place.astype(np.intp)
    values = _TABLE[row] + (place - row) * _TABLE_SLOPE[row]
    beyond = x > _TABLE_END
    if beyond.any():
        values[beyond] = x[beyond] - 0.5 * np.log(2 * np.pi * x[beyond])
    return np.asarray(values, dtype=np.float64)


def trial_amplitudes(weight: FloatArray) -> FloatArray:
    """a [s] to be tried for stretches of weight N [j] or, each column by itself, N [j, f]: [s] or [s, f]."""
    # λ contributes λ²/2 where it is small, and itself where it is large
    faint = np.sqrt(2 * criteria.FAINT / np.maximum(np.square(weight).sum(axis=0), 1e-300))
    return np.asarray(2.0 * np.sqrt(np.multiply.outer(criteria.AMPLITUDES**2, faint)))


def noise_level(*sides: tuple[float, float]) -> float:
    """The mean of u beside an order, from (sum, count) on either side: that of the louder side."""
    return max((total + criteria.PRIOR_STRETCHES) / (count + criteria.PRIOR_STRETCHES) for total, count in sides)


def log_likelihood_ratios(power: FloatArray, weight: FloatArray, amplitudes: FloatArray) -> FloatArray:
    """log L(a)/L(0) [s] (or [s, f]) of u and N [j] (or [j, f]) at a [s] (or [s, f])."""
    return np.stack(
        [np.minimum(rice(power, 0.25 * weight * a**2), criteria.MOST_PER_STRETCH).sum(axis=0) for a in amplitudes]
    )


def amplitude(power: FloatArray, weight: FloatArray) -> float:
    """a of u and N [j] by their means: E u = 1 + a² N/4."""
    return float(2.0 * np.sqrt(max(float((power - 1.0).sum()), 0.0) / max(float(weight.sum()), 1e-300)))
