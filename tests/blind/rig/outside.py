"""Hidden effects that no catalogue has, each with the axes on which its structure lives.

An axis is right where it is one that the effect is a function of; an effect of the reading's own size lives on what
sets that size too.
"""

import numpy as np

from models.arrays import FloatArray
from tests.blind.rig.clutch import Law
from tests.blind.rig.plan import Plan, Site
from tests.blind.rig.world import TESTS, Effect


def speed_bump(rng: np.random.Generator, _: Plan) -> Effect:
    """Friction higher (or lower) in a band of speed, at every pressure and all through life."""
    at, wide, sign = rng.uniform(400, 1500), rng.uniform(80, 220), rng.choice([-1.0, 1.0])

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        return sign * a * np.exp(-0.5 * ((site.rpm - at) / wide) ** 2) * law.static

    return Effect("speed_bump", 0.01, 0.5, friction, axes=frozenset({"speed_rpm"}))


def clock_wobble(rng: np.random.Generator, _: Plan) -> Effect:
    """A servo hunts: torque swings with a period of the test's clock that no temperature has."""
    period, phase = rng.uniform(35, 200), rng.uniform(0, 2 * np.pi, 500)

    def reading(a: float, site: Site, _: FloatArray) -> FloatArray:
        return a * np.sin(2 * np.pi * site.clock / period + phase[site.state][:, None])

    return Effect("clock_wobble", 0.1, 10.0, reading=reading, at=TESTS, axes=frozenset({"test_clock_s"}))


def bent_sensor(rng: np.random.Generator, _: Plan) -> Effect:
    """The torque sensor is not straight: a wave of its own reading."""
    period, phase = rng.uniform(5.0, 9.0), rng.uniform(0, 2 * np.pi)

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        return a * np.sin(2 * np.pi * torque / period + phase) + 0 * site.bar

    return Effect("bent_sensor", 0.1, 10.0, reading=reading, axes=frozenset({"torque_nm"}))


def pressure_way(rng: np.random.Generator, _: Plan) -> Effect:
    """The piston's seal sticks: less force on the way up than on the way down, by a share of the pressure's range."""
    sign = rng.choice([-1.0, 1.0])

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        top = int(np.argmax(site.bar[0]))
        way = np.where(np.arange(site.bar.shape[1]) <= top, -1.0, 1.0)
        off = sign * a * way * np.sqrt(np.clip((7.1 - site.bar) / 3.0, 0, 1))
        return law.at(site.bar + off).torque(site.v) - law.torque(site.v)

    return Effect("pressure_way", 0.02, 1.5, friction, at=TESTS, axes=frozenset({"test_clock_s", "pressure_bar"}))


def seasons(rng: np.random.Generator, plan: Plan) -> Effect:
    """All torque swings over the cycles, two to three times in a life, whatever eq. 6 does."""
    times, phase = rng.uniform(1.8, 3.0), rng.uniform(0, 2 * np.pi)

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        return a * torque * np.sin(2 * np.pi * times * site.cycles / plan.life.span + phase)

    return Effect("seasons", 0.01, 0.5, reading=reading, axes=frozenset({"cycles"}))


def resonance(rng: np.random.Generator, _: Plan) -> Effect:
    """A rotor's resonance crossed: torque bends one way below a speed and the other way above it."""
    at, wide = rng.uniform(600, 1500), rng.uniform(60, 150)

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        x = (site.rpm - at) / wide
        return a * x / (1 + x**2) + 0 * torque

    return Effect("resonance", 0.1, 10.0, reading=reading, axes=frozenset({"speed_rpm"}))


def clogging(rng: np.random.Generator, plan: Plan) -> Effect:
    """Grooves fill: the exponent of the viscous term goes up at high and down at low pressure as the clutch ages."""
    turn, knee = rng.uniform(4.8, 5.8), rng.uniform(1.5, 4.0)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        exponent = a * np.tanh((site.bar - turn) / 0.4) * (site.cycles / plan.life.span) ** 0.5
        return (
            law.viscous
            * ((site.v + 1e-6) / knee) ** 0.3
            * knee**0.3
            * np.expm1(np.clip(exponent * np.log((site.v + 0.05) / knee), -5, 5))
        )

    return Effect("clogging", 0.1, 3.0, friction, axes=frozenset({"speed_rpm", "pressure_bar", "cycles"}))


def braking(rng: np.random.Generator, _: Plan) -> Effect:
    """While slowing down, and only in a band of speed, the rig's brake drags along."""
    at, wide, sign = rng.uniform(500, 1500), rng.uniform(100, 250), rng.choice([-1.0, 1.0])

    def reading(a: float, site: Site, _: FloatArray) -> FloatArray:
        slowing = np.gradient(site.rpm, axis=1) < 0
        return sign * a * slowing * np.exp(-(((site.rpm - at) / wide) ** 4))

    return Effect("braking", 0.05, 10.0, reading=reading, at=("loop",), axes=frozenset({"loop_phase"}))
