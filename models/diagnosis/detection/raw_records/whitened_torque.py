"""Raw torque made ready for a search of what swings in it: free of what is slow, and its noise whitened.

    torque = smooth spline + x,    A(L) x / σ ~ white noise of deviation 1

A is an autoregression learnt from the record's own spectrum (above what the spline takes up), σ the local deviation of
A(L) x. A swing s(t) of unknown size and phase is then looked for by its matched filter,

    D = Σ s* A(1/L) [A(L) x / σ²],    N = Σ |A(ω) s|² / σ²,    |D|²/N ~ exponential of mean 1 where there is none.

The spline's knots are so close that no friction curve passed at the record's pace leaves anything above its cut-off.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_lsq_spline
from scipy.linalg import solve_toeplitz
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.records.cleaning import clean
from models.records.criteria import LEVEL_GAP, LEVEL_GAP_SHARE
from models.records.pressure_stretches import pressure_stretches
from models.records.runs import Record

#: A speed that goes this share of its highest the other way reverses; torque has settled so long [s] after.
REVERSES, TURNED = 0.03, 1.0
#: Samples that may be missing in a row.
GAP = 5
#: Records are averaged down to about this rate [Hz].
RATE = 250.0
#: The spline's knots lie so far apart at most [s], and this share of a swing of the speed.
KNOTS, KNOTS_SHARE = 0.25, 1 / 40
#: Samples between knots at least; with fewer nothing is left to be looked at.
FEWEST_BETWEEN = 5
#: What the spline does not touch, in cycles between knots; and the highest frequency as a share of the rate.
ABOVE, BELOW = 1.25, 0.45
#: A piece is this long at least: seconds, samples.
SHORTEST, FEWEST = 1.0, 48
#: Order of the autoregression; samples of a spectrum that it is learnt from.
MEMORY, SEGMENT = 6, 256
#: Points at which its gain is kept.
GAINS = 512
#: Time [s] over which the local deviation is taken.
LOCAL = 2.0
#: Squares count for this many of the usual at most where the local deviation is taken.
LARGEST_SQUARE = 12.0
#: No part of a record is taken for quieter than this share of the usual: a coarse recorder may write one value for long.
QUIETEST = 0.25
#: Noise of less than this share of the recorder's count does not blur its steps, which then look like swings.
BLURRED, COUNTED = 0.45, 5000
#: A speed that swings by less than this share of its highest stands.
STANDS = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Swings:
    """The samples of a record's pieces, one after the other: time [n] s, speed [n] rad/s, torque [n] Nm (the spline's).

    matched [n] is A(1/L) [A(L) x/σ²], weight [n] 1/σ²; `starts` are the pieces' first samples and n. `step` [s] is the
    usual interval, `slowest` and `fastest` [Hz] bound what can be seen, `gain` is |A|² evenly
    from 0 to half the rate.
    """

    time: FloatArray
    speed: FloatArray
    torque: FloatArray
    matched: FloatArray
    weight: FloatArray
    starts: tuple[int, ...]
    step: float
    slowest: float
    gain: FloatArray

    @property
    def fastest(self) -> float:
        return BELOW / self.step

    def response(self, frequency: FloatArray) -> FloatArray:
        """|A|² at frequencies [Hz] up to half the rate; what is beyond is given the last value."""
        place = frequency * (2 * (self.gain.size - 1) * self.step)
        return np.asarray(self.gain[np.minimum(place, self.gain.size - 1).astype(np.intp)])


def swings(record: Record, spans: FloatArray | None = None) -> Swings | None:
    """Of a record, within spans [k, 2] s where they are given, else where its pressure stands; None where it holds too
    little, or samples too far apart."""
    try:
        cleaned, period, _ = clean(record)
    except ValueError:
        return None
    count = max(1, int(1.0 / (RATE * period)))
    step = count * period
    pieces = [
        _averaged(cleaned, first, stop, count)
        for begin, end in _whole(cleaned, spans, period)
        for first, stop in _one_way(cleaned.speed, begin, end, round(TURNED / period))
        if (stop - first) * period >= SHORTEST and stop - first >= FEWEST * count
    ]
    if not pieces:
        return None
    spacing = min(KNOTS, *(KNOTS_SHARE * _pace(speed, step) for _, speed, _ in pieces))
    between = round(spacing / step)
    if between < FEWEST_BETWEEN or not ABOVE / (between * step) < BELOW / step:
        return None
    within = cleaned.torque[: cleaned.torque.size // count * count].reshape(-1, count).var(axis=1).mean()
    return _whitened(pieces, step, between, (BLURRED * _count(cleaned.torque)) ** 2 - float(within))


def _count(torque: FloatArray) -> float:
    """The least step [Nm] of what was written down."""
    moved = np.abs(np.diff(torque[:COUNTED]))
    moved = moved[moved > 1e-9 * float(np.abs(torque).max())]
    return float(moved.min()) if moved.size else 0.0


def _whole(record: Record, spans: FloatArray | None, period: float) -> Iterator[tuple[int, int]]:
    """Rows [first, stop) without gaps."""
    gaps = (np.flatnonzero(np.diff(record.time) > GAP * period) + 1).tolist()
    for first, stop in itertools.pairwise([0, *gaps, record.time.size]):
        if spans is None:
            yield from _at_one_pressure(record, first, stop)
    if spans is None:
        return
    for first, stop in (np.searchsorted(record.time, span) for span in spans):
        inside = [gap for gap in gaps if first < gap < stop]
        yield from itertools.pairwise([int(first), *inside, int(stop)])


def _at_one_pressure(record: Record, first: int, stop: int) -> Iterator[tuple[int, int]]:
    """Rows of [first, stop), which have no gaps, in which pressure stands."""
    if stop - first < FEWEST:
        return
    pressure = record.pressure[first:stop]
    usual = float(np.median(pressure))
    low, high = np.quantile(pressure, (0.005, 0.995))
    if high - low <= max(LEVEL_GAP, LEVEL_GAP_SHARE * abs(usual)):
        yield first, stop
        return
    for each in pressure_stretches(record.time[first:stop], pressure):
        yield first + each.start, first + each.stop


def _one_way(speed: FloatArray, first: int, stop: int, turned: int) -> Iterator[tuple[int, int]]:
    """Rows of [first, stop) between reversals of the speed, `turned` after each: where the clutch turns over torque jumps,
    at the same angle of the shaft each time, and that is no swing."""
    own = speed[first:stop]
    if min(own.max(initial=0.0), -own.min(initial=0.0)) <= REVERSES * np.abs(own).max(initial=0.0):
        yield first, stop
        return
    turns = np.flatnonzero(np.diff(np.signbit(own))) + 1
    yield first, first + int(turns[0])
    for begin, end in itertools.pairwise([*turns.tolist(), own.size]):
        yield first + begin + turned, first + end


def _averaged(record: Record, first: int, stop: int, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, speed and torque of the rows [first, stop), means of `count` each."""
    stop = first + (stop - first) // count * count
    time, speed, torque = (each[first:stop] for each in (record.time, record.speed, record.torque))
    if count == 1:
        return time, speed, torque
    time, speed, torque = (each.reshape(-1, count).mean(axis=1) for each in (time, speed, torque))
    return time, speed, torque


def _pace(speed: FloatArray, step: float) -> float:
    """The period [s] of the swing of a speed; infinite where it stands."""
    window = np.hanning(speed.size)
    power = np.abs(np.fft.rfft((speed - speed.mean()) * window))
    if 2 * power.max() <= STANDS * np.abs(speed).max() * window.sum():  # an encoder's noise is no swing
        return np.inf
    return float(speed.size * step / max(1, int(power.argmax())))


def _whitened(
    pieces: list[tuple[FloatArray, FloatArray, FloatArray]], step: float, between: int, least_square: float
) -> Swings | None:
    smooth = [_spline(torque, between) for _, _, torque in pieces]
    rest = [torque - slow for (_, _, torque), slow in zip(pieces, smooth, strict=True)]
    size = max(float(np.abs(torque).max()) for _, _, torque in pieces)
    scale = [float(each.std()) for each in rest]
    if not (min(scale) > 1e-9 * size and float(np.median(scale)) ** 2 > least_square):
        return None
    past = _autoregression([each / one for each, one in zip(rest, scale, strict=True)], 1.0 / between)
    fresh = [lfilter(past, 1.0, each) for each in rest]
    least = QUIETEST * float(np.median([np.square(each[past.size :]).mean() for each in fresh]))
    if not least > 0:
        return None
    weights = [_weight(each, past.size, round(LOCAL / step), least) for each in fresh]
    matched = [lfilter(past, 1.0, (e * w)[::-1])[::-1] for e, w in zip(fresh, weights, strict=True)]
    return Swings(
        time=np.concatenate([time for time, _, _ in pieces]),
        speed=np.concatenate([speed for _, speed, _ in pieces]),
        torque=np.concatenate(smooth),
        matched=np.concatenate(matched),
        weight=np.concatenate(weights),
        starts=tuple(np.cumsum([0, *(each.size for each in rest)]).tolist()),
        step=step,
        slowest=ABOVE / (between * step),
        gain=np.asarray(np.abs(np.fft.rfft(past, 2 * GAINS)) ** 2, dtype=np.float64),
    )


def _weight(fresh: FloatArray, memory: int, local: int, least: float) -> FloatArray:
    """1/σ² [n] of innovations [n], 0 where they still lack their past."""
    squares = fresh**2
    squares[:memory] = squares[memory:].mean()
    squares = np.minimum(squares, LARGEST_SQUARE * squares.mean())
    weight = 1.0 / np.maximum(uniform_filter1d(squares, min(local, fresh.size), mode="reflect"), least)
    weight[:memory] = 0.0
    return np.asarray(weight, dtype=np.float64)


def _spline(torque: FloatArray, between: int) -> FloatArray:
    """The cubic spline through torque [n] with a knot every `between` samples."""
    place = np.arange(torque.size, dtype=np.float64)
    inner = max(0, round(torque.size / between) - 1)
    knots = np.concatenate([np.zeros(4), np.linspace(0, place[-1], inner + 2)[1:-1], np.full(4, place[-1])])
    return np.asarray(make_lsq_spline(place, torque, knots, 3)(place), dtype=np.float64)


def _autoregression(rest: list[FloatArray], lowest: float) -> FloatArray:
    """A [p + 1] (Yule-Walker) for series whose spectrum below `lowest` [cycles a sample] goes on flat as it is above."""
    size = min(SEGMENT, min(each.size for each in rest))
    window = np.hanning(size)
    parts = [each[first : first + size] for each in rest for first in range(0, each.size - size + 1, size // 2)]
    power = np.mean(np.abs(np.fft.rfft(np.array(parts) * window, axis=1)) ** 2, axis=0)
    edge = max(1, int(np.ceil(lowest * size)))
    power[:edge] = power[edge : max(edge + 2, round(1.6 * edge))].mean()
    covariance = np.fft.irfft(power)[: MEMORY + 1]
    covariance[0] *= 1 + 1e-9
    return np.concatenate([[1.0], -solve_toeplitz(covariance[:-1], covariance[1:])])
