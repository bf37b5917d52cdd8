"""How far friction lags, fitted to whole periods of a dynamic record given the stationary curve S.

One number u is estimated, 1/C [s/Nm] of the attractor law or τ_1 [s] of the squeezed film: the torque is nearly linear
in it, so its likelihood is nearly normal, which that of C itself is not. Beside it a gain, a zero and single-valued shapes
are fitted, none of which has a loop area, so that u follows from how the torque differs between accelerating and
decelerating. u maximises the likelihood (the others are profiled out); its deviation comes from the curvature there, with
the noise taken from the residual and raised where that is not white: what no u explains makes u less certain. What an error
of the curve, as large as it is stated to be, would explain of that residual is left out of it: it is counted by itself.

The curve's own error contributes: the lag is S S' v̇/C, so that C is off by 9 to 18 % with M̄_c 2 % off, by up to 3 %
with V_S 5 % off, by up to 5 % with C_v 5 % off. u's gradient by the four parameters, each from one Gauss-Newton step at a
curve moved by a little, carries their covariance (delta method). To first order u is a measured loop over S S' v̇², noisy
both: its interval is Fieller's, |û - u| <= 1.645 √(n² + u² r²) with n the noise's deviation and r the curve's share, which
is open at the top where the curve's slope might be none.

By scaling, a torque g S is followed at C when S is followed at C/g: the attractor reported is g/u.

What is fitted beside u,

    M_i = g m(θ_i; u) + m_0 + Σ_h e_h T_h(v_i) + noise

g, within 5 % of 1, and m_0 are gain and zero of the sensor that day; the T_h are single-valued functions of speed,
orthogonal to S and 1, and absorb errors of S in shape.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from models.arrays import FloatArray
from models.friction.criteria import Z90
from models.friction.identification import StribeckFit
from models.friction.stribeck import StribeckParameters, torque
from models.loops.criteria import GAIN_SD, NOT_WHITE
from models.loops.lag_laws import attractor_torque, squeeze_film_torque
from models.records.periods import Cycle

#: A parameter is moved by this share of its deviation.
_MOVED = 0.01


class LagStatus(StrEnum):
    """DETERMINED; UNRESOLVED: no lag that noise would not make; AGAINST_THE_LAW: torque lags as the law cannot. Of a loop
    that no law was fitted to: NO_CURVE: no stationary curve at this pressure; REVERSES: the speed changes sign, which the
    laws do not describe; NO_PERIOD: no whole period."""

    DETERMINED = "determined"
    UNRESOLVED = "unresolved"
    AGAINST_THE_LAW = "against_the_law"
    NO_CURVE = "no_curve"
    REVERSES = "reverses"
    NO_PERIOD = "no_period"


@dataclass(frozen=True, slots=True, kw_only=True)
class StationaryCurve:
    """The stationary curve that torque lags behind, and the covariance [4, 4] of its parameters; zero where it is
    exact."""

    parameters: StribeckParameters
    covariance: FloatArray = field(default_factory=lambda: np.zeros((4, 4)))

    def __post_init__(self) -> None:
        if self.covariance.shape != (4, 4) or not np.isfinite(self.covariance).all():
            raise ValueError(f"covariance must be 4 x 4 and finite, got shape {self.covariance.shape}")

    @classmethod
    def of(cls, fit: StribeckFit) -> "StationaryCurve":
        """The stationary curve of a fit, with its unbiased covariance: lags are tracked along a life, and one loop's
        interval has the noise of the record beside it."""
        return cls(parameters=fit.parameters, covariance=fit.unbiased_covariance)


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
    """The fitted lag u of one law: lag > 0 or None, its deviation, the 90 % interval (its ends may be <= 0 or
    infinite), log_likelihood up to a constant that laws on one record share."""

    lag: float | None
    lag_sd: float
    interval: tuple[float, float]
    log_likelihood: float
    status: LagStatus


def fit_lag(
    law: Law, cycle: Cycle, phase: FloatArray, measured: FloatArray, curve: StationaryCurve, against: float = 3.0
) -> LagFit:
    """Fit `law` to torque [n] Nm at phase [n] rad of a cycle of *sliding velocity* in m/s, v >= 0 but for noise.

    A lag so many deviations below none is `against` the law. Raises ValueError where fewer than 20 samples slide.
    """
    posed = _Posed(law, cycle, phase, measured, curve.parameters)
    scanned = posed.at(law.lags)
    misfits = [posed.misfit(row) for row in scanned]
    best = int(np.argmin(misfits))
    none, first = posed.near_none(scanned[0])
    if first < -against * none or (best == 0 and first <= Z90 * none):
        slant = _by_curve(lambda moved: _Posed(law, cycle, phase, measured, moved).near_none()[1], curve)
        estimate = _Estimate(first, none, slant)
        status = LagStatus.AGAINST_THE_LAW if first < -against * estimate.sd else LagStatus.UNRESOLVED
        return posed.result(torque(posed.speed, curve.parameters), None, estimate, status)
    lag = posed.refined(misfits, best)
    middle, change = posed.about(lag)
    courses: list[FloatArray] = []

    def stepped(moved: StribeckParameters) -> float:
        after, course = _Posed(law, cycle, phase, measured, moved).stepped(lag)
        courses.append(course)
        return after

    slant = _by_curve(stepped, curve)
    erring = _erring(courses, curve) if courses else np.zeros((0, middle.size))
    sd, gain = posed.deviation(lag, middle, change, erring)
    share = 1 / gain if law.scaled else 1.0
    estimate = _Estimate(lag * share, sd * share, slant)
    status = LagStatus.DETERMINED if estimate.lag > Z90 * estimate.sd else LagStatus.UNRESOLVED
    return posed.result(middle, estimate.lag if status is LagStatus.DETERMINED else None, estimate, status)


@dataclass(frozen=True, slots=True)
class _Estimate:
    """An estimate of the lag u, with its standard deviations from the record's noise and from the curve's error."""

    lag: float
    noise: float
    slant: float

    @property
    def sd(self) -> float:
        """Standard deviation of the lag from both."""
        return math.hypot(self.noise, self.slant)

    def interval(self) -> tuple[float, float]:
        """Fieller's 90 % interval; an end that is not bounded is infinite."""
        spare = 1 - (Z90 * self.slant / self.lag) ** 2 if self.lag else 1.0
        clear = self.lag**2 - (Z90 * self.noise) ** 2
        if spare > 0:
            half = math.sqrt(max(self.lag**2 - spare * clear, 0.0))
            return (self.lag - half) / spare, (self.lag + half) / spare
        if clear <= 0:
            return -math.inf, math.inf
        # one end: the root of the quadratic that lies on the estimate's side
        end = clear / (abs(self.lag) + math.sqrt(self.lag**2 - spare * clear))
        return (end, math.inf) if self.lag > 0 else (-math.inf, -end)


def _by_curve(estimate: Callable[[StribeckParameters], float], curve: StationaryCurve) -> float:
    """Standard deviation of an estimate due to the curve's covariance, by forward differences: bounds at 0 do not
    matter."""
    deviation = np.sqrt(np.maximum(np.diag(curve.covariance), 0.0))
    if not deviation.any():
        return 0.0
    values = curve.parameters.as_array()
    estimated = estimate(curve.parameters)
    gradient = np.zeros(values.size)
    for k in np.flatnonzero(deviation):
        moved = values.copy()
        moved[k] += _MOVED * deviation[k]
        gradient[k] = (estimate(StribeckParameters.from_array(moved)) - estimated) / (moved[k] - values[k])
    variance = float(gradient @ curve.covariance @ gradient)
    return math.sqrt(max(variance, 0.0)) if math.isfinite(variance) else math.inf


def _erring(courses: Sequence[FloatArray], curve: StationaryCurve) -> FloatArray:
    """Changes of torque [k, n] Nm by one standard deviation of the curve's parameters, in k independent directions.

    `courses` are the torque at the curve, and with each uncertain parameter moved by _MOVED of its deviation.
    """
    deviation = np.sqrt(np.maximum(np.diag(curve.covariance), 0.0))
    uncertain = np.flatnonzero(deviation)
    spread = deviation[uncertain]
    roots, vectors = np.linalg.eigh(curve.covariance[np.ix_(uncertain, uncertain)] / np.outer(spread, spread))
    changes = np.stack([course - courses[0] for course in courses[1:]]) / _MOVED
    return np.asarray((vectors * np.sqrt(np.maximum(roots, 0.0))).T @ changes)


class _Posed:
    """The fitting problem of a law and a curve to the sliding samples of a record: phase, speed, torque [n].

    `absorbed` [n, s] spans zero and shapes, orthonormal; `left` is the torque without it. The law's torque is computed in
    its periodic state, over a grid of phases.
    """

    def __init__(
        self,
        law: Law,
        cycle: Cycle,
        phase: FloatArray,
        measured: FloatArray,
        curve: StribeckParameters,
        steps: int = 1000,  # of a period
        fewest: int = 20,  # samples
    ) -> None:
        self.law, self.cycle, self.curve = law, cycle, curve
        speed = cycle.value(phase)
        rows = speed > 0.01 * float(speed.max())  # slower it sticks or is next to it, and no stationary test goes there
        if rows.sum() < fewest:
            raise ValueError(f"at least {fewest} samples must slide, got {int(rows.sum())}")
        self.phase, self.speed, self.measured = phase[rows], speed[rows], measured[rows]
        self.absorbed = absorbed_beside(self.speed, curve)
        self.left = self.without(self.measured)
        rough = np.diff(self.measured[np.argsort(self.speed)])
        # a first guess, for the gain's prior
        self.noise = max(
            1.4826 * float(np.median(np.abs(rough))) / math.sqrt(2), 1e-6 * float(np.abs(self.measured).max()), 1e-12
        )
        self._steps = steps
        self._start = round(steps * min(max(0.5, 5.0 * cycle.frequency), 12.0))
        grid = 2 * math.pi * np.arange(-self._start, steps + 1) / steps
        self._time = grid / (2 * math.pi * cycle.frequency)
        self._velocity = np.maximum(cycle.value(grid), 0.0)

    def at(self, lags: FloatArray) -> FloatArray:
        """Predicted torque [k, n] Nm at lags [k]."""
        courses = self.law.respond(self._time, self._velocity, self.curve, lags[:, np.newaxis])[:, self._start :]
        position = np.mod(self.phase, 2 * math.pi) * (self._steps / (2 * math.pi))
        cell = np.minimum(position.astype(np.int64), self._steps - 1)
        part = position - cell
        return np.asarray(courses[:, cell] * (1 - part) + courses[:, cell + 1] * part, dtype=np.float64)

    def about(self, lag: float) -> tuple[FloatArray, FloatArray]:
        """Predicted torque [n] Nm at a lag, and its derivative by the lag."""
        step = 1e-3 * lag
        low, middle, high = self.at(np.array([lag - step, lag, lag + step]))
        return middle, (high - low) / (2 * step)

    def without(self, column: FloatArray) -> FloatArray:
        """A column [n] without what the absorbed shapes explain."""
        return np.asarray(column - self.absorbed @ (self.absorbed.T @ column), dtype=np.float64)

    def gain(self, left: FloatArray) -> float:
        """The factor of a projected course that fits the torque best, shrunk towards 1."""
        weight = (self.noise / GAIN_SD) ** 2
        return float((left @ self.left + weight) / (left @ left + weight))

    def misfit(self, course: FloatArray) -> float:
        """-2 log likelihood x noise², profiled over gain, zero and shapes."""
        left = self.without(course)
        gain = self.gain(left)
        return float(np.square(self.left - gain * left).sum() + ((gain - 1) * self.noise / GAIN_SD) ** 2)

    def near_none(self, little: FloatArray | None = None) -> tuple[float, float]:
        """Standard deviation and estimate of the lag, signed, from the model linearised about no lag; `little` [n] Nm
        is the torque at the least lag."""
        least = self.law.lags[:1]
        still = torque(self.speed, self.curve)
        little = self.at(least)[0] if little is None else little
        base = self.without(still)
        change = self.without((little - still) / float(least[0]))
        residual = self.left - self.gain(base) * base
        orthogonal = change - base * float(base @ change) / float(base @ base)
        strength = max(float(orthogonal @ orthogonal), 1e-300)
        estimate = float(orthogonal @ residual) / strength
        return self._deviation(residual - estimate * orthogonal) / math.sqrt(strength), estimate

    def stepped(self, lag: float) -> tuple[float, FloatArray]:
        """The lag after one Gauss-Newton step, over its gain where the law is scaled, and the torque [n] Nm before the
        step."""
        course, change = self.about(lag)
        base, slope = self.without(course), self.without(change)
        gain = self.gain(base)
        orthogonal = slope - base * float(base @ slope) / float(base @ base)
        move = float(orthogonal @ (self.left - gain * base)) / (gain * max(float(orthogonal @ orthogonal), 1e-300))
        after = lag + move
        return after / self.gain(base + move * slope) if self.law.scaled else after, course

    def refined(self, misfits: list[float], best: int) -> float:
        """The lag of least misfit about the best of the scan, in log u: by three finer scans, each a ninth of the last,
        and a parabola."""
        lags = self.law.lags
        low = math.log(lags[max(best - 1, 0)])
        high = math.log(lags[min(best + 1, lags.size - 1)])
        optimum, least = math.log(lags[best]), misfits[best]
        for _ in range(3):
            points = np.linspace(low, high, 9)
            values = np.array([self.misfit(row) for row in self.at(np.exp(points))])
            i = int(np.argmin(values))
            if values[i] <= least:
                optimum, least = float(points[i]), float(values[i])
            width = (high - low) / 8
            if 0 < i < 8:
                left, here, right = values[i - 1 : i + 2]
                curvature = left - 2 * here + right
                if curvature > 0:
                    optimum = float(points[i] + 0.5 * width * (left - right) / curvature)
            low, high = optimum - width, optimum + width
        return math.exp(optimum)

    def deviation(self, lag: float, course: FloatArray, change: FloatArray, erring: FloatArray) -> tuple[float, float]:
        """Standard deviation of u at the optimum (of gain x u/gain where the law is scaled), and the gain there.

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
        along = np.array([-lag / gain if self.law.scaled else 0.0, 1.0])
        along_variance = max(float(along @ variance @ along), 0.0)
        return math.hypot(math.sqrt(along_variance), self._by_phase(slope, course, gain)), gain

    def _by_phase(self, slope: FloatArray, course: FloatArray, gain: float) -> float:
        """Standard deviation of u due to the speed's own noise: an error of the phase opens a curve into a loop."""
        order = np.argsort(np.mod(self.phase, 2 * math.pi))
        turned = np.empty_like(course)
        distinct = np.mod(self.phase[order], 2 * math.pi) + 1e-9 * np.arange(order.size)
        turned[order] = np.gradient(course[order], np.maximum.accumulate(distinct))
        shift = float(slope @ self.without(turned)) / (gain * max(float(slope @ slope), 1e-300))
        count, cycle = self.cycle.cosine.size, self.cycle
        lead = np.zeros(2 * count)
        lead[0], lead[count] = -cycle.sine[0], cycle.cosine[0]
        lead /= cycle.amplitude**2
        return abs(shift) * math.sqrt(max(float(lead @ cycle.covariance @ lead), 0.0))

    def _deviation(self, residual: FloatArray, taken: float = 0.0, blocks: int = 24) -> float:
        """Standard deviation of a sample; raised where the means over blocks of phase scatter more than white noise
        would make them.

        `taken` degrees of freedom were taken out of the residual beside what is absorbed.
        """
        taken += self.absorbed.shape[1] + 2
        free = max(residual.size - taken, 1)
        variance = float(residual @ residual) / free
        turn = np.mod(self.phase, 2 * math.pi)
        block = np.minimum((turn * (blocks / (2 * math.pi))).astype(np.int64), blocks - 1)
        count = np.bincount(block, minlength=blocks)
        total = np.bincount(block, weights=residual, minlength=blocks)
        filled = count > 0
        freedom = max(int(filled.sum()) - taken, 4)
        ratio = float((total[filled] ** 2 / count[filled]).sum()) / freedom / max(variance, 1e-300)
        return math.sqrt(variance * (ratio if ratio > 1 + NOT_WHITE * math.sqrt(2 / freedom) else 1.0))

    def result(self, course: FloatArray, lag: float | None, estimate: _Estimate, status: LagStatus) -> LagFit:
        """The fit at a lag [s], at which the law gives the torque `course` [n], with its log likelihood."""
        left = self.without(course)
        miss = float(np.square(self.left - self.gain(left) * left).sum())
        size = self.measured.size
        return LagFit(
            lag=lag,
            lag_sd=estimate.sd,
            interval=estimate.interval(),
            log_likelihood=-0.5 * size * math.log(max(miss, 1e-300) / size),
            status=status,
        )


def absorbed_beside(speed: FloatArray, curve: StribeckParameters, count: int = 6) -> FloatArray:
    """Orthonormal basis [n, s] of a constant and `count` single-valued shapes over speed [n], without their part along
    the curve."""
    span = max(float(speed.max()) - float(speed.min()), 1e-12)
    shapes = np.polynomial.chebyshev.chebvander(2 * (speed - speed.min()) / span - 1, count + 1)
    frame, _ = np.linalg.qr(np.column_stack([np.ones_like(speed), torque(speed, curve)]))
    shapes = shapes[:, 1:] - frame @ (frame.T @ shapes[:, 1:])
    vectors, sizes, _ = np.linalg.svd(shapes, full_matrices=False)
    absorbed = np.column_stack([np.full(speed.size, speed.size**-0.5), vectors[:, sizes > 1e-6 * sizes[0]]])
    return np.asarray(np.linalg.qr(absorbed)[0])
