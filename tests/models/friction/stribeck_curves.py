"""Simulated stationary tests for the tests: written apart from the product's model, on the reference's protocol."""

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import StribeckParameters
from models.records.runs import Curve

#: The reference's speeds, 20..1970 rpm in steps of 50, at 58 mm [m/s], and its pressures [bar].
VELOCITY = np.arange(20, 1971, 50) * 2 * np.pi / 60 * 0.058
PRESSURES = np.arange(4.0, 7.01, 0.5)


def clutch(pressure: FloatArray, life: FloatArray, rng: np.random.Generator | None = None) -> FloatArray:
    """[..., 4]: M_s, M̄_c, V_S, C_v at pressure [bar] and life 0..1; about 25 Nm fresh at 5 bar. `rng`: 10 % spread."""
    parameters = np.stack(
        [
            5.0 * pressure * (1 - 0.5 * life),
            (0.45 + 0.9 * np.exp(-pressure / 2.5)) * (1 - 0.3 * life),
            0.9 * pressure * (1 - 0.4 * life),
            0.5 * pressure * (1 + 0.3 * life),
        ],
        axis=-1,
    )
    return parameters if rng is None else parameters * np.exp(0.1 * rng.standard_normal(parameters.shape))


def eq3(parameters: FloatArray, velocity: FloatArray) -> FloatArray:
    """Eq. 3 for velocity > 0 [n], as printed, in its plainest form: parameters [..., 4] -> [..., n]."""
    m_s, m_c, v_s, c_v = (parameters[..., i, None] for i in range(4))
    return np.asarray(m_s * (1 + (m_c - 1) * np.exp(-np.abs(v_s / velocity))) + c_v * velocity**0.3)


def curve(velocity: FloatArray, torque: FloatArray, torque_sd: FloatArray | None = None, bar: float = 5.0) -> Curve:
    return Curve(
        pressure=bar * 1e5,
        mean_pressure=bar * 1e5,
        velocity=np.asarray(velocity, dtype=np.float64),
        torque=np.asarray(torque, dtype=np.float64),
        torque_sd=torque_sd,
    )


def parameters(values: FloatArray) -> StribeckParameters:
    return StribeckParameters.from_array(np.asarray(values, dtype=np.float64))


def hard_curve(rng: np.random.Generator) -> Curve:
    """A curve of a random kind: plausible, flat, rising, spiked, noise only, short, repeated, degenerate, two-sided."""
    kind = rng.integers(12)
    n = int(rng.integers(2, 7)) if kind in (6, 7, 8) else 40
    velocity = np.sort(rng.uniform(0.05, 12.0, n)) if kind in (5, 6, 7, 8) else VELOCITY.copy()
    torque = eq3(clutch(rng.uniform(4, 7), rng.uniform(0, 1), rng), velocity)
    if kind == 1:
        torque = np.full(n, rng.uniform(1, 40))
    elif kind == 2:
        torque = rng.uniform(0, 5) + rng.uniform(0.2, 3) * velocity ** rng.uniform(0.5, 2)
    elif kind == 3:
        torque[rng.integers(n)] *= rng.uniform(0.2, 3)
    elif kind == 4:
        torque = rng.normal(10, 10, n)
    elif kind == 7:
        velocity = np.full(n, velocity[0])
    elif kind == 8:
        velocity = velocity[rng.integers(0, max(n // 2, 1), n)]
    elif kind == 9:
        torque = eq3(np.exp(rng.normal([2, 0, 1, 0], 2.0)), velocity)
    elif kind == 10:
        velocity, torque = velocity * np.where(np.arange(n) % 2, -1, 1), torque * np.where(np.arange(n) % 2, -1, 1)
    elif kind == 11:
        torque = torque * 0 if rng.random() < 0.2 else rng.uniform(5, 30) * np.exp(-velocity / rng.uniform(0.1, 5))
    noise = rng.choice([0.0, 0.01, 0.1])
    return curve(velocity, torque * (1 + noise * rng.standard_normal(n)))
