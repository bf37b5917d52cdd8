"""What can be hidden, in forms of the rig's own: the catalogue's seventeen effects, and others that no catalogue has.

Every maker draws a shape and returns the effect; amplitudes are set by loudness later. Beside each stands what it needs of
the protocol.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from models.arrays import FloatArray
from tests.lab.blind.rig.clutch import Law
from tests.lab.blind.rig.plan import DWELL, RPM, Plan, Site
from tests.lab.blind.rig.world import Effect

Maker = Callable[[np.random.Generator, Plan], Effect]
#: Fields of a `Wish`.
Wanted = dict[str, Any]
#: Kinds of sites: stationary tests, averaged on the rig or recorded, and where there is motion to see.
TESTS, RECORDS = ("stationary", "raw"), ("raw", "loop")


# --- What a stationary test sees: heat, oil, zero, gauge and the dwell.


def lagged(x: FloatArray, step: float, time: float) -> FloatArray:
    """x [series, n] through a first-order lag of `time` s, settled at the start."""
    keep = np.exp(-step / time)
    return lfilter([1 - keep], [1, -keep], x, axis=1, zi=keep * x[:, :1])[0]


def vogel(rng: np.random.Generator) -> "Vogel":
    return Vogel(float(rng.uniform(-115.0, -75.0)))


class Vogel:
    """ν(T) of the ATF through its two points, after Vogel: ln ν = A + B/(T - T0), relative to 85 °C."""

    def __init__(self, pole: float) -> None:
        self.pole = pole
        self.slope = np.log(56 / 9.3) / (1 / (40 - pole) - 1 / (100 - pole))

    def __call__(self, celsius: FloatArray) -> FloatArray:
        return np.exp(self.slope * (1 / (celsius - self.pole) - 1 / (85 - self.pole)))


def oil_temperature(rng: np.random.Generator, _: Plan) -> Effect:
    """Viscous torque with the viscosity of a film that follows the oil late; the Stribeck velocity goes the other way."""
    nu, late, second = vogel(rng), rng.uniform(4.0, 30.0), rng.uniform(0.0, 0.5)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        thick = nu(lagged(site.oil, site.step, late)) ** a
        warm = Law(law.static, law.ratio, law.stribeck / thick**second, law.viscous * thick)
        return warm.torque(site.v) - law.torque(site.v)

    return Effect("oil_temperature", 0.3, 4.0, friction)


def interface_heating(rng: np.random.Generator, _: Plan) -> Effect:
    """Sliding power warms the lining's face within milliseconds; warm friction is less, and less so the warmer it is."""
    late, most = rng.uniform(0.01, 0.05), rng.uniform(1.0, 3.0)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        torque = law.torque(site.v)
        power = lagged(torque * site.v / 150.0, site.step, late)
        return -torque * -np.expm1(-a * power / most) * most / (1 + a)

    return Effect("interface_heating", 0.05, 1.0, friction)


def viscous_exponent(rng: np.random.Generator, _: Plan) -> Effect:
    """The film thins with shear (Carreau): C_v v^0.3 (1 + (v/v_c)²)^a, either sign."""
    sign, knee = rng.choice([-1.0, 1.0]), rng.uniform(0.4, 1.2)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        return law.viscous * site.v**0.3 * ((1 + (site.v / knee) ** 2) ** (sign * a / 2) - 1)

    return Effect("viscous_exponent", 0.05, 0.6, friction)


def hydrodynamic_drag(rng: np.random.Generator, _: Plan) -> Effect:
    """Oil sheared in the grooves whatever the pressure: a little less than linear in speed, with Vogel's viscosity."""
    nu, full = vogel(rng), rng.uniform(80.0, 300.0)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        return a * nu(site.oil) * site.v / (1 + site.v / full) + 0 * law.static

    return Effect("hydrodynamic_drag", 0.05, 4.0, friction)


def torque_zero_shift(rng: np.random.Generator, plan: Plan) -> Effect:
    """The zero wanders over the days as a smoothed random walk with a trend, or jumps within a few cycles and stays."""
    life = plan.life
    if rng.random() < 0.5:
        days = np.linspace(life.moment[0], life.moment[-1] + 3000, 400)
        walk = gaussian_filter1d(np.cumsum(rng.standard_normal(400)) / 20, 40) + rng.uniform(1.5, 3) * np.linspace(
            0, 1, 400
        )
        walk -= walk[0]
        walk /= np.abs(walk).max() * rng.choice([-1.0, 1.0])

        def zero(site: Site) -> FloatArray:
            return np.interp(site.life.moment[site.state][:, None] + site.clock, days, walk)
    else:
        k = int(rng.integers(1, life.cycles.size))
        at, wide = 0.5 * (life.cycles[k - 1] + life.cycles[k]), 0.05 * (life.cycles[k] - life.cycles[k - 1])
        sign = rng.choice([-1.0, 1.0])

        def zero(site: Site) -> FloatArray:
            return sign * 0.5 * (1 + np.tanh((site.cycles - at) / wide)) * np.ones_like(site.bar)

    return Effect("torque_zero_shift", 0.1, 10.0, reading=lambda a, site, _: a * zero(site))


def pressure_offset(rng: np.random.Generator, plan: Plan) -> Effect:
    """The gauge reads wrong by more and more bar: the clutch is pressed by what it says and the offset."""
    sign, order = rng.choice([-1.0, 1.0]), rng.uniform(0.7, 1.5)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        wrong = sign * a * (site.cycles / plan.life.span) ** order
        return law.at(site.bar + wrong).torque(site.v) - law.torque(site.v)

    return Effect("pressure_offset", 0.05, 1.5, friction)


def unsettled_dwell(rng: np.random.Generator, _: Plan) -> Effect:
    """Torque creeps to a new level with two time constants, so that a plateau still carries a share of the one before it."""
    fast, slow, share = rng.uniform(0.8, 2.0), rng.uniform(2.5, 5.0), rng.uniform(0.3, 0.7)

    def left(torque: FloatArray, step: float, a: float) -> FloatArray:
        return a * (share * lagged(torque, step, fast) + (1 - share) * lagged(torque, step, slow) - torque)

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        if site.kind == "raw":
            return left(torque, site.step, a)
        fine = np.repeat(torque, 20, axis=1)
        change = left(fine, DWELL / 20, a).reshape(*torque.shape, 20)
        return change[..., 8:].mean(axis=-1)

    return Effect("unsettled_dwell", 0.3, 6.0, reading=reading, at=TESTS)


def rest_recovery(rng: np.random.Generator, plan: Plan) -> Effect:
    """A rested lining grips differently: ever more with the pause (saturating in its logarithm), gone in the test. What
    grips is all of friction, or the asperities alone."""
    hours = rng.uniform(0.5, 3.0)
    longest = np.log1p(plan.life.pause.max() / 3600 / hours)
    gone, sign, order = rng.uniform(120, 700), rng.choice([-1.0, 1.0]), rng.uniform(0.7, 1.0)
    as_a_whole = float(rng.random() < 0.5)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        late = site.clock + (DWELL * 250 if site.kind == "loop" else 0.0)  # loops come after the stationary test
        rested = np.log1p(site.life.pause[site.state][:, None] / 3600 / hours) / longest
        gripping = replace(law, viscous=as_a_whole * law.viscous).torque(site.v)
        return sign * a * rested * np.exp(-((late / gone) ** order)) * gripping

    return Effect("rest_recovery", 0.02, 0.5, friction)


# --- What needs motion: delay, inertia, the squeezed film, ripple and stick-slip.


def channel_delay(rng: np.random.Generator, _: Plan) -> Effect:
    """Torque is written down late: by a pure delay, or by the low-pass of its amplifier."""
    pure = rng.random() < 0.5

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        if not pure:
            return lagged(torque, site.step, a) - torque
        time = site.step * np.arange(torque.shape[1])
        return np.stack([np.interp(time - a, time, row) for row in torque]) - torque

    return Effect("channel_delay", 0.03, 0.8, reading=reading, at=RECORDS)


def inertia_torque(rng: np.random.Generator, _: Plan) -> Effect:
    """J dω/dt through the coupling, which rings a little after every change of acceleration."""
    ring, damp = 2 * np.pi * rng.uniform(2.0, 6.0), rng.uniform(0.4, 0.8)

    def reading(a: float, site: Site, _: FloatArray) -> FloatArray:
        speeding = np.gradient(site.rpm * RPM, site.step, axis=1)
        if site.kind == "raw":
            return a * speeding
        h = ring * site.step
        recursion = [1 + 2 * damp * h + h**2, -(2 + 2 * damp * h), 1.0]
        settled = speeding[:, :1]
        return a * (settled + lfilter([h**2], recursion, speeding - settled, axis=1))

    return Effect("inertia_torque", 0.01, 1.0, reading=reading, at=RECORDS)


def squeeze_film(rng: np.random.Generator, _: Plan) -> Effect:
    """The film's height follows dh/dt = (h_s(v) - h)/τ, faster where it is thick; contact and shear go with the height. Or
    its time is one and its strength another."""
    order, shear, hasten = rng.uniform(0.5, 0.75), rng.uniform(0.2, 0.7), rng.uniform(0.5, 2.0)
    aside = rng.spawn(1)[0]  # what is drawn here changes nothing that is drawn later
    if aside.random() < 0.3:
        return _film_of_its_own_strength(aside)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        v = np.maximum(site.v, 1e-4)
        rest = v**order
        film = np.empty_like(rest)
        film[:, 0] = rest[:, 0]
        late = a * (site.bar[:, 0] / 5.0) ** 0.5
        for k in range(1, rest.shape[1]):
            now = film[:, k - 1]
            film[:, k] = rest[:, k] + (now - rest[:, k]) * np.exp(-site.step / late * (0.2 + now**hasten))
        w = film ** (1 / order)
        dry = Law(law.static, law.ratio, law.stribeck, 0 * law.viscous)
        sheared = law.viscous * v**0.3 * ((rest / film) ** shear - 1)
        return dry.torque(v, film=w) - dry.torque(v) + sheared

    return Effect("squeeze_film", 0.1, 20.0, friction, at=RECORDS)


def _film_of_its_own_strength(rng: np.random.Generator) -> Effect:
    """Contact e^{-h/s} of a film that lags by a time that falls with the load, against that of the film at rest."""
    order, time = rng.uniform(0.4, 0.7), np.exp(rng.uniform(np.log(0.15), np.log(1.5)))
    soft, load = rng.uniform(0.5, 2.0), rng.uniform(0.6, 1.0)

    def reading(a: float, site: Site, _: FloatArray) -> FloatArray:
        rest = (np.maximum(site.v, 0.0) / 6.0) ** order
        late = time * (5.0 / site.bar[:, :1]) ** 0.5
        film = np.concatenate([lagged(row[None], site.step, tau) for row, tau in zip(rest, late[:, 0], strict=True)])
        return a * (site.bar / 5.0) ** load * (np.exp(-film / soft) - np.exp(-rest / soft))

    return Effect("squeeze_film", 1.0, 200.0, reading=reading, at=RECORDS)


def shaft_ripple(rng: np.random.Generator, _: Plan) -> Effect:
    """Once and twice a turn, in proportion to the load, its phase wandering slowly; a twist of the coupling at speed."""
    second, phase, slip = rng.uniform(0.0, 0.5), rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 0.02)

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        turn = np.cumsum(site.rpm * RPM, axis=1) * site.step + phase
        turn = turn + np.cumsum(np.random.default_rng(5).standard_normal(turn.shape[1])) * slip
        growth = 1 + 0.3 * np.tanh(site.rpm / 600)
        return a * torque * growth * (np.sin(turn) + second * np.sin(2 * turn + 1))

    return Effect("shaft_ripple", 0.003, 0.5, reading=reading, at=RECORDS, fast=True)


def stick_slip(rng: np.random.Generator, _: Plan) -> Effect:
    """Below some speed the drive train bursts into a limit cycle: a skewed wave that grows, saturates and breaks off."""
    natural, below, grown = rng.uniform(7.0, 18.0), rng.uniform(100, 260), rng.uniform(0.1, 0.4)
    seed = int(rng.integers(2**31))

    def reading(a: float, site: Site, torque: FloatArray) -> FloatArray:
        dice = np.random.default_rng(seed)
        slow = site.rpm < below
        count = np.cumsum(slow, axis=1)
        entered = count - np.maximum.accumulate(np.where(slow, 0, count), axis=1)
        grow = -np.expm1(-entered * site.step / grown) * slow
        phase = 2 * np.pi * (natural * site.step * np.arange(torque.shape[1]) + dice.random((torque.shape[0], 1)))
        wave = np.sin(phase + 0.6 * np.sin(phase))
        return a * grow * wave * (1 + 0.1 * dice.standard_normal((torque.shape[0], 1))) * (site.bar / 5)

    return Effect("stick_slip", 0.1, 20.0, reading=reading, at=RECORDS, fast=True)


# --- What use does: running-in, fresh oil, late wear, severity.


def running_in(rng: np.random.Generator, _: Plan) -> Effect:
    """Asperities bed in: M_s more (or less) when new, going as a stretched or as a double exponential of the cycles."""
    scale, sign = rng.uniform(250, 1200), rng.choice([-1.0, 1.0])
    if rng.random() < 0.5:
        order = rng.uniform(0.6, 0.9)

        def left(z: FloatArray) -> FloatArray:
            return np.exp(-((z / scale) ** order))
    else:
        share, later = rng.uniform(0.5, 0.8), rng.uniform(2.0, 4.0)

        def left(z: FloatArray) -> FloatArray:
            return share * np.exp(-z / scale) + (1 - share) * np.exp(-z / (later * scale))

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        rough = Law(law.static * (1 + sign * a * left(site.cycles)), law.ratio, law.stribeck, law.viscous)
        return rough.torque(site.v) - law.torque(site.v)

    return Effect("running_in", 0.05, 0.6, friction, moves_life=True)


def oil_change(rng: np.random.Generator, plan: Plan) -> Effect:
    """Fresh oil: C_v steps and comes part of the way back as the oil ages; the Coulomb ratio moves a little with it."""
    logged = [at for kind, at in plan.life.events if kind == "oil_change"]
    k = int(rng.integers(2, plan.life.cycles.size - 1))
    at = logged[0] if logged else 0.5 * (plan.life.cycles[k - 1] + plan.life.cycles[k])
    sign, back, stays = rng.choice([-1.0, 1.0]), rng.uniform(0.3, 0.8) * plan.life.span, rng.uniform(0.5, 0.9)
    boundary = rng.uniform(0.0, 0.06)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        since = np.maximum(site.cycles - at, 0.0)
        fresh = np.where(site.cycles >= at, stays + (1 - stays) * np.exp(-since / back), 0.0)
        viscous = law.viscous * (1 + sign * a * fresh)
        other = Law(law.static, law.ratio * (1 - sign * boundary * a * fresh), law.stribeck, viscous)
        return other.torque(site.v) - law.torque(site.v)

    return Effect("oil_change", 0.05, 0.7, friction, moves_life=True)


def accelerated_wear(rng: np.random.Generator, plan: Plan) -> Effect:
    """From some cycle on the lining goes faster: M_s falls with a softened corner, towards an end."""
    life = plan.life
    at = rng.uniform(0.45, 0.72) * life.span
    wide, order = rng.uniform(0.01, 0.05) * life.span, rng.uniform(1.0, 1.6)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        late = wide * np.logaddexp(0.0, (site.cycles - at) / wide) / (life.span - at)
        worn = Law(law.static * np.exp(-a * late**order), law.ratio, law.stribeck, law.viscous)
        return worn.torque(site.v) - law.torque(site.v)

    return Effect("accelerated_wear", 0.05, 1.2, friction, moves_life=True)


def load_severity(rng: np.random.Generator, _: Plan) -> Effect:
    """Cycles count for more the more energy each had: ζ grows by an Arrhenius-like factor of the energy."""
    bend = rng.uniform(-0.2, 0.2)

    def friction(a: float, site: Site, law: Law) -> FloatArray:
        blocks = np.diff(site.life.cycles, prepend=0.0)
        strain = site.life.energy / site.life.usual_energy - 1
        factor = np.exp(np.clip(a * (strain + bend * strain**2), -3, 3))
        zeta = np.cumsum(blocks * factor)[site.state][:, None]
        return law.later(zeta).torque(site.v) - law.torque(site.v)

    return Effect("load_severity", 0.3, 6.0, friction, moves_life=True)


# --- What no catalogue has, with the axes on which its structure lives. An axis is right where it is one that the effect is
# a function of; an effect of the reading's own size lives on what sets that size too.


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


HISTORY = frozenset({"running_in", "oil_change", "accelerated_wear", "load_severity"})

CATALOGUED: dict[str, tuple[Maker, Wanted]] = {
    "oil_temperature": (oil_temperature, {"oil": True}),
    "interface_heating": (interface_heating, {}),
    "hydrodynamic_drag": (hydrodynamic_drag, {}),
    "torque_zero_shift": (torque_zero_shift, {"oil": True, "moments": True}),
    "pressure_offset": (pressure_offset, {}),
    "unsettled_dwell": (unsettled_dwell, {}),
    "channel_delay": (channel_delay, {}),
    "inertia_torque": (inertia_torque, {}),
    "squeeze_film": (squeeze_film, {}),
    "shaft_ripple": (shaft_ripple, {"rate": 200.0}),
    "stick_slip": (stick_slip, {"rate": 200.0}),
    "running_in": (running_in, {"early": True}),
    "oil_change": (oil_change, {"event": "oil_change"}),
    "accelerated_wear": (accelerated_wear, {}),
    "load_severity": (load_severity, {"energy": True}),
    "rest_recovery": (rest_recovery, {"moments": True, "pauses": True}),
}

OUTSIDE: dict[str, tuple[Maker, Wanted]] = {
    "speed_bump": (speed_bump, {}),
    "clock_wobble": (clock_wobble, {}),
    "bent_sensor": (bent_sensor, {}),
    "pressure_way": (pressure_way, {"both_ways": True}),
    "seasons": (seasons, {}),
    "resonance": (resonance, {}),
    "clogging": (clogging, {}),
    "braking": (braking, {}),
}

#: No cause, but another form of the friction law.
LAWS: dict[str, tuple[Maker, Wanted]] = {"viscous_exponent": (viscous_exponent, {})}

ALL = CATALOGUED | OUTSIDE | LAWS
