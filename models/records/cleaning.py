"""Cleaning a raw record before it is cut: times in order, spikes removed, and notes of both.

Recorders lose samples, swap or repeat neighbouring times and sometimes record a spike. Times that are slightly out of
order are sorted; a clock that falls back further cannot be trusted and is refused. A spike is a few samples (up to 6 ms,
at least three) that are off the median of their surroundings by more than ten deviations of the noise.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records import criteria
from models.records.runs import Record

Note = tuple[str, str]

#: Samples from which a scale is estimated.
SCALE_SAMPLES = 50_000
_CHANNELS = ("pressure", "speed", "torque", "oil_temperature", "plate_temperature")


class Sampled(Protocol):
    """The channels of a `Record`, in SI units; a channel may be computed again at each access."""

    @property
    def time(self) -> FloatArray: ...
    @property
    def pressure(self) -> FloatArray: ...
    @property
    def speed(self) -> FloatArray: ...
    @property
    def torque(self) -> FloatArray: ...
    @property
    def oil_temperature(self) -> FloatArray | None: ...
    @property
    def plate_temperature(self) -> FloatArray | None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Cleaning:
    """The plan of a record's cleaning: `rows` to keep, in order of time (None: all, unchanged), its sampling period
    [s], notes."""

    rows: NDArray[np.intp] | None
    period: float
    notes: tuple[Note, ...]

    def of(self, channel: FloatArray) -> FloatArray:
        """The kept samples of a channel."""
        return channel if self.rows is None else channel[self.rows]


class UnusableRecordError(ValueError):
    """Raised for a record that cannot be evaluated, for a defect of the record and not of the code."""


def clean(record: Record) -> tuple[Record, float, tuple[Note, ...]]:
    """The record with times in order and without spikes, its sampling period [s], and notes.

    Raises UnusableRecordError as `plan_cleaning` does.
    """
    plan = plan_cleaning(record)
    if plan.rows is not None:
        record = record.take(plan.rows)
    return record, plan.period, plan.notes


def plan_cleaning(record: Sampled) -> Cleaning:
    """The rows of a record to keep, with times in order and without spikes; channels are examined one by one.

    Raises UnusableRecordError on fewer than 16 samples, values beyond ±1e15, times that do not advance, a clock that falls
    back, samples that lie less than 1 µs or more than 10 s apart, and rows that were stored only when a value changed.
    """
    size = record.time.size
    if size < criteria.FEWEST_SAMPLES:
        raise UnusableRecordError(f"time must have at least {criteria.FEWEST_SAMPLES} samples, got {size}")
    _require_measurements("time", record.time)
    order, period, notes = _in_order(record.time)
    ordered = Cleaning(rows=order, period=period, notes=())
    if not criteria.FASTEST <= period <= criteria.SLOWEST:
        raise UnusableRecordError(
            f"samples must lie {criteria.FASTEST:g} to {criteria.SLOWEST:g} s apart, got {period:.3g} s"
        )
    spikes: NDArray[np.bool_] = np.zeros(size, dtype=np.bool_)
    removed = []
    for name in _CHANNELS:
        channel = getattr(record, name)
        if channel is None:
            continue
        _require_measurements(name, channel)
        where = _spikes(ordered.of(channel), max(3, min(12, round(0.006 / period))))  # a spike lasts 6 ms at most
        if where.size:
            removed.append(f"{where.size} of {name}")
            spikes[where] = True
    if not removed:
        return Cleaning(rows=order, period=period, notes=tuple(notes))
    times = ordered.of(record.time)[spikes]
    apart = times[np.concatenate([[True], np.diff(times) > 1.0])]
    notes.append(("spikes_removed", f"Spiking samples removed: {', '.join(removed)}, at {listed(apart)} s."))
    rows = np.flatnonzero(~spikes)
    return Cleaning(rows=rows if order is None else order[rows], period=period, notes=tuple(notes))


def _require_measurements(name: str, channel: FloatArray) -> None:
    """Raise UnusableRecordError if a value of the channel is too large to be a measurement."""
    if max(float(channel.max()), -float(channel.min())) > criteria.LARGEST_VALUE:
        raise UnusableRecordError(
            f"{name} must lie within ±{criteria.LARGEST_VALUE:g}, got {float(channel[np.abs(channel).argmax()])}"
        )


def stands(times: FloatArray) -> bool:
    """Whether a clock [s], [n], is coarser than its rows: more than one in ten of its steps is zero."""
    return bool(np.count_nonzero(times[1:] == times[:-1]) > 0.1 * (times.size - 1))


def _in_order(time: FloatArray) -> tuple[NDArray[np.intp] | None, float, list[Note]]:
    """The rows in order of time (None: unchanged), the sampling period [s], and notes."""
    order, notes = None, list[Note]()
    steps = np.diff(time)
    forward = steps[:: max(1, steps.size // SCALE_SAMPLES)]
    forward = forward[forward > 0]
    if forward.size == 0 or time.max() <= time.min():
        raise UnusableRecordError(f"time must advance, but does not in any of the {time.size} samples")
    period = float(np.median(forward))
    swapped = int(np.count_nonzero(steps < 0))
    if swapped:
        fallback = np.maximum.accumulate(time) - time
        worst = int(fallback.argmax())
        # neighbours written in the wrong order are no clock that falls back
        if fallback[worst] > max(0.1, 10 * period):
            raise UnusableRecordError(
                f"time must run forwards, but time[{worst}] = {time[worst]} s lies {fallback[worst]:.6g} s before an "
                "earlier sample of the record"
            )
        order = np.argsort(time, kind="stable")
        time = time[order]
        steps = np.diff(time)
    repeated = int(np.count_nonzero(steps == 0))
    regular = (steps > 0.5 * period) & (steps < 1.5 * period)
    if regular.any():
        period = float(steps.mean(where=regular))
        scatter = float(steps.std(where=regular, mean=period)) / period
        if scatter > 0.01 or swapped or repeated:
            sentence = (
                f"The sampling interval scatters by {scatter:.1%}. Times repeated: {repeated}, swapped: {swapped}."
            )
            notes.append(("clock_jitter", sentence))
    missing, stored_on_change = _missing(time, period)
    if stored_on_change:
        raise UnusableRecordError(missing[0][1])
    return order, period, notes + missing


def missing_samples(time: FloatArray) -> list[Note]:
    """Note of samples missing from an increasing clock [s], [n], of any kind of record: lost, not stored, or passed
    over by a clock that was set forwards; empty where none are."""
    steps = np.diff(time)
    if steps.size == 0:
        return []
    # times that are rounded to a coarse unit lie one or two of it apart
    return _missing(time, float(steps.mean(where=steps <= 2.5 * np.median(steps))))[0]


def _missing(time: FloatArray, period: float) -> tuple[list[Note], bool]:
    """Note of missing samples by their period [s], and whether they are so many in so many places that rows were stored
    only when a value changed."""
    steps = np.diff(time)
    lost = round((time[-1] - time[0]) / period) + 1 - time.size
    gaps = np.flatnonzero(steps > 1.5 * period)
    if lost <= 0 or gaps.size == 0:
        return [], False
    longest = int(gaps[steps[gaps].argmax()])
    share = lost / (lost + time.size)
    at = f"{steps[longest]:.4g} s at {time[longest]:.3f} s"
    sentence = f"About {lost} samples ({share:.2%}) are missing; the longest gap is {at}."
    stored_on_change = share > criteria.SPARSE and gaps.size > criteria.SPARSE_GAPS * time.size
    if stored_on_change:
        sentence = (
            f"Samples must be stored at an even rate, got {gaps.size} gaps among {time.size} rows, the longest of {at}: "
            f"{share:.0%} are missing, as where a row is stored only when a value has changed. Export the record at an even "
            f"rate, such as every {period:.3g} s, each value held until the next."
        )
    elif gaps.size == 1:
        sentence = f"{sentence} A clock that was set forwards there looks the same."
    return [("samples_missing", sentence)], stored_on_change


def _spikes(channel: FloatArray, longest: int) -> NDArray[np.intp]:
    """Indices of samples that belong to a spike of at most `longest` samples."""
    stride = max(1, channel.size // SCALE_SAMPLES)
    jumps = np.abs(channel[longest::stride] - channel[:-longest:stride][: channel[longest::stride].size])
    scale = 1.05 * float(np.median(jumps))  # of a normal deviation: 1.4826 / sqrt(2)
    moved = np.abs(channel[1::stride] - channel[:-1:stride])
    if scale == 0.0 and moved.any():  # a coarse recorder: its count
        scale = float(moved[moved > 0].min())
    edges = _jumps(channel, 6.0 * scale)
    if edges.size > channel.size // 20:  # more than spikes: a signal that moves by itself
        edges = _jumps(channel, float(np.quantile(moved, 0.95)))
    if edges.size == 0:
        return edges
    suspects = np.unique((edges[:, np.newaxis] + np.arange(1 - longest, longest + 1)).ravel())
    suspects = suspects[(suspects >= 0) & (suspects < channel.size)]
    around = np.clip(suspects[:, np.newaxis] + np.arange(-longest, longest + 1), 0, channel.size - 1)
    window = channel[around]
    middle = np.median(window, axis=1)
    spread = 1.4826 * np.median(np.abs(window - middle[:, np.newaxis]), axis=1)
    return suspects[np.abs(channel[suspects] - middle) > 10.0 * np.maximum(spread, scale)]


def _jumps(channel: FloatArray, most: float) -> NDArray[np.intp]:
    """Indices of samples whose successor differs by more than `most`, computed piece by piece."""
    jumps = [
        np.flatnonzero(np.abs(np.diff(channel[start : start + SCALE_SAMPLES + 1])) > most) + start
        for start in range(0, channel.size - 1, SCALE_SAMPLES)
    ]
    return np.concatenate(jumps)


def listed(times: FloatArray) -> str:
    """The first five of times [s], as text for a note."""
    return ", ".join(f"{time:.2f}" for time in times[:5]) + (", ..." if len(times) > 5 else "")
