"""A raw record made fit to be cut: times in order, spikes taken out, and what was found said.

Recorders lose samples, swap or repeat neighbouring times and let a spike through now and then. Times that are slightly
out of order are sorted; a clock that falls back further cannot be trusted and is refused. A spike is a few samples (up
to 6 ms, at least three) that stand off the median of their surroundings by more than ten deviations of the noise.
"""

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.runs import Record

Note = tuple[str, str]

#: Samples below which nothing can be said of a record.
FEWEST_SAMPLES = 16
#: Values beyond this are no measurements; samples lie this far apart [s], at the least and at the most.
LARGEST, FASTEST, SLOWEST = 1e15, 1e-6, 10.0
#: A clock may fall back by this much [s], or by ten samples: neighbours that were written in the wrong order.
LARGEST_SWAP = 0.1
#: Intervals scatter by more than this share of their median: the clock jitters.
JITTER = 0.01
#: A spike stands off by more deviations than this, and its edge jumps by more than that.
SPIKE, EDGE = 10.0, 6.0
#: The longest spike [s].
SPIKE_DURATION = 0.006
#: Samples from which a scale is estimated.
SCALE_SAMPLES = 50_000
_CHANNELS = ("pressure", "speed", "torque", "oil_temperature")


def clean(record: Record) -> tuple[Record, float, tuple[Note, ...]]:
    """The record with times in order and without spikes, its sampling period [s], and notes on what was found.

    Raises ValueError on fewer than 16 samples, values beyond ±1e15, times that do not advance, a clock that falls back,
    and samples that lie less than 1 µs or more than 10 s apart.
    """
    if record.time.size < FEWEST_SAMPLES:
        raise ValueError(f"time must have at least {FEWEST_SAMPLES} samples, got {record.time.size}")
    for name in ("time", *_CHANNELS):
        channel = getattr(record, name)
        if channel is not None and max(float(channel.max()), -float(channel.min())) > LARGEST:
            raise ValueError(f"{name} must lie within ±{LARGEST:g}, got {float(channel[np.abs(channel).argmax()])}")
    record, period, notes = _in_order(record)
    if not FASTEST <= period <= SLOWEST:
        raise ValueError(f"samples must lie {FASTEST:g} to {SLOWEST:g} s apart, got {period:.3g} s")
    spikes: NDArray[np.bool_] = np.zeros(record.time.size, dtype=np.bool_)
    told = []
    for name in _CHANNELS:
        channel = getattr(record, name)
        if channel is None:
            continue
        where = _spikes(channel, max(3, min(12, round(SPIKE_DURATION / period))))
        if where.size:
            told.append(f"{where.size} of {name}")
            spikes[where] = True
    if told:
        times = record.time[spikes]
        notes.append(("spikes_removed", f"Spiking samples removed: {', '.join(told)}, {_at(times, 1.0)}."))
        record = _rows(record, ~spikes)
    return record, period, tuple(notes)


def _in_order(record: Record) -> tuple[Record, float, list[Note]]:
    time, notes = record.time, list[Note]()
    steps = np.diff(time)
    forward = steps[:: max(1, steps.size // SCALE_SAMPLES)]
    forward = forward[forward > 0]
    if forward.size == 0 or time.max() <= time.min():
        raise ValueError(f"time must advance, but no sampled interval of the {time.size} samples does")
    period = float(np.median(forward))
    backward = steps < 0
    swapped = int(np.count_nonzero(backward))
    if swapped:
        fallback = np.maximum.accumulate(time) - time
        worst = int(fallback.argmax())
        if fallback[worst] > max(LARGEST_SWAP, 10 * period):
            raise ValueError(
                f"time must run forwards, but time[{worst}] = {time[worst]} s lies {fallback[worst]:.6g} s before a "
                "sample that stands earlier in the record"
            )
        record = _rows(record, np.argsort(time, kind="stable"))
        time, steps = record.time, np.diff(record.time)
    repeated = int(np.count_nonzero(steps == 0))
    regular = steps[(steps > 0.5 * period) & (steps < 1.5 * period)]
    if regular.size:
        period = float(regular.mean())
        scatter = float(regular.std()) / period
        if scatter > JITTER or swapped or repeated:
            told = f"Sampling intervals scatter by {scatter:.1%}; {repeated} repeated and {swapped} swapped times."
            notes.append(("clock_jitter", told))
    lost = round((time[-1] - time[0]) / period) + 1 - time.size
    gaps = np.flatnonzero(steps > 1.5 * period)
    if lost > 0 and gaps.size:
        longest = int(gaps[steps[gaps].argmax()])
        told = f"About {lost} samples ({lost / (lost + time.size):.2%}) are missing; the longest gap is"
        notes.append(("samples_missing", f"{told} {steps[longest]:.4g} s at {time[longest]:.3f} s."))
    return record, period, notes


def _spikes(channel: FloatArray, longest: int) -> NDArray[np.intp]:
    """Indices of samples that belong to a spike of at most `longest` samples."""
    jumps = np.diff(channel)
    np.abs(jumps, out=jumps)
    stride = max(1, channel.size // SCALE_SAMPLES)
    apart = np.abs(channel[longest::stride] - channel[:-longest:stride][: channel[longest::stride].size])
    scale = 1.05 * float(np.median(apart))  # of a normal deviation: 1.4826 / sqrt(2)
    moved = jumps[::stride]
    if scale == 0.0 and moved.any():  # a coarse recorder: its count
        scale = float(moved[moved > 0].min())
    edges = np.flatnonzero(jumps > EDGE * scale)
    if edges.size > channel.size // 20:  # more than spikes: a signal that moves by itself
        edges = np.flatnonzero(jumps > float(np.quantile(moved, 0.95)))
    if edges.size == 0:
        return edges
    suspects = np.unique((edges[:, np.newaxis] + np.arange(1 - longest, longest + 1)).ravel())
    suspects = suspects[(suspects >= 0) & (suspects < channel.size)]
    around = np.clip(suspects[:, np.newaxis] + np.arange(-longest, longest + 1), 0, channel.size - 1)
    window = channel[around]
    middle = np.median(window, axis=1)
    spread = 1.4826 * np.median(np.abs(window - middle[:, np.newaxis]), axis=1)
    return suspects[np.abs(channel[suspects] - middle) > SPIKE * np.maximum(spread, scale)]


def _rows(record: Record, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Record:
    oil = record.oil_temperature
    return Record(
        time=record.time[rows],
        pressure=record.pressure[rows],
        speed=record.speed[rows],
        torque=record.torque[rows],
        oil_temperature=None if oil is None else oil[rows],
    )


def _at(times: FloatArray, apart: float) -> str:
    """ "at 1.20, 61.4, ... s": the first few of times that lie further apart than `apart` [s]."""
    first = times[np.concatenate([[True], np.diff(times) > apart])]
    return f"at {', '.join(f'{one:.2f}' for one in first[:5])}{', ...' if first.size > 5 else ''} s"
