"""Windows of raw records within a range of speeds, and their matched spectra: where a line of fixed frequency may show."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from models.arrays import FloatArray
from models.diagnosis.raw_records.criteria import (
    FEWEST_WINDOWS,
    LOWEST_BESIDE,
    LOWEST_LINE,
    RISE_TIME,
    SHORTEST_WINDOW,
    SPACING,
    SPEED_AVERAGE,
    STANDSTILL_SHARE,
)
from models.diagnosis.raw_records.limits import MOST_WINDOWS
from models.diagnosis.raw_records.whitened_torque import WhitenedRecord

Bools: TypeAlias = NDArray[np.bool_]
ComplexArray: TypeAlias = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """D and N [w, f] at multiples of SPACING; where they may give the noise level beside a line (`beside`), and where a line
    itself (`visible`) [w, f]; lowest and highest speed [w] rad/s, mean torque [w] Nm, and the usual length [s]."""

    sums: ComplexArray
    weight: FloatArray
    beside: Bools
    visible: Bools
    slowest: FloatArray
    fastest: FloatArray
    torque: FloatArray
    length: float


def windows_of(
    records: Sequence[WhitenedRecord], below: float, longest: float, highest: float, above: float = 0.0
) -> Windows | None:
    """Windows of all records, up to `longest` [s], in which the shaft is slower than the share `below` of its highest speed
    and faster than the share `above`, with frequencies up to `highest` [Hz]; None where they are too few."""
    top = max(float(np.abs(record.speed).max()) for record in records)
    places = [
        (record, first, stop)
        for record in records
        for first, stop in _passages(record, above * top, below * top, STANDSTILL_SHARE * top, longest)
    ]
    if len(places) > MOST_WINDOWS:
        places = [places[i] for i in np.linspace(0, len(places) - 1, MOST_WINDOWS).astype(int)]
    if len(places) < FEWEST_WINDOWS:
        return None
    count = 1 + int(min(highest, max(record.highest for record in records)) / SPACING)
    frequency = SPACING * np.arange(count, dtype=np.float64)
    sums, weight = np.zeros((len(places), count), dtype=np.complex128), np.zeros((len(places), count))
    lowest_line = LOWEST_LINE * np.array([[record.lowest] for record, _, _ in places])
    for row, (record, first, stop) in enumerate(places):
        inside = (frequency > LOWEST_BESIDE * record.lowest) & (frequency < record.highest)
        size = round(1.0 / (SPACING * record.step))
        slot = np.minimum(np.round((record.time[first:stop] - record.time[first]) / record.step).astype(int), size - 1)
        envelope = -np.expm1(-np.arange(stop - first) * (record.step / RISE_TIME))
        spectrum = np.fft.rfft(np.bincount(slot, record.matched[first:stop] * envelope, size))
        bins = np.flatnonzero(inside[: spectrum.size])
        weight[row, bins] = float(record.weight[first:stop] @ envelope**2) * record.response(frequency[bins])
        sums[row, bins] = spectrum[bins]
    speeds = [np.abs(record.speed[first:stop]) for record, first, stop in places]
    return Windows(
        sums=sums,
        weight=weight,
        beside=weight > 0,
        visible=(weight > 0) & (frequency > lowest_line),
        slowest=np.array([speed.min() for speed in speeds]),
        fastest=np.array([speed.max() for speed in speeds]),
        torque=np.array([abs(float(record.torque[first:stop].mean())) for record, first, stop in places]),
        length=float(np.median([(stop - first) * record.step for record, first, stop in places])),
    )


def _passages(
    record: WhitenedRecord, above: float, below: float, standstill: float, longest: float
) -> list[tuple[int, int]]:
    """Samples [first, stop) of windows with speeds [rad/s] between `above` and `below`, and on average above `standstill`;
    passages longer than `longest` [s] are cut into equal parts."""
    passages = []
    speed = uniform_filter1d(np.abs(record.speed), max(1, round(SPEED_AVERAGE / record.step)), mode="nearest")
    within = (speed >= above) & (speed <= below)
    for first, stop in zip(record.starts[:-1], record.starts[1:], strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], within[first:stop], [False]]).astype(np.int8)))
        for enter, leave in zip(first + edges[::2], first + edges[1::2], strict=True):
            if (leave - enter) * record.step < SHORTEST_WINDOW:
                continue
            parts = int(np.ceil((leave - enter) * record.step / longest))
            bounds = np.linspace(enter, leave, parts + 1).astype(int)
            passages += [(int(a), int(b)) for a, b in itertools.pairwise(bounds) if speed[a:b].mean() > standstill]
    return passages
