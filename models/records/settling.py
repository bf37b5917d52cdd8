"""The settling transient of torque on a dwell, and from when on a mean may be taken.

After a step the torque settles like M(t) = M_inf + A exp(-t/τ): the attractor law dM/dt = C (1 - M/S) at constant S is
this with τ = S/C. M_inf, A and a drift beside fast transients are linear given τ, which is scanned; every dwell has its
own τ with a prior about the one that explains all dwells of the record together, because most steps of a test are too
small to determine τ by themselves.

The settling time is 4 τ: what is left of the transient then is 1.8 %.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records import criteria
from models.records.mean_deviation import Stretch, pooled_correlation


@dataclass(frozen=True, slots=True, kw_only=True)
class Transients:
    """Settling transients, one row a dwell: time_constant [n] s (nan where no transient is resolved), slowest [n] s its
    upper limit, amplitude [n] Nm at the dwell's start, amplitude_sd [n] Nm."""

    time_constant: FloatArray
    slowest: FloatArray
    amplitude: FloatArray
    amplitude_sd: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scan:
    gain: FloatArray  # [J] what A takes off the sum of squares
    total: FloatArray  # [J] what A and the drift, where there is one, take off it
    residual: FloatArray  # [m] at the best
    variance: float


def fit_transients(stretches: Sequence[Stretch], shortest: float) -> Transients:
    """The settling transient of every dwell. `shortest` [s] is a block."""
    longest = max(float(stretch.time[-1]) for stretch in stretches)
    longest_tau = max(min(2.0 * longest, 6.0), 4 * shortest)  # no longer than two dwells or 6 s
    taus = np.geomspace(shortest, longest_tau, 40)
    bases: dict[bytes, _Basis] = {}  # to the microsecond, most dwells have the same times
    scans = []
    for stretch in stretches:
        clock = np.round(stretch.time, 6).tobytes()
        if clock not in bases:
            if len(bases) == 4:
                bases.clear()
            bases[clock] = _basis(stretch.time, taus)
        scans.append(_scan(stretch, bases[clock]))
    correlation = pooled_correlation([scan.residual for scan in scans], removed=3)
    long_run = np.array([[scan.variance * correlation.factor(scan.residual.size)] for scan in scans])
    gain = np.stack([scan.gain for scan in scans]) / long_run
    drifts = taus < criteria.DRIFT_SHARE * np.array([[stretch.time[-1]] for stretch in stretches])
    worth = np.stack([scan.total for scan in scans]) / long_run - drifts  # a drift is worth 1 by chance
    place = np.log(taus)
    common = _common(worth, gain, place)
    rows = [
        _fitted_transient(stretch, place, worth[i], gain[i], float(long_run[i, 0]), common)
        for i, stretch in enumerate(stretches)
    ]
    tau, slowest, amplitude, deviation = np.array(rows).T
    return Transients(time_constant=tau, slowest=slowest, amplitude=amplitude, amplitude_sd=deviation)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Basis:
    decay: FloatArray  # [J, m] exp(-t/τ) free of its mean and, where torque may drift beside it, of its trend
    trend: FloatArray  # [m], unit
    square: FloatArray  # [J] of the decays
    drifts: NDArray[np.bool_]  # [J] whether torque may drift beside a transient so fast: τ < a sixth of the dwell


def _basis(time: FloatArray, taus: FloatArray) -> _Basis:
    """Decaying exponentials of these time constants, free of mean and of trend where they are short."""
    decay = np.exp(-time / taus[:, np.newaxis])
    decay -= decay.mean(axis=1, keepdims=True)
    trend = time - time.mean()
    trend /= max(float(np.sqrt(trend @ trend)), 1e-300)
    drifts = taus < criteria.DRIFT_SHARE * time[-1]
    decay -= np.where(drifts, decay @ trend, 0.0)[:, np.newaxis] * trend
    square = np.maximum(np.einsum("jk,jk->j", decay, decay), 1e-12)
    return _Basis(decay=decay, trend=trend, square=square, drifts=drifts)


def _scan(stretch: Stretch, basis: _Basis) -> _Scan:
    """For each time constant how much of a stretch's torque it explains, and the residual and variance of the best one."""
    off = stretch.torque - stretch.torque.mean()
    along = basis.decay @ off
    gain = along**2 / basis.square
    drift = np.where(basis.drifts, float(basis.trend @ off), 0.0)
    total = gain + drift**2
    best = int(total.argmax())
    residual = off - along[best] / basis.square[best] * basis.decay[best] - drift[best] * basis.trend
    floor = (1e-9 * max(float(np.abs(stretch.torque).max()), 1e-9)) ** 2
    variance = max(float(residual @ residual) / max(residual.size - 3, 1), floor)
    return _Scan(gain=gain, total=total, residual=residual, variance=variance)


def _common(
    worth: FloatArray, gain: FloatArray, place: FloatArray, most_spread: float = 0.5, cap: float = 1e3
) -> tuple[float, float] | None:
    """Common log τ of all dwells [n, J], and the standard deviation of one dwell's log τ about it; None where no
    transient is visible. A dwell counts for `cap` squared deviations at most."""
    share = np.minimum(cap / np.maximum(worth.max(axis=1), cap), 1.0)
    together = share @ worth
    dwells = worth.shape[0]
    if share @ gain[:, together.argmax()] - dwells <= 5.0 * np.sqrt(2.0 * dwells):
        return None
    peaks = np.array([_peak(row, place) for row in worth])
    visible = gain[np.arange(dwells), worth.argmax(axis=1)] > criteria.OWN_GAIN
    determined = peaks[visible & (peaks[:, 1] < most_spread)]
    centre = _peak(together, place)[0]
    if determined.shape[0] < 8:
        return centre, most_spread
    # The median of a squared normal variable is 0.455 of its variance.
    beyond = float(np.median((determined[:, 0] - centre) ** 2)) / 0.455 - float(np.median(determined[:, 1] ** 2))
    return centre, min(max(float(np.sqrt(max(beyond, 0.0))), 0.1), most_spread)


def _peak(worth: FloatArray, place: FloatArray) -> tuple[float, float]:
    """Position of the maximum of worth [J], in squared deviations, over place [J], by a parabola; and its standard
    deviation."""
    best, step = int(worth.argmax()), float(place[1] - place[0])
    if not 0 < best < worth.size - 1:
        return float(place[best]), 1.0
    left, middle, right = (float(height) for height in worth[best - 1 : best + 2])
    curvature = left - 2 * middle + right
    if curvature >= 0:
        return float(place[best]), 1.0
    return float(place[best]) + 0.5 * (left - right) / curvature * step, min(step * float(np.sqrt(-2 / curvature)), 1.0)


def _fitted_transient(
    stretch: Stretch,
    place: FloatArray,
    worth: FloatArray,
    gain: FloatArray,
    long_run: float,
    common: tuple[float, float] | None,
) -> tuple[float, float, float, float]:
    """Time constant τ [s] of a dwell's transient and its upper limit [s], both NaN where it determines none, amplitude A
    [Nm] and its standard deviation.

    `gain` [J] and `worth` [J]: how much A alone, and A with a drift, take off the sum of squares at each ln τ of `place`
    [J], in variances `long_run` of the noise; `common`: mean and deviation of the prior of ln τ from all dwells."""
    if common is None and gain[worth.argmax()] < criteria.OWN_GAIN:
        return np.nan, np.nan, 0.0, 0.0
    penalty = 0.0 if common is None else ((place - common[0]) / common[1]) ** 2
    at, deviation = _peak(worth - penalty, place)
    tau = float(np.exp(at))
    decay = _basis(stretch.time, np.array([tau])).decay[0]
    square = max(float(decay @ decay), 1e-12)
    slowest = tau * float(np.exp(criteria.LATE * deviation))
    return tau, slowest, float(decay @ stretch.torque) / square, float(np.sqrt(long_run / square))


def dropped(transients: Transients, duration: FloatArray, deviation: FloatArray) -> FloatArray:
    """Time [n] s to drop from the start of each dwell: from then on the transient shifts the mean by < 0.1 of its
    deviation.

    duration [n] s of the dwells, deviation [n] Nm of a mean over the whole of each. At most three quarters are dropped.
    """
    share = np.linspace(0.05, criteria.MOST_DROPPED, 71)  # shares of a dwell
    size, wide = np.abs(transients.amplitude), criteria.LATE * transients.amplitude_sd
    shift = np.zeros((duration.size, share.size))
    for amplitude, tau in ((size + wide, transients.time_constant), (size, transients.slowest)):
        left = mean_decay(tau[:, np.newaxis], share * duration[:, np.newaxis], duration[:, np.newaxis])
        shift = np.maximum(shift, amplitude[:, np.newaxis] * left)
    small = shift <= 0.1 * deviation[:, np.newaxis] / np.sqrt(1 - share)
    small[np.isnan(transients.time_constant)] = True
    return np.asarray(np.where(small.any(axis=1), share[small.argmax(axis=1)], criteria.MOST_DROPPED) * duration)


def mean_decay(tau: FloatArray, start: FloatArray, stop: FloatArray) -> FloatArray:
    """Mean of exp(-t/τ) over start..stop."""
    return np.asarray(tau * (np.exp(-start / tau) - np.exp(-stop / tau)) / (stop - start))
