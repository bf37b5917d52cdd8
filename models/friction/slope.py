"""The slope of the friction coefficient over sliding speed, dμ/dv, of a fitted curve with its standard error.

Where friction falls with speed a driveline may shudder: the slope is the margin against it. Of eq. 3

    dS/dv = M_s (M̄_c - 1) e V_S/v² + γ C_v v^(γ-1),    e = exp(-V_S/v),    dμ/dv = dS/dv / (torque of a unit COF)

and its variance is gᵀ Σ g with the fit's covariance Σ and the gradient g of dS/dv in the four parameters. The two terms have
opposite signs, so that the slope passes through 0 as a clutch ages: it is tracked additively, and its `size` is that of the
terms, |first| + |second|, not of their difference.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, eq. 2-3.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.friction.identification import StribeckFit
from models.friction.stribeck import GAMMA, StribeckParameters, slope


@dataclass(frozen=True, slots=True, kw_only=True)
class Slope:
    """dμ/dv [s/m] at a sliding speed, its standard error, and the size of its terms; sd and size are positive."""

    value: float
    sd: float
    size: float


def cof_slope(fit: StribeckFit, velocity: float, torque_per_cof: float) -> Slope | None:
    """dμ/dv at velocity > 0 [m/s] where a COF of one is `torque_per_cof` > 0 [Nm]; None of a curve without friction.

    A fit that leaves V_S open still has a slope: its covariance is as wide as that. Raises ValueError where an argument is
    not positive.
    """
    if not velocity > 0.0:
        raise ValueError(f"velocity must be positive, got {velocity}")
    if not torque_per_cof > 0.0:
        raise ValueError(f"torque_per_cof must be positive, got {torque_per_cof}")
    gradient = slope_gradient(velocity, fit.parameters)
    sd = math.sqrt(max(0.0, float(gradient @ fit.covariance @ gradient))) / torque_per_cof
    value = float(slope(np.array(velocity), fit.parameters)) / torque_per_cof
    viscous = float(fit.parameters.viscous_coefficient) * float(gradient[3]) / torque_per_cof
    size = abs(value - viscous) + viscous
    return Slope(value=value, sd=sd, size=size) if sd > 0.0 and size > 0.0 else None


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
