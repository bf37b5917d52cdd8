"""One step of unscented Kalman filters, all of them at once, and the coordinates in which they run.

The state is (ξ0, ξ at a reference progress, log τ, log ε, δ, T δ', and the step of each event) in deviations from the prior
mean, in units of the prior's deviations, so that the numbers are near 1 whatever the quantity's unit. Here log τ is the
place of log |φ| (`courses.log_scale_at`, beyond the reference where a course ends) less log |ε|.

Between runs only δ moves, and linearly: its mean and covariance are led on exactly. What a run measures is not linear: the
2 d sigma points of a filter of d numbers, filterpy's, lie at ±√d deviations along the columns of the covariance's Cholesky
root, each with the weight 1/(2 d), none at the centre, so that S and P stay positive definite.

Source: S. J. Julier, J. K. Uhlmann, Proc. IEEE 92 (2004) 401-422, with κ = 0.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction
from models.tracking.courses import FORM_COURSE, FORM_PROPORTIONAL, FORM_SIZE, coefficients_at, log_scale_at
from models.tracking.criteria import DOMAIN, OUTLIER
from models.tracking.prior import Prior

#: Process noise of a step, and the least variance along any axis, in units of the prior's variance.
_PROCESS, _FLOOR = 1e-9, 1e-10
#: Numbers of a state before its steps.
BEFORE_STEPS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Normals:
    """k filters between two runs: form [k] (`courses`), mean [k, d], covariance [k, d, d] and scatter [k, 2] (variance,
    worth)."""

    form: NDArray[np.intp]
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
    """The step of k filters: their states, how probable the measurement was [k], and the squared innovations [k] in
    deviations, those of a sound and of an outlying run mixed like the step."""

    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray
    log_likelihood: FloatArray
    squared_innovation: FloatArray


def stepped(prior: Prior, normals: Normals, way: Way) -> Step:
    """The filters advanced to the next run."""
    unit = prior.initial_sd
    mean, covariance = predicted(prior, normals, way)
    growth = np.where(FORM_PROPORTIONAL[normals.form], way.relative, 1.0)
    scatter = normals.scatter[:, 0] * growth
    expected, variance, across = measured(prior, normals.form, mean, covariance, way)
    variance = variance + (way.variance + scatter) / unit**2
    off = way.value / unit - expected
    shares = np.array([1.0 - prior.outlying_share, prior.outlying_share])
    variances = variance[:, None] + np.array([0.0, (prior.outlying_size * prior.size / unit) ** 2])
    squared = off[:, None] ** 2 / variances
    density = shares * np.exp(-0.5 * np.minimum(squared, 1400.0)) / np.sqrt(2.0 * np.pi * variances)
    total = density.sum(axis=1)
    share = density / total[:, None]
    gain = across[:, :, None] / variances[:, None, :]
    moves = gain * off[:, None, None]
    middle = (moves * share[:, None, :]).sum(axis=2)
    apart = (moves - middle[:, :, None]) * np.sqrt(share)[:, None, :]
    kept = gain * (variances * share)[:, None, :]
    learnt = covariance - kept @ gain.swapaxes(1, 2) + apart @ apart.swapaxes(1, 2)
    return Step(
        mean=np.clip(mean + middle, -DOMAIN, DOMAIN),
        covariance=definite(learnt),
        scatter=scatter_learnt(prior, normals.scatter, squared[:, 0], variance, share[:, 0], growth),
        log_likelihood=np.log(np.maximum(total, 1e-300)),
        squared_innovation=np.minimum((share * squared).sum(axis=1), OUTLIER**2),
    )


def predicted(prior: Prior, normals: Normals, way: Way) -> tuple[FloatArray, FloatArray]:
    """Means and covariances led on to the next run."""
    mean, covariance = _widened(prior, normals, way.steps)
    gap = (way.after - way.before) / way.reference
    mean[:, 4] += gap * mean[:, 5]
    covariance[:, 4] += gap * covariance[:, 5]
    covariance[:, :, 4] += gap * covariance[:, :, 5]
    return mean, covariance + process(prior, FORM_SIZE[normals.form], way)


def measured(
    prior: Prior, form: NDArray[np.intp], mean: FloatArray, covariance: FloatArray, way: Way
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of what a run would measure without noise, in the prior's unit: mean [k], variance [k], covariance with the state
    [k, d]; by the sigma points."""
    dimension = mean.shape[1]
    points, weight = _standard_points(dimension)
    away = points @ np.linalg.cholesky(covariance).swapaxes(1, 2)
    rows = unscaled(prior, mean[:, None] + away)
    scale, exponent = coefficients(rows[..., 2], rows[..., 3], FORM_COURSE[form][:, None], way.reference)
    share, whole = progress_fraction(np.array([way.progress, way.reference])[:, None, None], scale, exponent)
    values = rows[..., 0] + (rows[..., 1] - rows[..., 0]) * share / whole + rows[..., 4] + rows[..., 6:].sum(axis=2)
    values /= prior.initial_sd
    expected = values @ weight
    off = values - expected[:, None]
    return expected, np.square(off) @ weight, ((off * weight)[:, None, :] @ away)[:, 0]


@cache
def _standard_points(dimension: int) -> tuple[FloatArray, FloatArray]:
    """filterpy's sigma points of a standard normal [2 d, d] with their weights [2 d], without the centre, which has none."""
    from filterpy.kalman import MerweScaledSigmaPoints  # start-up time

    points = MerweScaledSigmaPoints(dimension, alpha=1.0, beta=0.0, kappa=0.0)
    return points.sigma_points(np.zeros(dimension), np.eye(dimension))[1:], points.Wm[1:]


def coefficients(
    place: FloatArray, log_exponent: FloatArray, course: NDArray[np.intp], reference: float
) -> tuple[FloatArray, FloatArray]:
    """Signed φ and ε of a state's place and log |ε|, broadcast against the course."""
    log_scale, _ = log_scale_at(place, course, reference)
    return coefficients_at(log_scale, log_exponent, course)


def process(prior: Prior, size: FloatArray, way: Way) -> FloatArray:
    """Process noise [k, d, d] of δ and its slope over the way to the last measurement, for discrepancies of sizes q [k]."""
    noise = np.tile(_PROCESS * np.eye(BEFORE_STEPS + way.steps), (size.size, 1, 1))
    gap = (way.after - way.before) / way.reference
    density = 3.0 * (size * prior.size / prior.initial_sd) ** 2 * (way.reference / way.after) ** 3
    noise[:, 4:6, 4:6] += density[:, None, None] * np.array([[gap**3 / 3.0, gap**2 / 2.0], [gap**2 / 2.0, gap]])
    return noise


def _widened(prior: Prior, normals: Normals, steps: int) -> tuple[FloatArray, FloatArray]:
    """Means and covariances with the steps of all events: those that have none yet are as the prior has them."""
    (count, before), dimension = normals.mean.shape, BEFORE_STEPS + steps
    mean, covariance = np.zeros((count, dimension)), np.zeros((count, dimension, dimension))
    mean[:, :before], covariance[:, :before, :before] = normals.mean, normals.covariance
    new = np.arange(before, dimension)
    covariance[:, new, new] = (prior.step_size * prior.size / prior.initial_sd) ** 2
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
    prior: Prior,
    scatter: FloatArray,
    squared: FloatArray | float,
    variance: FloatArray | float,
    sound: FloatArray | float,
    growth: FloatArray | float = 1.0,
) -> FloatArray:
    """Variance and worth of the scatter [..., 2] after `squared` innovations in their deviations; `variance` in prior's
    units, the scatter's part of it s² times `growth`."""
    scatter_variance, worth = scatter[..., 0], scatter[..., 1]
    share = growth * scatter_variance / (variance * prior.initial_sd**2)
    surprise = np.minimum(squared, OUTLIER**2) - 1.0
    learnt = scatter_variance * (1.0 + sound * share * surprise / (worth + sound))
    low, high = (math.exp(2.0 * (prior.log_scatter_mean + k * prior.log_scatter_sd)) for k in (-DOMAIN, DOMAIN))
    return np.stack([np.clip(learnt, low, high), worth + sound], axis=-1)


def definite(covariance: FloatArray) -> FloatArray:
    """Covariances [..., d, d] symmetrised, with no eigenvalue below FLOOR."""
    symmetric = 0.5 * (covariance + covariance.swapaxes(-1, -2))
    values, vectors = np.linalg.eigh(symmetric)
    if values.min() >= _FLOOR:
        return np.asarray(symmetric)
    lifted = (vectors * np.maximum(values, _FLOOR)[..., None, :]) @ vectors.swapaxes(-1, -2)
    lifted = 0.5 * (lifted + lifted.swapaxes(-1, -2))
    return np.where((values[..., :1] >= _FLOOR)[..., None], symmetric, lifted)
