"""Eq. 6: how a friction quantity drifts with use, its inverse and the kinetics behind it.

    ξ(ζ) = ξ0 + Δ [1 - (1 + ζ/φ)^-ε]

The share D = (1 + ζ/φ)^-ε of the change that is still to come obeys general-order kinetics, dD/dζ = -k Dⁿ with
n = 1 + 1/ε and k = ε/φ. The severity of the load enters through the rate k, so ζ may be an energy as well as a number
of cycles.
Given (φ, ε) the law is linear in ξ0 and Δ. It saturates at ξ0 + Δ: a level beyond that is never reached.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, eq. 6.
"""

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from models.arrays import FloatArray

Number: TypeAlias = float | FloatArray
#: What is left of 1 + ζ/φ where a course has ended, and the logarithm of the most that a growing share becomes.
ENDED, LOG_MOST = 1e-12, math.log(1e3)


@dataclass(frozen=True, slots=True, kw_only=True)
class DegradationLaw:
    """The coefficients of eq. 6, floats or arrays that broadcast against each other.

    `initial` ξ0 and `change` Δ are in the unit of the quantity, `scale` φ in that of ζ (cycles), `exponent` ε [-]. Both are
    positive in eq. 6; with other signs it is another course (`models.tracking.courses`). Raises ValueError where one is not
    finite, or scale or exponent is 0.
    """

    initial: Number
    change: Number
    scale: Number
    exponent: Number

    def __post_init__(self) -> None:
        for name in ("initial", "change", "scale", "exponent"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} must be finite")
        for name in ("scale", "exponent"):
            if not np.all(getattr(self, name)):
                raise ValueError(f"{name} must not be 0")


def progress_fraction(zeta: Number, scale: Number, exponent: Number) -> FloatArray:
    """Share of the final change that has happened, σ [1 - (1 + ζ/φ)^-ε], σ the product of the signs of φ and ε;
    broadcast.

    Not negative; below 1 in eq. 6. ζ >= 0; beyond the end of a course that ends it stays as it was there. Accurate
    to rounding for the smallest ζ/φ: the power is taken by log1p and expm1.

    >>> float(progress_fraction(15_000.0, 5_000.0, 0.5))
    0.5
    """
    left = np.log1p(np.maximum(np.asarray(zeta) / scale, ENDED - 1.0))
    return np.asarray(
        -np.expm1(np.minimum(-np.asarray(exponent) * left, LOG_MOST)) * np.sign(scale) * np.sign(exponent)
    )


def value(zeta: Number, degradation: DegradationLaw) -> FloatArray:
    """Eq. 6, ξ(ζ) in the unit of ξ0; ζ >= 0 broadcasts against the coefficients."""
    d = degradation
    return np.asarray(d.initial + d.change * progress_fraction(zeta, d.scale, d.exponent))


def first_passage(level: Number, degradation: DegradationLaw) -> FloatArray:
    """Progress ζ at which ξ is `level`: φ [(1 - (level - ξ0)/Δ)^(-1/ε) - 1], or inf where eq. 6 never takes that value.

    It is monotone, so there is at most one such ζ; a constant (Δ = 0) is at its level from ζ = 0 on. Also inf where ζ
    is beyond what a float holds.
    """
    d = degradation
    gap = np.asarray(level, dtype=np.float64) - d.initial
    change = np.asarray(d.change, dtype=np.float64)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        share = np.where(gap == 0.0, 0.0, gap / change) * np.sign(d.scale) * np.sign(d.exponent)
        inside = reaches(level, degradation)
        growth = np.expm1(-np.log1p(-np.where(inside, share, 0.0)) / d.exponent)
        return np.where(inside, d.scale * growth, np.inf)


def reaches(level: Number, degradation: DegradationLaw) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Whether eq. 6 ever takes the value `level`: it starts there, or `level` lies between ξ0 and ξ0 + Δ
    (excluded)."""
    d = degradation
    gap = np.asarray(level, dtype=np.float64) - d.initial
    towards = np.where(np.asarray(d.change) < 0.0, -gap, gap)
    return np.asarray(
        (gap == 0.0) | ((towards > 0.0) & ((towards < np.abs(d.change)) | (np.sign(d.scale) * np.sign(d.exponent) < 0)))
    )
