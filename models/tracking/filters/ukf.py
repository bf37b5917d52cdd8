"""filterpy's unscented Kalman filter on eq. 6, one for each probable form (`courses`), started from the particles.

Nothing is carried: φ spans decades within the sigma points of a whole life, and a normal that goes along leaves the
curved ridge. At every test the particles before it (`particle`) give each form its mean and covariance, in closed form
(`before_last`); filterpy leads them on and takes in the test, and the likelihoods weigh the forms. It is another way from
one test to the next, by moments in place of weights, and as good as a normal is: good on the ridge of eq. 6, approximate
on those of other courses, where answers say so.

The state is (ξ0, ξ at the last test before, log τ, log ε, δ, T δ', log s, and the step of each event): in logarithms
φ = τε, ε and s cannot leave their domain, and with ξ at a test in place of Δ the ridge of the posterior is nearly
straight. All are in deviations from the prior mean, in units of the prior's deviations. log τ is the place of log |φ|
(`courses.log_scale_at`) less log |ε|. Between tests only δ moves, an integrated random walk. The sigma points lie at
±√d deviations, none at the centre, so that S and P stay positive definite. A test may be outlying: each form takes it
in as a sound one and as an outlying one.

With fewer than FEWEST_BEFORE tests before it, where a test comes out of order, where it is more probably outlying
than sound and where a tenth of the courses that the normals hold would have ended before it, a normal says nothing,
and the answer is the particles'.

Source: S. J. Julier, J. K. Uhlmann, Proc. IEEE 92 (2004) 401-422, with κ = 0.
"""

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction
from models.tracking.courses import (
    FORM_COURSE,
    FORM_PROPORTIONAL,
    FORM_SIZE,
    coefficients_at,
    log_scale_at,
    place_of,
)
from models.tracking.criteria import DOMAIN, FEWEST_BEFORE, LEAST_FORM
from models.tracking.discrepancy import PAST, columns, drawn_discrepancy, value_and_slope
from models.tracking.filters.particle import Entered, Particle, ParticleState
from models.tracking.history import History, span_of
from models.tracking.linear_model import linear_moments
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior
from models.tracking.sampling import normalised, spread_normals, systematic

#: Numbers of a state before its steps, and which of them are those of δ.
BEFORE_STEPS, DELTA = 7, slice(4, 6)
_NORMALS = ("form", "weight", "mean", "covariance")


@dataclass(frozen=True, slots=True, kw_only=True)
class Normals:
    """k normals of a life's coefficients after a test: form [k], weight [k], mean [k, d] and covariance [k, d, d] in units
    of the prior; none where the particles answer. The second number of a state is ξ at the progress `reference`."""

    reference: float
    form: FloatArray
    weight: FloatArray
    mean: FloatArray
    covariance: FloatArray

    @classmethod
    def none(cls) -> "Normals":
        """No normals."""
        shape = (0, BEFORE_STEPS)
        return cls(
            reference=1.0,
            form=np.zeros(0),
            weight=np.zeros(0),
            mean=np.zeros(shape),
            covariance=np.zeros((*shape, BEFORE_STEPS)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class UkfState:
    """State of the filter: the particles, and the normals after the newest test, from which no later step starts."""

    particles: ParticleState
    normals: Normals

    @property
    def prior(self) -> TrackPrior:
        """The prior of the particles."""
        return self.particles.prior

    @property
    def history(self) -> History:
        """All measurements."""
        return self.particles.history

    def to_arrays(self) -> dict[str, FloatArray | NDArray[np.bool_]]:
        """The state as named arrays; `from_arrays` gives it back exactly."""
        normals = {f"normal_{name}": getattr(self.normals, name) for name in _NORMALS}
        return self.particles.to_arrays() | normals | {"normal_reference": np.array([self.normals.reference])}

    @classmethod
    def from_arrays(cls, arrays: dict[str, Any]) -> "UkfState":
        """The inverse of `to_arrays`."""
        named = {name: arrays[f"normal_{name}"] for name in _NORMALS}
        normals = Normals(reference=float(arrays["normal_reference"][0]), **named)
        return cls(particles=ParticleState.from_arrays(arrays), normals=normals)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ukf:
    """The filter: the particle filter, and at every test filterpy's step from the moments of its particles."""

    name: ClassVar[str] = "ukf"
    particle: Particle = field(default_factory=Particle)

    def start(self, prior: TrackPrior) -> UkfState:
        """The state before any measurement."""
        return UkfState(particles=self.particle.start(prior), normals=Normals.none())

    def update(self, state: UkfState, measurement: Measurement, rng: np.random.Generator) -> UkfState:
        """The state with one more measurement: particles, and the normals updated by it."""
        before, entered = state.history, self.particle.entered(state.particles, measurement)
        in_order = measurement.progress >= before.span and measurement.epoch >= before.epoch.max(initial=0.0)
        ready = before.value.size >= FEWEST_BEFORE and in_order
        normals = stepped(entered) if ready else Normals.none()
        return UkfState(particles=self.particle.settled(entered, rng), normals=normals)

    def passed(self, state: UkfState, measurement: Measurement, rng: np.random.Generator) -> UkfState:
        """The state with one more measurement, without normals, because no answer is asked for after it."""
        return UkfState(particles=self.particle.update(state.particles, measurement, rng), normals=Normals.none())

    def posterior(self, state: UkfState, size: int, rng: np.random.Generator) -> TrackPosterior:
        """`size` evenly spread draws from the normals, all of equal weight but those whose course would have ended before
        the last measurement, which have none. Where those are more than a tenth, or there are no normals, draws of the
        particles."""
        normals, prior, history = state.normals, state.prior, state.history
        if normals.form.size == 0:
            return self.particle.posterior(state.particles, size, rng)
        kind, rows = _drawn_states(prior, normals, size, rng)
        initial, at_reference, place, log_exponent, delta, slope, log_scatter, *steps = rows.T
        form = normals.form.astype(np.intp)[kind]
        scale, exponent = coefficients(place, log_exponent, FORM_COURSE[form], normals.reference)
        ended = (scale < 0.0) & (-scale <= history.span)
        if ended.mean() > 0.1:
            return self.particle.posterior(state.particles, size, rng)
        change = (at_reference - initial) / progress_fraction(normals.reference, scale, exponent)
        worn = -change * progress_fraction(history.span, scale, exponent) / initial
        ends = np.stack([delta, slope * history.span / normals.reference])
        smooth = np.where(FORM_SIZE[form, None] > 0.0, (np.linalg.pinv(value_and_slope(1.0, 1.0)) @ ends).T, 0.0)
        terms = np.column_stack([smooth, *steps])
        return TrackPosterior(
            weight=np.where(ended, 0.0, 1.0 / np.count_nonzero(~ended)),
            initial=initial,
            change=change,
            scale=scale,
            exponent=exponent,
            scatter=np.exp(log_scatter),
            proportional=FORM_PROPORTIONAL[form],
            discrepancy=drawn_discrepancy(history, prior, FORM_SIZE[form], terms, worn, rng),
        )


def _drawn_states(
    prior: TrackPrior, normals: Normals, size: int, rng: np.random.Generator
) -> tuple[NDArray[np.intp], FloatArray]:
    """`size` evenly spread draws from the mixture of normals: which normal each is of [size], and its state [size, n]."""
    kind = systematic(normals.weight, size, float(rng.random()))
    spread = spread_normals(size, rng.random(5))
    spread = np.column_stack([spread, rng.standard_normal((size, normals.mean.shape[1] - spread.shape[1]))])
    root = np.linalg.cholesky(normals.covariance)
    return kind, unscaled(prior, normals.mean[kind] + np.einsum("nij,nj->ni", root[kind], spread))


def stepped(entered: Entered) -> Normals:
    """The normals of particles before the last run of a history, with it taken in; none where it is more probably
    outlying."""
    prior, history = entered.prior, entered.history
    reference, form = span_of(history.progress[:-1]), entered.cloud.form.astype(np.intp)
    weight, (states, factors) = normalised(entered.cloud.log_weight), before_last(entered, reference)
    shares = np.bincount(form, weights=weight, minlength=FORM_SIZE.size)
    forms = np.flatnonzero((shares > LEAST_FORM) | (shares == shares.max()))
    taken, weights = [], []
    for kind in forms.tolist():
        of_form = np.flatnonzero(form == kind)
        mean, covariance = _moments(states[of_form], factors.take(of_form, axis=2), weight[of_form])
        for density, normal in _taken_in(mean, covariance, kind, reference, history, prior):
            taken.append(normal)
            weights.append(shares[kind] * density)
    weight = np.array(weights) / max(sum(weights), 1e-300)
    if not weight[::2].sum() > 0.5:
        return Normals.none()
    return Normals(
        reference=reference,
        form=np.repeat(forms, 2).astype(np.float64),
        weight=weight,
        mean=np.stack([np.clip(mean, -DOMAIN, DOMAIN) for mean, _ in taken]),
        covariance=np.stack([definite(covariance) for _, covariance in taken]),
    )


def before_last(entered: Entered, reference: float) -> tuple[FloatArray, FloatArray]:
    """Every particle's mean [n, d] of a state given all runs but the last, in closed form, and factors F [i, k, n] of the
    covariance Σ_i F_i F_iᵀ of its k `linear` numbers; the others are the particle's own.

    Given a particle the last value y is a linear combination of the state beside it, with noise of variance d: where that
    has the mean m, the variance v and the covariance c with the state, the mean without it is off by c (m - y)/(d - v), and
    the covariance by c cᵀ/(d - v).
    """
    prior, history, points = entered.prior, entered.history, entered.cloud.placed()
    now, then = points.basis(history.progress[-1:])[0], points.basis(np.array([reference]))[0]
    steps, nothing = history.steps.size, np.zeros(now.size)
    of_terms = np.zeros((5 + steps, PAST + steps))
    of_terms[2:4, :PAST] = value_and_slope(reference, history.span)
    of_terms[4:-1, PAST:] = np.eye(steps)
    of_terms[-1] = columns(history)[-1]
    of_initial = np.array([1.0, 1.0, *np.zeros(2 + steps), 1.0])
    of_change = np.stack([nothing, then, *[nothing] * (2 + steps), now])
    mean, factors = linear_moments(entered.solved, prior, of_initial, of_change, of_terms)
    noise = history.variance[-1] + np.exp(2.0 * points.log_scatter) * np.where(
        FORM_PROPORTIONAL[points.form], prior.relative_squared(history.value[-1]), 1.0
    )
    shared = np.einsum("ikn,in->kn", factors, factors[:, -1])
    left = np.sqrt(np.maximum(noise - shared[-1], 1e-9 * noise))
    shared, off = shared / left, (mean[-1] - history.value[-1]) / left
    mean, factors = mean[:-1] + shared[:-1] * off, np.concatenate([factors, shared[None]])[:, :-1]
    rows = np.empty((mean.shape[0] + 3, now.size))
    rows[linear(rows.shape[0])] = mean
    rows[[2, 3, 6]] = place_of(points.log_scale, points.course, reference), points.log_exponent, points.log_scatter
    return scaled(prior, rows.T), factors / prior.initial_sd


def linear(dimension: int) -> NDArray[np.intp]:
    """Which numbers of a state are linear: (ξ0, ξ at the reference, δ, T δ', steps)."""
    return np.array([0, 1, 4, 5, *range(BEFORE_STEPS, dimension)])


def _taken_in(
    mean: FloatArray, covariance: FloatArray, kind: int, reference: float, history: History, prior: TrackPrior
) -> list[tuple[float, tuple[FloatArray, FloatArray]]]:
    """filterpy's step of a form's normal by the last run, as a sound and as an outlying one: of each the probability
    density up to a constant, mean and covariance."""
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter  # start-up time

    dimension, unit, value = mean.size, prior.initial_sd, float(history.value[-1])
    progress, course, gap = float(history.progress[-1]), np.array(FORM_COURSE[kind]), history.span / reference - 1.0

    def led_on(x: FloatArray, gap: float) -> FloatArray:
        return np.concatenate([x[:4], [x[4] + gap * x[5]], x[5:]])

    def measured(states: FloatArray) -> FloatArray:
        initial, at_reference, place, log_exponent, delta, _, _, *steps = unscaled(prior, states).T
        scale, exponent = coefficients(place, log_exponent, course, reference)
        share, so_far = progress_fraction(np.array([[progress], [reference]]), scale, exponent)
        return np.asarray((initial + (at_reference - initial) * share / so_far + delta + sum(steps)) / unit)

    points = MerweScaledSigmaPoints(dimension, alpha=1.0, beta=0.0, kappa=0.0)
    kalman = UnscentedKalmanFilter(dimension, 1, gap, None, led_on, points)
    kalman.x, kalman.P, kalman.Q = mean, covariance, 1e-9 * np.eye(dimension)
    # δ has the deviation q at what was measured, now further on
    diffusion = 3.0 * (FORM_SIZE[kind] * prior.size / unit) ** 2 * (reference / history.span) ** 3
    kalman.Q[DELTA, DELTA] += diffusion * np.array([[gap**3 / 3.0, gap**2 / 2.0], [gap**2 / 2.0, gap]])
    kalman.predict()
    values = measured(kalman.sigmas_f)  # of all sigma points at once
    growth = prior.relative_squared(value) if FORM_PROPORTIONAL[kind] else 1.0
    scatter = math.exp(2.0 * unscaled(prior, mean)[6]) * growth
    found = []
    for share, further in ((1.0 - prior.outlying_share, 0.0), (prior.outlying_share, prior.outlying_size * prior.size)):
        kalman.x, kalman.P = kalman.x_prior, kalman.P_prior
        each, noise = iter(values), float(history.variance[-1] + scatter + further**2) / unit**2
        kalman.update(np.array([value / unit]), R=noise, hx=lambda _, each=each: np.array([next(each)]))
        innovation, variance = float(kalman.y[0]), float(kalman.S[0, 0])
        density = share * math.exp(-0.5 * min(innovation**2 / variance, 1400.0)) / math.sqrt(variance)
        found.append((density, (kalman.x, kalman.P)))
    return found


def coefficients(
    place: FloatArray, log_exponent: FloatArray, course: NDArray[np.intp], reference: float
) -> tuple[FloatArray, FloatArray]:
    """Signed φ and ε of a state's place and log |ε|, broadcast against the course."""
    log_scale, _ = log_scale_at(place, course, reference)
    return coefficients_at(log_scale, log_exponent, course)


def _centre_and_unit(prior: TrackPrior, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Centre [n] and unit [n] by which the state (ξ0, ξ at the reference, log τ, log ε, δ, T δ', log s, steps) is stored
    as a number of order one."""
    level, rate = prior.initial_mean, prior.log_scale_mean - prior.log_exponent_mean
    centre, unit = np.zeros(dimension), np.full(dimension, prior.initial_sd)
    centre[:4] = level, level, rate, prior.log_exponent_mean
    unit[2:4] = prior.log_scale_sd, prior.log_exponent_sd
    centre[6], unit[6] = prior.log_scatter_mean, prior.log_scatter_sd
    return centre, unit


def scaled(prior: TrackPrior, points: FloatArray) -> FloatArray:
    """Rows of (ξ0, ξ at the reference, place, log ε, δ, T δ', log s, steps) as states [n, d]."""
    centre, unit = _centre_and_unit(prior, points.shape[1])
    rows = points.copy()
    rows[:, 2] -= rows[:, 3]
    return np.asarray((rows - centre) / unit)


def unscaled(prior: TrackPrior, state: FloatArray) -> FloatArray:
    """The inverse of `scaled`, for states [..., d]; states far out of the domain are moved to its edge."""
    centre, unit = _centre_and_unit(prior, state.shape[-1])
    rows = centre + unit * np.clip(state, -2.0 * DOMAIN, 2.0 * DOMAIN)
    rows[..., 2] += rows[..., 3]
    return np.asarray(rows)


def definite(covariance: FloatArray, least: float = 1e-10) -> FloatArray:
    """A covariance [d, d] symmetrised, with no eigenvalue below `least`, in units of the prior's variance."""
    symmetric = 0.5 * (covariance + covariance.T)
    values, vectors = np.linalg.eigh(symmetric)
    if values.min() >= least:
        return np.asarray(symmetric)
    lifted = (vectors * np.maximum(values, least)) @ vectors.T
    return np.asarray(0.5 * (lifted + lifted.T))


def _moments(means: FloatArray, factors: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean [d], held within ±DOMAIN, and covariance [d, d] of a mixture of normals, of means [n, d] and factors [i, k, n]
    (`before_last`)."""
    share = weight / weight.sum()
    mean = share @ means
    off, within = means - mean, linear(mean.size)
    covariance = (share * off.T) @ off
    covariance[within[:, None], within] += np.matmul(share * factors, factors.swapaxes(1, 2)).sum(axis=0)
    return np.clip(mean, -DOMAIN, DOMAIN), definite(covariance)
