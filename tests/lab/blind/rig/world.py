"""What an ideal sensor would read: the stationary curve with what is hidden in it, followed by the attractor law (GMS)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from tests.lab.blind.rig.clutch import Clutch, Law
from tests.lab.blind.rig.plan import Plan, Site

Friction = Callable[[float, Site, Law], FloatArray]
Reading = Callable[[float, Site, FloatArray], FloatArray]
Drag = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Effect:
    """Something hidden, its shape already drawn: torque that it adds to friction (which then lags) or to the reading.

    `unit` is an amplitude of ordinary size, `most` the largest that makes sense; `at` are the kinds of sites where it acts,
    `axes` where its structure lives.
    """

    slug: str
    unit: float
    most: float
    friction: Friction | None = None
    reading: Reading | None = None
    at: tuple[str, ...] = ("stationary", "raw", "loop")
    axes: frozenset[str] = frozenset()
    fast: bool = False  # swings from sample to sample, so that no mean over samples shows it
    moves_life: bool = False


def follow(site: Site, curve: FloatArray, attractor: FloatArray) -> FloatArray:
    """dM/dt = C (1 - M/S) from M = S: exact for S linear over a step's ∫C/S dt, in pieces short enough for the products."""
    rate = attractor / np.maximum(curve, 1e-6)
    x = 0.5 * (rate[:, 1:] + rate[:, :-1]) * site.step
    keep = np.exp(-x)
    ramp = -np.expm1(-x) / x  # mean of e^{-(x - u)} over the step
    gain = curve[:, 1:] * (1 - ramp) + curve[:, :-1] * (ramp - keep)
    torque = np.empty_like(curve)
    torque[:, 0] = curve[:, 0]
    piece = max(1, int(200 / max(float(x.max()), 1e-9)))
    for a in range(0, x.shape[1], piece):
        power = np.cumprod(keep[:, a : a + piece], axis=1)
        torque[:, a + 1 : a + 1 + piece] = power * (
            torque[:, a : a + 1] + np.cumsum(gain[:, a : a + piece] / power, axis=1)
        )
    return torque


def _rubbed(site: Site, clutch: Clutch, effects: Sequence[tuple[Effect, float]]) -> FloatArray:
    """Torque [Nm] of friction, with the effects that are friction, followed by the attractor law."""
    law = clutch.law(site.bar, site.cycles)
    torque = law.torque(site.v)
    for effect, amplitude in effects:
        if effect.friction is not None and site.kind in effect.at:
            torque = torque + effect.friction(amplitude, site, law)
    if site.kind == "stationary":
        return torque
    return follow(site, torque, clutch.attractor(site.bar, site.cycles))


def read(
    plan: Plan,
    clutch: Clutch,
    effects: Sequence[tuple[Effect, float]] = (),
    drag: Drag | None = None,
) -> list[FloatArray]:
    """Torque [Nm] at every site of the plan, without noise. Where there is no pressure no lining touches: what there is of
    torque is `drag` at v [m/s], and what is added to the reading."""
    readings = []
    for site in plan.sites:
        torque = np.zeros_like(site.v) if drag is None else drag(site.v)
        if site.bar.any():
            torque = _rubbed(site, clutch, effects)
        for effect, amplitude in effects:
            if effect.reading is not None and site.kind in effect.at:
                torque = torque + effect.reading(amplitude, site, torque)
        readings.append(torque)
    return readings
