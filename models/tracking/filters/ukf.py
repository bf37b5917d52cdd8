"""Unscented Kalman filters, one for each probable form (`courses`), weighed by their innovations.

The state is (ξ0, ξ at a reference progress, log τ, log ε, δ, T δ', and the step of each event): in logarithms φ = τε and
ε cannot leave their domain, and with ξ at the reference in place of Δ the ridge of the posterior is nearly straight. All
are in deviations from the prior mean, in units of the prior's deviations, so that the numbers are near 1 whatever the
quantity's unit. The law does not move between runs; δ is an integrated random walk, and an event adds its step of the
level to the state: one common step would book the sum of all on the last event.

The prior is far too wide for sigma points: φ spans decades within them, and a filter started there does not recover.
So the filters start, one for each form, from the means and covariances of the exact posterior of the first measurements
together; before that the answers are draws of the prior, weighted by the evidence of the few measurements. They start again
when their innovations become too large, when progress has doubled (the law is curved, and the reference moves along), or
when a run comes out of order.

A run may be outlying: each update is that of a sound run and of an outlying one, mixed by how probable either is. The
scatter between runs is learnt from the innovations: of an innovation with y²/S = κ, the share g = s²/S is scatter, and
E[e²] = s² (1 + g (κ - 1)) is averaged into s² with the weight of one observation (the step of an
expectation-maximisation). A normal on a curved ridge is only approximate: the other filters are the reference.

In a step, of all filters at once, log τ is the place of log |φ| (`courses.log_scale_at`, beyond the reference where a
course ends) less log |ε|. Between runs only δ moves, and linearly: its mean and covariance are led on exactly. What a run
measures is not linear: the 2 d sigma points of a filter of d numbers, filterpy's, lie at ±√d deviations along the columns
of the covariance's Cholesky root, each with the weight 1/(2 d), none at the centre, so that S and P stay positive
definite.

Source: S. J. Julier, J. K. Uhlmann, Proc. IEEE 92 (2004) 401-422, with κ = 0.
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction
from models.tracking.courses import (
    FORM_COURSE,
    FORM_PROPORTIONAL,
    FORM_SIZE,
    SCALE_SIGN,
    coefficients_at,
    log_scale_at,
    place_of,
)
from models.tracking.criteria import DOMAIN, OUTLIER
from models.tracking.discrepancy import PAST, drawn, value_and_slope_now
from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.particle import Particle, ParticleState, log_likelihood_of
from models.tracking.history import History
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior
from models.tracking.sampling import normalised, spread_normals, systematic

#: Numbers of a state before its steps.
BEFORE_STEPS = 6


_ARRAYS = ("form", "log_weight", "mean", "covariance", "scatter")
#: The grid that starts the filter.
_STARTER = Grid(nodes=13, rows=13, levels=7)
#: Draws of the prior before the start. Chosen: of 6,000, three measurements leave 190 or more that count, 740 in the median.
_PRIOR = Particle(particles=6_000)


@dataclass(frozen=True, slots=True, kw_only=True)
class UkfState:
    """One filter for each of k forms (`courses`): form [k], log_weight [k], mean [k, d] and covariance [k, d, d] in units
    of the prior (d: 6, and one for each event), scatter [k, 2]: its variance in the quantity's unit squared and how many
    observations it is worth.

    `history` is everything measured, `reference` the progress at which the filters started, `squared_innovation` the
    running mean of squared innovations.
    """

    prior: TrackPrior
    history: History
    reference: float
    squared_innovation: float
    form: FloatArray
    log_weight: FloatArray
    mean: FloatArray
    covariance: FloatArray
    scatter: FloatArray

    @property
    def kinds(self) -> NDArray[np.intp]:
        """The form of every filter [k]."""
        return self.form.astype(np.intp)

    def to_arrays(self) -> dict[str, FloatArray]:
        """The state as named arrays; `from_arrays` gives it back exactly."""
        named = {name: getattr(self, name) for name in _ARRAYS}
        lone = {"prior": self.prior.to_array(), "place": np.array([self.reference, self.squared_innovation])}
        return self.history.to_arrays() | lone | named

    @classmethod
    def from_arrays(cls, arrays: dict[str, FloatArray]) -> "UkfState":
        """The inverse of `to_arrays`."""
        reference, squared_innovation = arrays["place"].tolist()
        return cls(
            prior=TrackPrior.from_array(arrays["prior"]),
            history=History.from_arrays(arrays),
            reference=reference,
            squared_innovation=squared_innovation,
            **{name: arrays[name] for name in _ARRAYS},
        )


def stepped(state: UkfState, history: History, forget: float = 0.3) -> UkfState:
    """The filters advanced to the last run of a history. Squared innovations are those of a sound and of an outlying run,
    mixed like the step; their running mean forgets at the rate `forget`."""
    prior, unit = state.prior, state.prior.initial_sd
    mean, covariance = predicted(state, history)
    growth = np.where(FORM_PROPORTIONAL[state.kinds], prior.relative_squared(history.value[-1]), 1.0)
    scatter = state.scatter[:, 0] * growth
    expected, variance, across = measured(state, mean, covariance, float(history.progress[-1]))
    variance = variance + (history.variance[-1] + scatter) / unit**2
    off = history.value[-1] / unit - expected
    shares = np.array([1.0 - prior.outlying_share, prior.outlying_share])
    variances = variance[:, None] + np.array([0.0, (prior.outlying_size * prior.size / unit) ** 2])
    squared = off[:, None] ** 2 / variances
    density = shares * np.exp(-0.5 * np.minimum(squared, 1400.0)) / np.sqrt(2.0 * np.pi * variances)
    total = density.sum(axis=1)
    share = density / total[:, None]
    gain = across[:, :, None] / variances[:, None, :]
    moves = gain * off[:, None, None]
    middle = (moves * share[:, None, :]).sum(axis=2)
    deviations = (moves - middle[:, :, None]) * np.sqrt(share)[:, None, :]
    gains = gain * (variances * share)[:, None, :]
    learnt = covariance - gains @ gain.swapaxes(1, 2) + deviations @ deviations.swapaxes(1, 2)
    log_weight = state.log_weight + np.log(np.maximum(total, 1e-300))
    squared_innovation = float(normalised(log_weight) @ np.minimum((share * squared).sum(axis=1), OUTLIER**2))
    return replace(
        state,
        history=history,
        squared_innovation=(1.0 - forget) * state.squared_innovation + forget * squared_innovation,
        log_weight=log_weight - log_weight.max(),
        mean=np.clip(mean + middle, -DOMAIN, DOMAIN),
        covariance=definite(learnt),
        scatter=scatter_learnt(prior, state.scatter, squared[:, 0], variance, share[:, 0], growth),
    )


def predicted(state: UkfState, history: History) -> tuple[FloatArray, FloatArray]:
    """Means and covariances led on to the last run of a history; of the level's steps those that have none yet are as the
    prior has them, and the process noise of δ and its slope goes with the size q of each filter."""
    prior, (count, before), steps = state.prior, state.mean.shape, history.step_sizes(state.prior)
    dimension = BEFORE_STEPS + steps.size
    mean, covariance = np.zeros((count, dimension)), np.zeros((count, dimension, dimension))
    mean[:, :before], covariance[:, :before, :before] = state.mean, state.covariance
    new = np.arange(before, dimension)
    covariance[:, new, new] = (steps[new - BEFORE_STEPS] * prior.size / prior.initial_sd) ** 2
    gap = (history.span - state.history.span) / state.reference
    mean[:, 4] += gap * mean[:, 5]
    covariance[:, 4] += gap * covariance[:, 5]
    covariance[:, :, 4] += gap * covariance[:, :, 5]
    density = (
        3.0 * (FORM_SIZE[state.kinds] * prior.size / prior.initial_sd) ** 2 * (state.reference / history.span) ** 3
    )
    noise = np.tile(1e-9 * np.eye(dimension), (count, 1, 1))
    noise[:, 4:6, 4:6] += density[:, None, None] * np.array([[gap**3 / 3.0, gap**2 / 2.0], [gap**2 / 2.0, gap]])
    return mean, covariance + noise


def measured(
    state: UkfState, mean: FloatArray, covariance: FloatArray, progress: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of what a run at a progress would measure without noise, in the prior's unit: mean [k], variance [k], covariance with
    the state [k, d]; by the sigma points of mean [k, d] and covariance [k, d, d]."""
    prior, reference = state.prior, state.reference
    points, weight = _standard_points(mean.shape[1])
    away = points @ np.linalg.cholesky(covariance).swapaxes(1, 2)
    rows = unscaled(prior, mean[:, None] + away)
    scale, exponent = coefficients(rows[..., 2], rows[..., 3], FORM_COURSE[state.kinds][:, None], reference)
    share, at_reference = progress_fraction(np.array([progress, reference])[:, None, None], scale, exponent)
    values = (
        rows[..., 0] + (rows[..., 1] - rows[..., 0]) * share / at_reference + rows[..., 4] + rows[..., 6:].sum(axis=2)
    )
    values /= prior.initial_sd
    expected = values @ weight
    off = values - expected[:, None]
    return expected, np.square(off) @ weight, ((off * weight)[:, None, :] @ away)[:, 0]


@cache
def _standard_points(dimension: int) -> tuple[FloatArray, FloatArray]:
    """filterpy's 2 d sigma points of a standard normal of d numbers [2 d, d] and their weights [2 d]. Its first point, the
    centre, is left out: its weight is 0."""
    from filterpy.kalman import MerweScaledSigmaPoints  # start-up time

    points = MerweScaledSigmaPoints(dimension, alpha=1.0, beta=0.0, kappa=0.0)
    return points.sigma_points(np.zeros(dimension), np.eye(dimension))[1:], points.Wm[1:]


def coefficients(
    place: FloatArray, log_exponent: FloatArray, course: NDArray[np.intp], reference: float
) -> tuple[FloatArray, FloatArray]:
    """Signed φ and ε of a state's place and log |ε|, broadcast against the course."""
    log_scale, _ = log_scale_at(place, course, reference)
    return coefficients_at(log_scale, log_exponent, course)


def _units(prior: TrackPrior, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Centres and units of (ξ0, ξ at the reference, log τ, log ε, δ, T δ', steps)."""
    level, rate = prior.initial_mean, prior.log_scale_mean - prior.log_exponent_mean
    centre, unit = np.zeros(dimension), np.full(dimension, prior.initial_sd)
    centre[:4] = level, level, rate, prior.log_exponent_mean
    unit[2:4] = prior.log_scale_sd, prior.log_exponent_sd
    return centre, unit


def scaled(prior: TrackPrior, points: FloatArray) -> FloatArray:
    """Rows of (ξ0, ξ at the reference, place, log ε, δ, T δ', steps) as states [n, d]."""
    centre, unit = _units(prior, points.shape[1])
    rows = points.copy()
    rows[:, 2] -= rows[:, 3]
    return np.asarray((rows - centre) / unit)


def unscaled(prior: TrackPrior, state: FloatArray) -> FloatArray:
    """The inverse of `scaled`, for states [..., d]; states far out of the domain are moved to its edge."""
    centre, unit = _units(prior, state.shape[-1])
    rows = centre + unit * np.clip(state, -2.0 * DOMAIN, 2.0 * DOMAIN)
    rows[..., 2] += rows[..., 3]
    return np.asarray(rows)


def scatter_learnt(
    prior: TrackPrior,
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


def definite(covariance: FloatArray, least: float = 1e-10) -> FloatArray:
    """Covariances [..., d, d] symmetrised, with no eigenvalue below `least`, in units of the prior's variance."""
    symmetric = 0.5 * (covariance + covariance.swapaxes(-1, -2))
    values, vectors = np.linalg.eigh(symmetric)
    if values.min() >= least:
        return np.asarray(symmetric)
    lifted = (vectors * np.maximum(values, least)[..., None, :]) @ vectors.swapaxes(-1, -2)
    lifted = 0.5 * (lifted + lifted.swapaxes(-1, -2))
    return np.where((values[..., :1] >= least)[..., None], symmetric, lifted)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ukf:
    """The filter, started from the first `together` >= 1 measurements; its updates use no random numbers.

    Chosen: started at the eighth test, with the posterior laid again at each before, forecasts of lives of eq. 6 are as good
    (docs/appendix/prognosis.md), and a life of 16 tests takes 1.2 to 1.5 times as long.
    """

    name: ClassVar[str] = "ukf"
    together: int = 4

    def start(self, prior: TrackPrior) -> UkfState:
        """The prior itself, without normals, which the first measurements make together."""
        return UkfState(
            prior=prior,
            history=History.of((), prior),
            reference=1.0,
            squared_innovation=1.0,
            form=np.zeros(0),
            log_weight=np.zeros(0),
            mean=np.zeros((0, BEFORE_STEPS)),
            covariance=np.zeros((0, BEFORE_STEPS, BEFORE_STEPS)),
            scatter=np.zeros((0, 2)),
        )

    def update(self, state: UkfState, measurement: Measurement, rng: np.random.Generator | None = None) -> UkfState:  # noqa: ARG002
        """The state after one more measurement: predict, update, symmetrise, keep to the domain; or start again."""
        before, prior = state.history, state.prior
        history = before.append(measurement, prior)
        backwards = measurement.progress < before.span or measurement.epoch < before.epoch.max(initial=0.0)
        if history.value.size < self.together:
            return replace(state, history=history)
        # with 2, 2.5 and 3 they hold 5, 1 and 3 of 6 ends of logarithms at 60 % of life, and as many of other laws
        new = state.form.size == 0 or backwards or measurement.progress > 2.0 * state.reference
        if new:
            return _started(prior, history)
        updated = stepped(state, history)
        # where courses that end before what is measured have much of the weight: lives that fall at once (ad hoc) are
        # forecast the same where they start again at every test; without it they end
        if updated.squared_innovation > 4.0 or _over(updated) > 0.1:
            return _started(prior, history)
        return updated

    def posterior(self, state: UkfState, size: int, rng: np.random.Generator) -> TrackPosterior:
        """`size` evenly spread draws of equal weight from the normals, those left out whose course would have ended before
        the last measurement; the scatter is a point estimate of each."""
        prior, history = state.prior, state.history
        if state.form.size == 0:
            return _before_the_start(prior, history, size, rng)
        kind = systematic(normalised(state.log_weight), size, float(rng.random()))
        normals = spread_normals(size, rng.random(5))
        normals = np.column_stack([normals, rng.standard_normal((size, state.mean.shape[1] - normals.shape[1]))])
        root = np.linalg.cholesky(state.covariance)
        point = state.mean[kind] + np.einsum("nij,nj->ni", root[kind], normals)
        initial, at_reference, place, log_exponent, *discrepancy_terms = unscaled(prior, point).T
        form = state.kinds[kind]
        scale, exponent = coefficients(place, log_exponent, FORM_COURSE[form], state.reference)
        change = (at_reference - initial) / progress_fraction(state.reference, scale, exponent)
        ends = np.stack([discrepancy_terms[0], discrepancy_terms[1] * history.span / state.reference])
        worn = -change * progress_fraction(history.span, scale, exponent) / initial
        sizes = FORM_SIZE[form]
        course = np.where(sizes[:, None] > 0.0, (np.linalg.pinv(value_and_slope_now()) @ ends).T, 0.0)
        heights = np.stack(discrepancy_terms[2:], axis=1) if len(discrepancy_terms) > 2 else np.zeros((size, 0))
        weight = np.where((scale < 0.0) & (-scale <= history.span), 0.0, 1.0)
        weight = weight if weight.any() else np.ones(size)
        return TrackPosterior(
            weight=weight / weight.sum(),
            initial=initial,
            change=change,
            scale=scale,
            exponent=exponent,
            scatter=np.sqrt(state.scatter[kind, 0]),
            proportional=FORM_PROPORTIONAL[form],
            discrepancy=drawn(history, prior, sizes, np.concatenate([course, heights], axis=1), worn, rng),
        )


def _over(state: UkfState) -> float:
    """The share of the weight on courses that end before the last measurement, which none of them can."""
    gap, (centre, unit) = state.history.span - state.reference, _units(state.prior, state.mean.shape[1])
    if gap <= 0.0:
        return 0.0
    ends = np.flatnonzero(SCALE_SIGN[FORM_COURSE[state.kinds]] < 0.0)
    place = slice(2, 4)  # the sum of log τ and log ε
    mean = (centre[place] + unit[place] * state.mean[ends, place]).sum(axis=1)
    variance = unit[place] @ state.covariance[ends, place, place] @ unit[place]
    return float(normalised(state.log_weight)[ends] @ ndtr((math.log(gap) - mean) / np.sqrt(variance)))


def _before_the_start(prior: TrackPrior, history: History, size: int, rng: np.random.Generator) -> TrackPosterior:
    """`size` draws given a few measurements: of evenly spread ones of the prior, by the evidence."""
    cloud = _PRIOR.start(prior).cloud
    outlying = rng.random((_PRIOR.particles, history.value.size)) < prior.outlying_share
    cloud = replace(cloud, outlying=outlying.astype(np.float64))
    cloud = replace(cloud, log_weight=log_likelihood_of(history, prior, cloud))
    return _PRIOR.posterior(ParticleState(prior=prior, history=history, cloud=cloud), size, rng)


def _started(prior: TrackPrior, history: History) -> UkfState:
    """The normals with the moments of the exact posterior, by form, from evenly spread draws: as many again for every so
    many events, each of which has a moment of its own."""
    many = 3_000 * (1 + history.steps.size // 20)
    draws = _STARTER.posterior(GridState(prior=prior, history=history), many, np.random.default_rng(0))
    reference = history.span
    form, (course, steps) = draws.form, _beside(draws, history.steps.size)
    points = scaled(
        prior,
        np.column_stack(
            [
                draws.initial,
                draws.initial + draws.change * progress_fraction(reference, draws.scale, draws.exponent),
                place_of(draws.log_scale, draws.course, reference),
                draws.log_exponent,
                course,
                steps,
            ]
        ),
    )
    shares = np.bincount(form, weights=draws.weight, minlength=FORM_SIZE.size)
    # a covariance of d numbers needs more than d draws; the exact posterior's rare courses are those that end soon
    enough = np.bincount(form, minlength=FORM_SIZE.size) > 2 * points.shape[1]
    likely_kinds = np.flatnonzero(enough | (shares == shares.max()))
    moments = [_moments(points[form == kind], draws.weight[form == kind]) for kind in likely_kinds]
    log_scatter = np.log(draws.scatter)
    variance = [
        math.exp(2.0 * np.average(log_scatter[form == k], weights=draws.weight[form == k])) for k in likely_kinds
    ]
    worth = max(1.0, 0.5 / prior.log_scatter_sd**2) + history.value.size
    return UkfState(
        prior=prior,
        history=history,
        reference=reference,
        squared_innovation=1.0,
        form=likely_kinds.astype(np.float64),
        log_weight=np.log(shares[likely_kinds] / shares[likely_kinds].max()),
        mean=np.stack([mean for mean, _ in moments]),
        covariance=np.stack([covariance for _, covariance in moments]),
        scatter=np.array([(s_squared, worth) for s_squared in variance]),
    )


def _beside(draws: TrackPosterior, steps: int) -> tuple[FloatArray, FloatArray]:
    """Of every draw (δ, T δ') at the end of what was measured [n, 2], and the level's steps [n, steps]."""
    discrepancy = draws.discrepancy
    if discrepancy is None:
        return np.zeros((draws.weight.size, 2)), np.zeros((draws.weight.size, steps))
    return discrepancy.curvature[:, :PAST] @ value_and_slope_now().T, discrepancy.height


def _moments(points: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    share = weight / weight.sum()
    mean = share @ points
    off = points - mean
    return np.clip(mean, -DOMAIN, DOMAIN), definite((share * off.T) @ off)
