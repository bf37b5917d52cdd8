"""Simulated lives, brute-force posteriors and scores for the statistical tests of tracking and prognosis."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.degradation.general_order import DegradationLaw, first_passage, value
from models.prognosis.ended_lives import ObservedLife, ended_life, new_and_laws
from models.prognosis.first_passage import ends_of_life, weighted_quantiles
from models.tracking import linear_model, sampling
from models.tracking.courses import FORM_COURSE, FORM_SIZE, SCALE_SIGN, log_form_weight
from models.tracking.filters.particle import ParticleState
from models.tracking.history import History
from models.tracking.linear_model import EvaluationPoints
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior, weak
from tests import dense
from tests.models.tracking.tracked_series import sent

LEVELS = np.array([0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95])
STAGES = (0.2, 0.4, 0.6, 0.8)
PRIOR = weak(Measurement(progress=0.0, value=0.13, variance=0.0), falling=True)
CAP = 1e6  # an end of life beyond it is scored as if it were there


@dataclass(frozen=True)
class Life:
    """A clutch that was: its coefficients, the scatter of its runs and when its COF was half."""

    truth: DegradationLaw
    scatter: float
    end: float

    def measured(self, share: float, runs: int, rng: np.random.Generator, outlying: float = 0.0) -> list[Measurement]:
        """Runs up to a share of life; of each, with the probability `outlying`, the gain is off by 10 %."""
        progress = np.linspace(0.0, share * self.end, runs)
        values = value(progress, self.truth) + self.scatter * rng.standard_normal(runs)
        if outlying > 0.0:
            values *= np.where(rng.random(runs) < outlying, 1.0 + 0.1 * rng.choice([-1.0, 1.0], runs), 1.0)
        return sent(progress, values)


def upto(measurements: list[Measurement], stage: float) -> list[Measurement]:
    """Those up to a stage of a life whose 25 runs end at 80 % of it."""
    return measurements[: round(stage * 30) + 1]


def lives(count: int, seed: int) -> Iterator[tuple[Life, np.random.Generator]]:
    """Lives drawn from the prior, of those that reach half of their COF between 100 and 1,000,000 cycles."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    found = 0
    while found < count:
        initial = rng.normal(PRIOR.initial_mean, PRIOR.initial_sd)
        truth = DegradationLaw(
            initial=initial,
            change=rng.normal(PRIOR.change_mean, PRIOR.change_sd),
            scale=math.exp(rng.normal(PRIOR.log_scale_mean, PRIOR.log_scale_sd)),
            exponent=math.exp(rng.normal(PRIOR.log_exponent_mean, PRIOR.log_exponent_sd)),
        )
        scatter = math.exp(rng.normal(PRIOR.log_scatter_mean, PRIOR.log_scatter_sd))
        end = float(first_passage(0.5 * initial, truth))
        if initial > 0.0 and 100.0 < end < CAP:
            found += 1
            yield Life(truth, scatter, end), rng


def typical(count: int, seed: int) -> Iterator[tuple[Life, np.random.Generator]]:
    """Lives like the reference's, not drawn from the prior: half of the COF lost around 15,000 cycles."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(count):
        initial = 0.13 * math.exp(rng.normal(0.0, 0.1))
        truth = DegradationLaw(
            initial=initial,
            change=-initial * rng.uniform(0.6, 0.9),
            scale=math.exp(rng.normal(math.log(5_000.0), 0.4)),
            exponent=math.exp(rng.normal(math.log(0.7), 0.4)),
        )
        end = float(first_passage(0.5 * initial, truth))
        if end < CAP:
            yield Life(truth, 0.003 * initial, end), rng


def at_stages(
    tracker: Any, prior: TrackPrior, measurements: list[Measurement], rng: np.random.Generator
) -> Iterator[tuple[float, Any]]:
    """The states at the stages of a life whose 25 runs end at 80 % of it: the grid's laid at once, the others' on the
    way."""
    state, seen = tracker.start(prior), 0
    for stage in STAGES:
        runs = upto(measurements, stage)
        if tracker.name == "grid":
            state = tracker.from_history(prior, runs)
        else:
            for measurement in runs[seen:]:
                state = tracker.update(state, measurement, rng)
        seen = len(runs)
        yield stage, state


def sampled(
    prior: TrackPrior, measurements: list[Measurement], points: EvaluationPoints, log_weight: np.ndarray, count: int
) -> TrackPosterior:
    """`count` draws of equal weight out of weighted points, with their linear terms drawn given each."""
    weight = np.exp(log_weight - log_weight.max())
    index = sampling.systematic(weight, count, 0.5)
    kept = EvaluationPoints(**{name: getattr(points, name)[..., index] for name in EvaluationPoints.__slots__})
    history = History.of(measurements, prior)
    rng = np.random.default_rng(1)
    solved, weight = linear_model.pointwise(history, prior, kept), np.full(count, 1.0 / count)
    return sampling.with_linear_terms(history, prior, kept, solved, weight, rng.standard_normal((count, 2)), rng)


def weighted(
    prior: TrackPrior, measurements: list[Measurement], points: EvaluationPoints, log_proposal: np.ndarray
) -> tuple[np.ndarray, float]:
    """Log weights [n] of points by the density written out in full, over their own; and how many they count for. A course
    that ended before the last measurement was none of these."""
    log_likelihood = np.concatenate(
        [
            dense.log_likelihood(
                prior,
                measurements,
                EvaluationPoints(**{k: getattr(points, k)[..., c] for k in EvaluationPoints.__slots__}),
            )
            for c in np.array_split(np.arange(points.size.size), max(1, points.size.size // 2_000))
        ]
    )
    log_weight = log_likelihood + log_prior(prior, points) - log_proposal
    span, ending = max(m.progress for m in measurements), SCALE_SIGN[FORM_COURSE[points.form]] < 0.0
    log_weight[ending & (np.exp(points.log_scale) <= span)] = -np.inf
    weight = np.exp(log_weight - log_weight.max())
    return log_weight, float(weight.sum() ** 2 / np.square(weight).sum())


def log_prior(prior: TrackPrior, points: EvaluationPoints) -> np.ndarray:
    """Log prior density of points [n], without the constant of the normals."""
    count, share = points.outlying.sum(axis=0), max(prior.outlying_share, 1e-300)
    chance = count * math.log(share) + (points.outlying.shape[0] - count) * math.log1p(-prior.outlying_share)
    flat = prior.log_density(points.log_scale, points.log_exponent, points.log_scatter)
    return flat + log_form_weight(prior)[points.form] + chance


def from_prior(
    prior: TrackPrior, measurements: list[Measurement], count: int, rng: np.random.Generator
) -> tuple[TrackPosterior, float]:
    """The exact posterior by `count` draws of the prior, for few measurements; and how many they count for."""
    spread = np.array([prior.log_scale_sd, prior.log_exponent_sd, prior.log_scatter_sd])
    centre = np.array([prior.log_scale_mean, prior.log_exponent_mean, prior.log_scatter_mean])
    normals = centre + spread * rng.standard_normal((count, 3))
    points = EvaluationPoints(
        log_scale=normals[:, 0],
        log_exponent=normals[:, 1],
        log_scatter=normals[:, 2],
        form=rng.choice(FORM_SIZE.size, size=count, p=np.exp(log_form_weight(prior))),
        outlying=(rng.random((len(measurements), count)) < prior.outlying_share).astype(float),
    )
    log_weight, effective_count = weighted(prior, measurements, points, log_prior(prior, points))
    return sampled(prior, measurements, points, log_weight, 4_000), effective_count


def exact(
    state: ParticleState, measurements: list[Measurement], count: int, rng: np.random.Generator
) -> tuple[TrackPosterior, float]:
    """The exact posterior by importance sampling, late in life too; and how many draws it counts for.

    A particle cloud says where to look, nothing more: points come from Student's t with 4 degrees around random
    particles (a tenth of the cloud's covariance), sizes and sets of outlying runs as often as among the particles, one
    time in ten any size. Every point is weighted by the density written out in full over that of its proposal.
    """
    prior, cloud = state.prior, state.cloud
    share = np.exp(cloud.log_weight - cloud.log_weight.max())
    share /= share.sum()
    turned = cloud.points @ TURN
    root = np.linalg.cholesky(0.1 * np.cov(turned, rowvar=False, aweights=share) + 1e-12 * np.eye(3))
    around = turned[rng.choice(share.size, size=count, p=share)]
    tail = np.sqrt(4.0 / rng.chisquare(4.0, size=count))
    proposed = around + tail[:, None] * rng.standard_normal((count, 3)) @ root.T
    near = np.zeros(count)
    middle = turned.mean(axis=0)
    there, here = (np.linalg.solve(root, (each - middle).T).T for each in (turned, proposed))
    for chunk in np.array_split(np.arange(count), max(1, count // 500)):
        apart = np.square(here[chunk]).sum(axis=1)[:, None] + np.square(there).sum(axis=1) - 2.0 * here[chunk] @ there.T
        tails = 1.0 + np.maximum(apart, 0.0) / 4.0
        near[chunk] = np.log((1.0 / (tails * tails * tails * np.sqrt(tails))) @ share)
    forms = 0.9 * np.bincount(cloud.form.astype(int), weights=share, minlength=FORM_SIZE.size) + 0.1 / FORM_SIZE.size
    sets, which = np.unique(cloud.outlying, axis=0, return_inverse=True)
    chances = np.bincount(which.ravel(), weights=share)
    chances = 0.9 * chances + 0.1 / chances.size
    form, group = rng.choice(FORM_SIZE.size, size=count, p=forms), rng.choice(chances.size, size=count, p=chances)
    back = proposed @ np.linalg.inv(TURN)
    points = EvaluationPoints(
        log_scale=back[:, 0], log_exponent=back[:, 1], log_scatter=back[:, 2], form=form, outlying=sets[group].T
    )
    log_weight, effective_count = weighted(
        prior, measurements, points, near + np.log(forms)[form] + np.log(chances)[group]
    )
    return sampled(prior, measurements, points, log_weight, 4_000), effective_count


#: (log φ, log ε, log s) to (log τ, log ε, log s), where the ridge is nearly straight.
TURN = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])


def taught(tests: Sequence[Measurement], end: float) -> ObservedLife:
    """What a life with these tests teaches that ended at `end`, with half of its new value."""
    initial, laws = new_and_laws(tests)
    progress, values = np.array([(test.progress, test.value) for test in tests]).T
    return ended_life(progress, values, end, initial=initial, fraction=0.5, laws=laws)


def ends(posterior: TrackPosterior) -> np.ndarray:
    return np.minimum(ends_of_life(posterior, 0.5), CAP)


def misplaced(
    reference: TrackPosterior, other: TrackPosterior, of: Callable[[TrackPosterior], np.ndarray] = ends
) -> np.ndarray:
    """By how much the quantiles of one sample, of the end of life if nothing else, miss their level under the other."""
    sample = of(reference)
    found = weighted_quantiles(of(other), other.weight, LEVELS)
    slack = 1e-9 * np.abs(found)
    below = np.array([reference.weight[sample < x - e].sum() for x, e in zip(found, slack, strict=True)])
    upto = np.array([reference.weight[sample <= x + e].sum() for x, e in zip(found, slack, strict=True)])
    return np.where(below > LEVELS, below - LEVELS, np.where(upto < LEVELS, LEVELS - upto, 0.0))
