"""The dwells of a stationary test, detected in its speed and pressure without knowing its protocol.

The record is averaged over blocks of some 10 ms. A block is steady where the means of 0.2 s after it and of 0.2 s before
it agree within six deviations of their difference, in speed and in pressure; runs of steady blocks are dwells, widened
again up to where speed or pressure leaves the level. Where the clutch is open throughout, pressure is sensor noise:
the dwells are those of speed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records import criteria
from models.records.cleaning import Cleaning, Note, Sampled, listed


@dataclass(frozen=True, slots=True, kw_only=True)
class Blocks:
    """Means over `size` samples each: time [m] s, pressure, speed, torque, oil_temperature, plate_temperature;
    scatter [m] Nm², the variance of torque within a block; gap [m]: many samples are missing before or in this block.
    """

    size: int
    duration: float
    time: FloatArray
    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray
    scatter: FloatArray
    oil_temperature: FloatArray | None
    plate_temperature: FloatArray | None
    gap: NDArray[np.bool_]


def average(record: Sampled, cleaning: Cleaning) -> Blocks:
    """Block means, over about 10 ms each, of the kept rows of a record; a remainder at its end is left out."""
    period = cleaning.period
    size = max(1, round(0.01 / period))  # blocks of 10 ms
    time = cleaning.of(record.time)
    count = time.size // size
    share = np.full(size, 1.0 / size)

    def blocks_of(channel: FloatArray) -> FloatArray:
        return cleaning.of(channel)[: count * size].reshape(count, size)

    def mean(channel: FloatArray) -> FloatArray:
        return np.asarray(blocks_of(channel) @ share, dtype=np.float64)

    def scatter(channel: FloatArray) -> FloatArray:
        off = blocks_of(channel) - mean(channel)[:, np.newaxis]
        return np.asarray(np.einsum("ij,ij->i", off, off) / size, dtype=np.float64)

    late = np.flatnonzero(np.diff(time) > max(0.25, 6 * size * period)) + 1
    gap: NDArray[np.bool_] = np.zeros(count, dtype=np.bool_)
    gap[np.minimum(late // size, count - 1)] = True
    oil, plate = record.oil_temperature, record.plate_temperature
    return Blocks(
        size=size,
        duration=size * period,
        time=np.asarray(time[: count * size].reshape(count, size) @ share, dtype=np.float64),
        pressure=mean(record.pressure),
        speed=mean(record.speed),
        torque=mean(record.torque),
        scatter=scatter(record.torque),
        oil_temperature=None if oil is None else mean(oil),
        plate_temperature=None if plate is None else mean(plate),
        gap=gap,
    )


def find_dwells(blocks: Blocks) -> tuple[list[slice], list[Note]]:
    """The dwells, slices of blocks on one level, in motion, and under pressure where there is any, in the order of
    time; and notes on dwells left out."""
    if blocks.time.size < criteria.SHORTEST_DWELL:
        return [], []
    window = max(4, round(0.2 / blocks.duration))  # 0.2 s before and after, four blocks at least
    pressure, speed = _Channel(blocks.pressure, window), _Channel(blocks.speed, window)
    idle = _highest(blocks.pressure, window) < criteria.UNLOADED
    channels, least = (
        # no lining is loaded below 2 % of the highest pressure
        ((speed,), -math.inf) if idle else ((pressure, speed), 0.02 * pressure.highest)
    )
    active = (np.abs(blocks.pressure) > least) & (np.abs(blocks.speed) > criteria.STANDSTILL_SHARE * speed.highest)
    steady = ~blocks.gap
    for channel in channels:
        channel.judge(active)
        steady &= channel.steady
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steady, [False]]).astype(np.int8)))
    cores = [(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a >= 2]
    cores = _merged(cores, blocks, channels)
    return _sorted_out(_widened(cores, blocks, channels), blocks, channels, least)


def _highest(pressure: FloatArray, window: int) -> float:
    """Highest pressure [Pa], as the 99.5 % quantile of means over a window of blocks: a gauge's noise and its negative
    offset are no pressure."""
    size = min(window, pressure.size)
    total = np.concatenate([[0.0], np.cumsum(pressure)])
    return float(np.quantile((total[size:] - total[:-size]) / size, 0.995))


class _Channel:
    """The speed or pressure channel [m], and whether it is steady at each block."""

    def __init__(self, values: FloatArray, window: int) -> None:
        self.values = values
        self.highest = float(np.quantile(np.abs(values), 0.995))
        self.steady: NDArray[np.bool_] = np.ones(values.size, dtype=np.bool_)
        self.threshold = 5e-4 * self.highest
        self.window = window
        self._levels: dict[tuple[int, int], tuple[float, float]] = {}

    def judge(self, active: NDArray[np.bool_]) -> None:
        """Marks the blocks as steady at which the windows after and before agree; the record's ends are as the blocks
        next to them."""
        size = self.values.size
        window = min(self.window, size // 2)
        total = np.concatenate([[0.0], np.cumsum(self.values - self.values.mean())])
        curvature = np.abs(total[2 * window :] - 2 * total[window : size - window + 1] + total[: size - 2 * window + 1])
        curvature = (curvature / window)[np.clip(np.arange(size) - window, 0, size - 2 * window)]
        # A quarter of a normal variable's absolute values lies below 0.3186 deviations: ramps are above that.
        deviation = float(np.quantile(curvature[active] if active.any() else curvature, 0.25)) / 0.3186
        self.threshold = max(
            # changes above 2 % of the highest are always steps, below 0.05 % never
            self.threshold,
            min(6.0 * deviation, 0.02 * self.highest),
        )
        self.steady = curvature <= self.threshold

    def level(self, core: tuple[int, int]) -> tuple[float, float]:
        """Level of a core, and the tolerance within which blocks lie on it; only after `judge`."""
        if core not in self._levels:
            part = self.values[slice(*core)]
            self._levels[core] = (
                float(np.median(part)),
                max(criteria.LEAVING_DEVIATIONS * float(part.std()), self.threshold),
            )
        return self._levels[core]


def _merged(cores: list[tuple[int, int]], blocks: Blocks, channels: tuple[_Channel, ...]) -> list[tuple[int, int]]:
    """Cores with neighbours on the same level merged, where no block between them leaves the level."""
    merged: list[tuple[int, int]] = []
    for core in cores:
        if merged and not blocks.gap[merged[-1][1] : core[0]].any():
            last = merged[-1]
            same = True
            for channel in channels:
                (first, wide), (second, narrow) = channel.level(last), channel.level(core)
                between = np.abs(channel.values[last[1] : core[0]] - 0.5 * (first + second))
                same &= abs(first - second) <= channel.threshold
                same &= bool((between <= max(wide, narrow) + 0.5 * abs(first - second)).all())
            if same:
                merged[-1] = (last[0], core[1])
                continue
        merged.append(core)
    return merged


def _widened(cores: list[tuple[int, int]], blocks: Blocks, channels: tuple[_Channel, ...]) -> list[slice]:
    """Cores widened to where a channel begins to leave the level, or samples are missing."""
    dwells = []
    for row, (start, stop) in enumerate(cores):
        first = cores[row - 1][1] if row else 0
        last = cores[row + 1][0] if row + 1 < len(cores) else blocks.time.size
        back, on = start - first, last - stop
        for channel in channels:
            level, tolerance = channel.level((start, stop))
            off = np.where(blocks.gap[first:last], np.inf, np.abs(channel.values[first:last] - level))
            back = min(back, _reach(off[: start - first][::-1], tolerance))
            on = min(on, _reach(off[stop - first :], tolerance))
        dwells.append(slice(start - back, stop + on))
    return dwells


def _reach(off: FloatArray, tolerance: float) -> int:
    """Number of blocks on the level: a ramp takes as long to the tolerance as from there to twice that."""
    out = np.flatnonzero(off > tolerance)
    if out.size == 0:
        return off.size
    far = np.flatnonzero(off[out[0] :] > 2 * tolerance)
    return max(int(out[0]) - 1 - (int(far[0]) if far.size else 0), 0)


def _sorted_out(
    dwells: list[slice], blocks: Blocks, channels: tuple[_Channel, ...], least: float
) -> tuple[list[slice], list[Note]]:
    """The dwells from which a mean is computed, and notes on the others; the last of `channels` is speed, `least` [Pa]
    the pressure below which there is none."""
    kept: list[slice] = []
    speed = channels[-1]
    left: dict[str, list[float]] = {code: [] for code in _SENTENCES}
    settled: slice | None = None
    for row, dwell in enumerate(dwells):
        following = [later for later in dwells[row + 1 : row + 1 + 4] if not blocks.gap[dwell.stop : later.start].any()]
        if settled is not None and _crest(channels, settled, dwell, following):
            left["overshoot"].append(float(blocks.time[dwell.start]))
            continue
        settled = dwell
        if float(blocks.pressure[dwell].mean()) <= least:
            reason = "no_pressure"
        elif abs(float(blocks.speed[dwell].mean())) <= criteria.STANDSTILL_SHARE * speed.highest:
            reason = "standstill"
        elif dwell.stop - dwell.start < criteria.SHORTEST_DWELL:
            reason = "dwell_too_short"
        elif any(_ramps(channel, dwell) for channel in channels):
            reason = "not_steady"
        else:
            kept.append(dwell)
            continue
        left[reason].append(float(blocks.time[dwell.start]))
    return kept, [
        (code, _SENTENCES[code].format(n=len(at), at=listed(np.array(at)))) for code, at in left.items() if at
    ]


def _crest(channels: tuple[_Channel, ...], before: slice, dwell: slice, following: list[slice]) -> bool:
    """Whether a dwell is only a crest of an overshoot, or the trough after it, between the dwell before and the first long
    dwell that follows: speed or pressure went beyond the latter's level."""
    long = (later for later in following if dwell.stop - dwell.start < 0.25 * (later.stop - later.start))
    after = next(long, None)
    if after is None:
        return False
    beyond = False
    for channel in channels:
        first, middle, last = (float(channel.values[part].mean()) for part in (before, dwell, after))
        # off its level by 30 % of the step at most
        if abs(middle - last) > 0.3 * abs(last - first) + channel.threshold:
            return False
        on_the_way = np.copysign(1.0, last - first) * (channel.values[before.stop : dwell.stop] - last)
        beyond |= abs(last - first) > 2 * channel.threshold and bool(on_the_way.max() > channel.threshold)
    return beyond


_SENTENCES = {
    "overshoot": "Left out: {n} overshoots, at {at} s.",
    "no_pressure": "Left out: {n} stretches without pressure, from {at} s on.",
    "standstill": "Left out: {n} stretches at standstill, from {at} s on.",
    "dwell_too_short": "Left out: {n} plateaus that are too short, from {at} s on.",
    "not_steady": "Left out: {n} stretches in which speed or pressure drifts, from {at} s on.",
}


def _ramps(channel: _Channel, where: slice) -> bool:
    """Whether a channel moves evenly over a part of the record, by more than its noise."""
    part = channel.values[where]
    pieces = min(6, part.size // 2)
    means = part[: part.size // pieces * pieces].reshape(pieces, -1).mean(axis=1)
    noise = criteria.LEAVING_DEVIATIONS * float(np.diff(part).std()) * np.sqrt(pieces / part.size)
    return bool(np.ptp(means) > max(2 * channel.threshold, noise, 0.01 * abs(float(part.mean()))))  # 1 % over a dwell
