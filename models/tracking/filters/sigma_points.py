"""One step of one unscented Kalman filter, and the coordinates in which it runs.

The state is (ξ0, ξ at a reference progress, log τ, log ε, δ, T δ', step) in deviations from the prior mean, in units of
the prior's deviations, so that the numbers are near 1 whatever the quantity's unit.
"""

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction
from models.tracking.criteria import DOMAIN, OUTLIER
from models.tracking.prior import Prior

#: Process noise of a step, and the least variance along any axis, in units of the prior's variance.
_PROCESS, _FLOOR = 1e-9, 1e-10
#: The state's dimension; sigma points at ±√7 deviations with no weight on the centre: all weights are positive, so S
#: and P stay positive definite.
DIMENSION = 7
SIGMA = {"n": DIMENSION, "alpha": 1.0, "beta": 0.0, "kappa": 0.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Normal:
    """One filter between two steps: its size q, mean [7], covariance [7, 7] and scatter [2] (variance, worth)."""

    size: float
    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """From one run to the next: the `reference` progress of the coordinates, the largest progress `before` and `after`,
    `events` in between, and the new run's progress, value and variance."""

    reference: float
    before: float
    after: float
    events: int
    progress: float
    value: float
    variance: float


@dataclass(frozen=True, slots=True)
class Step:
    """One filter's step: its state, how probable the measurement was, and the squared innovation in deviations, those of
    a sound and of an outlying run mixed like the step."""

    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray
    log_likelihood: float
    squared_innovation: float


def stepped(prior: Prior, normal: Normal, way: Way) -> Step:
    """One filter advanced to the next run."""
    unit = prior.initial_sd

    def moved(point: FloatArray, _: float) -> FloatArray:
        propagated = point.copy()
        propagated[4] += propagated[5] * (way.after - way.before) / way.reference
        return propagated

    def expected(point: FloatArray) -> FloatArray:
        initial, at_reference, log_scale, log_exponent, course, _, step = unscaled(prior, point)
        share, whole = progress_fraction(
            np.array([way.progress, way.reference]), math.exp(log_scale), math.exp(log_exponent)
        )
        return np.array([(initial + (at_reference - initial) * share / whole + course + step) / unit])

    further = (prior.outlying_size * prior.size / unit) ** 2
    scatter = float(normal.scatter[0])
    ukf = UnscentedKalmanFilter(
        dim_x=DIMENSION, dim_z=1, dt=1.0, hx=expected, fx=moved, points=MerweScaledSigmaPoints(**SIGMA)
    )
    ukf.x, ukf.P = normal.mean.copy(), normal.covariance.copy()
    ukf.Q = process(prior, normal.size, way)
    ukf.R = np.array([[(way.variance + scatter) / unit**2]])
    ukf.predict()
    ukf.update(np.array([way.value / unit]))
    off, variance = float(ukf.y[0]), float(ukf.S[0, 0])
    shares = np.array([1.0 - prior.outlying_share, prior.outlying_share])
    variances = np.array([variance, variance + further])
    density = shares * np.exp(-0.5 * np.minimum(off**2 / variances, 1400.0)) / np.sqrt(2.0 * np.pi * variances)
    total = float(density.sum())
    share = density / total
    gain = (ukf.K[:, 0] * variance)[:, None] / variances
    means = ukf.x_prior[:, None] + gain * off
    mean = means @ share
    apart = (means - mean[:, None]) * np.sqrt(share)
    learnt = ukf.P_prior - (gain * variances * share) @ gain.T + apart @ apart.T
    return Step(
        mean=np.clip(mean, -DOMAIN, DOMAIN),
        covariance=definite(learnt),
        scatter=scatter_learnt(prior, normal.scatter, off**2 / variance, variance, float(share[0])),
        log_likelihood=math.log(max(total, 1e-300)),
        squared_innovation=min(float(share @ (off**2 / variances)), OUTLIER**2),
    )


def process(prior: Prior, size: float, way: Way) -> FloatArray:
    """Process noise of δ and its slope over the way to the last measurement, and of the level at an event."""
    noise = _PROCESS * np.eye(DIMENSION)
    gap = (way.after - way.before) / way.reference
    density = 3.0 * (size * prior.size / prior.initial_sd) ** 2 * (way.reference / way.after) ** 3
    noise[4:6, 4:6] += density * np.array([[gap**3 / 3.0, gap**2 / 2.0], [gap**2 / 2.0, gap]])
    noise[6, 6] += way.events * (prior.step_size * prior.size / prior.initial_sd) ** 2
    return noise


def units(prior: Prior) -> tuple[FloatArray, FloatArray]:
    """Centres and units of (ξ0, ξ at the reference, log τ, log ε, δ, T δ', step)."""
    level, rate = prior.initial_mean, prior.log_scale_mean - prior.log_exponent_mean
    centre = np.array([level, level, rate, prior.log_exponent_mean, 0.0, 0.0, 0.0])
    sd = prior.initial_sd
    return centre, np.array([sd, sd, prior.log_scale_sd, prior.log_exponent_sd, sd, sd, sd])


def scaled(prior: Prior, points: FloatArray) -> FloatArray:
    """Rows of (ξ0, ξ at the reference, log φ, log ε, δ, T δ', step) as states [n, 7]."""
    centre, unit = units(prior)
    rows = points.copy()
    rows[:, 2] -= rows[:, 3]
    return np.asarray((rows - centre) / unit)


def unscaled(prior: Prior, state: FloatArray) -> FloatArray:
    """The inverse of `scaled`, for states [..., 7]; states far out of the domain are moved to its edge."""
    centre, unit = units(prior)
    rows = centre + unit * np.clip(state, -2.0 * DOMAIN, 2.0 * DOMAIN)
    rows[..., 2] += rows[..., 3]
    return np.asarray(rows)


def scatter_learnt(prior: Prior, scatter: FloatArray, squared: float, variance: float, sound: float) -> FloatArray:
    """Variance and worth of the scatter after a `squared` innovation in its deviations; `variance` in prior's units."""
    scatter_variance, worth = scatter.tolist()
    share = scatter_variance / (variance * prior.initial_sd**2)
    learnt = scatter_variance * (1.0 + sound * share * (min(squared, OUTLIER**2) - 1.0) / (worth + sound))
    low, high = (math.exp(2.0 * (prior.log_scatter_mean + k * prior.log_scatter_sd)) for k in (-DOMAIN, DOMAIN))
    return np.array([min(max(learnt, low), high), worth + sound])


def definite(covariance: FloatArray) -> FloatArray:
    """Symmetrised, with no eigenvalue below FLOOR."""
    symmetric = 0.5 * (covariance + covariance.T)
    values, vectors = np.linalg.eigh(symmetric)
    if values[0] >= _FLOOR:
        return np.asarray(symmetric)
    lifted = vectors * np.maximum(values, _FLOOR) @ vectors.T
    return np.asarray(0.5 * (lifted + lifted.T))
