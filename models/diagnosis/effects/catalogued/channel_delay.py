"""The torque channel lags the speed channel."""

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene
from models.diagnosis.design.facts import Facts
from models.diagnosis.effects.effect import Effect, Family, Kind, Shape, Tried
from models.diagnosis.effects.first_order_lag import phases_of


def _grid(_facts: Facts) -> tuple[Tried, ...]:
    return (Tried(shape=()),)


def _change(scene: Scene, amplitude: float, _shape: Shape) -> FloatArray:
    points = scene.points
    out = np.zeros_like(scene.curve)
    looping = np.flatnonzero(points.loop >= 0)
    if looping.size:
        phases = phases_of(points, looping)
        curves = scene.curve[looping].reshape(-1, phases)
        step = amplitude * points.angular_frequency[looping].reshape(-1, phases)[:, :1] * phases / (2 * np.pi)
        out[looping] = (_shifted(curves, np.clip(step, -phases, phases)) - curves).ravel()
    return out


def _shifted(curves: FloatArray, steps: FloatArray) -> FloatArray:
    """Periodic curves [l, k] as they were `steps` [l, 1] phases before, by parabolas through the nearest three."""
    whole = np.round(steps)
    x = steps - whole
    at = (np.arange(curves.shape[1]) - whole.astype(np.intp)) % curves.shape[1]
    here, after, before = (np.take_along_axis(curves, (at + k) % curves.shape[1], axis=1) for k in (0, 1, -1))
    return np.asarray(here - 0.5 * x * (after - before) + 0.5 * x * x * (after - 2 * here + before), dtype=np.float64)


EFFECT = Effect(
    slug="channel_delay",
    title="The torque channel is delayed",
    physics="A filter or the recorder delays torque against speed: while accelerating, torque belongs to a lower speed.",
    formula="S(v(t - δ)) - S(v(t)), to first order -δ dS/dt",
    source="anti-aliasing filters and multiplexed recorders; no friction is in it",
    family=Family.DYNAMIC,
    kind=Kind.LAG,
    channels=("time_s",),
    amplitude="delay",
    unit="ms",
    prior_sd=0.08,
    positive=False,
    scale=1000.0,
    shapes=(),
    grid=_grid,
    change=_change,
    before_lag=True,
    discrepancies=(),
    opposite_physics="Torque is ahead of the speed: a filter or the recorder delays the speed channel.",
)
