"""Torque that swings at one frequency, whatever the speed: at low speed only (stick-slip), or everywhere."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.detection.raw_records.incoherent import (
    MOST_A_STRETCH,
    PRIOR_STRETCHES,
    SHARES,
    amplitude,
    likelihoods,
    sizes,
)
from models.diagnosis.detection.raw_records.shaft_orders import Line
from models.diagnosis.detection.raw_records.whitened_torque import Swings

#: Shares of the highest speed below which stick-slip is looked for.
SLOW = (0.05, 0.08, 0.125, 0.2, 0.4)
#: Below this share on average the shaft stands.
STANDING = 0.004
#: Windows [s]: at least, at most at low speed, everywhere.
SHORTEST, LONGEST, ANYWHERE = 0.5, 2.5, 2.0
#: A speed is taken over this long [s].
STEADY = 0.1
#: A swing is there after about this long [s]: between at once, and after some of its own periods.
RISE = 0.12
#: Frequencies lie so far apart [Hz]; stick-slip is looked for up to so many.
SPACING, HIGHEST_SLOW = 0.125, 45.0
#: What is around a frequency [bins on either side]: from, to; farther in short windows.
NEAR, FAR = 10, 34
#: Louder around than this many times the noise is no noise.
LOUD = 1.3
#: Size of the second harmonic where there is one, and how likely one is.
SECOND, SECOND_SHARE = 0.33, 0.4
#: Windows looked at, at most, evenly taken; fewest that show a line.
MOST_WINDOWS, FEWEST = 400, 3
#: Frequencies of a share at which the second harmonic's phase is held to the first's; phases tried, and between them.
LOCKED, PHASES, LAGS = 4, 16, 6
#: What is around reaches below the lowest frequency looked at, as shares of `Swings.slowest`.
LOWEST, LOWEST_AROUND = 0.8, 0.4

Bools = NDArray[np.bool_]
IntArray = NDArray[np.intp]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """D and N [w, f]; where they tell what is around, and where they are looked at themselves [w, f]; speeds at least and
    at most [w] rad/s, mean torque [w] Nm, and the usual length [s]."""

    sums: ComplexArray
    weight: FloatArray
    around: Bools
    seen: Bools
    slowest: FloatArray
    fastest: FloatArray
    torque: FloatArray
    length: float


def best_slow(records: Sequence[Swings], order: Line | None = None) -> Line:
    """The evidence of a line at low speed; windows that an order passes at its frequency are left out."""
    found = []
    for share in SLOW:
        windows = _windows(records, share, LONGEST, HIGHEST_SLOW)
        if windows is not None:
            size = np.sqrt(windows.torque / max(float(np.mean(windows.torque)), 1e-300))
            found.append(_line(windows, size, order, share))
    return _joined(found, len(SLOW))


def best_anywhere(records: Sequence[Swings], order: Line | None = None, above: float = 0.0) -> Line:
    """The evidence of a line at all speeds alike, or at all above a share of the highest."""
    windows = _windows(records, 1.0, ANYWHERE, np.inf, above)
    return Line() if windows is None else _joined([_line(windows, np.ones_like(windows.torque), order, 1.0)], 1)


def _joined(found: list[Line], tried: int) -> Line:
    if not found:
        return Line()
    best = max(found, key=lambda each: each.evidence)
    evidence = float(logsumexp([each.evidence for each in found]) - np.log(tried))
    return Line(evidence=evidence, at=best.at, amplitude=best.amplitude, share=best.share, clear=best.clear)


def _windows(
    records: Sequence[Swings], share: float, longest: float, highest: float, above: float = 0.0
) -> Windows | None:
    """Windows of all records in which the shaft is slower than one share of its highest speed and faster than another."""
    top = max(float(np.abs(each.speed).max()) for each in records)
    places = [
        (swings, first, stop)
        for swings in records
        for first, stop in _passages(swings, above * top, share * top, STANDING * top, longest)
    ]
    if len(places) > MOST_WINDOWS:
        places = [places[i] for i in np.linspace(0, len(places) - 1, MOST_WINDOWS).astype(int)]
    if len(places) < FEWEST:
        return None
    count = 1 + int(min(highest, max(each.fastest for each in records)) / SPACING)
    frequency = SPACING * np.arange(count, dtype=np.float64)
    sums, weight = np.zeros((len(places), count), dtype=np.complex128), np.zeros((len(places), count))
    lowest = LOWEST * np.array([[swings.slowest] for swings, _, _ in places])
    for row, (swings, first, stop) in enumerate(places):
        inside = (frequency > LOWEST_AROUND * swings.slowest) & (frequency < swings.fastest)
        size = round(1.0 / (SPACING * swings.step))
        slot = np.minimum(np.round((swings.time[first:stop] - swings.time[first]) / swings.step).astype(int), size - 1)
        rise = -np.expm1(-np.arange(stop - first) * (swings.step / RISE))
        line = np.fft.rfft(np.bincount(slot, swings.matched[first:stop] * rise, size))
        some = np.flatnonzero(inside[: line.size])
        weight[row, some] = float(swings.weight[first:stop] @ rise**2) * swings.response(frequency[some])
        sums[row, some] = line[some]
    speeds = [np.abs(swings.speed[first:stop]) for swings, first, stop in places]
    return Windows(
        sums=sums,
        weight=weight,
        around=weight > 0,
        seen=(weight > 0) & (frequency > lowest),
        slowest=np.array([each.min() for each in speeds]),
        fastest=np.array([each.max() for each in speeds]),
        torque=np.array([abs(float(swings.torque[first:stop].mean())) for swings, first, stop in places]),
        length=float(np.median([(stop - first) * swings.step for swings, first, stop in places])),
    )


def _passages(swings: Swings, above: float, below: float, standing: float, longest: float) -> list[tuple[int, int]]:
    """Samples [first, stop) of windows faster than `above` and slower than `below`, long passages in equal parts."""
    found = []
    speed = uniform_filter1d(np.abs(swings.speed), max(1, round(STEADY / swings.step)), mode="nearest")
    slow = (speed >= above) & (speed <= below)
    for first, stop in zip(swings.starts[:-1], swings.starts[1:], strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], slow[first:stop], [False]]).astype(np.int8)))
        for enter, leave in zip(first + edges[::2], first + edges[1::2], strict=True):
            if (leave - enter) * swings.step < SHORTEST:
                continue
            parts = int(np.ceil((leave - enter) * swings.step / longest))
            bounds = np.linspace(enter, leave, parts + 1).astype(int)
            found += [(int(a), int(b)) for a, b in itertools.pairwise(bounds) if speed[a:b].mean() > standing]
    return found


def _line(windows: Windows, size: FloatArray, order: Line | None, share: float) -> Line:
    """The evidence of a line in these windows, its size in each as [w], over all frequencies."""
    clear = _clear(windows, order)
    seen, around = windows.seen & clear, windows.around & clear
    wanted = np.flatnonzero(seen.sum(axis=0) >= max(FEWEST, 0.3 * seen.shape[0]))
    if wanted.size == 0:
        return Line(share=share)
    power = np.where(around, np.abs(windows.sums) ** 2 / np.maximum(windows.weight, 1e-300), 0.0)
    usual = _levels(power, around, SPACING * windows.length)
    sums = np.where(seen, windows.sums * size[:, np.newaxis] / usual, 0.0)
    weight = np.where(seen, windows.weight * (size**2)[:, np.newaxis] / usual, 0.0)
    power = np.where(seen, power / usual, 0.0)
    both = _likelihoods(power, sums, weight, wanted, skewed=share < 1.0)
    likely = 1.0 / wanted / float(np.sum(1.0 / wanted))
    evidence = float(logsumexp(both, b=SHARES[:, np.newaxis] * likely))
    _, _, column = np.unravel_index(int(both.argmax()), both.shape)
    near = wanted[np.abs(wanted - wanted[column]) < NEAR]
    best = near[int((power[:, near] * weight[:, near]).sum(axis=0).argmax())]  # where windows count for their most
    here = seen[:, best]
    return Line(
        evidence=evidence,
        at=float(SPACING * best),
        amplitude=amplitude(power[here, best], weight[here, best]),
        share=share,
        clear=float(both.max()),
    )


def _likelihoods(
    power: FloatArray, sums: ComplexArray, weight: FloatArray, wanted: IntArray, *, skewed: bool
) -> FloatArray:
    """log L [2, s, f] of a line without and with a second harmonic (`skewed`), their shares beforehand in it.

    Where a second harmonic promises most, its phase is held to the first's; elsewhere it is anything."""
    tried = sizes(weight[:, wanted])
    alone = likelihoods(power[:, wanted], weight[:, wanted], tried)
    second = alone.copy()
    if skewed:
        double = 2 * wanted
        some = np.flatnonzero(double < power.shape[1])
        second[:, some] += likelihoods(power[:, double[some]], weight[:, double[some]], SECOND * tried[:, some])
        for column in some[np.argsort(-second[:, some].max(axis=0))[:LOCKED]]:
            two = [wanted[column], double[column]]
            second[:, column] = _locked(sums[:, two], weight[:, two], tried[:, column])
    return np.stack([alone + np.log(1 - SECOND_SHARE), second + np.log(SECOND_SHARE)])


def _locked(sums: ComplexArray, weight: FloatArray, tried: FloatArray) -> FloatArray:
    """log L [s] of a first and a second harmonic, D and N [w, 2], whose phases keep a lag ψ that all windows share:

    Σ_w ln mean_φ exp(a Re[D₁ e^{-iφ} + q D₂ e^{-i(2φ + ψ)}] - a² (N₁ + q² N₂)/4),   averaged over ψ
    """
    turn = np.exp(-2j * np.pi * np.arange(PHASES) / PHASES)
    lag = np.exp(-2j * np.pi * np.arange(LAGS) / LAGS)
    first = (sums[:, :1] * turn).real
    second = (lag[:, np.newaxis, np.newaxis] * (sums[:, 1:] * turn**2)).real
    along, cost = first + SECOND * second, 0.25 * (weight[:, 0] + SECOND**2 * weight[:, 1])
    top = along.max(axis=-1)
    logs = []
    for one in tried:
        each = one * top + np.log(np.exp(one * (along - top[..., np.newaxis])).mean(axis=-1)) - one**2 * cost
        logs.append(logsumexp(np.minimum(each, MOST_A_STRETCH).sum(axis=-1)) - np.log(LAGS))
    return np.array(logs)


def _clear(windows: Windows, order: Line | None) -> Bools:
    """[w, f]: false where an order passes the frequency in the window."""
    frequency = SPACING * np.arange(windows.sums.shape[1])
    if order is None:
        return np.ones(windows.sums.shape, dtype=np.bool_)
    low, high = (order.at / (2 * np.pi) * each[:, np.newaxis] for each in (windows.slowest, windows.fastest))
    edge = 2.0 / windows.length
    clear = (frequency < low - edge) | (frequency > high + edge)
    return clear & ((frequency < 2 * low - edge) | (frequency > 2 * high + edge))


def _levels(power: FloatArray, seen: Bools, independent: float) -> FloatArray:
    """The mean of u [f] around each frequency: the louder side's, 1 unless many windows say otherwise.

    Where it is loud around, something is left that is no noise, with crests of its own: there it is the highest crest.
    `independent` is how many bins' worth of news a bin holds."""
    total, count = np.where(seen, power, 0.0).sum(axis=0), seen.sum(axis=0).astype(float)
    own = max(1, round(1.0 / independent))
    near, side = max(NEAR, 3 * own // 2), max(FAR - NEAR, 4 * own)
    mean = _smoothed(total, count, side, independent, PRIOR_STRETCHES)
    loud = _smoothed(total, count, side, independent, 1.0)
    crest = maximum_filter1d(_smoothed(total, count, own, independent, 1.0), side)
    pad, by = near + side, near + side // 2
    around = np.arange(total.size) + pad
    mean, loud, crest = (
        np.maximum(*(np.pad(each, pad, mode="edge")[around + shift] for shift in (-by, by)))
        for each in (mean, loud, crest)
    )
    return np.asarray(np.where(mean > LOUD, np.maximum(loud, crest), mean))


def _smoothed(total: FloatArray, count: FloatArray, width: int, independent: float, prior: float) -> FloatArray:
    """The mean of u [f] over a width of bins, 1 unless more than `prior` windows say otherwise."""
    sums, many = (independent * width * uniform_filter1d(each, width, mode="constant") for each in (total, count))
    return np.asarray((sums + prior) / (many + prior))
