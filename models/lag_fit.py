"""How far friction lags, fitted to whole periods of a dynamic record given the stationary curve S.

One number u is sought, 1/C [s/Nm] of the attractor law or τ_1 [s] of the squeezed film: the torque is nearly linear
in it, so its likelihood is nearly normal, which that of C itself is not. The record is

    M_i = g m(θ_i; u) + m_0 + Σ_h e_h T_h(v_i) + noise

m is the law's torque in its periodic state. Gain g, within 5 % of 1, and zero m_0 are the sensor's and the day's; the
T_h are single-valued functions of speed, made orthogonal to S and 1, and take what S has wrong in shape. None of them
has a loop area. So g is judged by the curve, and u by how the torque differs between accelerating and decelerating.
u maximises the likelihood (they are profiled out); its deviation comes from the curvature there, with the noise taken
from the residual and raised where that is not white: what no u explains makes u less certain.

What the deviation does not hold is the curve's own slope, for the lag is S S' v̇/C: with M̄_c 2 % off C is off by 9 to 18 %,
with V_S 5 % off by up to 3 %, with C_v 5 % off by up to 5 %.

By scaling, a torque g S is followed at C when S is followed at C/g: the attractor told is g/u.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models.arrays import FloatArray
from models.lag import attractor_torque, squeeze_film_torque
from models.periods import Cycle
from models.stribeck import StribeckParameters, torque

#: The gain's prior deviation [-].
GAIN_SD = 0.05
#: Speeds below this share of the highest are sticking or next to it, and no stationary test reaches them.
LEAST_SPEED = 0.01
#: Two-sided 90 %.
NINETY = 1.6448536269514722
#: A lag is against the law where it is this many deviations below none.
AGAINST = 3.0
_SHAPES = 6
_GRID = 1000  # steps of a period
_RUN_IN = 5.0  # s before the periodic state, half a period at least and 12 at most
_BLOCKS = 24


class LagStatus(StrEnum):
    """DETERMINED; UNRESOLVED: no lag that noise would not make; AGAINST: torque lags the other way than the law can."""

    DETERMINED = "determined"
    UNRESOLVED = "unresolved"
    AGAINST = "against_the_law"


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """A law of lag: `lags` [k] are the u that are scanned, ascending; `respond` gives torque [k, n] at time, velocity.

    `scaled`: the lag of a torque g S is u/g.
    """

    name: str
    lags: FloatArray
    scaled: bool
    respond: Callable[[FloatArray, FloatArray, StribeckParameters, FloatArray], FloatArray]


ATTRACTOR = Law(
    name="attractor",
    lags=np.geomspace(2e-5, 0.2, 15),
    scaled=True,
    respond=lambda time, velocity, curve, lag: attractor_torque(time, velocity, curve, 1 / lag),
)
SQUEEZE_FILM = Law(
    name="squeeze film",
    lags=np.geomspace(2e-4, 3.0, 15),
    scaled=False,
    respond=lambda time, velocity, curve, lag: squeeze_film_torque(time, velocity, curve, lag),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LagFit:
    """u of one law: lag > 0 or None, its deviation, the 90 % interval (its ends may be <= 0), the gain found, `noise`
    [Nm] the residual's deviation, log_likelihood up to a constant that laws on one record share."""

    lag: float | None
    lag_sd: float
    interval: tuple[float, float]
    gain: float
    noise: float
    log_likelihood: float
    status: LagStatus


def fit_lag(law: Law, cycle: Cycle, phase: FloatArray, measured: FloatArray, curve: StribeckParameters) -> LagFit:
    """Fit `law` to torque [n] Nm at phase [n] rad of a cycle of *sliding velocity* in m/s, v >= 0 but for noise.

    Raises ValueError where fewer than 20 samples slide.
    """
    problem = _problem(cycle, phase, measured, curve)
    course = _Course(law, cycle, curve)
    scanned = course.at(law.lags, problem.phase)
    misses = [problem.miss(row) for row in scanned]
    best = int(np.argmin(misses))
    none, first = problem.linear(torque(problem.speed, curve), scanned[0], float(law.lags[0]))
    if first < -AGAINST * none or (best == 0 and first <= NINETY * none):
        status = LagStatus.AGAINST if first < -AGAINST * none else LagStatus.UNRESOLVED
        return problem.told(torque(problem.speed, curve), None, first, none, status)
    lag = _refine(problem, course, law.lags, misses, best)
    step = 1e-3 * lag
    low, middle, high = course.at(np.array([lag - step, lag, lag + step]), problem.phase)
    sd, gain = problem.deviation(middle, (high - low) / (2 * step), lag, cycle, law.scaled)
    share = 1 / gain if law.scaled else 1.0
    status = LagStatus.DETERMINED if lag > NINETY * sd else LagStatus.UNRESOLVED
    return problem.told(
        middle, lag * share if status is LagStatus.DETERMINED else None, lag * share, sd * share, status
    )


class _Course:
    """A law's torque in its periodic state, over a grid of phases."""

    def __init__(self, law: Law, cycle: Cycle, curve: StribeckParameters) -> None:
        self._law, self._curve = law, curve
        self._start = round(_GRID * min(max(0.5, _RUN_IN * cycle.frequency), 12.0))
        self._grid = 2 * math.pi * np.arange(-self._start, _GRID + 1) / _GRID
        self._time = self._grid / (2 * math.pi * cycle.frequency)
        self._velocity = np.maximum(cycle.value(self._grid), 0.0)

    def at(self, lags: FloatArray, phase: FloatArray) -> FloatArray:
        """[k, n] Nm for lags [k] at phase [n]."""
        courses = self._law.respond(self._time, self._velocity, self._curve, lags[:, np.newaxis])[:, self._start :]
        position = np.mod(phase, 2 * math.pi) * (_GRID / (2 * math.pi))
        cell = np.minimum(position.astype(np.int64), _GRID - 1)
        part = position - cell
        return np.asarray(courses[:, cell] * (1 - part) + courses[:, cell + 1] * part, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Problem:
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

    def miss(self, course: FloatArray) -> float:
        """-2 log likelihood x noise², profiled over gain, zero and shapes."""
        left = self.without(course)
        gain = self.gain(left)
        return float(np.square(self.left - gain * left).sum() + ((gain - 1) * self.noise / GAIN_SD) ** 2)

    def linear(self, still: FloatArray, little: FloatArray, lag: float) -> tuple[float, float]:
        """Deviation and estimate of u by linearising about no lag: tells its sign."""
        base = self.without(still)
        change = self.without((little - still) / lag)
        gain = self.gain(base)
        residual = self.left - gain * base
        own = change - base * float(base @ change) / float(base @ base)
        strength = max(float(own @ own), 1e-300)
        estimate = float(own @ residual) / strength
        return self._deviation(residual - estimate * own) / math.sqrt(strength), estimate

    def deviation(
        self, course: FloatArray, change: FloatArray, lag: float, cycle: Cycle, scaled: bool
    ) -> tuple[float, float]:
        """Deviation of u at the optimum (of gain x u/gain where the lag is `scaled` by the gain), and the gain there."""
        base, slope = self.without(course), self.without(change)
        gain = self.gain(base)
        sd = self._deviation(self.left - gain * base)
        information = np.array([[base @ base + (self.noise / GAIN_SD) ** 2, gain * (base @ slope)], [0, 0]])
        information[1] = information[0, 1], gain**2 * (slope @ slope)
        variance = sd**2 * np.linalg.inv(information + 1e-12 * np.diag(np.diag(information)))
        along = np.array([-lag / gain if scaled else 0.0, 1.0])
        told = max(float(along @ variance @ along), 0.0)
        return math.hypot(math.sqrt(told), self._by_phase(slope, course, gain, cycle)), gain

    def _by_phase(self, slope: FloatArray, course: FloatArray, gain: float, cycle: Cycle) -> float:
        """What the speed's own noise adds: a phase that is wrong makes a loop of a curve."""
        order = np.argsort(np.mod(self.phase, 2 * math.pi))
        turned = np.empty_like(course)
        turned[order] = np.gradient(course[order], np.maximum.accumulate(_spread(self.phase[order])))
        shift = float(slope @ self.without(turned)) / (gain * max(float(slope @ slope), 1e-300))
        count = cycle.cosine.size
        lead = np.zeros(2 * count)
        lead[0], lead[count] = -cycle.sine[0], cycle.cosine[0]
        lead /= cycle.amplitude**2
        return abs(shift) * math.sqrt(max(float(lead @ cycle.covariance @ lead), 0.0))

    def _deviation(self, residual: FloatArray) -> float:
        """Of a sample; raised where the means over blocks of phase scatter more than white noise would make them."""
        free = max(residual.size - self.absorbed.shape[1] - 2, 1)
        variance = float(residual @ residual) / free
        turn = np.mod(self.phase, 2 * math.pi)
        block = np.minimum((turn * (_BLOCKS / (2 * math.pi))).astype(np.int64), _BLOCKS - 1)
        count = np.bincount(block, minlength=_BLOCKS)
        total = np.bincount(block, weights=residual, minlength=_BLOCKS)
        filled = count > 0
        freedom = max(int(filled.sum()) - self.absorbed.shape[1] - 2, 4)
        ratio = float((total[filled] ** 2 / count[filled]).sum()) / freedom / max(variance, 1e-300)
        return math.sqrt(variance * (ratio if ratio > 1 + 2.5 * math.sqrt(2 / freedom) else 1.0))

    def told(self, course: FloatArray, lag: float | None, centre: float, sd: float, status: LagStatus) -> LagFit:
        left = self.without(course)
        gain = self.gain(left)
        miss = float(np.square(self.left - gain * left).sum())
        size = self.measured.size
        return LagFit(
            lag=lag,
            lag_sd=sd,
            interval=(centre - NINETY * sd, centre + NINETY * sd),
            gain=gain,
            noise=math.sqrt(miss / max(size - self.absorbed.shape[1] - 2, 1)),
            log_likelihood=-0.5 * size * math.log(max(miss, 1e-300) / size),
            status=status,
        )


def _spread(phase: FloatArray) -> FloatArray:
    """Phases of one turn, ascending, made distinct."""
    return np.asarray(np.mod(phase, 2 * math.pi) + 1e-9 * np.arange(phase.size), dtype=np.float64)


def _problem(cycle: Cycle, phase: FloatArray, measured: FloatArray, curve: StribeckParameters) -> _Problem:
    speed = cycle.value(phase)
    highest = float(speed.max())
    rows = speed > LEAST_SPEED * highest
    if rows.sum() < 20:
        raise ValueError(f"at least 20 samples must slide, got {int(rows.sum())}")
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
    return _Problem(phase=phase, speed=speed, measured=measured, absorbed=absorbed, left=left, noise=noise)


def _refine(problem: _Problem, course: _Course, lags: FloatArray, misses: list[float], best: int) -> float:
    """The minimum about the best of the scan, in log u: three finer scans, each a ninth of the last, and a parabola."""
    low = math.log(lags[max(best - 1, 0)])
    high = math.log(lags[min(best + 1, lags.size - 1)])
    found = math.log(lags[best])
    least = misses[best]
    for _ in range(3):
        points = np.linspace(low, high, 9)
        values = np.array([problem.miss(row) for row in course.at(np.exp(points), problem.phase)])
        i = int(np.argmin(values))
        if values[i] <= least:
            found, least = float(points[i]), float(values[i])
        width = (high - low) / 8
        if 0 < i < 8:
            left, here, right = values[i - 1 : i + 2]
            bend = left - 2 * here + right
            if bend > 0:
                found = float(points[i] + 0.5 * width * (left - right) / bend)
        low, high = found - width, found + width
    return math.exp(found)
