"""Faults of rigs that no effect of the catalogue describes: they compete with it and are never named.

Smooth structure has no change points and no time constants. Without these rows a gain that settles while the sensor warms up
passes for a zero that does, and another speed scale from a cycle on for fresh oil: the effect of the catalogue that
resembles it has the right course and would win. Where a fault does best, what was found is uncatalogued, lies on the fault's
axis, and the report describes it. Their size is a share of the torque, of the speed or of the pressure.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene, curve
from models.diagnosis.design.design import CLOCK, CYCLES, PRESSURE, SPEED, IntArray
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import CREEPS, Effect, EffectKind, Shape, ShapeParameter, Tried, with_onset
from models.friction.stribeck import PARAMETER_NAMES

#: The first shape of a gain over life says whether it steps (at the cycle that follows) or creeps (by the power).
_STEP, _CREEP = 0.0, 1.0


def last_direction(values: FloatArray, previous: IntArray) -> FloatArray:
    """Direction [P] in which a value was last changed before a plateau: 1 raised, -1 lowered, 0 unknown. `previous` [P]
    is the plateau before it, -1 where there is none; plateaus of a run follow each other."""
    has_previous = previous >= 0
    change = np.where(has_previous, values - values[np.maximum(previous, 0)], 0.0)
    changed = ~has_previous | (np.abs(change) > 0.01 * np.abs(values))  # less than 1 % is the same level
    last_change = np.maximum.accumulate(np.where(changed, np.arange(values.size), 0))
    return np.asarray(np.sign(change)[last_change], dtype=np.float64)


def direction_if_both(scene: Scene, values: FloatArray) -> FloatArray:
    """`last_direction` [P] of values at the scene's points, or 0 where nearly all changes go one way."""
    direction = last_direction(values, scene.points.previous)
    least = 0.1 * np.count_nonzero(scene.points.steady)  # with fewer the direction is only another name for the level
    each_way = min(np.count_nonzero(direction > 0), np.count_nonzero(direction < 0))
    return direction if each_way >= max(least, 1.0) else np.zeros_like(direction)


def _courses_over_life(facts: Facts) -> tuple[Tried, ...]:
    """Shapes (course, value) of a gain over life: a step at each possible onset [cycles], a creep with each power of
    CREEPS. Steps together are as probable as creeps; none with fewer than three states."""
    if facts.states.size < 3:
        return ()
    weight = -float(np.log(len(facts.onsets)))
    steps = tuple(Tried(shape=(_STEP, onset), log_weight=weight) for _, onset, _ in facts.onsets)
    weight = -float(np.log(len(CREEPS)))
    return steps + tuple(Tried(shape=(_CREEP, power), log_weight=weight) for power in CREEPS)


def _gain_with_life(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque a S from a cycle on, or a S (ζ/ζ_last)^q [P] Nm."""
    course, value = shape
    share = np.where(scene.points.cycles > value, 1.0, 0.0) if course == _STEP else scene.life**value
    return np.asarray(amplitude * share * scene.curve, dtype=np.float64)


def _courses_over_test(_: Facts) -> tuple[Tried, ...]:
    """Shapes (time constant τ [s], whether it acts in loops) of a gain over a test's clock; τ = 0 stands for a linear
    drift."""
    return tuple(Tried(shape=(time, in_loops)) for time in (0.0, 60.0, 150.0, 400.0) for in_loops in (0.0, 1.0))


def _gain_with_clock(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """Change of torque a S t/30 min, or a S (1 - e^{-t/τ}) [P] Nm."""
    time, in_loops = shape
    clock = np.maximum(scene.points.clock, 0.0)
    share = -np.expm1(-clock / time) if time > 0 else clock / 1800.0
    shown = scene.points.steady | (in_loops > 0)
    return np.asarray(amplitude * np.where(shown, share, 0.0) * scene.curve, dtype=np.float64)


def _parameter_scaled(parameter: str) -> Callable[[Scene, float, Shape], FloatArray]:
    """A change of torque by a scaled parameter, S with (1 + a) θ minus S with θ [P] Nm, θ a parameter of eq. 3 (one of
    PARAMETER_NAMES)."""
    place = PARAMETER_NAMES.index(parameter)

    def change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
        parameters = scene.parameters.copy()
        parameters[:, place] *= _factor(amplitude)
        return scene.points.engaged * curve(scene.points.velocity, parameters) - scene.curve

    return change


def _factor(amplitude: float) -> float:
    """Factor 1 + a, kept above 0.05."""
    return max(1.0 + amplitude, 0.05)  # a fit may try what is no speed


def _fault(
    slug: str,
    title: str,
    axis: str,
    change: Callable[[Scene, float, Shape], FloatArray],
    grid: Callable[[Facts], tuple[Tried, ...]] = lambda _: (Tried(shape=()),),
    shapes: int = 0,
    *,
    before_lag: bool = False,
) -> Effect:
    """A rig fault that is never named, with so many `shapes` from its grid."""
    return Effect(
        slug=slug,
        title=title,
        kind=EffectKind.ARTEFACT,
        amplitude="size",
        unit="-",
        prior_sd=0.02,  # of all of them
        shapes=tuple(ShapeParameter(name="course", unit="-") for _ in range(shapes)),
        grid=grid,
        change=change,
        before_lag=before_lag,
        named=False,
        axis=axis,
    )


def _step(slug: str, title: str, change: Callable[[Scene, float, Shape], FloatArray]) -> Effect:
    """A rig fault with an onset after the first state: the baseline absorbs a fault that is there from the start."""
    fault = with_onset(_fault(slug, title, CYCLES, change, before_lag=True))

    def grid(facts: Facts) -> tuple[Tried, ...]:
        return tuple(Tried(shape=(onset,)) for _, onset, _ in facts.onsets) if facts.states.size > 2 else ()

    return replace(fault, grid=grid)


FAULTS: tuple[Effect, ...] = (
    with_onset(
        _fault(
            "gain_with_clock",
            "a gain of the torque that drifts while a test lasts, as a sensor's does that warms up",
            CLOCK,
            _gain_with_clock,
            _courses_over_test,
            shapes=2,
        )
    ),
    _fault(
        "gain_with_life",
        "a gain of the torque that steps or creeps over the life, as after another calibration",
        CYCLES,
        _gain_with_life,
        _courses_over_life,
        shapes=2,
    ),
    _step(
        "speed_scale_step",
        "another scale of the speed, as of another encoder or belt",
        lambda scene, a, _: scene.curve_with(velocity=scene.points.velocity * _factor(a)) - scene.curve_with(),
    ),
    _step("static_torque_step", "a step of the static torque", _parameter_scaled("static_torque")),
    _step("stribeck_velocity_step", "a step of the Stribeck velocity", _parameter_scaled("stribeck_velocity")),
    with_onset(
        _fault(
            "gauge_hysteresis",
            "a pressure that depends on whether it was last raised or lowered",
            PRESSURE,
            lambda scene, a, _: (
                a * direction_if_both(scene, scene.points.pressure) * scene.points.pressure * scene.by_pressure
            ),
        )
    ),
    with_onset(
        _fault(
            "speed_hysteresis",
            "a torque that depends on whether the speed was last raised or lowered",
            SPEED,
            lambda scene, a, _: a * direction_if_both(scene, scene.points.velocity) * scene.curve,
        )
    ),
)

FAULT_BY_SLUG = {fault.slug: fault for fault in FAULTS}
