"""The extended model of a judgement: the effects that it names, fitted together, or a smooth correction; `held_out`
measures its gain.

Structure without a name is corrected on the test's clock, the oil's temperature or the loop's phase, where it lives there;
over speed, pressure and life the law's discrepancy is in every model,

    δ(x) = S(v; p, ζ) Σ_k a_k φ_k(x),     a_k ~ N(0, (τ/(1 + k/3))²),     φ_k cosines over the range of each axis

with the τ of the largest marginal likelihood. The correction interpolates inside the data's range; beyond it the last value
is kept, and nothing of it is followed into the future of a life.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.design.design import CLOCK, PHASE, TEMPERATURE, Design, Points
from models.diagnosis.effects.catalogue import change_columns
from models.diagnosis.effects.effect import Effect, EffectKind
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.explanations.verdict import Judgement, Verdict
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import gram_of, project
from models.diagnosis.validation.held_out import FittedModel, Gain, measure_gain
from models.gaussian_evidence import log_gain

#: The slug of a smooth correction, which is no effect of the catalogue.
SLUG = "unexplained_structure"

#: Gauss-Newton steps: the correction is linear but for the lag of loops.
_STEPS = 6

_OF_POINTS: dict[str, Callable[[Points], FloatArray]] = {
    CLOCK: lambda points: np.where(points.steady, points.clock, 0.0),
    TEMPERATURE: lambda points: points.temperature,
}

#: Axes that can carry a smooth correction.
AXES = frozenset({*_OF_POINTS, PHASE})


def smooth_fit(problem: FitProblem, baseline: PooledFit, axes: Sequence[str]) -> PooledFit | None:
    """The baseline refitted with a smooth correction on the axes; None where no axis can carry one."""
    effects = [effect for axis in axes[:2] for effect in _along(problem.design, axis)]
    if not effects:
        return None
    size = _size(problem, baseline, effects)
    start = [
        FittedEffect(effect=replace(effect, prior_sd=size * effect.prior_sd), amplitude=0.0, shape=())
        for effect in effects
    ]
    return fit(problem, baseline.laws, start, steps=_STEPS)


def _along(design: Design, axis: str) -> list[Effect]:
    """Smooth effects along an axis, one for each function: cosines over the axis's range, or a loop's harmonics."""
    if axis == PHASE and design.loops:
        waves: tuple[Callable[[FloatArray], FloatArray], ...] = (np.cos, np.sin)
        orders = product(range(1, 5 + 1), waves)
        return [_effect(k, partial(_harmonic, k=k, wave=wave), before_lag=False) for k, wave in orders]
    if axis not in _OF_POINTS:
        return []
    place = _OF_POINTS[axis]
    measured = place(design.points)
    measured = np.unique(measured[np.isfinite(measured)])
    if measured.size < 2:
        return []
    low, high = float(measured[0]), float(measured[-1])

    def cosine(points: Points, k: int) -> FloatArray:
        unit = np.clip((place(points) - low) / (high - low), 0.0, 1.0)  # NaN where it was not measured
        return np.asarray(np.nan_to_num(np.cos(np.pi * k * unit), nan=0.0), dtype=np.float64)

    count = min(10, measured.size - 1)
    return [_effect(k, partial(cosine, k=k), before_lag=axis != CLOCK) for k in range(1, count + 1)]


def _harmonic(points: Points, k: int, wave: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """A wave [P] of k times the loop's phase; 0 at plateaus."""
    return np.where(points.steady, 0.0, wave(k * points.phase))


def _effect(k: int, column: Callable[[Points], FloatArray], *, before_lag: bool) -> Effect:
    """A smooth effect in proportion to the torque; it is neither taken off measurements nor followed along a life."""
    return Effect(
        slug=SLUG,
        title="Structure without a name",
        kind=EffectKind.LAG,
        amplitude="share of the torque",
        unit="-",
        prior_sd=1.0 / (1.0 + k / 3.0),
        change=lambda scene, amplitude, _: amplitude * scene.curve * column(scene.points),
        before_lag=before_lag,
        tails=float("inf"),
    )


def _size(problem: FitProblem, baseline: PooledFit, effects: Sequence[Effect]) -> float:
    """Size τ of largest marginal likelihood, in units of the prior's deviations."""
    unit_changes = [(effect.change(baseline.prediction.scene, 1.0, ()), effect.lags(())) for effect in effects]
    gram = gram_of(problem, baseline, change_columns(problem.design, baseline.prediction, unit_changes))
    projected = project(gram, problem.noise.run_gain, problem.noise.curve_gain, problem.noise.law)
    unit = np.array([effect.prior_sd for effect in effects])
    return max(criteria.CORRECTION_SIZES, key=lambda size: log_gain(projected.info, projected.score, size * unit))


def validate(
    problem: FitProblem, baseline: PooledFit, judgement: Judgement, rng: np.random.Generator
) -> tuple[PooledFit | None, Gain | None]:
    """The baseline extended by the likeliest causes, or by a smooth correction on the axes of unexplained structure (None
    where there is nothing to extend by), and its gain (None where nothing can be held out)."""
    extended = judgement.stand[0].fit if judgement.stand else None
    if judgement.verdict is Verdict.UNEXPLAINED_STRUCTURE:
        extended = smooth_fit(problem, baseline, [axis.axis for axis in judgement.where if axis.axis in AXES])
    if extended is None:
        return None, None
    return extended, measure_gain(FittedModel(problem, baseline), FittedModel(problem, extended), rng)
