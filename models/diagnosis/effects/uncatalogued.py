"""What rigs do that no effect of the catalogue is: it competes with the catalogue and is never named.

Smooth contrasts know no change points and no time constants. Without these templates a gain that settles while the sensor
warms up passes for a zero that does, and another speed scale from a cycle on for fresh oil: the catalogue's cousin has the
right course and would win. Where one of these does clearly better than the catalogue, structure is unexplained, lives on the
stranger's axis, and the report says what it looks like.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.axes import CLOCK, CYCLES, PRESSURE, SPEED
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Effect, Family, Kind, Shape, ShapeParameter, Tried

#: The usual size of all of them, as a share of the torque or of the speed (of the usual pressure's ∂S/∂p p for a gauge's).
USUAL = 0.02
#: A pressure or speed that differs by less than this share from the one before was held.
_HELD = 0.01
#: Where fewer plateaus than this share were come to from above (from below), the way is only another name for the level.
_RETURNING = 0.1
_HALF_HOUR = 1800.0
_STEP = 0.0
_TIMES = (60.0, 150.0, 400.0)
_POWERS = (0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stranger:
    """A template, the axis on which it lives, and what it looks like."""

    effect: Effect
    axis: str
    looks: str


def _stranger(
    slug: str,
    looks: str,
    formula: str,
    axis: str,
    grid: Callable[[Facts], tuple[Tried, ...]],
    change: Callable[[Scene, float, Shape], FloatArray],
    shapes: int,
) -> Stranger:
    effect = Effect(
        slug=slug,
        title=looks,
        physics=looks,
        formula=formula,
        source="faults of rigs",
        family=Family.SENSOR,
        kind=Kind.ARTEFACT,
        channels=(),
        amplitude="size",
        unit="-",
        prior_sd=USUAL,
        positive=False,
        scale=1.0,
        shapes=tuple(ShapeParameter(name="course", unit="-", lowest=-np.inf, highest=np.inf) for _ in range(shapes)),
        grid=grid,
        change=change,
        before_lag=False,
        discrepancies=(),
    )
    return Stranger(effect=effect, axis=axis, looks=looks)


def _clock_grid(_facts: Facts) -> tuple[Tried, ...]:
    return tuple(Tried(shape=(time, motion)) for time in (0.0, *_TIMES) for motion in (0.0, 1.0))


def _gain_with_clock(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """S t/30 min or S (1 - e^{-t/τ}), on plateaus only or in loops too."""
    time, motion = shape
    clock = np.maximum(scene.points.clock, 0.0)
    share = -np.expm1(-clock / time) if time > 0 else clock / _HALF_HOUR
    there = scene.points.steady | (motion > 0)
    return np.asarray(amplitude * np.where(there, share, 0.0) * scene.curve, dtype=np.float64)


def _life_grid(facts: Facts) -> tuple[Tried, ...]:
    if facts.states.size < 3:
        return ()
    weight = -float(np.log(len(facts.onsets)))
    steps = tuple(Tried(shape=(_STEP, onset), log_weight=weight) for _, onset, _ in facts.onsets)
    return steps + tuple(Tried(shape=(1.0, power), log_weight=-float(np.log(len(_POWERS)))) for power in _POWERS)


def _gain_with_life(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """S from a cycle on, or S (ζ/ζ_last)^q."""
    course, value = shape
    cycles = scene.points.cycles
    life = np.maximum((cycles - scene.facts.states[0]) / scene.facts.life, 0.0)
    share = np.where(cycles > value, 1.0, 0.0) if course == _STEP else life**value
    return np.asarray(amplitude * share * scene.curve, dtype=np.float64)


def _step_grid(facts: Facts) -> tuple[Tried, ...]:
    return tuple(Tried(shape=(onset,)) for _, onset, _ in facts.onsets) if facts.states.size > 2 else ()


def _speed_from(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
    """v ∂S/∂v from a cycle on."""
    stepped = np.where(scene.points.cycles > shape[0], scene.by_velocity * scene.points.velocity, 0.0)
    return np.asarray(amplitude * stepped, dtype=np.float64)


def _parameter_from(place: int) -> Callable[[Scene, float, Shape], FloatArray]:
    """θ ∂S/∂θ of one of eq. 3's parameters from a cycle on."""

    def change(scene: Scene, amplitude: float, shape: Shape) -> FloatArray:
        stepped = np.where(scene.points.cycles > shape[0], scene.gradient[:, place] * scene.parameters[:, place], 0.0)
        return np.asarray(amplitude * stepped, dtype=np.float64)

    return change


def _once(_facts: Facts) -> tuple[Tried, ...]:
    return (Tried(shape=()),)


def way(values: FloatArray, previous: np.ndarray[tuple[int], np.dtype[np.intp]]) -> FloatArray:
    """[P] whether a value was last raised (1) or lowered (-1) before a plateau, 0 where nobody knows: `previous` [P] is the
    plateau before it, -1 where there is none, and plateaus of a run follow each other."""
    known = previous >= 0
    change = np.where(known, values - values[np.maximum(previous, 0)], 0.0)
    told = ~known | (np.abs(change) > _HELD * np.abs(values))
    last = np.maximum.accumulate(np.where(told, np.arange(values.size), 0))
    return np.asarray(np.sign(change)[last], dtype=np.float64)


def _both_ways(scene: Scene, values: FloatArray) -> FloatArray:
    """`way` [P], or 0 where a campaign goes one way only."""
    found = way(values, scene.points.previous)
    least = _RETURNING * np.count_nonzero(scene.points.steady)
    both = min(np.count_nonzero(found > 0), np.count_nonzero(found < 0)) >= max(least, 1.0)
    return found if both else np.zeros_like(found)


def _gauge_lags(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    """± p ∂S/∂p, by the way in which pressure was last changed."""
    pressure = scene.points.pressure
    turned = _both_ways(scene, pressure) * pressure * scene.by_pressure
    return np.asarray(amplitude * turned, dtype=np.float64)


def _friction_remembers(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    """± S, by the way in which speed was last changed."""
    return np.asarray(amplitude * _both_ways(scene, scene.points.velocity) * scene.curve, dtype=np.float64)


STRANGERS: tuple[Stranger, ...] = (
    _stranger(
        "gain_with_clock",
        "a gain of the torque that drifts while a test lasts, as a sensor's does that warms up",
        "a S t/30 min, or a S (1 - e^{-t/τ})",
        CLOCK,
        _clock_grid,
        _gain_with_clock,
        2,
    ),
    _stranger(
        "gain_with_life",
        "a gain of the torque that steps or creeps over the life, as after another calibration",
        "a S from a cycle on, or a S (ζ/ζ_last)^q",
        CYCLES,
        _life_grid,
        _gain_with_life,
        2,
    ),
    _stranger(
        "speed_scale_step",
        "another scale of the speed from a cycle on, as of another encoder or belt",
        "a v ∂S/∂v from a cycle on",
        CYCLES,
        _step_grid,
        _speed_from,
        1,
    ),
    _stranger(
        "static_torque_step",
        "a static torque that steps at a cycle",
        "a M_s ∂S/∂M_s from a cycle on",
        CYCLES,
        _step_grid,
        _parameter_from(0),
        1,
    ),
    _stranger(
        "stribeck_velocity_step",
        "a Stribeck velocity that steps at a cycle",
        "a V_S ∂S/∂V_S from a cycle on",
        CYCLES,
        _step_grid,
        _parameter_from(2),
        1,
    ),
    _stranger(
        "gauge_hysteresis",
        "a pressure that depends on whether it was last raised or lowered",
        "± a p ∂S/∂p",
        PRESSURE,
        _once,
        _gauge_lags,
        0,
    ),
    _stranger(
        "speed_hysteresis",
        "a torque that depends on whether the speed was last raised or lowered",
        "± a S",
        SPEED,
        _once,
        _friction_remembers,
        0,
    ),
)

STRANGE = {each.effect.slug: each for each in STRANGERS}
