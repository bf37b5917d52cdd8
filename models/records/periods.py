"""Whole periods of a record whose speed swings periodically.

A dynamic Stribeck test holds the pressure and swings the speed, 15 s at 0.1 Hz a pressure: one and a half periods. A
loop closes after whole periods only, so half a period must be left out; the *last* whole periods are kept, for the
first half holds the start. The swing is fitted by

    v(t) = v_0 + Σ_h a_h cos hθ + b_h sin hθ,    θ = 2π f (t - t_0),    h = 1 ... 4, or up to 32 where ramps have corners

with f free (Gauss-Newton on all of the level's samples, outliers left out), so that neither an even clock, nor a certain
rate, nor a whole number of samples a period is needed.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, section 2.3.4.
"""

import math
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.records import criteria
from models.records.outliers import beside, leading, near, running_median

#: Steps of a fit, at most.
_STEPS = 25
#: The frequency is refined to so much of 1/duration at last.
_EXACT = 1e-10
#: A speed that a curve misses by so much of its amplitude does not swing; nor one with a larger share of samples off it.
_MISS, _OFF = 0.15, 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """A fitted periodic swing: frequency [Hz], origin t_0 [s], mean v_0, cosine and sine [h], in the fitted quantity's
    unit.

    `covariance` [2h, 2h] is that of (cosine, sine) with f free; `noise` the deviation of a sample; the swing begins at
    `begin` [s], its last whole periods are those of start <= t < stop [s]; `outliers` samples were left out.
    """

    frequency: float
    origin: float
    mean: float
    cosine: FloatArray
    sine: FloatArray
    covariance: FloatArray
    noise: float
    periods: int
    begin: float
    start: float
    stop: float
    outliers: int

    @property
    def amplitude(self) -> float:
        """Amplitude of the first harmonic."""
        return math.hypot(float(self.cosine[0]), float(self.sine[0]))

    def phase(self, time: FloatArray) -> FloatArray:
        """Phase θ [n] rad at time [n] s."""
        return 2 * math.pi * self.frequency * (time - self.origin)

    def value(self, phase: FloatArray) -> FloatArray:
        """Fitted value v [n] at phase [n] rad."""
        basis = harmonics(phase, self.cosine.size)
        return np.asarray(self.mean + basis @ np.concatenate([self.cosine, self.sine]), dtype=np.float64)

    def gradient(self, phase: FloatArray) -> FloatArray:
        """Derivative dv/dθ [n] at phase [n] rad; dv/dt is 2πf times that."""
        order = np.arange(1, self.cosine.size + 1)
        basis = harmonics(phase, self.cosine.size)
        return np.asarray(basis @ np.concatenate([order * self.sine, -order * self.cosine]), dtype=np.float64)


def harmonics(phase: FloatArray, count: int) -> FloatArray:
    """Design matrix [n, 2 count] of cos hθ and sin hθ for h = 1 ... count, cosines first."""
    turn = np.exp(1j * phase)
    powers = np.empty((phase.size, count), dtype=np.complex128)
    power = np.ones_like(turn)
    for h in range(count):
        power = power * turn
        powers[:, h] = power
    return np.concatenate([powers.real, powers.imag], axis=1)


def sample_interval(time: FloatArray) -> float:
    """The median distance of two samples [s], 0 for a single one."""
    return float(np.median(np.diff(time))) if time.size > 1 else 0.0


def fit_cycle(time: FloatArray, value: FloatArray) -> Cycle | str:
    """The swing of value [n] over time [n] s (ascending), and its last whole periods; a sentence where there is none.

    SPEED_HARMONICS harmonics for a motor commanded to follow a sine, more for motions with corners.
    """
    moving = _without_rest(time, value, float(time[-1] - time[0])) if time.size else slice(0)
    t, y = time[moving], value[moving]
    if t.size < 4 * (2 * criteria.SPEED_HARMONICS + 2) or t[-1] <= t[0]:
        return f"The speed moves for {t.size} samples only: too few for a period."
    if not (np.ptp(y) > 0 and np.isfinite(np.ptp(y))):
        return "The speed does not move."
    fitted = _refine(t, y, _coarse_frequency(t, y), 1, 1e-3)
    if not isinstance(fitted, str):
        moving = _without_rest(t, y, min(1 / fitted.frequency, float(t[-1] - t[0])))
        t, y = t[moving], y[moving]
        fitted = _without_ends(t, y, fitted.frequency, criteria.SPEED_HARMONICS)
    if isinstance(fitted, str):
        return fitted
    if not fitted.noise < _MISS * fitted.amplitude:
        miss = fitted.noise / max(fitted.amplitude, 1e-3 * fitted.noise, 1e-300)
        return (
            f"The speed does not swing periodically: a periodic curve misses it by {100 * miss:.3g} % of its amplitude "
            f"(RMS; {100 * _MISS:g} % is the limit)."
        )
    if fitted.outliers > _OFF * t.size:
        return (
            f"The speed does not swing periodically: {100 * fitted.outliers / t.size:.3g} % of the samples lie off the "
            f"periodic curve ({100 * _OFF:g} % is the limit)."
        )
    return _with_corners(t, y, fitted)


def _without_ends(time: FloatArray, value: FloatArray, frequency: float, count: int) -> Cycle | str:
    """A fit of `count` harmonics to the part of the record that follows the swing."""
    fitted: Cycle | str = ""
    for _ in range(6):  # ends that do not swing
        fitted = _refine(time, value, frequency, count, _EXACT)
        if isinstance(fitted, str):
            return fitted
        following = _following(time, value, fitted)
        if following == slice(0, time.size):
            break
        frequency, time, value = fitted.frequency, time[following], value[following]
    return fitted


def _with_corners(time: FloatArray, value: FloatArray, cycle: Cycle) -> Cycle:
    """The cycle refitted with more harmonics, as long as these reduce the residual substantially: ramps have corners, a
    sine has none."""
    step = max(1, time.size // 8000)
    time, value = time[::step], value[::step]
    inside = (time >= cycle.begin) & (time < cycle.stop)
    t, y = time[inside], value[inside]
    most = t.size / (3 * max((t[-1] - t[0]) * cycle.frequency, 1.0))
    richer = cycle
    for count in criteria.CORNERS:
        if richer.noise < 0.002 * cycle.amplitude or count > most or t.size < 4 * (2 * count + 2):
            break
        refined = _refine(t, y, richer.frequency, count, _EXACT)
        if isinstance(refined, str) or refined.noise > criteria.TAKEN * richer.noise:
            break
        richer = refined
    if richer is cycle:
        return cycle
    # a corner at an end may have been cut off as no part of the swing
    trimmed = _without_ends(time, value, richer.frequency, richer.cosine.size)
    return richer if isinstance(trimmed, str) or trimmed.noise > richer.noise / criteria.TAKEN else trimmed


def _following(time: FloatArray, value: FloatArray, cycle: Cycle) -> slice:
    """Slice of the samples without the ends that do not follow the swing: holds between two pressures, the way to where
    the next begins."""
    residual = value - cycle.value(cycle.phase(time))
    usual = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
    smooth = running_median(residual, criteria.NEIGHBOURS)
    off = np.abs(smooth) > max(criteria.OUTLIER * usual, 0.02 * cycle.amplitude)  # it does not swing yet, or no more
    before, after = leading(off), leading(off[::-1])
    return slice(before, off.size - after) if before + after < off.size else slice(0, off.size)


def _without_rest(time: FloatArray, value: FloatArray, period: float) -> slice:
    """Slice of the samples without standstill before and after, if that is no longer than a swing of this period [s]
    may rest."""
    smooth = running_median(value, 3)
    swing, noise = float(np.ptp(smooth)), float(np.median(np.abs(value - smooth)))
    least = min(0.02 * swing + 4 * noise, 0.05 * swing)
    # the share of a period that a sine spends so near an end of its swing, where the record begins or stops there
    lingers = 1.6 * math.acos(1 - 2 * least / swing) / (2 * math.pi) if swing > 0 else criteria.REST_SHARE
    lowest, still = float(smooth.min()), max(4 * noise, 1e-3 * swing)

    def rest(course: FloatArray, passed: FloatArray) -> int:
        """Samples of the course that stand still at its beginning, `passed` [n] s being its clock."""
        off = np.abs(course - course[0])
        inside = 0.1 * swing < course[0] - lowest < 0.9 * swing
        moved = np.flatnonzero(off > least)
        # away from the swing's ends 2 % of the record
        longest = 0.02 * (time[-1] - time[0]) if inside else min(criteria.REST_SHARE, lingers) * period
        if not moved.size or passed[moved[0]] <= longest:
            return 0
        return int(moved[0]) if inside else int(np.flatnonzero(off[: moved[0]] <= still)[-1]) + 1

    start, after = rest(smooth, time - time[0]), rest(smooth[::-1], (time[-1] - time)[::-1])
    return slice(start, time.size - after) if start + after < time.size else slice(0, time.size)


def _coarse_frequency(time: FloatArray, value: FloatArray) -> float:
    """Coarse frequency [Hz] of the swing, by the periodogram's peak and then the best sine about it: within a twentieth
    of 1/duration."""
    duration = float(time[-1] - time[0])
    points = int(min(4096, max(64, time.size)))
    grid = np.linspace(0.0, duration, points)
    y = np.interp(grid, time - time[0], running_median(value, 5))
    power = np.abs(np.fft.rfft(y - y.mean(), 4 * points)) ** 2
    frequencies = np.fft.rfftfreq(4 * points, grid[1])
    peak = float(frequencies[np.argmax(np.where(frequencies >= 0.5 / duration, power, 0.0))])
    step = max(1, points // 1024) if peak * duration < 100 else 1
    candidates = np.linspace(peak - 0.8 / duration, peak + 0.8 / duration, 65)
    candidates = candidates[candidates > 0.4 / duration]
    return float(candidates[int(np.argmax(_explained(grid[::step], y[::step], candidates)))])


def _explained(time: FloatArray, value: FloatArray, frequencies: FloatArray) -> FloatArray:
    """Sum of squares of value [n] explained by a mean and a sine of each frequency [m] Hz: [m]."""
    turn = np.exp(2j * math.pi * frequencies[:, np.newaxis] * time)
    once, twice, along = turn.sum(axis=1), (turn**2).sum(axis=1), turn @ value
    gram = np.empty((frequencies.size, 3, 3))
    gram[:, 0, 0] = time.size
    gram[:, 0, 1] = gram[:, 1, 0] = once.real
    gram[:, 0, 2] = gram[:, 2, 0] = once.imag
    gram[:, 1, 1], gram[:, 2, 2] = 0.5 * (time.size + twice.real), 0.5 * (time.size - twice.real)
    gram[:, 1, 2] = gram[:, 2, 1] = 0.5 * twice.imag
    projected = np.stack([np.full(frequencies.size, value.sum()), along.real, along.imag], axis=1)
    solved = np.linalg.solve(gram + 1e-12 * time.size * np.eye(3), projected[..., np.newaxis])[..., 0]
    return np.asarray((projected * solved).sum(axis=1), dtype=np.float64)


def _refine(time: FloatArray, value: FloatArray, frequency: float, count: int, tolerance: float) -> Cycle | str:
    """The swing by Gauss-Newton on frequency, mean and `count` harmonics, iterated until the frequency moves by less
    than `tolerance`/duration; a sentence where it fails. Outliers are determined again in the first steps."""
    origin, duration = 0.5 * float(time[0] + time[-1]), float(time[-1] - time[0])
    order, highest = np.arange(1, count + 1), 0.5 / max(sample_interval(time), 1e-12)
    keep, steady = np.ones(time.size, dtype=np.bool_), beside(value)
    coefficients: FloatArray = np.zeros(2 * count + 1)
    gram: FloatArray = np.zeros((0, 0))
    residual: FloatArray = value
    for step in range(_STEPS):
        basis = harmonics(2 * math.pi * frequency * (time - origin), count)
        design = np.column_stack([np.ones_like(time), basis])
        design_kept = design[keep]
        coefficients = np.asarray(
            np.linalg.lstsq(design_kept.T @ design_kept, design_kept.T @ value[keep], rcond=None)[0], dtype=np.float64
        )
        cosine, sine = coefficients[1 : count + 1], coefficients[count + 1 :]
        slope = basis @ np.concatenate([order * sine, -order * cosine])
        by_frequency = 2 * math.pi * (time - origin) / duration * slope  # per cycle over the record
        residual = np.asarray(value - design @ coefficients, dtype=np.float64)
        full = np.column_stack([design, by_frequency])[keep]
        gram = full.T @ full
        move = float(np.linalg.lstsq(gram, full.T @ residual[keep], rcond=None)[0][-1])
        frequency += float(np.clip(move, -0.2, 0.2)) / duration
        if not 0.2 / duration < frequency < highest:
            return "The speed does not swing periodically."
        if step < 4:
            keep = near(residual, value) | steady
        elif abs(move) < tolerance:
            break
    interval = sample_interval(time)
    sampled = (float(time[-1] - time[0]) + interval) * frequency
    periods = math.floor(sampled + 1 - 0.99)  # a fit of harmonics bridges the last 1 %
    if periods < 1:
        return f"No whole period: {sampled:.2f} periods of {1 / frequency:.4g} s were recorded."
    noise = math.sqrt(float((residual[keep] ** 2).sum()) / max(int(keep.sum()) - 2 * count - 2, 1))
    inverse = np.asarray(np.linalg.pinv(gram, hermitian=True), dtype=np.float64)
    stop = float(time[-1]) + 0.5 * interval
    return Cycle(
        frequency=frequency,
        origin=origin,
        mean=float(coefficients[0]),
        cosine=coefficients[1 : count + 1],
        sine=coefficients[count + 1 :],
        covariance=inverse[1:-1, 1:-1] * noise**2,
        noise=noise,
        periods=periods,
        begin=float(time[0]),
        start=stop - periods / frequency,
        stop=stop,
        outliers=int((~keep).sum()),
    )
