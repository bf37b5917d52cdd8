"""A raw stationary record (section 2.3.3 of the reference) cut into steady plateaus.

Clean the record (`records.cleaning`), find the dwells in its speed and pressure (`records.dwells`), drop the transient of
torque at the start of each (`records.settling`), and take the mean of the rest with its deviation under autocorrelated
noise (`records.mean_deviation`). Notes say what is dropped, and why.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records.cleaning import SCALE_SAMPLES, Note, Sampled, UnusableRecordError, listed, plan_cleaning
from models.records.dwells import Blocks, average, find_dwells
from models.records.mean_deviation import Stretch, deviations
from models.records.runs import Plateaus
from models.records.settling import dropped, fit_transients, mean_decay
from models.records.torque_filter import filtered


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateauCut:
    """Plateaus in the order measured, one row [n] each, with their intervals and the notes of the cut.

    `plateaus.torque_sd` [n] Nm is the deviation of the mean torque. `count` [n] samples were used; `noise` [n] Nm is the
    deviation of a sample about its dwell; `drift` [n] Nm/s the slope of torque over the samples used, with its deviation
    `drift_sd`; `time_constant` [n] s that of torque's exponential approach, nan where no transient exceeds the noise.
    `settled` [n] is false where more of the transient than the mean's deviation was left at the end of the dwell: that mean
    is taken over the last quarter, is not extrapolated, and the shift by its transient is part of its torque_sd. `start`
    and `stop` [n] s bound the samples used. `notes` are pairs of a code and a sentence.
    """

    plateaus: Plateaus
    count: NDArray[np.int64]
    drift: FloatArray
    drift_sd: FloatArray
    time_constant: FloatArray
    settled: NDArray[np.bool_]
    noise: FloatArray
    start: FloatArray
    stop: FloatArray
    notes: tuple[Note, ...]


def cut_plateaus(record: Sampled, torque_filter: float = 0.0) -> PlateauCut:
    """The steady plateaus of a record of 10 to 2,000 Hz; `torque_filter` [s] is the time constant of the torque channel's
    own low-pass where it is declared, through which pressure and speed are then seen (`records.torque_filter`).

    Steps of speed and pressure may come in any order and direction; samples may be missing, their times jitter, single
    samples spike, signals be quantised. Raises UnusableRecordError on fewer than 16 samples, a clock that does not advance
    or falls back, and a record without any steady dwell in motion, and under pressure where there is any.
    """
    plan = plan_cleaning(record)
    blocks = _filtered(average(record, plan), torque_filter)
    dwells, left_out = find_dwells(blocks)
    if not dwells:
        reasons = " ".join(sentence for _, sentence in left_out)
        raise UnusableRecordError(
            f"the record must hold plateaus: speed and pressure both steady, neither at zero. {reasons}".rstrip()
        )
    duration = np.array([blocks.time[dwell.stop - 1] - blocks.time[dwell.start] + blocks.duration for dwell in dwells])
    transients = fit_transients(_stretches(blocks, dwells), blocks.duration)
    used, drop, moments = dwells, np.zeros(duration.size), deviations(_stretches(blocks, dwells))
    for _ in range(4):  # dropping a transient makes the means' deviations smaller, so that more may have to be dropped
        further = np.maximum(drop, dropped(transients, duration, moments.mean * np.sqrt(1 - drop / duration)))
        if (further == drop).all():
            break
        drop = further
        used = [_used(blocks, dwell, float(drop[row])) for row, dwell in enumerate(dwells)]
        moments = deviations(_stretches(blocks, used))
    amplitude = np.hypot(transients.amplitude, transients.amplitude_sd)
    settled = ~(amplitude * np.exp(-duration / transients.time_constant) > moments.mean)
    noise = np.sqrt(_mean(blocks.scatter, used) + moments.average**2)
    # of the mean by its transient, where one is resolved
    shift = np.nan_to_num(amplitude * mean_decay(transients.time_constant, drop, duration))
    half = 0.5 * (blocks.duration - plan.period)
    cut = PlateauCut(
        plateaus=_plateaus(
            blocks, used, np.sqrt(moments.mean**2 + _rounding(plan.of(record.torque), noise) ** 2 + shift**2)
        ),
        count=np.array([(dwell.stop - dwell.start) * blocks.size for dwell in used]),
        drift=moments.drift,
        drift_sd=moments.drift_sd,
        time_constant=transients.time_constant,
        settled=settled,
        noise=noise,
        start=np.array([blocks.time[dwell.start] for dwell in used]) - half,
        stop=np.array([blocks.time[dwell.stop - 1] for dwell in used]) + half,
        notes=(*plan.notes, *left_out),
    )
    notes = [*cut.notes, *_notes(cut, drop)]
    if not moments.resolved:
        sentence = (
            "The noise of torque is autocorrelated over longer times than a dwell: deviations of means rest on a white and "
            "a slow part of it, estimated from all dwells together."
        )
        notes.append(("slow_noise", sentence))
    return replace(cut, notes=tuple(notes))


def _filtered(blocks: Blocks, torque_filter: float) -> Blocks:
    """Block means with pressure and speed delayed like torque: means over blocks commute with a filter, and are clean
    of spikes."""
    if torque_filter == 0.0:
        return blocks
    pressure, speed = (filtered(blocks.time, channel, torque_filter) for channel in (blocks.pressure, blocks.speed))
    return replace(blocks, pressure=pressure, speed=speed)


def _stretches(blocks: Blocks, dwells: list[slice]) -> list[Stretch]:
    """Torque of each dwell, block by block, with times from its start."""
    times = ((blocks.time[dwell], blocks.torque[dwell]) for dwell in dwells)
    return [Stretch(time=time - time[0], torque=torque) for time, torque in times]


def _plateaus(blocks: Blocks, used: list[slice], torque_sd: FloatArray) -> Plateaus:
    """The means of all channels over the used part of each dwell."""
    torque = _mean(blocks.torque, used)
    return Plateaus(
        pressure=_mean(blocks.pressure, used),
        speed=_mean(blocks.speed, used),
        torque=torque,
        torque_sd=np.maximum(torque_sd, 1e-9 * np.maximum(np.abs(torque), 1e-9)),
        oil_temperature=None if blocks.oil_temperature is None else _mean(blocks.oil_temperature, used),
        plate_temperature=None if blocks.plate_temperature is None else _mean(blocks.plate_temperature, used),
    )


def _notes(cut: PlateauCut, drop: FloatArray) -> list[Note]:
    """Sentences on what was discarded, did not settle or drifts."""
    notes = [
        (
            "transient_discarded",
            f"The first {drop.min():.2f} to {drop.max():.2f} s of {drop.size} dwells, {drop.sum():.1f} s in all, are "
            "left out of their means: torque was settling.",
        )
    ]
    for code, rows, sentence in (
        ("unsettled", ~cut.settled, "{n} of {all} dwells ended before their torque had settled, beginning at {at} s."),
        (
            "drifting",
            cut.settled & (np.abs(cut.drift) > 4.0 * cut.drift_sd),
            "Torque drifts on {n} of {all} settled dwells, beginning at {at} s.",
        ),
    ):
        if rows.any():
            text = sentence.format(n=np.count_nonzero(rows), all=rows.size, at=listed(cut.start[rows]))
            notes.append((code, text))
    return notes


def _used(blocks: Blocks, dwell: slice, drop: float) -> slice:
    """The rows of a dwell after its settling time, three at least."""
    first = int(np.searchsorted(blocks.time[dwell], blocks.time[dwell.start] + drop))
    return slice(min(dwell.start + first, dwell.stop - 3), dwell.stop)


def _mean(channel: FloatArray, dwells: list[slice]) -> FloatArray:
    """Mean [d] of a channel over each dwell."""
    return np.array([channel[dwell].mean() for dwell in dwells])


def _rounding(torque: FloatArray, noise: FloatArray) -> float:
    """Error [Nm] of a mean by rounding to counts of q: q/√12 exp(-2π² σ²/q²), σ the noise [n] Nm before rounding."""
    levels = np.unique(torque[:: max(1, torque.size // SCALE_SAMPLES)])
    if levels.size < 2:
        return 0.0
    count = float(np.diff(levels).min())
    if count**2 == 0.0:  # steps of no torque that is measured: their square underflows
        return 0.0
    before = max(float((noise**2).mean()) / count**2 - 1 / 12, 0.0)  # over many levels, rounding adds q²/12 on average
    return count / math.sqrt(12.0) * math.exp(-2 * math.pi**2 * min(before, 30.0))
