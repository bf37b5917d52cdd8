"""Order tracking: torque that swings k times a revolution, demodulated along the shaft's angle in stretches.

The phase may be kept over one or several stretches, and the size may go with the load or with the speed; evidence is
averaged over both and over the orders by their prior probabilities.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.design.design import IntArray
from models.diagnosis.raw_records import criteria
from models.diagnosis.raw_records.swing import (
    Line,
    amplitude,
    log_likelihood_ratios,
    noise_level,
    trial_amplitudes,
)
from models.diagnosis.raw_records.whitened_torque import WhitenedRecord

#: Laws of the size: with the load (the torque's root, between independent of it and proportional), or with the speed.
_LAWS = ("load", "speed")
#: D and N [b] of an order in the stretches of all records.
Demodulated: TypeAlias = tuple[NDArray[np.complex128], FloatArray]


def best_order(records: Sequence[WhitenedRecord], line: Line | None = None) -> Line:
    """The evidence of ripple and its best order; samples in which `line` would lie on the order are left out."""
    stretches = [_stretch_starts(record) for record in records]
    groups = _coherent_groups(records)
    sizes = _relative_sizes(records, stretches)
    orders = sorted(
        {
            round(k + offset, 1)
            for k in criteria.ORDERS
            for offset in (*criteria.BELOW_ORDER, 0.0, *criteria.ABOVE_ORDER)
        }
    )
    demodulated = _demodulated(records, stretches, orders, line)
    by_order: dict[float, FloatArray] = {}
    best, highest = Line(), -np.inf
    for order, probability in criteria.ORDERS.items():
        logs = np.zeros((len(_LAWS), len(criteria.COHERENT_STRETCHES)))
        for i, law in enumerate(_LAWS):
            for j, kept in enumerate(criteria.COHERENT_STRETCHES):
                evidence, size, peak = _order_evidence(demodulated, order, sizes[law], groups[kept])
                logs[i, j] = evidence
                if evidence + np.log(probability) > highest and peak > 0:
                    highest = evidence + float(np.log(probability))
                    best = Line(position=order, amplitude=size, peak=peak)
        by_order[order] = logs
    parts = [np.log(probability / by_order[k].size) + by_order[k].ravel() for k, probability in criteria.ORDERS.items()]
    both = by_order[criteria.PAIRED_ORDERS[0]] + by_order[criteria.PAIRED_ORDERS[1]]
    parts.append(np.log(criteria.PAIRED_PROBABILITY / both.size) + both.ravel())
    return replace(best, evidence=float(logsumexp(np.concatenate(parts))))


def _stretch_count(record: WhitenedRecord, first: int, stop: int) -> int:
    return max(1, round((stop - first) * record.step / criteria.STRETCH))


def _stretch_starts(record: WhitenedRecord) -> IntArray:
    """First samples of the stretches of a record."""
    starts = []
    for first, stop in zip(record.starts[:-1], record.starts[1:], strict=True):
        count = _stretch_count(record, first, stop)
        starts.append(np.linspace(first, stop, count + 1)[:-1].astype(np.intp))
    return np.concatenate(starts)


def _coherent_groups(records: Sequence[WhitenedRecord]) -> dict[int, IntArray]:
    """For each number of stretches over which the phase is kept: the first stretches of the groups, which stay within a
    piece."""
    groups: dict[int, list[int]] = {kept: [] for kept in criteria.COHERENT_STRETCHES}
    before = 0
    for record in records:
        for first, stop in zip(record.starts[:-1], record.starts[1:], strict=True):
            count = _stretch_count(record, first, stop)
            for kept in criteria.COHERENT_STRETCHES:
                parts = max(1, round(count / kept))
                groups[kept] += (before + np.linspace(0, count, parts + 1)[:-1].astype(np.intp)).tolist()
            before += count
    return {kept: np.array(firsts, dtype=np.intp) for kept, firsts in groups.items()}


def _relative_sizes(records: Sequence[WhitenedRecord], stretches: list[IntArray]) -> dict[str, FloatArray]:
    """Each law's relative size [b] in the stretches, 1 on average."""

    def means(channels: list[FloatArray]) -> FloatArray:
        by_record = [
            np.add.reduceat(np.abs(channel), firsts) / np.diff(np.append(firsts, channel.size))
            for channel, firsts in zip(channels, stretches, strict=True)
        ]
        values = np.concatenate(by_record)
        return values / max(float(np.sqrt(np.mean(values**2))), 1e-300)

    return {
        "load": np.sqrt(means([record.torque for record in records])),
        "speed": means([record.speed for record in records]),
    }


def _demodulated(
    records: Sequence[WhitenedRecord], stretches: list[IntArray], orders: list[float], line: Line | None
) -> dict[float, Demodulated]:
    """D and N of every order (multiples of a tenth, ascending)."""
    highest = max(float(np.abs(record.speed).max()) for record in records)
    parts: dict[float, list[tuple[FloatArray, FloatArray]]] = {order: [] for order in orders}
    for record, firsts in zip(records, stretches, strict=True):
        hertz = record.speed / (2 * np.pi)
        steps = np.diff(record.time, prepend=record.time[0])
        angle = 2 * np.pi * np.cumsum(hertz * steps)
        hertz = np.abs(hertz)
        # e^{-ikφ} of each order from that of the one before, by powers of e^{-iφ/10}
        tenths = {1: np.exp(-0.1j * angle)}
        for k in range(2, 11):
            tenths[k] = tenths[k - 1] * tenths[1]
        carrier, carrier_tenths = np.ones(angle.size, dtype=np.complex128), 0
        counts = np.diff(np.append(firsts, angle.size))
        for order in orders:
            while carrier_tenths < round(10 * order):
                step = min(10, round(10 * order) - carrier_tenths)
                carrier, carrier_tenths = carrier * tenths[step], carrier_tenths + step
            frequency = order * hertz
            visible = (frequency > record.lowest) & (frequency < record.highest)
            if line is not None:
                distance = np.minimum(np.abs(frequency - line.position), np.abs(frequency - 2 * line.position))
                slow = hertz * 2 * np.pi <= criteria.LINE_SPEED * line.speed_share * highest
                visible &= ~((distance < criteria.LINE_WIDTH) & slow)
            weight = record.weight * visible
            total = np.add.reduceat(carrier * (record.matched * visible), firsts)
            power = np.add.reduceat(weight * record.response(frequency), firsts)
            enough = np.add.reduceat(visible.astype(float), firsts) > criteria.LEAST_VISIBLE * counts
            parts[order].append((total * enough, power * enough))
    return {
        k: (np.concatenate([d for d, _ in all_]), np.concatenate([n for _, n in all_])) for k, all_ in parts.items()
    }


def _powers(order: Demodulated, size: FloatArray, firsts: IntArray) -> tuple[FloatArray, FloatArray]:
    """u and N of the groups in which the order is visible."""
    total, weight = np.add.reduceat(order[0] * size, firsts), np.add.reduceat(order[1] * size**2, firsts)
    visible = weight > 0
    return np.abs(total[visible]) ** 2 / weight[visible], weight[visible]


def _order_evidence(
    demodulated: dict[float, Demodulated], order: float, size: FloatArray, firsts: IntArray
) -> tuple[float, float, float]:
    """Evidence of an order, its amplitude, and the largest log likelihood ratio."""
    power, weight = _powers(demodulated[order], size, firsts)
    if power.size < criteria.FEWEST_STRETCHES:
        return 0.0, 0.0, 0.0
    sides = []
    for offsets in (criteria.BELOW_ORDER, criteria.ABOVE_ORDER):
        beside = [_powers(demodulated[round(order + offset, 1)], size, firsts)[0] for offset in offsets]
        sides.append((float(sum(values.sum() for values in beside)), float(sum(values.size for values in beside))))
    noise = noise_level(*sides)
    logs = log_likelihood_ratios(power / noise, weight / noise, trial_amplitudes(weight / noise))
    return (
        float(logsumexp(logs, b=criteria.AMPLITUDE_WEIGHTS)),
        amplitude(power / noise, weight / noise),
        float(logs.max()),
    )
