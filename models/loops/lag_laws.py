"""The two laws by which friction lags its speed, given the stationary curve S of eq. 3: an attractor, or a squeezed film.

The attractor law is that of the generalised Maxwell slip (GMS) model, in its sliding regime. Torque runs after S, the faster
the higher C [Nm/s]:

    dM/dt = C (sign v - M/|S(v)|)                                                 time constant |S|/C

To first order in 1/C its loop area, eq. 8, is -(1/C) ∮ S S' v̇² dt: *negative* wherever S rises with v. It needs S > 0.

The squeezed film of oil, after eq. 7, takes time to follow the speed. A film h that carries the load W has h_s ∝ (v/W)^n at
rest with itself, so that away from it the film carries W (h_s/h)^{1/n}; eq. 7 adds -η_e l (2a/h)³ ḣ, and the sum must be W.
In terms of the speed w whose stationary film is the present one, h = h_s(w), that is exactly a first-order lag, slower in
thin films,

    dw/dt = (v - w)/τ(w),    τ(w) = n η_e l (2a)³/(W h²) = τ_1 (w/1 m/s)^{-2n}

Asperities carry what the film's thickness lets them; the film is sheared at v/h. With n = 1 - γ = 0.7 (γ = 0.3 of eq. 3;
elastohydrodynamic films have 0.67 to 0.7) the two terms of eq. 3 are just these two, and

    M = sign v [ M_s (1 + (M̄_c - 1) e^{-V_S/w}) + C_v |v|/w^n ]

is S(v) where w = v. Accelerating, w < v: more contact *and* a thinner film, so torque is higher also where S rises
(M̄_c <= 1). At one lining τ_1 ∝ η_e^{1-2n} W^{2n-1}: it grows with pressure^0.4.

Both need sliding; sticking and presliding are not in them. Velocities that swing through zero are followed with |v| in the
film and sign v in the torque.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 2.3.4, eqs. 7-8 and its references 5, 6 and 16.
The step from eq. 7 to τ(w), and the split of eq. 3, are this project's.
"""

from dataclasses import replace

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import GAMMA, StribeckParameters, torque
from models.relaxation import relax

#: The exponent n of film thickness over speed [-].
FILM_EXPONENT = 1 - GAMMA
_POWER = 2 * FILM_EXPONENT - 1  # z = w^-0.4 makes the film's equation convex


def attractor_torque(
    time: FloatArray,
    velocity: FloatArray,
    parameters: StribeckParameters,
    attractor: float | FloatArray,
    start: float | FloatArray | None = None,
) -> FloatArray:
    """Torque M [n] Nm by the attractor law at time [n] s (ascending) and velocity [n] m/s; attractor C > 0 [Nm/s].

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
    strength = np.maximum(np.abs(curve), 1e-9)
    return relax(time, np.asarray(attractor) / strength, curve, curve[..., :1] if start is None else start)


def squeeze_film_torque(
    time: FloatArray, velocity: FloatArray, parameters: StribeckParameters, film_time: float | FloatArray
) -> FloatArray:
    """Torque M [n] Nm by the squeezed film at time [n] s (ascending) and velocity [n] m/s; film_time τ_1 > 0 [s] at
    w = 1 m/s.

    An array of film times [k, 1] gives [k, n]; w at time[0] is |v|. Raises ValueError on τ_1 <= 0 or times that fall.
    """
    film = film_speed(time, velocity, film_time)
    dry = replace(parameters, viscous_coefficient=0.0)
    sheared = parameters.viscous_coefficient * np.abs(velocity) / film**FILM_EXPONENT
    return np.asarray(np.copysign(1.0, velocity) * (torque(film, dry) + sheared), dtype=np.float64)


def film_speed(time: FloatArray, velocity: FloatArray, film_time: float | FloatArray) -> FloatArray:
    """Film speed w [n] m/s, the speed whose stationary film is the present one, at time [n] s and velocity [n] m/s.

    In z = w^-0.4 the film's equation is ż = (0.4/τ_1)(z^-2.5 - |v|), convex in z: Newton's iteration on whole courses
    climbs to the solution from wherever it starts, and each step is one linear lag.
    """
    if not (np.asarray(film_time) > 0).all():
        raise ValueError(f"film_time must be positive, got {film_time}")
    speed = np.abs(velocity)
    fastest = max(float(speed.max()), 1e-12)
    rate = _POWER / np.asarray(film_time, dtype=np.float64)
    first = max(float(speed[0]), 1e-6 * fastest) ** -_POWER
    least = fastest**-_POWER
    course = np.maximum(speed, 0.2 * fastest) ** -_POWER * np.ones_like(rate)
    for _ in range(60):
        flow = course ** (-1 / _POWER)
        fall = rate / _POWER * flow / course
        after = np.maximum(relax(time, fall, course + rate * (flow - speed) / fall, first), least)
        done = bool((np.abs(after - course) <= 1e-9 * after).all())
        course = after
        if done:
            break
    return np.asarray(course ** (-1 / _POWER), dtype=np.float64)
