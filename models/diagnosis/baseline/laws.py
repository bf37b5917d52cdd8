"""The baseline's laws: eq. 2-3 over the pressure laws of fig. 9 over eq. 6, one parameter vector for a whole campaign.

With D(ζ) = 1 - (1 + ζ/φ)^-ε (eq. 6's share), one (φ, ε) for each Stribeck parameter, and P⁻, P⁺ the campaign's lowest and
highest pressure,

    parameter = u⁻ (1 + s⁻ D) w(p) + u⁺ (1 + s⁺ D) (1 - w(p))
    w         = (P⁺ - p)/(P⁺ - P⁻)                               for M_s, V_S, C_v: straight lines in pressure
    w         = (g(p) - g(P⁺))/(1 - g(P⁺)),  g = (1 + b (p - P⁻)/p_0)^{-1/b}  for M̄_c: fast or slowly to its asymptote
    log C          = κ(p) + d_1 x + d_2 x (1 + ξ)/(x + ξ) + d_3 x (p - p̄)/(P⁺ - P⁻),       x = ζ/ζ_last,  ξ = 0.15
    open clutch    = Σ_k o_k (v/v_0)^k,  k = 1 ... 4                           the drag of its oil, and no friction

(φ, ε) stand in θ as (log h, log ε) with h the half-life, D(h) = 1/2: φ = h/(2^{1/ε} - 1). Data determine h far better than
φ. u⁻, u⁺ are the fresh values at the two ends of the pressures; intercept and slope (asymptote and excess) drift each by its
own share: whether eq. 6 multiplies a law as a whole (s⁻ = s⁺) or not is left to the data. Fig. 9 shows that M̄_c falls to an
asymptote and not how: b, the curvature of its fall, leaves that open. b → 0 is c_∞ + a e^{-p/p_0}, b = 1 with p_0 = P⁻ is
c_∞ + a/p; below P⁻ the law goes on by its tangent. κ is free at every pressure of the loops and linear between them.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, eqs. 2, 3, 6, figs. 9 and 10; the bilinear form and the
course of C are this project's.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_form import LearnedLaw
from models.diagnosis.design.design import IntArray, Points
from models.diagnosis.design.facts import Facts
from models.friction.stribeck import GAMMA

#: The laws of eq. 6 over pressure, in the order of `models.friction.stribeck.PARAMETER_NAMES`; each has six places in θ.
BLOCK, BLOCKS = 6, 4
#: What stands where in such a block of θ.
ENDS, SHARES, COURSE = slice(0, 2), slice(2, 4), slice(4, BLOCK)
#: What `Laws.raised` raises: the four, and log C.
RAISED = BLOCKS + 1
#: θ: four blocks of (low end, high end, share low, share high, log h, log ε); log p_0, log b;
#: d_1, d_2, d_3; then κ at each pressure of the loops; then o_1 ... o_4 of the open clutch.
LOG_DECAY = BLOCKS * BLOCK
LOG_CURVATURE = LOG_DECAY + 1
FALL = slice(LOG_DECAY, LOG_CURVATURE + 1)
DRIFT = LOG_CURVATURE + 1
ATTRACTOR = DRIFT + 3
#: Powers of speed of the open clutch's drag. Chosen: four follow a drag that rises and falls again to a percent; with two
#: the remainder passed for a shifted zero.
POWERS = 4
KAPPA, OPEN_DRAG = slice(ATTRACTOR, -POWERS), slice(-POWERS, None)
RATIO, STRIBECK_VELOCITY = 1, 2  # the places of M̄_c and V_S among the four
#: V_S [m/s] is kept above this, lest eq. 3 divides by it.
_LEAST_VELOCITY = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """The reference values of the laws: pressure range, last state, loop pressures and velocity."""

    lowest: float  # pressure [Pa]
    highest: float
    last: float  # state [cycles]
    loop_pressures: FloatArray  # [l] Pa, ascending
    reference_velocity: float  # [m/s], in the middle of what was measured

    @property
    def span(self) -> float:
        """The range of the pressures [Pa], or the pressure itself where there is only one."""
        return self.highest - self.lowest if self.highest > self.lowest else self.highest


@dataclass(frozen=True, slots=True, kw_only=True)
class Laws:
    """The parameter vector theta [ATTRACTOR + loop pressures + POWERS] of the baseline, and the frame that it refers
    to."""

    theta: FloatArray
    frame: Frame
    learned: LearnedLaw | None = None  # how friction differs from them, for what changes pressure, speed or cycles

    def parameters(self, pressure: FloatArray, cycles: FloatArray, *, below: float = 0.0) -> FloatArray:
        """Stribeck parameters M_s, M̄_c, V_S, C_v [n, 4] at pressure [n] Pa and cycles [n]. V_S is kept above 0, the
        others are as fitted; `below` as in `falling_weight`."""
        begins, repeats = _stretches(pressure, cycles)
        return np.repeat(self._evaluated(pressure[begins], cycles[begins], None, below)[0], repeats, axis=0)

    def with_gradient(self, pressure: FloatArray, cycles: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Parameters [n, 4], their derivatives by θ's blocks [n, 4, BLOCK], and those of M̄_c by FALL [n, 2]."""
        begins, repeats = _stretches(pressure, cycles)
        slopes = np.empty((begins.size, 4, BLOCK))
        values, by_fall = self._evaluated(pressure[begins], cycles[begins], slopes)
        values, slopes, by_fall = (np.repeat(rows, repeats, axis=0) for rows in (values, slopes, by_fall))
        return values, slopes, by_fall

    def _evaluated(
        self, pressure: FloatArray, cycles: FloatArray, slopes: FloatArray | None, below: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Stribeck parameters [n, 4] at pressure [n] Pa and cycles [n], and M̄_c's derivatives by FALL [n, 2]. An array
        `slopes` [n, 4, BLOCK] is filled with the derivatives of each parameter by its block of θ."""
        values = np.empty((pressure.size, 4))
        by_fall = np.zeros((pressure.size, 2))
        high = (pressure - self.frame.lowest) / self.frame.span
        # rows of one test follow each other: eq. 6 is computed once for each
        begins, repeats = _stretches(cycles)
        states = cycles[begins]
        fall, fall_slopes = falling_weight(high, self.frame.span, self.theta[FALL], below)
        for k in range(4):
            first, second, share_1, share_2, log_half, log_exponent = self.theta[k * BLOCK : (k + 1) * BLOCK].tolist()
            weight_1, weight_2 = (fall, 1.0 - fall) if k == RATIO else (1.0 - high, high)
            done, by_half, by_exponent = (
                np.repeat(share, repeats) for share in _progress(states, log_half, log_exponent)
            )
            lost = first * share_1 * weight_1 + second * share_2 * weight_2
            values[:, k] = first * weight_1 + second * weight_2 + lost * done
            if k == RATIO:
                by_fall = fall_slopes * (first * (1.0 + share_1 * done) - second * (1.0 + share_2 * done))[:, None]
            if slopes is not None:
                slopes[:, k, 0] = weight_1 * (1.0 + share_1 * done)
                slopes[:, k, 1] = weight_2 * (1.0 + share_2 * done)
                slopes[:, k, 2] = first * weight_1 * done
                slopes[:, k, 3] = second * weight_2 * done
                slopes[:, k, 4] = lost * by_half
                slopes[:, k, 5] = lost * by_exponent
        too_low = values[:, 2] < _LEAST_VELOCITY
        values[too_low, 2] = _LEAST_VELOCITY
        if slopes is not None:
            slopes[too_low, 2] = 0.0
        return values, by_fall

    def raised(self, place: int, by: float) -> "Laws":
        """The laws with one of M_s, M̄_c, V_S, C_v, log C (by `place`) larger by `by` everywhere."""
        theta = self.theta.copy()
        if place == BLOCKS:
            theta[KAPPA] += by
        else:
            block = theta[place * BLOCK : (place + 1) * BLOCK]  # a view
            lost = block[ENDS] * block[SHARES]
            block[ENDS] += by
            block[SHARES] = lost / block[ENDS]
        return replace(self, theta=theta)

    def by_pressure(self, pressure: FloatArray, cycles: FloatArray) -> FloatArray:
        """Derivatives d(M_s, M̄_c, V_S, C_v)/dp [n, 4] 1/Pa."""
        step = 1e-4 * self.frame.span
        ahead, behind = self.parameters(pressure + step, cycles), self.parameters(pressure - step, cycles)
        return np.asarray((ahead - behind) / (2 * step), dtype=np.float64)

    def log_attractor(self, pressure: FloatArray, cycles: FloatArray) -> tuple[FloatArray, FloatArray]:
        """log C [n] at pressure [n] Pa and cycles [n], and its derivatives by (d_1, d_2, d_3, κ...) [n, 3 + l]."""
        levels = self.frame.loop_pressures
        weights = np.stack([np.interp(pressure, levels, unit) for unit in np.eye(levels.size)], axis=-1)
        x = cycles / max(self.frame.last, 1.0)
        tilt = (pressure - 0.5 * (self.frame.lowest + self.frame.highest)) / self.frame.span
        early = x * (1.0 + criteria.EARLY) / (x + criteria.EARLY)
        columns = np.concatenate([np.stack([x, early, x * tilt], axis=-1), weights], axis=-1)
        return columns @ self.theta[DRIFT:-POWERS], columns


def _stretches(*keys: FloatArray) -> tuple[IntArray, IntArray]:
    """First rows [b] and lengths [b] of stretches of equal keys: a loop is one stretch."""
    changes = np.any([np.diff(key, prepend=np.nan) != 0.0 for key in keys], axis=0)
    begins = np.flatnonzero(changes)
    return begins, np.diff(begins, append=changes.size)


def falling_weight(
    high: FloatArray, span: float, fall: FloatArray, below: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Weight w [n] of M̄_c's falling law at (p - P⁻)/(P⁺ - P⁻) = `high` [n], and its derivatives [n, 2] by `fall`: log
    p_0, p_0 in Pa, and log b, b within CURVATURE_BOUNDS. Below P⁻ the law continues by its tangent, because a hyperbola
    has its pole there; for the share `below` of the span (and of the way to the pole) it continues itself first."""
    ratio = float(np.clip(span / np.exp(fall[0]), 1e-3, 60.0))
    curvature = float(np.exp(np.clip(fall[1], *np.log(criteria.CURVATURE_BOUNDS))))
    at = np.append(high, 1.0)
    near = np.maximum(at, -below * min(1.0, 1.0 / (curvature * ratio)))
    stretched = 1.0 + curvature * ratio * near
    logs = np.log(stretched)
    left, along = np.exp(-logs / curvature), ratio * near / stretched
    tangent = ratio * np.minimum(at - near, 0.0) / stretched
    weight = left * (1.0 - tangent)
    by_decay = left * (along * (1.0 - tangent) + tangent * (1.0 - curvature * along))
    by_curvature = left * ((logs / curvature - along) * (1.0 - tangent) + tangent * curvature * along)
    slopes = np.stack([by_decay, by_curvature], axis=-1)
    full_weight = 1.0 - weight[-1]
    by_fall = (slopes[:-1] - slopes[-1]) / full_weight + ((weight[:-1] - weight[-1]) / full_weight**2)[
        :, None
    ] * slopes[-1]
    return (weight[:-1] - weight[-1]) / full_weight, by_fall


def _progress(cycles: FloatArray, log_half: float, log_exponent: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Share D [n] of eq. 6's change, and dD/dlog h, dD/dlog ε [n]."""
    exponent = np.exp(log_exponent)
    doubling = np.expm1(np.log(2.0) / exponent)
    ratio = cycles * doubling / np.exp(log_half)
    stretched = np.log1p(ratio)
    left = np.exp(-exponent * stretched)
    by_half = -exponent * left * ratio / (1.0 + ratio)
    along = np.log(2.0) / exponent * (1.0 + doubling) / doubling  # dlog φ/dlog ε
    return -np.expm1(-exponent * stretched), by_half, exponent * left * stretched + along * by_half


def curve(velocity: FloatArray, parameters: FloatArray) -> FloatArray:
    """Eq. 3 [n] Nm at velocity [n] m/s > 0 with parameters [n, 4]; as `friction.stribeck.torque`, any sign of parameter."""
    decay = np.exp(-np.minimum(parameters[:, 2] / velocity, 700.0))
    return np.asarray(
        parameters[:, 0] * (1.0 - decay + parameters[:, 1] * decay) + parameters[:, 3] * velocity**GAMMA,
        dtype=np.float64,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """The baseline evaluated at points [P]; with the clutch open there is no friction: all but parameters and decay is
    0."""

    points: Points
    facts: Facts
    laws: Laws
    parameters: FloatArray  # [P, 4]
    curve: FloatArray  # S [Nm]
    gradient: FloatArray  # [P, 4] of S by the parameters
    decay: FloatArray  # e = exp(-V_S/v)
    by_velocity: FloatArray  # ∂S/∂v [Nm s/m]

    @property
    def life(self) -> FloatArray:
        """Share [P] of the measured life that has passed, 0 before its first state."""
        gone = (self.points.cycles - self.facts.states[0]) / self.facts.life
        return np.asarray(np.maximum(gone, 0.0), dtype=np.float64)

    def learned_share(self, velocity: FloatArray) -> FloatArray:
        """Learned discrepancy δ [P] of the law at the points under another velocity [P] m/s; 0 if none was learned."""
        learned = self.laws.learned
        if learned is None:
            return np.zeros_like(velocity)
        return learned.share(velocity, self.points.pressure, self.points.cycles)

    @property
    def by_pressure(self) -> FloatArray:
        """Derivative ∂S/∂p [P] Nm/Pa along the laws."""
        slopes = self.laws.by_pressure(self.points.pressure, self.points.cycles)
        return np.asarray(np.einsum("nk,nk->n", self.gradient, slopes), dtype=np.float64)

    @property
    def viscous(self) -> FloatArray:
        """Viscous torque C_v v^γ [P] Nm."""
        torque = self.points.engaged * self.parameters[:, 3] * self.points.velocity**GAMMA
        return np.asarray(torque, dtype=np.float64)

    @property
    def open_powers(self) -> FloatArray:
        """Terms (v/v_0)^k [P, POWERS] of the open clutch's drag, 0 where it is closed."""
        powers = np.zeros((self.points.engaged.size, POWERS))
        is_open = np.flatnonzero(self.points.engaged < 1.0)
        relative = self.points.velocity[is_open] / self.laws.frame.reference_velocity
        powers[is_open] = (1.0 - self.points.engaged[is_open])[:, None] * relative[:, None] ** np.arange(1, POWERS + 1)
        return powers

    def curve_with(
        self,
        *,
        cycles: FloatArray | None = None,
        velocity: FloatArray | None = None,
        pressure: FloatArray | None = None,
    ) -> FloatArray:
        """Torque of the stationary curve S (1 + δ) [P] Nm at the points, with their cycles, velocities [m/s] > 0 or
        pressures [Pa] replaced by those that are given [P].

        With given pressures M̄_c's law goes on BELOW the lowest that was measured: it is the same clutch there."""
        p = self.points.pressure if pressure is None else pressure
        v = self.points.velocity if velocity is None else velocity
        parameters = self.parameters
        if cycles is not None or pressure is not None:
            parameters = self.laws.parameters(
                p, self.points.cycles if cycles is None else cycles, below=0.0 if pressure is None else criteria.BELOW
            )
        torque = self.points.engaged * curve(v, parameters)
        if self.laws.learned is None:
            return torque
        return torque * (1.0 + self.laws.learned.share(v, p, self.points.cycles if cycles is None else cycles))


def gradient_of(velocity: FloatArray, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives ∂S/∂(M_s, M̄_c, V_S, C_v) [n, 4] and the decay e [n] at velocity [n] m/s > 0."""
    decay = np.exp(-np.minimum(parameters[:, 2] / velocity, 700.0))
    m_s, m_c = parameters[:, 0], parameters[:, 1]
    columns = (1.0 - decay + m_c * decay, m_s * decay, -m_s * (m_c - 1.0) * decay / velocity, velocity**GAMMA)
    return np.stack(columns, axis=-1), decay


def scene_of(laws: Laws, points: Points, facts: Facts, values: FloatArray | None = None) -> Scene:
    """The laws evaluated at the points, where their parameters may be known as `values` [P, 4]."""
    if values is None:
        values = laws.parameters(points.pressure, points.cycles)
    gradient, decay = gradient_of(points.velocity, values)
    gradient *= points.engaged[:, None]
    falling = gradient[:, 2] * values[:, 2] / points.velocity
    rising = GAMMA * values[:, 3] * gradient[:, 3] / points.velocity
    return Scene(
        points=points,
        facts=facts,
        laws=laws,
        parameters=values,
        curve=np.asarray(values[:, 0] * gradient[:, 0] + values[:, 3] * gradient[:, 3], dtype=np.float64),
        gradient=gradient,
        decay=decay,
        by_velocity=np.asarray(rising - falling, dtype=np.float64),
    )
