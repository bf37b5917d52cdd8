"""The least squares of a lag, given the stationary curve S: what is absorbed, the residual, and how noisy that is.

    M_i = g m(θ_i; u) + m_0 + Σ_h e_h T_h(v_i) + noise

g, within 5 % of 1, and m_0 are gain and zero of the sensor that day; the T_h are single-valued functions of speed,
orthogonal to S and 1, and absorb errors of S in shape. None of them has a loop area. `models.loops.lag_fit` estimates u.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.friction.stribeck import StribeckParameters, torque
from models.loops.criteria import FEWEST_SLIDING, GAIN_SD, NOT_WHITE
from models.records.periods import Cycle

_SHAPES = 6
_BLOCKS = 24


@dataclass(frozen=True, slots=True, kw_only=True)
class LagProblem:
    """The samples that slide: phase, speed, torque [n]; `absorbed` [n, s] spans zero and shapes, orthonormal."""

    phase: FloatArray
    speed: FloatArray
    measured: FloatArray
    absorbed: FloatArray
    left: FloatArray  # measured, without what is absorbed
    noise: float  # first guess, for the gain's prior

    def without(self, column: FloatArray) -> FloatArray:
        return np.asarray(column - self.absorbed @ (self.absorbed.T @ column), dtype=np.float64)

    def gain(self, left: FloatArray) -> float:
        weight = (self.noise / GAIN_SD) ** 2
        return float((left @ self.left + weight) / (left @ left + weight))

    def misfit(self, course: FloatArray) -> float:
        """-2 log likelihood x noise², profiled over gain, zero and shapes."""
        left = self.without(course)
        gain = self.gain(left)
        return float(np.square(self.left - gain * left).sum() + ((gain - 1) * self.noise / GAIN_SD) ** 2)

    def linear(self, still: FloatArray, little: FloatArray, lag: float) -> tuple[float, float]:
        """Deviation and estimate of u by linearising about no lag: it gives the sign."""
        base = self.without(still)
        change = self.without((little - still) / lag)
        gain = self.gain(base)
        residual = self.left - gain * base
        own = change - base * float(base @ change) / float(base @ base)
        strength = max(float(own @ own), 1e-300)
        estimate = float(own @ residual) / strength
        return self._deviation(residual - estimate * own) / math.sqrt(strength), estimate

    def step(self, course: FloatArray, change: FloatArray, lag: float) -> tuple[float, float]:
        """u after a Gauss-Newton step from `lag`, whose torque is `course` and changes by `change`, and the gain there."""
        base, slope = self.without(course), self.without(change)
        gain = self.gain(base)
        own = slope - base * float(base @ slope) / float(base @ base)
        move = float(own @ (self.left - gain * base)) / (gain * max(float(own @ own), 1e-300))
        return lag + move, self.gain(base + move * slope)

    def deviation(
        self, course: FloatArray, change: FloatArray, lag: float, cycle: Cycle, *, scaled: bool, erring: FloatArray
    ) -> tuple[float, float]:
        """Deviation of u at the optimum (of gain x u/gain where the lag is `scaled` by the gain), and the gain there.

        `erring` [k, n] Nm is how the torque changes where the curve errs by a deviation, in independent directions: what
        that explains of the residual is no noise.
        """
        base, slope = self.without(course), self.without(change)
        gain = self.gain(base)
        residual = self.left - gain * base
        directions = np.stack([self.without(way) for way in erring]) if len(erring) else erring
        strength = directions @ directions.T
        damped = strength + self.noise**2 * np.eye(len(erring))
        residual -= np.linalg.solve(damped, directions @ residual) @ directions
        sd = self._deviation(residual, taken=float(np.trace(np.linalg.solve(damped, strength))))
        information = np.array([[base @ base + (self.noise / GAIN_SD) ** 2, gain * (base @ slope)], [0, 0]])
        information[1] = information[0, 1], gain**2 * (slope @ slope)
        variance = sd**2 * np.linalg.inv(information + 1e-12 * np.diag(np.diag(information)))
        along = np.array([-lag / gain if scaled else 0.0, 1.0])
        along_variance = max(float(along @ variance @ along), 0.0)
        return math.hypot(math.sqrt(along_variance), self._by_phase(slope, course, gain, cycle)), gain

    def _by_phase(self, slope: FloatArray, course: FloatArray, gain: float, cycle: Cycle) -> float:
        """The part of the speed's own noise: an error of the phase opens a curve into a loop."""
        order = np.argsort(np.mod(self.phase, 2 * math.pi))
        turned = np.empty_like(course)
        turned[order] = np.gradient(course[order], np.maximum.accumulate(_spread(self.phase[order])))
        shift = float(slope @ self.without(turned)) / (gain * max(float(slope @ slope), 1e-300))
        count = cycle.cosine.size
        lead = np.zeros(2 * count)
        lead[0], lead[count] = -cycle.sine[0], cycle.cosine[0]
        lead /= cycle.amplitude**2
        return abs(shift) * math.sqrt(max(float(lead @ cycle.covariance @ lead), 0.0))

    def _deviation(self, residual: FloatArray, taken: float = 0.0) -> float:
        """Of a sample; raised where the means over blocks of phase scatter more than white noise would make them.

        `taken` degrees of freedom were taken out of the residual beside what is absorbed.
        """
        taken += self.absorbed.shape[1] + 2
        free = max(residual.size - taken, 1)
        variance = float(residual @ residual) / free
        turn = np.mod(self.phase, 2 * math.pi)
        block = np.minimum((turn * (_BLOCKS / (2 * math.pi))).astype(np.int64), _BLOCKS - 1)
        count = np.bincount(block, minlength=_BLOCKS)
        total = np.bincount(block, weights=residual, minlength=_BLOCKS)
        filled = count > 0
        freedom = max(int(filled.sum()) - taken, 4)
        ratio = float((total[filled] ** 2 / count[filled]).sum()) / freedom / max(variance, 1e-300)
        return math.sqrt(variance * (ratio if ratio > 1 + NOT_WHITE * math.sqrt(2 / freedom) else 1.0))


def _spread(phase: FloatArray) -> FloatArray:
    """Phases of one turn, ascending, made distinct."""
    return np.asarray(np.mod(phase, 2 * math.pi) + 1e-9 * np.arange(phase.size), dtype=np.float64)


def make_lag_problem(cycle: Cycle, phase: FloatArray, measured: FloatArray, curve: StribeckParameters) -> LagProblem:
    speed = cycle.value(phase)
    highest = float(speed.max())
    rows = speed > 0.01 * highest  # slower it sticks or is next to it, and no stationary test goes there
    if rows.sum() < FEWEST_SLIDING:
        raise ValueError(f"at least {FEWEST_SLIDING} samples must slide, got {int(rows.sum())}")
    phase, speed, measured = phase[rows], speed[rows], measured[rows]
    span = max(highest - float(speed.min()), 1e-12)
    shapes = np.polynomial.chebyshev.chebvander(2 * (speed - speed.min()) / span - 1, _SHAPES + 1)
    frame, _ = np.linalg.qr(np.column_stack([np.ones_like(speed), torque(speed, curve)]))
    shapes = shapes[:, 1:] - frame @ (frame.T @ shapes[:, 1:])
    vectors, sizes, _ = np.linalg.svd(shapes, full_matrices=False)
    absorbed = np.column_stack([np.full(speed.size, speed.size**-0.5), vectors[:, sizes > 1e-6 * sizes[0]]])
    absorbed, _ = np.linalg.qr(absorbed)
    left = measured - absorbed @ (absorbed.T @ measured)
    rough = np.diff(measured[np.argsort(speed)])
    noise = max(1.4826 * float(np.median(np.abs(rough))) / math.sqrt(2), 1e-6 * float(np.abs(measured).max()), 1e-12)
    return LagProblem(phase=phase, speed=speed, measured=measured, absorbed=absorbed, left=left, noise=noise)
