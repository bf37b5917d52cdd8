"""Friction that lags speed: the attractor law of the generalised Maxwell slip (GMS) model, and a squeezed film.

**Attractor** (sliding regime). Torque runs after the stationary curve S of eq. 3, the faster the higher C [Nm/s]:

    dM/dt = C (sign v - M/|S(v)|)                                                 time constant |S|/C

To first order in 1/C its loop area, eq. 8, is -(1/C) ∮ S S' v̇² dt: *negative* wherever S rises with v.

**Squeezed film**, after eq. 7. A film h that carries the load W has h_s ∝ (v/W)^n at rest with itself, so that away from
it the film carries W (h_s/h)^{1/n}; eq. 7 adds -η_e l (2a/h)³ ḣ, and the sum must be W. In terms of the speed w whose
stationary film is the present one, h = h_s(w), that is exactly a first-order lag, slower in thin films,

    dw/dt = (v - w)/τ(w),    τ(w) = n η_e l (2a)³/(W h²) = τ_1 (w/1 m/s)^{-2n}

Asperities carry what the film's thickness lets them; the film is sheared at v/h. With n = 1 - γ = 0.7 (γ = 0.3 of eq. 3;
elastohydrodynamic films have 0.67 to 0.7) the two terms of eq. 3 are just these two, and

    M = sign v [ M_s (1 + (M̄_c - 1) e^{-V_S/w}) + C_v |v|/w^n ]

is S(v) where w = v. Accelerating, w < v: more contact *and* a thinner film, so torque is higher also where S rises
(M̄_c <= 1). At one lining τ_1 ∝ η_e^{1-2n} W^{2n-1}: it grows with pressure^0.4, see `film_time_at`.

Both need a curve S > 0 and sliding; sticking and presliding are not in them. Velocities that swing through zero are
followed with |v| in the film and sign v in the torque.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 2.3.4, eqs. 7-8 and its references 5, 6 and 16.
The step from eq. 7 to τ(w), and the split of eq. 3, are this project's.
"""

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import GAMMA, StribeckParameters, slope, torque

#: The exponent n of film thickness over speed [-].
FILM_EXPONENT = 1 - GAMMA
#: The pressure [Pa] at which film times are compared.
FILM_PRESSURE = 5e5
#: Speeds below this share of the highest [-] are lifted to it where a film's thickness is taken.
_LEAST_SPEED = 1e-6
_LEAST_TORQUE = 1e-9
_POWER = 2 * FILM_EXPONENT - 1  # z = w^-0.4 makes the film's equation convex
_NEWTON_STEPS = 60


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
    return _relax(time, np.asarray(attractor) / strength, curve, curve[..., :1] if start is None else start)


def squeeze_film_torque(
    time: FloatArray,
    velocity: FloatArray,
    parameters: StribeckParameters,
    film_time: float | FloatArray,
    start: float | None = None,
) -> FloatArray:
    """M [n] Nm by the squeezed film at time [n] s (ascending) and velocity [n] m/s; film_time τ_1 > 0 [s] at w = 1 m/s.

    An array of film times [k, 1] gives [k, n]. `start` is w at time[0] [m/s], |v| if not given.
    Raises ValueError on τ_1 <= 0 or times that fall.
    """
    film = film_speed(time, velocity, film_time, start)
    return film_torque(velocity, film, parameters)


def film_torque(velocity: FloatArray, film: FloatArray, parameters: StribeckParameters) -> FloatArray:
    """M [n] Nm at velocity [n] m/s over the film that is stationary at `film` w [n] m/s > 0."""
    dry = StribeckParameters(
        static_torque=parameters.static_torque,
        coulomb_ratio=parameters.coulomb_ratio,
        stribeck_velocity=parameters.stribeck_velocity,
        viscous_coefficient=0.0,
    )
    sheared = parameters.viscous_coefficient * np.abs(velocity) / film**FILM_EXPONENT
    return np.asarray(np.copysign(1.0, velocity) * (torque(film, dry) + sheared), dtype=np.float64)


def film_speed(
    time: FloatArray, velocity: FloatArray, film_time: float | FloatArray, start: float | None = None
) -> FloatArray:
    """w [n] m/s, the speed whose stationary film is the present one, at time [n] s and velocity [n] m/s.

    In z = w^-0.4 the film's equation is ż = (0.4/τ_1)(z^-2.5 - |v|), convex in z: Newton's iteration on whole courses
    climbs to the solution from wherever it starts, and each step is one linear lag.
    """
    if not (np.asarray(film_time) > 0).all():
        raise ValueError(f"film_time must be positive, got {film_time}")
    speed = np.abs(velocity)
    fastest = max(float(speed.max()), 0.0 if start is None else abs(start), 1e-12)
    rate = _POWER / np.asarray(film_time, dtype=np.float64)
    first = max(abs(float(speed[0]) if start is None else start), _LEAST_SPEED * fastest) ** -_POWER
    least = fastest**-_POWER
    course = np.maximum(speed, 0.2 * fastest) ** -_POWER * np.ones_like(rate)
    for _ in range(_NEWTON_STEPS):
        flow = course ** (-1 / _POWER)
        fall = rate / _POWER * flow / course
        after = np.maximum(_relax(time, fall, course + rate * (flow - speed) / fall, first), least)
        done = bool((np.abs(after - course) <= 1e-9 * after).all())
        course = after
        if done:
            break
    return np.asarray(course ** (-1 / _POWER), dtype=np.float64)


def film_time_at(pressure: float, film_time: float) -> float:
    """τ_1 [s] at pressure > 0 [Pa] of a lining that has `film_time` [s] at FILM_PRESSURE: ∝ pressure^(2n - 1)."""
    return float(film_time * (pressure / FILM_PRESSURE) ** _POWER)


def attractor_area(
    velocity: FloatArray, acceleration: FloatArray, period: float, parameters: StribeckParameters, attractor: float
) -> float:
    """-(1/C) ∮ S S' v̇² dt [Nm m/s], the attractor law's loop area to first order in 1/C.

    velocity [n] m/s and acceleration [n] m/s² at n evenly spaced times of one period [s], none of them at standstill
    unless v̇ is 0 there too.
    """
    turning = np.square(acceleration)
    rise = torque(velocity, parameters) * slope(velocity, parameters)
    return (
        -float(np.where(turning > 0, np.where(np.isfinite(rise), rise, 0.0) * turning, 0.0).mean()) * period / attractor
    )


def _relax(time: FloatArray, rate: FloatArray, target: FloatArray, start: float | FloatArray) -> FloatArray:
    """y [..., n] of dy/dt = rate (target - y), y = start at time[0]; rate [..., n] 1/s > 0, target [..., n].

    With u = ∫ rate dt (trapezoids) and the target linear in u in each step the step is exact; the recursion
    y_{i+1} = a_i y_i + b_i is solved by doubling, so that nothing loops over time.
    """
    step = np.diff(time)
    if (step < 0).any():
        raise ValueError(f"time must not fall, but does at row {int((step < 0).argmax()) + 1}")
    rate, target = np.broadcast_arrays(rate, target)
    x = 0.5 * step * (rate[..., 1:] + rate[..., :-1])
    keep = np.exp(-x)
    tiny = x < 1e-4
    mean_keep = np.where(tiny, 1 - x / 2 + x * x / 6, -np.expm1(-x) / np.where(tiny, 1.0, x))
    gain = target[..., 1:] * (1 - mean_keep) + target[..., :-1] * (mean_keep - keep)
    first = np.broadcast_to(np.asarray(start, dtype=np.float64), (*gain.shape[:-1], 1))
    gain[..., :1] += keep[..., :1] * first
    ahead = 1
    while ahead < gain.shape[-1]:
        gain[..., ahead:] = gain[..., ahead:] + keep[..., ahead:] * gain[..., :-ahead]
        keep[..., ahead:] = keep[..., ahead:] * keep[..., :-ahead]
        if not keep[..., ahead:].any():
            break
        ahead *= 2
    return np.concatenate([first, gain], axis=-1)
