"""One step of one unscented Kalman filter, and the coordinates in which it runs.

The state is (ξ0, ξ at a reference progress, log τ, log ε, δ, T δ', and the step of each event) in deviations from the prior
mean, in units of the prior's deviations, so that the numbers are near 1 whatever the quantity's unit. Here log τ is the
place of log |φ| (`courses.log_scale_at`, beyond the reference where a course ends) less log |ε|.
"""

import math
from dataclasses import dataclass

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction
from models.tracking.courses import FORM_COURSE, FORM_PROPORTIONAL, FORM_SIZE, coefficients_at, log_scale_at
from models.tracking.criteria import DOMAIN, OUTLIER
from models.tracking.prior import Prior

#: Process noise of a step, and the least variance along any axis, in units of the prior's variance.
_PROCESS, _FLOOR = 1e-9, 1e-10
#: Numbers of a state before its steps. Sigma points of d numbers lie at ±√d deviations with no weight on the centre: all
#: weights are positive, so S and P stay positive definite.
BEFORE_STEPS = 6
_SIGMA = {"alpha": 1.0, "beta": 0.0, "kappa": 0.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class Normal:
    """One filter between two runs: its form (`courses`), mean [d], covariance [d, d] and scatter [2] (variance, worth)."""

    form: int
    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """From one run to the next: the `reference` progress of the coordinates, the largest progress `before` and `after`,
    `steps` after events so far, and the new run's progress, value, variance and `relative` size squared."""

    reference: float
    before: float
    after: float
    steps: int
    progress: float
    value: float
    variance: float
    relative: float


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
    unit, course = prior.initial_sd, FORM_COURSE[[normal.form]]
    mean_before, covariance_before = _widened(prior, normal, way.steps)
    dimension = mean_before.size

    def moved(point: FloatArray, _: float) -> FloatArray:
        propagated = point.copy()
        propagated[4] += propagated[5] * (way.after - way.before) / way.reference
        return propagated

    def expected(point: FloatArray) -> FloatArray:
        initial, at_reference, place, log_exponent, beside, _, *steps = unscaled(prior, point)
        scale, exponent = coefficients(place, log_exponent, course, way.reference)
        share, whole = progress_fraction(np.array([way.progress, way.reference]), scale, exponent)
        return np.array([(initial + (at_reference - initial) * share / whole + beside + sum(steps)) / unit])

    further = (prior.outlying_size * prior.size / unit) ** 2
    growth = way.relative if FORM_PROPORTIONAL[normal.form] else 1.0
    scatter = float(normal.scatter[0]) * growth
    ukf = UnscentedKalmanFilter(
        dim_x=dimension, dim_z=1, dt=1.0, hx=expected, fx=moved, points=MerweScaledSigmaPoints(n=dimension, **_SIGMA)
    )
    ukf.x, ukf.P = mean_before, covariance_before
    ukf.Q = process(prior, float(FORM_SIZE[normal.form]), way)
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
        scatter=scatter_learnt(prior, normal.scatter, off**2 / variance, variance, float(share[0]), growth),
        log_likelihood=math.log(max(total, 1e-300)),
        squared_innovation=min(float(share @ (off**2 / variances)), OUTLIER**2),
    )


def coefficients(
    place: FloatArray, log_exponent: FloatArray, course: NDArray[np.intp], reference: float
) -> tuple[FloatArray, FloatArray]:
    """Signed φ and ε of a state's place and log |ε|, broadcast against the course."""
    log_scale, _ = log_scale_at(place, course, reference)
    return coefficients_at(log_scale, log_exponent, course)


def process(prior: Prior, size: float, way: Way) -> FloatArray:
    """Process noise of δ and its slope over the way to the last measurement."""
    noise = _PROCESS * np.eye(BEFORE_STEPS + way.steps)
    gap = (way.after - way.before) / way.reference
    density = 3.0 * (size * prior.size / prior.initial_sd) ** 2 * (way.reference / way.after) ** 3
    noise[4:6, 4:6] += density * np.array([[gap**3 / 3.0, gap**2 / 2.0], [gap**2 / 2.0, gap]])
    return noise


def _widened(prior: Prior, normal: Normal, steps: int) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance with the steps of all events: those that have none yet are as the prior has them."""
    before = normal.mean.size
    mean, covariance = np.zeros(BEFORE_STEPS + steps), np.zeros((BEFORE_STEPS + steps, BEFORE_STEPS + steps))
    mean[:before], covariance[:before, :before] = normal.mean, normal.covariance
    new = np.arange(before, mean.size)
    covariance[new, new] = (prior.step_size * prior.size / prior.initial_sd) ** 2
    return mean, covariance


def _units(prior: Prior, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Centres and units of (ξ0, ξ at the reference, log τ, log ε, δ, T δ', steps)."""
    level, rate = prior.initial_mean, prior.log_scale_mean - prior.log_exponent_mean
    centre, unit = np.zeros(dimension), np.full(dimension, prior.initial_sd)
    centre[:4] = level, level, rate, prior.log_exponent_mean
    unit[2:4] = prior.log_scale_sd, prior.log_exponent_sd
    return centre, unit


def scaled(prior: Prior, points: FloatArray) -> FloatArray:
    """Rows of (ξ0, ξ at the reference, place, log ε, δ, T δ', steps) as states [n, d]."""
    centre, unit = _units(prior, points.shape[1])
    rows = points.copy()
    rows[:, 2] -= rows[:, 3]
    return np.asarray((rows - centre) / unit)


def unscaled(prior: Prior, state: FloatArray) -> FloatArray:
    """The inverse of `scaled`, for states [..., d]; states far out of the domain are moved to its edge."""
    centre, unit = _units(prior, state.shape[-1])
    rows = centre + unit * np.clip(state, -2.0 * DOMAIN, 2.0 * DOMAIN)
    rows[..., 2] += rows[..., 3]
    return np.asarray(rows)


def scatter_learnt(
    prior: Prior, scatter: FloatArray, squared: float, variance: float, sound: float, growth: float = 1.0
) -> FloatArray:
    """Variance and worth of the scatter after a `squared` innovation in its deviations; `variance` in prior's units, the
    scatter's part of it s² times `growth`."""
    scatter_variance, worth = scatter.tolist()
    share = growth * scatter_variance / (variance * prior.initial_sd**2)
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
