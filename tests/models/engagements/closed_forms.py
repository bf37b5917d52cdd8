"""Engagements in closed form: a flywheel of inertia J brought to rest by a clutch, no motor, all indicators known exactly.

Written apart from models/engagements/simulation: nothing here integrates. Time counts from contact at CONTACT s; before it
the clutch is open, after rest it stands.

    constant      p, μ constant                  ω = ω0 - T t/J
    ramp          p = k t, μ constant            ω = ω0 - K t²/2J                       (T = K t)
    exponential   p = P (1 - e^{-t/τ})           ω = ω0 - (T/J)(t - τ(1 - e^{-t/τ}))
    sloped        μ = a + b ω, p constant        ω = (ω0 + a/b) e^{-b C t/J} - a/b     (C = T/μ)
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from models.arrays import FloatArray
from models.records.runs import Record

#: 99/133 mm, two faces: torque per μ and Pa, written out once more.
PER_PASCAL = 2 * math.pi / 4 * (0.133**2 - 0.099**2) * (0.133 + 0.099) / 4
SPEED, INERTIA, PRESSURE = 2000 * 2 * math.pi / 60, 0.6, 8e5
CONTACT, HELD = 0.6, 0.6


@dataclass(frozen=True)
class Engagement:
    """Functions of time since contact [s], until rest at `stop` [s], and what the indicators must be."""

    stop: float
    pressure: Callable[[FloatArray], FloatArray]
    speed: Callable[[FloatArray], FloatArray]
    torque: Callable[[FloatArray], FloatArray]
    cof: Callable[[float], float]
    start: float
    peak_power: float

    def expected(self) -> dict[str, float]:
        at = {share: self._moment(share) for share in (0.9, 0.5, 0.1)}
        initial, midpoint, endpoint = (self.cof(at[share]) for share in (0.9, 0.5, 0.1))
        end, middle = (float(self.torque(np.array(moment))) for moment in (self.stop, at[0.5]))
        return {
            "stop_time": self.stop - self.start,
            "energy": 0.5 * INERTIA * SPEED**2,
            "peak_power": self.peak_power,
            "initial_cof": initial,
            "midpoint_cof": midpoint,
            "endpoint_cof": endpoint,
            "initial_ratio": initial / midpoint,
            "endpoint_ratio": endpoint / midpoint,
            "torque_rise": end / middle - 1,
        }

    def _moment(self, share: float) -> float:
        return float(brentq(lambda t: float(self.speed(np.array(t))) - share * SPEED, 0.0, self.stop))


def constant(cof: float = 0.12) -> Engagement:
    torque = cof * PER_PASCAL * PRESSURE
    return Engagement(
        stop=INERTIA * SPEED / torque,
        pressure=lambda t: np.full_like(t, PRESSURE),
        speed=lambda t: SPEED - torque * t / INERTIA,
        torque=lambda t: np.full_like(t, torque),
        cof=lambda _t: cof,
        start=0.0,
        peak_power=torque * SPEED,
    )


def ramp(cof: float = 0.12, stop: float = 2.0) -> Engagement:
    rate = 2 * INERTIA * SPEED / stop**2
    return Engagement(
        stop=stop,
        pressure=lambda t: rate / (cof * PER_PASCAL) * t,
        speed=lambda t: SPEED - rate * t**2 / (2 * INERTIA),
        torque=lambda t: rate * t,
        cof=lambda _t: cof,
        start=0.1 * stop,
        peak_power=rate * stop * SPEED * 2 / (3 * math.sqrt(3)),
    )


def exponential(cof: float = 0.12, tau: float = 0.2) -> Engagement:
    torque = cof * PER_PASCAL * PRESSURE

    def risen(t: FloatArray | float) -> FloatArray:
        return np.asarray(1 - np.exp(-np.asarray(t) / tau))

    def speed(t: FloatArray | float) -> FloatArray:
        return np.asarray(SPEED - torque / INERTIA * (t - tau * risen(t)))

    stop = float(brentq(speed, 0.0, 20.0))
    fine = np.linspace(0.0, stop, 200_001)
    return Engagement(
        stop=stop,
        pressure=lambda t: PRESSURE * risen(t),
        speed=speed,
        torque=lambda t: torque * risen(t),
        cof=lambda _t: cof,
        start=-tau * math.log(1 - 0.1 * float(risen(stop))),
        peak_power=float((torque * risen(fine) * speed(fine)).max()),
    )


def sloped(at_rest: float = 0.14, slope: float = -1.5e-4) -> Engagement:
    """μ rises towards rest where the slope [s/rad] is negative."""
    per_cof = PER_PASCAL * PRESSURE
    rate, level = slope * per_cof / INERTIA, at_rest / slope

    def speed(t: FloatArray) -> FloatArray:
        return np.asarray((SPEED + level) * np.exp(-rate * t) - level)

    def cof(t: FloatArray) -> FloatArray:
        return np.asarray(at_rest + slope * speed(t))

    stop = math.log((SPEED + level) / level) / rate
    fine = np.linspace(0.0, stop, 200_001)
    return Engagement(
        stop=stop,
        pressure=lambda t: np.full_like(t, PRESSURE),
        speed=speed,
        torque=lambda t: per_cof * cof(t),
        cof=lambda t: float(cof(np.array(t))),
        start=0.0,
        peak_power=float((per_cof * cof(fine) * speed(fine)).max()),
    )


FORMS = {"constant": constant(), "ramp": ramp(), "exponential": exponential(), "sloped": sloped()}


@dataclass(frozen=True)
class Sensors:
    """`noise` of a reading [-], `floor` of a channel's highest value [-], what torque [Nm] and speed [rad/s] read at zero,
    the share of samples that are lost, and a hole between two times since contact [s]."""

    noise: float = 0.01
    floor: float = 0.001
    torque_zero: float = 0.0
    speed_zero: float = 0.0
    lost: float = 0.0
    hole: tuple[float, float] | None = None


EXACT = Sensors(noise=0.0, floor=0.0)


def record(form: Engagement, rate: float, seed: int = 0, sensors: Sensors = Sensors()) -> Record:
    """The record of an engagement at a rate [Hz]."""
    rng = np.random.default_rng([41, seed])
    time = (np.arange(int((CONTACT + form.stop + HELD) * rate)) + rng.uniform()) / rate
    since = time - CONTACT
    slipping = (since >= 0) & (since < form.stop)
    inside = np.clip(since, 0.0, form.stop)
    pressure = np.where(since >= 0, form.pressure(inside), 0.0)
    columns = [
        pressure,
        np.where(since < form.stop, form.speed(inside), 0.0) + sensors.speed_zero,
        np.where(slipping, form.torque(inside), 0.0) + sensors.torque_zero,
    ]
    read = [
        column * (1 + sensors.noise * rng.standard_normal(time.size))
        + sensors.floor * column.max() * rng.standard_normal(time.size)
        for column in columns
    ]
    kept = rng.random(time.size) >= sensors.lost
    if sensors.hole is not None:
        kept &= (since < sensors.hole[0]) | (since > sensors.hole[1])
    return Record(time=time[kept], pressure=read[0][kept], speed=read[1][kept], torque=read[2][kept])
