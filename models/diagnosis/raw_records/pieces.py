"""The pieces of a raw record that are analysed: without gaps, at one pressure, between reversals of the speed."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.raw_records.criteria import (
    FEWEST_SAMPLES,
    LONGEST_GAP,
    REVERSES,
    SETTLED_AFTER_REVERSAL,
    SHORTEST_PIECE,
)
from models.records.criteria import LEVEL_GAP, LEVEL_GAP_SHARE
from models.records.pressure_stretches import pressure_stretches
from models.records.runs import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Consecutive samples [n]: time [s], speed [rad/s], torque [Nm]."""

    time: FloatArray
    speed: FloatArray
    torque: FloatArray


def pieces_of(record: Record, spans: FloatArray | None, period: float, count: int) -> list[Piece]:
    """The pieces of a record with a sample every `period` [s], means of `count` samples each; within spans [k, 2] s where
    they are given, else where its pressure is constant."""
    turned = round(SETTLED_AFTER_REVERSAL / period)
    return [
        _averaged(record, first, stop, count)
        for begin, end in _without_gaps(record, spans, period)
        for first, stop in _one_direction(record.speed, begin, end, turned)
        if (stop - first) * period >= SHORTEST_PIECE and stop - first >= FEWEST_SAMPLES * count
    ]


def _without_gaps(record: Record, spans: FloatArray | None, period: float) -> Iterator[tuple[int, int]]:
    """Rows [first, stop) without gaps."""
    gaps = (np.flatnonzero(np.diff(record.time) > LONGEST_GAP * period) + 1).tolist()
    if spans is None:
        for first, stop in itertools.pairwise([0, *gaps, record.time.size]):
            yield from _at_one_pressure(record, first, stop)
        return
    for first, stop in (np.searchsorted(record.time, span) for span in spans):
        inside = [gap for gap in gaps if first < gap < stop]
        yield from itertools.pairwise([int(first), *inside, int(stop)])


def _at_one_pressure(record: Record, first: int, stop: int) -> Iterator[tuple[int, int]]:
    """Rows of [first, stop), which have no gaps, at which the pressure is constant."""
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
    """Rows of [first, stop) between reversals of the speed, from `turned` rows after each on: where the clutch reverses the
    torque jumps, at the same angle of the shaft each time, which would pass for a ripple."""
    part = speed[first:stop]
    if min(part.max(initial=0.0), -part.min(initial=0.0)) <= REVERSES * np.abs(part).max(initial=0.0):
        yield first, stop
        return
    turns = np.flatnonzero(np.diff(np.signbit(part))) + 1
    yield first, first + int(turns[0])
    for begin, end in itertools.pairwise([*turns.tolist(), part.size]):
        yield first + begin + turned, first + end


def _averaged(record: Record, first: int, stop: int, count: int) -> Piece:
    """The rows [first, stop), means of `count` each."""
    stop = first + (stop - first) // count * count
    time, speed, torque = (channel[first:stop] for channel in (record.time, record.speed, record.torque))
    if count > 1:
        time, speed, torque = (channel.reshape(-1, count).mean(axis=1) for channel in (time, speed, torque))
    return Piece(time=time, speed=speed, torque=torque)
