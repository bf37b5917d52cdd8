"""Dynamic Stribeck tests as a rig would record them, for the tests of loops and lag; made apart from `models.loops`.

The torque comes from scipy's stiff integrator on the laws as they are written in the paper, over a run-in before the
record starts; the rest (noise, jitter, lost samples, spikes) is what recorders do.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import solve_ivp

from models.clutch import Geometry
from models.friction.stribeck import StribeckParameters, slope
from models.records.runs import Record

GEOMETRY = Geometry()
SWING = 1000 * 2 * math.pi / 60  # rad/s, amplitude and offset
#: About the nominal simulated clutch at 5 bar: rises up to 2 m/s, then falls.
FALLING = StribeckParameters(static_torque=25.0, coulomb_ratio=0.75, stribeck_velocity=5.0, viscous_coefficient=1.3)
#: Rises everywhere: viscous drag dominates (4 bar, fresh).
RISING = StribeckParameters(static_torque=18.0, coulomb_ratio=0.97, stribeck_velocity=3.0, viscous_coefficient=2.2)

Torque = Callable[[np.ndarray], np.ndarray]


def curve(v: np.ndarray | float, p: StribeckParameters) -> np.ndarray:
    """Eq. 3 for v > 0, written out again."""
    v = np.maximum(v, 1e-12)
    e = np.exp(-p.stribeck_velocity / v)
    return p.static_torque * (1 + (p.coulomb_ratio - 1) * e) + p.viscous_coefficient * v**0.3


def attractor_area(v: np.ndarray, rate: np.ndarray, period: float, p: StribeckParameters, c: float) -> float:
    """-(1/C) ∮ S S' v̇² dt [Nm m/s], the attractor law's loop area to first order in 1/C, for v > 0 or v̇ = 0."""
    rise = curve(v, p) * slope(v, p)
    return -float(np.where(np.isfinite(rise), rise * rate**2, 0.0).mean()) * period / c


def velocity(t: np.ndarray | float, frequency: float = 0.1) -> np.ndarray:
    """Eq. 1 of the test's sine [m/s]: amplitude and offset 1000 rpm, at its mean and rising at t = 0."""
    return GEOMETRY.mean_radius * SWING * (1 + np.sin(2 * math.pi * frequency * np.asarray(t)))


def attractor(p: StribeckParameters, c: float, frequency: float = 0.1) -> Torque:
    """dM/dt = C (1 - M/S), integrated by LSODA to 1e-10."""

    def rate(t: float, m: np.ndarray) -> np.ndarray:
        return c * (1 - m / curve(velocity(t, frequency), p))

    return _integrated(rate, lambda t: float(curve(velocity(t, frequency), p)), lambda _, m: m, frequency)


def squeezed(p: StribeckParameters, film_time: float, frequency: float = 0.1) -> Torque:
    """The film equation in h itself, h = w^0.7: dh/dt = (h³/(n τ_1)) ((h_s/h)^{1/n} - 1) n ... by LSODA to 1e-10."""
    n = 0.7

    def rate(t: float, h: np.ndarray) -> np.ndarray:
        # load balance W = W (h_s/h)^(1/n) - B h^-3 dh/dt, with B/W = τ_1/n
        balance = velocity(t, frequency) / h ** (1 / n) - 1
        return n * h**3 / film_time * balance

    def told(t: np.ndarray, h: np.ndarray) -> np.ndarray:
        v, w = velocity(t, frequency), h ** (1 / n)
        dry = p.static_torque * (1 + (p.coulomb_ratio - 1) * np.exp(-p.stribeck_velocity / w))
        return dry + p.viscous_coefficient * v / h

    return _integrated(rate, lambda t: float(velocity(t, frequency)) ** n, told, frequency)


def _integrated(rate: Callable, start: Callable, told: Callable, frequency: float) -> Torque:
    before = -1.0 / frequency
    found: dict[float, object] = {}

    def at(time: np.ndarray) -> np.ndarray:
        last = float(time.max()) + 1e-3
        if last not in found:
            found[last] = solve_ivp(
                rate, (before, last), [start(before)], method="LSODA", rtol=1e-9, atol=1e-11, dense_output=True,
                max_step=0.02 / frequency,
            ).sol  # fmt: skip
        return told(time, found[last](time)[0])

    return at


def record(
    torques: Sequence[Torque],
    pressures: Sequence[float],
    *,
    rate: float = 100.0,
    duration: float = 15.0,
    frequency: float = 0.1,
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
    lost: float = 0.0,
    jitter: float = 0.0,
    spikes: int = 0,
    ramp: float = 0.0,
) -> Record:
    """Pressures [Pa] one after another, each `duration` s of the sine; noise is a share of torque, speed and pressure
    (a tenth of it), jitter a share of the sampling interval, `ramp` s between pressures with the motor at its mean."""
    blocks: list[tuple[np.ndarray, ...]] = []
    clock = 0.0
    for i, (torque, pressure) in enumerate(zip(torques, pressures, strict=True)):
        local = np.arange(round(duration * rate)) / rate
        if rng is not None and jitter:
            local = np.sort(local + jitter / rate * rng.uniform(-0.5, 0.5, local.size))
        sent = torque(local)
        blocks.append((clock + local, np.full(local.size, pressure), velocity(local, frequency), sent))
        clock += duration
        if ramp and i + 1 < len(pressures):
            way = np.arange(round(ramp * rate)) / rate
            changing = pressure + (pressures[i + 1] - pressure) * way / ramp
            still = np.full(way.size, GEOMETRY.mean_radius * SWING), np.full(way.size, sent.mean())
            blocks.append((clock + way, changing, *still))
            clock += ramp
    time, p, v, m = (np.concatenate(column) for column in zip(*blocks, strict=True))
    speed = v / GEOMETRY.mean_radius
    if rng is not None:
        p = p * (1 + 0.1 * noise * rng.standard_normal(p.size))
        speed = speed + 0.1 * noise * SWING * rng.standard_normal(p.size)
        m = m + noise * np.abs(m).mean() * rng.standard_normal(p.size)
        hit = rng.choice(p.size, size=spikes, replace=False)
        m[hit] += rng.choice([-1.0, 1.0], size=spikes) * rng.uniform(5.0, 50.0, size=spikes)
        keep = rng.random(p.size) >= lost
        time, p, speed, m = time[keep], p[keep], speed[keep], m[keep]
    return Record(time=time, pressure=p, speed=speed, torque=m)


#: A fine clock over two periods of the swing, of which the last is taken.
FINE = np.linspace(-10.0, 10.0, 20_001)
PERIOD = slice(10_000, None)


def dense_area(torque: np.ndarray) -> float:
    """Eq. 8 by trapezoids over the last period of FINE."""
    return float(np.trapezoid(torque[PERIOD], velocity(FINE)[PERIOD]))
