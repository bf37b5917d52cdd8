"""Raw torque made ready for a search of swings: freed of everything slow, and its noise whitened.

    torque = smooth spline + x,    A(L) x / σ ~ white noise of deviation 1

A is an autoregression estimated from the record's own spectrum (above what the spline absorbs), σ the local deviation of
A(L) x. A swing s(t) of unknown size and phase is then looked for by its matched filter,

    D = Σ s* A(1/L) [A(L) x / σ²],    N = Σ |A(ω) s|² / σ²,    |D|²/N ~ exponential of mean 1 where there is none.

The spline's knots are so close that no friction curve passed at the record's pace leaves anything above its cut-off.

Pieces of a record are analysed that have no gaps, one pressure and no reversal of the speed.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.linalg import solve_toeplitz
from scipy.ndimage import uniform_filter1d

from models.arrays import FloatArray
from models.records.cleaning import UnusableRecordError, clean
from models.records.criteria import LEVEL_GAP, LEVEL_GAP_SHARE
from models.records.pressure_levels import pressure_stretches
from models.records.runs import Record

#: A piece holds at least so many samples, means of several where the record is fast.
FEWEST_SAMPLES = 48
#: The lowest frequency that the spline leaves untouched [cycles between knots]; the highest, as a share [-] of the rate.
LOWEST_CYCLES, HIGHEST_SHARE = 1.25, 0.45
#: A speed that goes this share [-] of its highest the other way reverses.
REVERSES = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordPiece:
    """A piece of a record, consecutive samples [n]: time [s], speed [rad/s], torque [Nm]."""

    time: FloatArray
    speed: FloatArray
    torque: FloatArray


def pieces_of(record: Record, spans: FloatArray | None, period: float, count: int) -> list[RecordPiece]:
    """Pieces of a record with a sample every `period` [s], as means of `count` samples each; within spans [k, 2] s
    where they are given, else where its pressure is constant."""
    turned = round(1.0 / period)  # torque has settled 1 s after
    return [
        _averaged(record, first, stop, count)
        for begin, end in _without_gaps(record, spans, period)
        for first, stop in _one_direction(record.speed, begin, end, turned)
        if (stop - first) * period >= 1.0 and stop - first >= FEWEST_SAMPLES * count
    ]


def _without_gaps(record: Record, spans: FloatArray | None, period: float) -> Iterator[tuple[int, int]]:
    """Row ranges [first, stop) of the spans, split at gaps in the record."""
    gaps = (np.flatnonzero(np.diff(record.time) > 5 * period) + 1).tolist()  # samples that may be missing in a row
    if spans is None:
        for first, stop in itertools.pairwise([0, *gaps, record.time.size]):
            yield from _at_one_pressure(record, first, stop)
        return
    for first, stop in (np.searchsorted(record.time, span) for span in spans):
        inside = [gap for gap in gaps if first < gap < stop]
        yield from itertools.pairwise([int(first), *inside, int(stop)])


def _at_one_pressure(record: Record, first: int, stop: int) -> Iterator[tuple[int, int]]:
    """Row ranges of constant pressure within [first, stop), which has no gaps."""
    if stop - first < FEWEST_SAMPLES:
        return
    pressure = record.pressure[first:stop]
    usual = float(np.median(pressure))
    low, high = np.quantile(pressure, (0.005, 0.995))
    if high - low <= max(LEVEL_GAP, LEVEL_GAP_SHARE * abs(usual)):
        yield first, stop
        return
    for stretch in pressure_stretches(record.time[first:stop], pressure):
        yield first + stretch.start, first + stretch.stop


def _one_direction(speed: FloatArray, first: int, stop: int, turned: int) -> Iterator[tuple[int, int]]:
    """Row ranges [first, stop) between reversals of the speed, each from `turned` rows after the reversal on: where the
    clutch reverses the torque jumps, at the same angle of the shaft each time, which would pass for a ripple."""
    part = speed[first:stop]
    if min(part.max(initial=0.0), -part.min(initial=0.0)) <= REVERSES * np.abs(part).max(initial=0.0):
        yield first, stop
        return
    turns = np.flatnonzero(np.diff(np.signbit(part))) + 1
    yield first, first + int(turns[0])
    for begin, end in itertools.pairwise([*turns.tolist(), part.size]):
        yield first + begin + turned, first + end


def _averaged(record: Record, first: int, stop: int, count: int) -> RecordPiece:
    """A piece of the rows [first, stop), as means of `count` each."""
    stop = first + (stop - first) // count * count
    time, speed, torque = (channel[first:stop] for channel in (record.time, record.speed, record.torque))
    if count > 1:
        time, speed, torque = (channel.reshape(-1, count).mean(axis=1) for channel in (time, speed, torque))
    return RecordPiece(time=time, speed=speed, torque=torque)


@dataclass(frozen=True, slots=True, kw_only=True)
class WhitenedRecord:
    """Whitened torque of a record's pieces, samples [n], concatenated."""

    time: FloatArray  # [s]
    speed: FloatArray  # [rad/s]
    torque: FloatArray  # [Nm], the spline's
    matched: FloatArray  # A(1/L) [A(L) x/σ²]
    weight: FloatArray  # 1/σ²
    starts: tuple[int, ...]  # the pieces' first samples, and n
    step: float  # the sample interval [s]
    lowest: float  # bounds the frequencies that can be seen [Hz], as `highest` does
    gain: FloatArray  # |A|² evenly from 0 to half the rate

    @property
    def highest(self) -> float:
        return HIGHEST_SHARE / self.step

    def response(self, frequency: FloatArray) -> FloatArray:
        """Squared gain |A|² of the whitening filter at frequencies [Hz] up to half the rate; beyond, the last value."""
        place = frequency * (2 * (self.gain.size - 1) * self.step)
        return np.asarray(self.gain[np.minimum(place, self.gain.size - 1).astype(np.intp)])


def whitened_record(record: Record, spans: FloatArray | None = None) -> WhitenedRecord | None:
    """Whitened torque of a record, within spans [k, 2] s where they are given, else where its pressure is constant;
    None where it holds too few samples, or samples too far apart."""
    try:
        cleaned, period, _ = clean(record)
    except UnusableRecordError:
        return None
    count = max(1, int(1.0 / (250.0 * period)))  # averaged down to about 250 Hz
    step = count * period
    pieces = pieces_of(cleaned, spans, period, count)
    if not pieces:
        return None
    # knots are closer than 0.25 s and a fortieth of the speed's own period
    spacing = min(0.25, *((1 / 40) * _speed_period(piece.speed, step) for piece in pieces))
    between = round(spacing / step)
    # with fewer than five samples between knots the spline leaves nothing
    if between < 5 or not LOWEST_CYCLES / (between * step) < HIGHEST_SHARE / step:
        return None
    averaged_out = cleaned.torque[: cleaned.torque.size // count * count].reshape(-1, count).var(axis=1).mean()
    steps = np.abs(np.diff(cleaned.torque[:5000]))
    counts = steps[steps > 1e-9 * float(np.abs(cleaned.torque).max())]
    # noise of less than 0.45 counts does not blur the recorder's steps, which then look like a swing
    blurred = (0.45 * float(counts.min(initial=np.inf))) ** 2 if counts.size else 0.0
    return _whitened(pieces, step, between, blurred - float(averaged_out))


def _speed_period(speed: FloatArray, step: float) -> float:
    """The period [s] of the strongest oscillation of a speed; infinite where it is constant."""
    window = np.hanning(speed.size)
    power = np.abs(np.fft.rfft((speed - speed.mean()) * window))
    if 2 * power.max() <= 0.05 * np.abs(speed).max() * window.sum():  # an encoder's noise is no oscillation
        return np.inf
    return float(speed.size * step / max(1, int(power.argmax())))


def _whitened(pieces: Sequence[RecordPiece], step: float, between: int, least_variance: float) -> WhitenedRecord | None:
    """Pieces whitened by a common autoregression; None where noise is too small beside the recorder's steps (its median
    variance at most `least_variance` [Nm²])."""
    from scipy.signal import lfilter  # start-up time

    smooth = [_spline(piece.torque, between) for piece in pieces]
    fast = [piece.torque - slow for piece, slow in zip(pieces, smooth, strict=True)]
    largest = max(float(np.abs(piece.torque).max()) for piece in pieces)
    deviations = [float(series.std()) for series in fast]
    if not (min(deviations) > 1e-9 * largest and float(np.median(deviations)) ** 2 > least_variance):
        return None
    scaled = [series / deviation for series, deviation in zip(fast, deviations, strict=True)]
    polynomial = _autoregression(scaled, 1.0 / between)
    innovations = [lfilter(polynomial, 1.0, series) for series in fast]
    usual = float(np.median([np.square(series[polynomial.size :]).mean() for series in innovations]))
    least = 0.25 * usual  # a coarse recorder may write one value for long
    if not least > 0:
        return None
    # the local deviation is that of 2 s
    weights = [_weight(series, polynomial.size, round(2.0 / step), least) for series in innovations]
    matched = [
        lfilter(polynomial, 1.0, (series * weight)[::-1])[::-1]
        for series, weight in zip(innovations, weights, strict=True)
    ]
    return WhitenedRecord(
        time=np.concatenate([piece.time for piece in pieces]),
        speed=np.concatenate([piece.speed for piece in pieces]),
        torque=np.concatenate(smooth),
        matched=np.concatenate(matched),
        weight=np.concatenate(weights),
        starts=tuple(np.cumsum([0, *(series.size for series in fast)]).tolist()),
        step=step,
        lowest=LOWEST_CYCLES / (between * step),
        gain=np.asarray(np.abs(np.fft.rfft(polynomial, 2 * 512)) ** 2, dtype=np.float64),
    )


def _weight(innovations: FloatArray, order: int, local: int, least: float) -> FloatArray:
    """Weights 1/σ² [n] of innovations [n] by their local variance, 0 for the first `order`, which lack their past."""
    squares = innovations**2
    squares[:order] = squares[order:].mean()
    squares = np.minimum(squares, 12.0 * squares.mean())
    weight = 1.0 / np.maximum(uniform_filter1d(squares, min(local, innovations.size), mode="reflect"), least)
    weight[:order] = 0.0
    return np.asarray(weight, dtype=np.float64)


def _spline(torque: FloatArray, between: int) -> FloatArray:
    """The cubic spline through torque [n] with a knot every `between` samples."""
    place = np.arange(torque.size, dtype=np.float64)
    inner = max(0, round(torque.size / between) - 1)
    knots = np.concatenate([np.zeros(4), np.linspace(0, place[-1], inner + 2)[1:-1], np.full(4, place[-1])])
    return np.asarray(make_lsq_spline(place, torque, knots, 3)(place), dtype=np.float64)


def _autoregression(series: Sequence[FloatArray], lowest: float) -> FloatArray:
    """Coefficients A [p + 1] of an autoregression (Yule-Walker) for series whose spectrum is continued flat below
    `lowest` [cycles a sample]."""
    size = min(256, min(part.size for part in series))
    window = np.hanning(size)
    segments = [part[first : first + size] for part in series for first in range(0, part.size - size + 1, size // 2)]
    power = np.mean(np.abs(np.fft.rfft(np.array(segments) * window, axis=1)) ** 2, axis=0)
    edge = max(1, int(np.ceil(lowest * size)))
    power[:edge] = power[edge : max(edge + 2, round(1.6 * edge))].mean()
    covariance = np.fft.irfft(power)[: 6 + 1]
    covariance[0] *= 1 + 1e-9
    return np.concatenate([[1.0], -solve_toeplitz(covariance[:-1], covariance[1:])])
