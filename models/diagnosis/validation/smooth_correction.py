"""Structure without a name: a smooth discrepancy on the axes on which it was seen.

    δ(x) = S(v; p, ζ) Σ_k a_k φ_k(x),     a_k ~ N(0, (τ/(1 + k/3))²),     φ_k cosines over the range of each axis

τ is the one that the data find most probable. It fills in between measurements inside the data's range; beyond it the last
value stands, and nothing of it is followed into the future of a life.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.axes import CLOCK, CYCLES, PHASE, PRESSURE, SPEED, TEMPERATURE
from models.diagnosis.design.design import Design
from models.diagnosis.design.points import Points
from models.diagnosis.effects.effect import Effect, Family, Kind, Shape
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit, Fitted, Priors, fit
from models.diagnosis.pooled_fit.projection import change_columns, gram_of, project

#: What a smooth discrepancy is called where effects are named.
SLUG = "unexplained_structure"
#: Cosines along an axis; harmonics of a loop; deviations τ that are tried, as shares of the torque.
COSINES, HARMONICS = 10, 5
SIZES = (0.001, 0.003, 0.01, 0.03, 0.1)
#: Axes that are taken in at most.
MOST_AXES = 2

_OF_POINTS: dict[str, Callable[[Points], FloatArray]] = {
    SPEED: lambda points: points.velocity,
    PRESSURE: lambda points: points.pressure,
    CYCLES: lambda points: np.sqrt(points.cycles),
    CLOCK: lambda points: np.where(points.steady, points.clock, 0.0),
    TEMPERATURE: lambda points: points.temperature,
}

#: Axes that can carry a smooth discrepancy.
AXES = frozenset({*_OF_POINTS, PHASE})


def smooth_fit(design: Design, noise: Noise, priors: Priors, baseline: Fit, axes: Sequence[str]) -> Fit | None:
    """The baseline with a smooth discrepancy on the axes beside it, refitted; None where no axis can carry one."""
    effects = [effect for axis in axes[:MOST_AXES] for effect in _along(design, axis)]
    if not effects:
        return None
    size = _size(design, noise, priors, baseline, effects)
    scaled = [replace(each, prior_sd=size * each.prior_sd) for each in effects]
    start = [Fitted(effect=each, amplitude=0.0, shape=()) for each in scaled]
    return fit(design, noise, baseline.laws, priors, start, steps=6)


def _along(design: Design, axis: str) -> list[Effect]:
    """One effect a function: cosines over the axis's range, or a loop's harmonics."""
    if axis == PHASE:
        waves = [(k, wave) for k in range(1, HARMONICS + 1) for wave in (np.cos, np.sin)] if design.loops else []
        return [_effect(k, _harmonic(k, wave), before_lag=False) for k, wave in waves]
    if axis not in _OF_POINTS:
        return []
    place = _OF_POINTS[axis]
    values = place(design.points)
    known = values[np.isfinite(values)]
    if known.size == 0 or not np.ptp(known) > 0:
        return []
    low, high = float(known.min()), float(known.max())
    count = min(COSINES, np.unique(known).size - 1)
    return [_effect(k, _cosine(place, low, high, k), before_lag=axis != CLOCK) for k in range(1, count + 1)]


def _cosine(place: Callable[[Points], FloatArray], low: float, high: float, k: int) -> Callable[[Points], FloatArray]:
    def column(points: Points) -> FloatArray:
        values = place(points)
        unit = np.clip((np.where(np.isfinite(values), values, low) - low) / (high - low), 0.0, 1.0)
        return np.where(np.isfinite(values), np.cos(np.pi * k * unit), 0.0)

    return column


def _harmonic(k: int, wave: Callable[[FloatArray], FloatArray]) -> Callable[[Points], FloatArray]:
    return lambda points: np.where(points.steady, 0.0, wave(k * points.phase))


def _effect(k: int, column: Callable[[Points], FloatArray], *, before_lag: bool) -> Effect:
    def change(scene: Scene, amplitude: float, _: Shape) -> FloatArray:
        return amplitude * scene.curve * column(scene.points)

    return Effect(
        slug=SLUG,
        title="Structure without a name",
        physics="",
        formula="S(v; p, ζ) a cos(π k x)",
        source="this module",
        family=Family.SENSOR,
        kind=Kind.LAG,  # neither taken off measurements nor followed along a life
        channels=(),
        amplitude="share of the torque",
        unit="-",
        prior_sd=1.0 / (1.0 + k / 3.0),
        positive=False,
        scale=1.0,
        shapes=(),
        grid=lambda _: (),
        change=change,
        before_lag=before_lag,
        bends=(),
        tails=float("inf"),
    )


def _size(design: Design, noise: Noise, priors: Priors, baseline: Fit, effects: Sequence[Effect]) -> float:
    """τ of the largest marginal likelihood: ½ uᵀ (1 + I)⁻¹ u - ½ ln|1 + I|, in units of the prior's deviations."""
    prediction: Prediction = baseline.prediction
    changes = change_columns(
        design, prediction, [(each.change(prediction.scene, 1.0, ()), each.lags(())) for each in effects]
    )
    projected = project(gram_of(design, noise, priors, baseline, changes), noise.run_gain, noise.curve_gain)
    unit = np.array([each.prior_sd for each in effects])
    worth = []
    for size in SIZES:
        scale = size * unit
        inner = np.eye(unit.size) + projected.info * scale[:, None] * scale
        along = projected.score * scale
        worth.append(0.5 * float(along @ np.linalg.solve(inner, along)) - 0.5 * float(np.linalg.slogdet(inner)[1]))
    return SIZES[int(np.argmax(worth))]
