"""Torque that swings at one frequency, whatever the speed: at low speed only (stick-slip), or at all speeds. It is looked
for in windows of raw records within a range of speeds, by their matched spectra.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.design.design import IntArray
from models.diagnosis.raw_records import criteria
from models.diagnosis.raw_records.swing import Line, amplitude, log_likelihood_ratios, trial_amplitudes
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
        for first, stop in _passages(record, above * top, below * top, criteria.STANDSTILL_SHARE * top, longest)
    ]
    if len(places) > criteria.MOST_WINDOWS:
        places = [places[i] for i in np.linspace(0, len(places) - 1, criteria.MOST_WINDOWS).astype(int)]
    if len(places) < criteria.FEWEST_WINDOWS:
        return None
    count = 1 + int(min(highest, max(record.highest for record in records)) / criteria.SPACING)
    frequency = criteria.SPACING * np.arange(count, dtype=np.float64)
    sums, weight = np.zeros((len(places), count), dtype=np.complex128), np.zeros((len(places), count))
    lowest_line = criteria.LOWEST_LINE * np.array([[record.lowest] for record, _, _ in places])
    for row, (record, first, stop) in enumerate(places):
        inside = (frequency > criteria.LOWEST_BESIDE * record.lowest) & (frequency < record.highest)
        size = round(1.0 / (criteria.SPACING * record.step))
        slot = np.minimum(np.round((record.time[first:stop] - record.time[first]) / record.step).astype(int), size - 1)
        envelope = -np.expm1(-np.arange(stop - first) * (record.step / criteria.RISE_TIME))
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
    speed = uniform_filter1d(np.abs(record.speed), max(1, round(criteria.SPEED_AVERAGE / record.step)), mode="nearest")
    within = (speed >= above) & (speed <= below)
    for first, stop in zip(record.starts[:-1], record.starts[1:], strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], within[first:stop], [False]]).astype(np.int8)))
        for enter, leave in zip(first + edges[::2], first + edges[1::2], strict=True):
            if (leave - enter) * record.step < criteria.SHORTEST_WINDOW:
                continue
            parts = int(np.ceil((leave - enter) * record.step / longest))
            bounds = np.linspace(enter, leave, parts + 1).astype(int)
            passages += [(int(a), int(b)) for a, b in itertools.pairwise(bounds) if speed[a:b].mean() > standstill]
    return passages


#: Phases of the first harmonic, and lags of the second, over which a tied second harmonic is averaged.
_PHASES, _LAGS = 16, 6


def best_slow_line(records: Sequence[WhitenedRecord], order: Line | None = None) -> Line:
    """The evidence of a line at low speed, its size by the load's root; windows in which `order` passes its frequency are
    left out."""
    lines = []
    for share in criteria.SLOW_SHARES:
        windows = windows_of(records, share, criteria.LONGEST_SLOW_WINDOW, criteria.HIGHEST_SLOW)
        if windows is not None:
            size = np.sqrt(windows.torque / max(float(np.mean(windows.torque)), 1e-300))
            lines.append(_line(windows, size, order, share))
    return _averaged(lines, len(criteria.SLOW_SHARES))


def best_line(records: Sequence[WhitenedRecord], order: Line | None = None, above: float = 0.0) -> Line:
    """The evidence of a line at all speeds alike, or at all above a share of the highest."""
    windows = windows_of(records, 1.0, criteria.LONGEST_WINDOW, np.inf, above)
    return Line() if windows is None else _averaged([_line(windows, np.ones_like(windows.torque), order, 1.0)], 1)


def _averaged(lines: list[Line], tried: int) -> Line:
    """The best line, with the evidence averaged over as many speed shares as were tried."""
    if not lines:
        return Line()
    best = max(lines, key=lambda line: line.evidence)
    return replace(best, evidence=float(logsumexp([line.evidence for line in lines]) - np.log(tried)))


def _line(windows: Windows, size: FloatArray, order: Line | None, share: float) -> Line:
    """The evidence of a line in these windows, its relative size in each [w], averaged over all frequencies with a prior
    ∝ 1/f; with a second harmonic in it at low speed."""
    clear = _clear_of_order(windows, order)
    visible, beside = windows.visible & clear, windows.beside & clear
    least = max(criteria.FEWEST_WINDOWS, criteria.LEAST_WINDOW_SHARE * visible.shape[0])
    frequencies = np.flatnonzero(visible.sum(axis=0) >= least)  # as multiples of SPACING
    if frequencies.size == 0:
        return Line(speed_share=share)
    power = np.where(beside, np.abs(windows.sums) ** 2 / np.maximum(windows.weight, 1e-300), 0.0)
    noise = _noise_levels(power, beside, criteria.SPACING * windows.length)
    sums = np.where(visible, windows.sums * size[:, np.newaxis] / noise, 0.0)
    weight = np.where(visible, windows.weight * (size**2)[:, np.newaxis] / noise, 0.0)
    power = np.where(visible, power / noise, 0.0)
    logs = _log_likelihoods(power, sums, weight, frequencies, second_harmonic=share < 1.0)
    prior = 1.0 / frequencies / float(np.sum(1.0 / frequencies))
    evidence = float(logsumexp(logs, b=criteria.AMPLITUDE_WEIGHTS[:, np.newaxis] * prior))
    _, _, column = np.unravel_index(int(logs.argmax()), logs.shape)
    near = frequencies[np.abs(frequencies - frequencies[column]) < criteria.NEAREST_BIN]
    best = near[
        int((power[:, near] * weight[:, near]).sum(axis=0).argmax())
    ]  # where the windows with most weight agree
    shown = visible[:, best]
    return Line(
        evidence=evidence,
        position=float(criteria.SPACING * best),
        amplitude=amplitude(power[shown, best], weight[shown, best]),
        speed_share=share,
        peak=float(logs.max()),
    )


def _log_likelihoods(
    power: FloatArray, sums: ComplexArray, weight: FloatArray, frequencies: IntArray, *, second_harmonic: bool
) -> FloatArray:
    """log L(a)/L(0) [2, s, f] without and with a second harmonic, the log of their prior probabilities included.

    At the frequencies where a second harmonic promises most its phase is tied to the first's; elsewhere it is free."""
    amplitudes = trial_amplitudes(weight[:, frequencies])
    first = log_likelihood_ratios(power[:, frequencies], weight[:, frequencies], amplitudes)
    both = first.copy()
    if second_harmonic:
        double = 2 * frequencies
        inside = np.flatnonzero(double < power.shape[1])
        both[:, inside] += log_likelihood_ratios(
            power[:, double[inside]], weight[:, double[inside]], criteria.SECOND_HARMONIC * amplitudes[:, inside]
        )
        for column in inside[np.argsort(-both[:, inside].max(axis=0))[: criteria.TIED_FREQUENCIES]]:
            pair = [frequencies[column], double[column]]
            both[:, column] = _tied(sums[:, pair], weight[:, pair], amplitudes[:, column])
    return np.stack([first + np.log(1 - criteria.SECOND_PROBABILITY), both + np.log(criteria.SECOND_PROBABILITY)])


def _tied(sums: ComplexArray, weight: FloatArray, amplitudes: FloatArray) -> FloatArray:
    """log L(a)/L(0) [s] of a first and a second harmonic, D and N [w, 2], whose phases keep a lag ψ that all windows share:

    Σ_w ln mean_φ exp(a Re[D₁ e^{-iφ} + q D₂ e^{-i(2φ + ψ)}] - a² (N₁ + q² N₂)/4),   averaged over ψ
    """
    phases = np.exp(-2j * np.pi * np.arange(_PHASES) / _PHASES)
    lags = np.exp(-2j * np.pi * np.arange(_LAGS) / _LAGS)
    first = (sums[:, :1] * phases).real
    second = (lags[:, np.newaxis, np.newaxis] * (sums[:, 1:] * phases**2)).real
    along, cost = (
        first + criteria.SECOND_HARMONIC * second,
        0.25 * (weight[:, 0] + criteria.SECOND_HARMONIC**2 * weight[:, 1]),
    )
    top = along.max(axis=-1)
    logs = []
    for a in amplitudes:
        by_window = a * top + np.log(np.exp(a * (along - top[..., np.newaxis])).mean(axis=-1)) - a**2 * cost
        logs.append(logsumexp(np.minimum(by_window, criteria.MOST_PER_STRETCH).sum(axis=-1)) - np.log(_LAGS))
    return np.array(logs)


def _clear_of_order(windows: Windows, order: Line | None) -> Bools:
    """[w, f]: false where the order, or its double, passes the frequency in the window."""
    frequency = criteria.SPACING * np.arange(windows.sums.shape[1])
    if order is None:
        return np.ones(windows.sums.shape, dtype=np.bool_)
    low, high = (order.position / (2 * np.pi) * speed[:, np.newaxis] for speed in (windows.slowest, windows.fastest))
    edge = 2.0 / windows.length
    clear = (frequency < low - edge) | (frequency > high + edge)
    return clear & ((frequency < 2 * low - edge) | (frequency > 2 * high + edge))


def _noise_levels(power: FloatArray, beside: Bools, independent: float) -> FloatArray:
    """The mean of u [f] beside each frequency: that of the louder side, 1 unless many windows show another.

    Where it is LOUD, something other than noise remains, with crests of its own: there it is the highest crest.
    `independent` is how many independent values a bin counts for."""
    total, count = np.where(beside, power, 0.0).sum(axis=0), beside.sum(axis=0).astype(float)
    own = max(1, round(1.0 / independent))
    near, side = max(criteria.NEAREST_BIN, 3 * own // 2), max(criteria.FARTHEST_BIN - criteria.NEAREST_BIN, 4 * own)
    mean = _smoothed(total, count, side, independent, criteria.PRIOR_STRETCHES)
    loud = _smoothed(total, count, side, independent, 1.0)
    crest = maximum_filter1d(_smoothed(total, count, own, independent, 1.0), side)
    pad, shift = near + side, near + side // 2
    padded = np.arange(total.size) + pad
    mean, loud, crest = (
        np.maximum(*(np.pad(level, pad, mode="edge")[padded + offset] for offset in (-shift, shift)))
        for level in (mean, loud, crest)
    )
    return np.asarray(np.where(mean > criteria.LOUD, np.maximum(loud, crest), mean))


def _smoothed(total: FloatArray, count: FloatArray, width: int, independent: float, prior: float) -> FloatArray:
    """The mean of u [f] over `width` bins, 1 unless more than `prior` windows show another."""
    sums, counts = (independent * width * uniform_filter1d(values, width, mode="constant") for values in (total, count))
    return np.asarray((sums + prior) / (counts + prior))
