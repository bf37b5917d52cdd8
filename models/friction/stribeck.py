"""The stationary Stribeck curve of eq. 2-3, its slope in speed and its gradient in the parameters.

    S(v) = sign(v) [M_s (1 + (M̄_c - 1) e) + C_v |v|^γ],    e = exp(-V_S/|v|),    γ = 0.3

e is as printed: 0 at rest and 1 at high speed, so M_s is the torque at rest and M_s M̄_c + C_v |v|^γ the torque far
above V_S. At v = ±0 every function takes the one-sided limit that the sign bit names: S(+0) = M_s, S(-0) = -M_s.

Source: Ompusunggu, Janssens, Sas, "Friction Behavior of a Wet Clutch Subjected to Accelerated Degradation",
ISRN Tribology 2013, 607279, eq. 2-3; γ = 0.3 from its section 3.1.2.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray

#: The exponent of the viscous term [-].
GAMMA = 0.3
#: The order of every array of parameters, gradients and covariances.
PARAMETER_NAMES = ("static_torque", "coulomb_ratio", "stribeck_velocity", "viscous_coefficient")
#: Below this speed [m/s] the clutch stands still: its reciprocal must stay far from overflow.
STANDSTILL = 1e-150


@dataclass(frozen=True, slots=True, kw_only=True)
class StribeckParameters:
    """The four parameters of one pressure and state, each >= 0; floats, or arrays that broadcast against velocity.

    static_torque M_s [Nm], coulomb_ratio M̄_c [-], stribeck_velocity V_S [m/s], viscous_coefficient C_v [Nm/(m/s)^γ].
    Raises ValueError where a value is negative or not finite.
    """

    static_torque: float | FloatArray
    coulomb_ratio: float | FloatArray
    stribeck_velocity: float | FloatArray
    viscous_coefficient: float | FloatArray

    def __post_init__(self) -> None:
        for name in PARAMETER_NAMES:
            value = getattr(self, name)
            if not (0.0 <= value < math.inf if type(value) is float else (np.isfinite(value) & (value >= 0)).all()):
                raise ValueError(f"{name} must be finite and not negative, got {value}")

    def as_array(self) -> FloatArray:
        """[4] in the order of PARAMETER_NAMES; [4, ...] where the parameters are arrays, which then must broadcast."""
        values = [getattr(self, name) for name in PARAMETER_NAMES]
        if all(
            type(value) is float for value in values
        ):  # a pressure's own: nothing to broadcast, twenty times as quick
            return np.array(values)
        return np.stack(np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in values)))

    @classmethod
    def from_array(cls, values: FloatArray) -> "StribeckParameters":
        """The inverse of `as_array`: [4], or [4, ...] for arrays of parameters."""
        if values.shape[:1] != (4,):
            raise ValueError(f"values must have 4 rows, got shape {values.shape}")
        m_s, m_c, v_s, c_v = values if values.ndim > 1 else values.tolist()
        return cls(static_torque=m_s, coulomb_ratio=m_c, stribeck_velocity=v_s, viscous_coefficient=c_v)


def _decay(velocity: FloatArray, stribeck_velocity: float | FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed |v| [n] with standstill lifted off zero, and e = exp(-V_S/|v|) [n], 0 at standstill even where V_S is 0."""
    speed = np.abs(velocity)
    moving = speed > STANDSTILL
    safe = np.where(moving, speed, 1.0)
    return speed, np.where(moving, np.exp(-(stribeck_velocity / safe)), 0.0)


def torque(velocity: FloatArray, parameters: StribeckParameters) -> FloatArray:
    """Eq. 3, S(v) [Nm] at velocity [n] m/s of either sign.

    >>> p = StribeckParameters(static_torque=22.0, coulomb_ratio=0.5, stribeck_velocity=4.5, viscous_coefficient=3.0)
    >>> torque(np.array([-0.0, 0.0, 11.97]), p).round(3).tolist()
    [-22.0, 22.0, 20.764]
    """
    speed, e = _decay(velocity, parameters.stribeck_velocity)
    m_s, m_c = parameters.static_torque, parameters.coulomb_ratio
    magnitude = m_s * ((1 - e) + m_c * e) + parameters.viscous_coefficient * speed**GAMMA
    return np.asarray(np.copysign(1.0, velocity) * magnitude, dtype=np.float64)


def gradient(velocity: FloatArray, parameters: StribeckParameters) -> FloatArray:
    """Derivatives ∂S/∂(M_s, M̄_c, V_S, C_v) [n, 4] at velocity [n] m/s, columns in the order of PARAMETER_NAMES.

    sign(v) [(1 - e) + M̄_c e,   M_s e,   -M_s (M̄_c - 1) e/|v|,   |v|^γ]
    """
    speed, e = _decay(velocity, parameters.stribeck_velocity)
    m_s, m_c = parameters.static_torque, parameters.coulomb_ratio
    safe = np.where(speed > STANDSTILL, speed, 1.0)
    columns = np.broadcast_arrays((1 - e) + m_c * e, m_s * e, -m_s * (m_c - 1) * e / safe, speed**GAMMA)
    return np.asarray(np.copysign(1.0, velocity)[..., None] * np.stack(columns, axis=-1), dtype=np.float64)


def slope(velocity: FloatArray, parameters: StribeckParameters) -> FloatArray:
    """Slope dS/dv [Nm s/m] at velocity [n] m/s, even in v: M_s (M̄_c - 1) e V_S/v² + γ C_v |v|^(γ-1).

    Negative slope is what makes a driveline shudder. At v = ±0 the viscous term has no finite slope: inf where C_v > 0,
    and 0 where C_v = 0 (e vanishes faster than any power of v).
    """
    speed, e = _decay(velocity, parameters.stribeck_velocity)
    moving = speed > STANDSTILL
    safe = np.where(moving, speed, 1.0)
    m_s, m_c, c_v = parameters.static_torque, parameters.coulomb_ratio, parameters.viscous_coefficient
    falling = m_s * (m_c - 1) * (e / safe) * (parameters.stribeck_velocity / safe)
    at_rest = np.where(np.asarray(c_v) > 0, np.inf, 0.0)
    return np.where(moving, falling + GAMMA * c_v * safe ** (GAMMA - 1), at_rest)


def slope_gradient(velocity: float, parameters: StribeckParameters) -> FloatArray:
    """∂(dS/dv)/∂(M_s, M̄_c, V_S, C_v) [4] at velocity > 0 [m/s]:

    (M̄_c - 1) e V_S/v²,   M_s e V_S/v²,   M_s (M̄_c - 1) e (1 - V_S/v)/v²,   γ v^(γ-1)
    """
    m_s, m_c, v_s, _ = parameters.as_array().tolist()
    ratio = v_s / velocity
    e = math.exp(-ratio)
    bend = e * ratio / velocity
    return np.array(
        [(m_c - 1) * bend, m_s * bend, m_s * (m_c - 1) * e * (1 - ratio) / velocity**2, GAMMA * velocity ** (GAMMA - 1)]
    )
