"""The closed form that grid and particle share: eq. 6 is linear in ξ0 and Δ once φ, ε and the scatter s are given.

With y_t = ξ0 + Δ b_t + e_t, b_t = 1 - (1 + ζ_t/φ)^-ε and e_t ~ N(0, v_t + s²), normal priors on ξ0 and Δ lead to a
normal posterior and to the probability of the data with both integrated out. A few weighted sums over the measurements
are all that either needs, with weights r_t = 1/(v_t + s²) and y_t taken from the prior mean of ξ0.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior

#: Values are told apart to this share of the prior's deviations. Where a series is free of noise its likelihood grows
#: without bound as the scatter vanishes, and differences of sums weighted by 1/s² would be rounding alone.
RESOLUTION = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """The measurements so far, in the order they came: progress, value, variance, each [t]."""

    progress: FloatArray
    value: FloatArray
    variance: FloatArray

    @classmethod
    def of(cls, measurements: Sequence[Measurement]) -> "History":
        """The columns of a sequence of measurements, possibly empty."""
        rows = np.array([(m.progress, m.value, m.variance) for m in measurements], dtype=np.float64).reshape(-1, 3)
        return cls(progress=rows[:, 0].copy(), value=rows[:, 1].copy(), variance=rows[:, 2].copy())

    def append(self, measurement: Measurement) -> "History":
        """A history with one more measurement."""
        return History(
            progress=np.append(self.progress, measurement.progress),
            value=np.append(self.value, measurement.value),
            variance=np.append(self.variance, measurement.variance),
        )

    def to_arrays(self) -> dict[str, FloatArray]:
        """The columns by name."""
        return {"progress": self.progress, "value": self.value, "variance": self.variance}

    @classmethod
    def from_arrays(cls, arrays: dict[str, FloatArray]) -> "History":
        """The inverse of `to_arrays`."""
        return cls(progress=arrays["progress"], value=arrays["value"], variance=arrays["variance"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Sums:
    """Weighted sums over the measurements: Σr, Σrb, Σrb², Σry, Σrby, Σry², and Σ log r; shapes broadcast."""

    r: FloatArray
    rb: FloatArray
    rbb: FloatArray
    ry: FloatArray
    rby: FloatArray
    ryy: FloatArray
    log_r: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditional:
    """The normal posterior of (ξ0, Δ) given φ, ε and s: means, variances and covariance, equal shapes."""

    initial: FloatArray
    change: FloatArray
    initial_variance: FloatArray
    change_variance: FloatArray
    covariance: FloatArray


def resolved(measurement: Measurement, prior: Prior) -> Measurement:
    """The measurement with the variance of its resolution added, as every filter takes it in."""
    resolution = RESOLUTION * math.hypot(prior.initial_sd, prior.change_sd)
    return replace(measurement, variance=measurement.variance + resolution**2)


def evidence(sums: Sums, prior: Prior) -> FloatArray:
    """Log probability of the data given φ, ε and s, with ξ0 and Δ integrated out.

    -½ [Σ log(2π/r) + log|A| + log(σ0² σΔ²) + Σ r z² - cᵀ A⁻¹ c], where z = y - E[ξ0] - E[Δ] b, c = (Σrz, Σrbz) and A
    is the posterior precision. By elimination, so that the nearly singular A of a curve that has saturated keeps its
    digits.
    """
    a00, _, c0, pivot, d1 = _eliminate(sums, prior)
    mean = prior.change_mean
    misfit = sums.ryy - 2.0 * mean * sums.rby + mean**2 * sums.rbb
    quadratic = c0**2 / a00 + d1**2 / pivot
    spread = math.log(prior.initial_sd) + math.log(prior.change_sd)
    return np.asarray(0.5 * (sums.log_r - np.log(a00 * pivot) - misfit + quadratic) - spread)


def conditional(sums: Sums, prior: Prior) -> Conditional:
    """The posterior of (ξ0, Δ) given φ, ε and s."""
    a00, a01, c0, pivot, d1 = _eliminate(sums, prior)
    change_variance = 1.0 / pivot
    slope = a01 / a00
    shift = d1 * change_variance
    return Conditional(
        initial=prior.initial_mean + c0 / a00 - slope * shift,
        change=prior.change_mean + shift,
        initial_variance=1.0 / a00 + slope**2 * change_variance,
        change_variance=change_variance,
        covariance=-slope * change_variance,
    )


def _eliminate(sums: Sums, prior: Prior) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    a00 = sums.r + prior.initial_sd**-2
    c0 = sums.ry - prior.change_mean * sums.rb
    c1 = sums.rby - prior.change_mean * sums.rbb
    slope = sums.rb / a00
    floor = prior.change_sd**-2
    pivot = floor + np.maximum(sums.rbb - sums.rb * slope, 0.0)
    return a00, sums.rb, c0, pivot, c1 - slope * c0


def basis(progress: FloatArray, log_scale: FloatArray, log_exponent: FloatArray) -> FloatArray:
    """b = 1 - (1 + ζ/φ)^-ε, broadcast: `degradation.progress_fraction`, twice as quick.

    Accurate to 2e-16 absolute, not relative: here b only ever stands beside measurement noise.
    """
    return np.asarray(1.0 - np.exp(-np.exp(log_exponent) * np.log(1.0 + progress * np.exp(-log_scale))))


def pointwise(
    history: History, prior: Prior, log_scale: FloatArray, log_exponent: FloatArray, log_scatter: FloatArray
) -> Sums:
    """The sums at points [n] of (log φ, log ε, log s); each [n]."""
    b = basis(history.progress[:, None], log_scale, log_exponent)
    r = 1.0 / (history.variance[:, None] + np.exp(2.0 * log_scatter))
    y = history.value - prior.initial_mean
    rb = r * b
    return Sums(
        r=r.sum(axis=0),
        rb=rb.sum(axis=0),
        rbb=np.einsum("tn,tn->n", rb, b),
        ry=y @ r,
        rby=y @ rb,
        ryy=y**2 @ r,
        log_r=np.log(r / (2.0 * np.pi)).sum(axis=0),
    )


def tabulated(history: History, prior: Prior, table: FloatArray, log_scatter: FloatArray, blur: float = 0.0) -> Sums:
    """The sums on a table of scatter levels [l] by cells [g], from the cells' table b [t, g], by matrix products.

    Sums with b have the shape [l, g], those without [l, 1]. `blur` is a further deviation of every measurement.
    """
    r = 1.0 / (history.variance + blur**2 + np.exp(2.0 * log_scatter)[:, None])
    y = history.value - prior.initial_mean
    return Sums(
        r=r.sum(axis=1, keepdims=True),
        rb=r @ table,
        rbb=r @ table**2,
        ry=(r @ y)[:, None],
        rby=(r * y) @ table,
        ryy=(r @ y**2)[:, None],
        log_r=np.log(r / (2.0 * np.pi)).sum(axis=1, keepdims=True),
    )
