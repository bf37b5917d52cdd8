"""The attractor law of the generalised Maxwell slip (GMS) model, in its sliding regime, and the area of its loop.

Torque runs after the stationary curve S of eq. 3, the faster the higher C [Nm/s]:

    dM/dt = C (sign v - M/|S(v)|)                                                 time constant |S|/C

To first order in 1/C its loop area, eq. 8, is -(1/C) ∮ S S' v̇² dt: *negative* wherever S rises with v.

The law needs a curve S > 0 and sliding; sticking and presliding are not in it. Velocities that swing through zero are
followed with sign v in the torque.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 2.3.4, eq. 8 and its references 5, 6 and 16.
"""

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import StribeckParameters, torque
from models.relaxation import relax

_LEAST_TORQUE = 1e-9


def attractor_torque(
    time: FloatArray,
    velocity: FloatArray,
    parameters: StribeckParameters,
    attractor: float | FloatArray,
    start: float | FloatArray | None = None,
) -> FloatArray:
    """M [n] Nm by the attractor law at time [n] s (ascending) and velocity [n] m/s; attractor C > 0 [Nm/s].

    An array of attractors [k, 1] gives [k, n]. `start` is M at time[0], S(v) if not given. Between samples S is taken
    as linear in ∫ C/|S| dt: stable however stiff, exact for constant S, and of second order in the time step.
    Raises ValueError on C <= 0 or times that fall.

    >>> p = StribeckParameters(static_torque=20.0, coulomb_ratio=1.0, stribeck_velocity=1.0, viscous_coefficient=0.0)
    >>> attractor_torque(np.array([0.0, 0.2]), np.array([1.0, 1.0]), p, 100.0, start=10.0).round(4).tolist()
    [10.0, 16.3212]
    """
    if not (np.asarray(attractor) > 0).all():
        raise ValueError(f"attractor must be positive, got {attractor}")
    curve = torque(velocity, parameters)
    strength = np.maximum(np.abs(curve), _LEAST_TORQUE)
    return relax(time, np.asarray(attractor) / strength, curve, curve[..., :1] if start is None else start)
