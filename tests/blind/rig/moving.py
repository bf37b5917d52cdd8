"""Hidden effects that need motion: delay, inertia, the squeezed film, ripple and stick-slip. Forms of their own."""

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray
from tests.blind.rig.clutch import Law
from tests.blind.rig.plan import RPM, Plan, Site
from tests.blind.rig.steady import lagged
from tests.blind.rig.world import Effect

#: Where there is motion to see.
RECORDS = ("raw", "loop")


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
