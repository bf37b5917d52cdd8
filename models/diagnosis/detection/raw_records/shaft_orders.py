"""Torque that swings k times a turn: samples demodulated along the shaft's angle, in stretches short and long."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.detection.raw_records.incoherent import SHARES, amplitude, level, likelihoods, sizes
from models.diagnosis.detection.raw_records.whitened_torque import Swings

IntArray = NDArray[np.intp]

#: Orders looked for and how likely each is beforehand.
ORDERS = dict(
    zip(
        (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0),
        (0.05, 0.25, 0.03, 0.20, 0.08, 0.07, 0.03, 0.05, 0.04, 0.02, 0.03),
        strict=True,
    )
)
#: The first and second together.
BOTH, BOTH_SHARE = (1.0, 2.0), 0.15
#: Orders beside one that is looked for, in which it does not show.
LEFT, RIGHT = (-0.3, -0.2), (0.2, 0.3)
#: Length of a stretch [s], and how many of them keep their phase.
STRETCH, KEPT = 1.25, (1, 2, 4, 12)
#: A law of the size: with the load (the torque's root, between all alike and like the torque), or with the speed.
LAWS = ("load", "speed")
#: Fewer stretches show no order.
FEWEST = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """What swings best: evidence [nats], its order or frequency [Hz], its amplitude [Nm]; `share` of the highest speed
    below which it does; `clear` is how far log L stands over none."""

    evidence: float = 0.0
    at: float = 0.0
    amplitude: float = 0.0
    share: float = 1.0
    clear: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Turns:
    """D and N [b] of an order in the stretches of all records."""

    sums: NDArray[np.complex128]
    weight: FloatArray


def best_order(records: Sequence[Swings], line: Line | None = None) -> Line:
    """The evidence of ripple and its best order; samples in which a line would lie on it are left out."""
    stretches = [_bounds(each) for each in records]
    groups = _groups(records)
    sizes_of = _sizes_of(records, stretches)
    wanted = sorted({round(k + by, 1) for k in ORDERS for by in (*LEFT, 0.0, *RIGHT)})
    turns = demodulated(records, stretches, wanted, line)
    found: dict[float, FloatArray] = {}
    best, highest = Line(), -np.inf
    for order in ORDERS:
        logs = np.zeros((len(LAWS), len(KEPT)))
        for i, law in enumerate(LAWS):
            for j, kept in enumerate(KEPT):
                value, size, clear = _order(turns, order, sizes_of[law], groups[kept])
                logs[i, j] = value
                if value + np.log(ORDERS[order]) > highest and clear > 0:
                    highest = value + float(np.log(ORDERS[order]))
                    best = Line(at=order, amplitude=size, clear=clear)
        found[order] = logs
    parts = [np.log(share / found[k].size) + found[k].ravel() for k, share in ORDERS.items()]
    both = found[BOTH[0]] + found[BOTH[1]]
    parts.append(np.log(BOTH_SHARE / both.size) + both.ravel())
    return Line(
        evidence=float(logsumexp(np.concatenate(parts))), at=best.at, amplitude=best.amplitude, clear=best.clear
    )


def _bounds(swings: Swings) -> IntArray:
    """First samples of the stretches."""
    firsts = []
    for first, stop in zip(swings.starts[:-1], swings.starts[1:], strict=True):
        count = max(1, round((stop - first) * swings.step / STRETCH))
        firsts.append(np.linspace(first, stop, count + 1)[:-1].astype(np.intp))
    return np.concatenate(firsts)


def _groups(records: Sequence[Swings]) -> dict[int, IntArray]:
    """Of each number of stretches that keep their phase: the first stretches of the groups, which stay within a piece."""
    found: dict[int, list[int]] = {kept: [] for kept in KEPT}
    at = 0
    for swings in records:
        for first, stop in zip(swings.starts[:-1], swings.starts[1:], strict=True):
            count = max(1, round((stop - first) * swings.step / STRETCH))
            for kept in KEPT:
                parts = max(1, round(count / kept))
                found[kept] += (at + np.linspace(0, count, parts + 1)[:-1].astype(np.intp)).tolist()
            at += count
    return {kept: np.array(firsts, dtype=np.intp) for kept, firsts in found.items()}


def _sizes_of(records: Sequence[Swings], stretches: list[IntArray]) -> dict[str, FloatArray]:
    """Each law's size [b] in the stretches, 1 on average."""

    def means(values: list[FloatArray]) -> FloatArray:
        each = [
            np.add.reduceat(np.abs(value), firsts) / np.diff(np.append(firsts, value.size))
            for value, firsts in zip(values, stretches, strict=True)
        ]
        found = np.concatenate(each)
        return found / max(float(np.sqrt(np.mean(found**2))), 1e-300)

    return {"load": np.sqrt(means([each.torque for each in records])), "speed": means([each.speed for each in records])}


def demodulated(
    records: Sequence[Swings], stretches: list[IntArray], orders: list[float], line: Line | None
) -> dict[float, Turns]:
    """D and N of every order."""
    highest = max(float(np.abs(each.speed).max()) for each in records)
    parts: dict[float, list[tuple[FloatArray, FloatArray]]] = {order: [] for order in orders}
    for swings, firsts in zip(records, stretches, strict=True):
        hertz = swings.speed / (2 * np.pi)
        steps = np.diff(swings.time, prepend=swings.time[0])
        angle = 2 * np.pi * np.cumsum(hertz * steps)
        hertz = np.abs(hertz)
        tenth = {1: np.exp(-0.1j * angle)}
        for k in range(2, 11):
            tenth[k] = tenth[k - 1] * tenth[1]
        turn, now = np.ones(angle.size, dtype=np.complex128), 0
        counts = np.diff(np.append(firsts, angle.size))
        for order in orders:
            while now < round(10 * order):
                by = min(10, round(10 * order) - now)
                turn, now = turn * tenth[by], now + by
            frequency = order * hertz
            seen = (frequency > swings.slowest) & (frequency < swings.fastest)
            if line is not None:
                near = np.minimum(np.abs(frequency - line.at), np.abs(frequency - 2 * line.at)) < 1.0
                seen &= ~(near & (hertz * 2 * np.pi <= 1.2 * line.share * highest))
            weight = swings.weight * seen
            total = np.add.reduceat(turn * (swings.matched * seen), firsts)
            power = np.add.reduceat(weight * swings.response(frequency), firsts)
            lasting = np.add.reduceat(seen.astype(float), firsts) > 0.25 * counts
            parts[order].append((total * lasting, power * lasting))
    return {
        order: Turns(sums=np.concatenate([a for a, _ in each]), weight=np.concatenate([b for _, b in each]))
        for order, each in parts.items()
    }


def _powers(turns: Turns, size: FloatArray, firsts: IntArray) -> tuple[FloatArray, FloatArray]:
    """u and N of the groups that hold anything."""
    total = np.add.reduceat(turns.sums * size, firsts)
    weight = np.add.reduceat(turns.weight * size**2, firsts)
    some = weight > 0
    return np.abs(total[some]) ** 2 / weight[some], weight[some]


def _order(turns: dict[float, Turns], order: float, size: FloatArray, firsts: IntArray) -> tuple[float, float, float]:
    """Evidence of an order, amplitude, and log L over none at it."""
    power, weight = _powers(turns[order], size, firsts)
    if power.size < FEWEST:
        return 0.0, 0.0, 0.0
    sides = []
    for side in (LEFT, RIGHT):
        around = [_powers(turns[round(order + by, 1)], size, firsts)[0] for by in side]
        sides.append((float(sum(each.sum() for each in around)), float(sum(each.size for each in around))))
    usual = level(*sides)
    tried = sizes(weight / usual)
    logs = likelihoods(power / usual, weight / usual, tried)
    return float(logsumexp(logs, b=SHARES)), amplitude(power / usual, weight / usual), float(logs.max())
