"""A swing that stands out of the noise, at an order of the shaft or at a fixed frequency: evidence without its phase.

The phase is unknown in every stretch, the size follows one law in all. With u = |D|²/N of a stretch (`whitened_torque`),
exponential of mean 1 where nothing swings, and λ = a² N/4,

    log L(a)/L(0) = Σ_j ln I0(2 √(λ_j u_j)) - λ_j                                          (Rice)

averaged over a with the prior AMPLITUDE_WEIGHTS. Where nothing swings, the mean of u is taken from beside the order or
frequency in question.

Order tracking: torque that swings k times a revolution, demodulated along the shaft's angle in stretches.

The phase may be kept over one or several stretches, and the size may go with the load or with the speed; evidence is
averaged over both and over the orders by their prior probabilities.

Torque that swings at one frequency, whatever the speed: at low speed only (stick-slip), or at all speeds. It is looked
for in windows of raw records within a range of speeds, by their matched spectra.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.special import i0e, logsumexp

from models.arrays import FloatArray
from models.diagnosis.design.design import IntArray
from models.diagnosis.raw_records.whitened_torque import WhitenedRecord

Bools: TypeAlias = NDArray[np.bool_]
ComplexArray: TypeAlias = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A swing at an order of the shaft or at a frequency; the default value is none."""

    evidence: float = 0.0  # [nats], averaged over everything tried
    position: float = 0.0  # the order [per revolution] or the frequency [Hz]
    amplitude: float = 0.0  # [Nm]
    speed_share: float = 1.0  # of the highest speed, below which it acts
    peak: float = 0.0  # the largest log likelihood ratio [nats]


#: Amplitudes tried, as multiples of the one at which all stretches together show about 4 nats, and their prior weights: a
#: loud swing is evident with any.
AMPLITUDES = np.array([0.9, 1.1, 1.35, 1.65, 2.0, 2.5, 3.2, 4.5, 7.0, 12.0, 25.0, 60.0])
AMPLITUDE_WEIGHTS = np.repeat([1.0, 0.5, 0.2, 0.1], [7, 1, 1, 3])
AMPLITUDE_WEIGHTS /= AMPLITUDE_WEIGHTS.sum()
#: One stretch counts for at most so many nats: one burst is not an order.
MOST_PER_STRETCH = 10.0
#: The noise level beside a line is taken for 1 unless more than so many stretches show another.
PRIOR_STRETCHES = 40.0

_TABLE_STEP, _TABLE_END = 0.02, 60.0
_GRID = np.arange(0.0, _TABLE_END + 2 * _TABLE_STEP, _TABLE_STEP)
_TABLE = np.log(i0e(_GRID)) + _GRID
_TABLE_SLOPE = np.diff(_TABLE, append=_TABLE[-1])


def rice(power: FloatArray, lam: FloatArray) -> FloatArray:
    """Log likelihood ratio log L(a)/L(0) of power u >= 0 at λ >= 0 (Rice), broadcast."""
    root = 2.0 * np.sqrt(power * lam)
    return np.asarray(_log_bessel(root) - lam, dtype=np.float64)


def _log_bessel(x: FloatArray) -> FloatArray:
    """ln I0(x) of x >= 0, within 1e-4: interpolated in a table, beyond it x - ½ ln(2π x)."""
    place = np.minimum(x, _TABLE_END) * (1.0 / _TABLE_STEP)
    row = place.astype(np.intp)
    values = _TABLE[row] + (place - row) * _TABLE_SLOPE[row]
    beyond = x > _TABLE_END
    if beyond.any():
        values[beyond] = x[beyond] - 0.5 * np.log(2 * np.pi * x[beyond])
    return np.asarray(values, dtype=np.float64)


def trial_amplitudes(weight: FloatArray) -> FloatArray:
    """Trial amplitudes a [s] for stretches of weight N [j], or [s, f] for N [j, f], each column by itself."""
    # λ contributes λ²/2 where it is small, and itself where it is large
    # all stretches together show about 4 nats at amplitude 1
    faint = np.sqrt(2 * 4.0 / np.maximum(np.square(weight).sum(axis=0), 1e-300))
    return np.asarray(2.0 * np.sqrt(np.multiply.outer(AMPLITUDES**2, faint)))


def log_likelihood_ratios(power: FloatArray, weight: FloatArray, amplitudes: FloatArray) -> FloatArray:
    """Log likelihood ratios log L(a)/L(0) [s] (or [s, f]) of u and N [j] (or [j, f]) at amplitudes a [s] (or
    [s, f])."""
    return np.stack([np.minimum(rice(power, 0.25 * weight * a**2), MOST_PER_STRETCH).sum(axis=0) for a in amplitudes])


def amplitude(power: FloatArray, weight: FloatArray) -> float:
    """Moment estimate of the amplitude a from the means of u and N [j]: E u = 1 + a² N/4."""
    return float(2.0 * np.sqrt(max(float((power - 1.0).sum()), 0.0) / max(float(weight.sum()), 1e-300)))


#: Orders looked for [per revolution] and their prior probabilities; the first and second order together have another 0.15.
ORDERS = {0.5: 0.05, 1.0: 0.25, 1.5: 0.03, 2.0: 0.20, 3.0: 0.08, 4.0: 0.07, 5.0: 0.03, 6.0: 0.05, 8.0: 0.04}
ORDERS |= {10.0: 0.02, 12.0: 0.03}
#: Offsets [per revolution] of the orders beside one, which give the noise level: it does not show there.
_BESIDE = (0.2, 0.3)
#: Numbers of stretches over which the phase may be kept.
_COHERENT = (1, 2, 4, 12)
#: Laws of the size: with the load (the torque's root, between independent of it and proportional), or with the speed.
_LAWS = ("load", "speed")
#: D and N [b] of an order in the stretches of all records.
Demodulated: TypeAlias = tuple[ComplexArray, FloatArray]


def best_order(records: Sequence[WhitenedRecord], line: Line | None = None) -> Line:
    """The shaft order of highest evidence as a line, with the evidence of ripple averaged over all orders; samples in
    which `line` would lie on the order are left out."""
    stretches, groups = _stretches(records)
    sizes = _relative_sizes(records, stretches)
    orders = sorted({round(k + side * offset, 1) for k in ORDERS for side in (-1.0, 0.0, 1.0) for offset in _BESIDE})
    demodulated = _demodulated(records, stretches, orders, line)
    by_order: dict[float, FloatArray] = {}
    best, highest = Line(), -np.inf
    for order, probability in ORDERS.items():
        logs = np.zeros((len(_LAWS), len(_COHERENT)))
        for (i, law), (j, coherent_time) in itertools.product(enumerate(_LAWS), enumerate(_COHERENT)):
            found = _line_at_order(demodulated, order, sizes[law], groups[coherent_time])
            logs[i, j] = found.evidence
            if found.evidence + np.log(probability) > highest and found.peak > 0:
                highest, best = found.evidence + float(np.log(probability)), found
        by_order[order] = logs
    parts = [np.log(probability / by_order[k].size) + by_order[k].ravel() for k, probability in ORDERS.items()]
    both = by_order[1.0] + by_order[2.0]
    parts.append(np.log(0.15 / both.size) + both.ravel())
    return replace(best, evidence=float(logsumexp(np.concatenate(parts))))


def _stretches(records: Sequence[WhitenedRecord]) -> tuple[list[IntArray], dict[int, IntArray]]:
    """First samples of each record's stretches; and for each number of stretches over which a swing keeps its phase,
    the first stretches of its groups, as indices of the stretches of all records. No group goes on over a gap in a
    record."""
    starts, groups, stretches_before = [], {kept: list[IntArray]() for kept in _COHERENT}, 0
    for record in records:
        own = []
        for first, stop in itertools.pairwise(record.starts):
            count = max(1, round((stop - first) * record.step / 1.25))  # stretches of 1.25 s
            own.append(np.linspace(first, stop, count + 1)[:-1].astype(np.intp))
            for kept in _COHERENT:
                parts = max(1, round(count / kept))
                groups[kept].append(stretches_before + np.linspace(0, count, parts + 1)[:-1].astype(np.intp))
            stretches_before += count
        starts.append(np.concatenate(own))
    return starts, {kept: np.concatenate(firsts) for kept, firsts in groups.items()}


def _relative_sizes(records: Sequence[WhitenedRecord], stretches: list[IntArray]) -> dict[str, FloatArray]:
    """Relative amplitude [b] of a swing in the stretches, by law: proportional to speed, or to the root of the load,
    each relative to its root mean square."""
    sizes = {}
    for law, name in (("load", "torque"), ("speed", "speed")):
        channels = [getattr(record, name) for record in records]
        by_record = [
            np.add.reduceat(np.abs(channel), firsts) / np.diff(np.append(firsts, channel.size))
            for channel, firsts in zip(channels, stretches, strict=True)
        ]
        values = np.concatenate(by_record)
        sizes[law] = values / max(float(np.sqrt(np.mean(values**2))), 1e-300)
    return sizes | {"load": np.sqrt(sizes["load"])}


def _demodulated(
    records: Sequence[WhitenedRecord], stretches: list[IntArray], orders: list[float], line: Line | None
) -> dict[float, Demodulated]:
    """Demodulated sums D and weights N of every order (multiples of a tenth, ascending)."""
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
                # the line acts up to some more than its speed
                slow = hertz * 2 * np.pi <= 1.2 * line.speed_share * highest
                visible &= ~((distance < 1.0) & slow)  # 1 Hz to either side
            weight = record.weight * visible
            total = np.add.reduceat(carrier * (record.matched * visible), firsts)
            power = np.add.reduceat(weight * record.response(frequency), firsts)
            # in a quarter of the stretch's samples
            enough = np.add.reduceat(visible.astype(float), firsts) > 0.25 * counts
            parts[order].append((total * enough, power * enough))
    return {
        k: (np.concatenate([d for d, _ in all_]), np.concatenate([n for _, n in all_])) for k, all_ in parts.items()
    }


def _powers(order: Demodulated, size: FloatArray, firsts: IntArray) -> tuple[FloatArray, FloatArray]:
    """Power u [v] and weight N [v] of the groups in which the order is visible, D summed over a group's stretches."""
    total, weight = np.add.reduceat(order[0] * size, firsts), np.add.reduceat(order[1] * size**2, firsts)
    visible = weight > 0
    return np.abs(total[visible]) ** 2 / weight[visible], weight[visible]


def _noise_beside_order(
    demodulated: dict[float, Demodulated], order: float, size: FloatArray, firsts: IntArray
) -> float:
    """Noise level beside an order, as a multiple of the expected one: the mean of u at the orders on its louder side,
    shrunk towards 1 by PRIOR_STRETCHES."""
    level = 0.0
    for side in (-1.0, 1.0):
        neighbours = [_powers(demodulated[round(order + side * offset, 1)], size, firsts)[0] for offset in _BESIDE]
        total, count = sum(float(values.sum()) for values in neighbours), sum(values.size for values in neighbours)
        level = max(level, (total + PRIOR_STRETCHES) / (count + PRIOR_STRETCHES))
    return level


def _line_at_order(demodulated: dict[float, Demodulated], order: float, size: FloatArray, firsts: IntArray) -> Line:
    """The swing at a shaft order as a line with its evidence: relative amplitude `size` [b] in the stretches, phase kept
    within groups of stretches that begin at `firsts` [g]. No line where fewer than four groups show the order."""
    power, weight = _powers(demodulated[order], size, firsts)
    if power.size < 4:
        return Line()
    noise = _noise_beside_order(demodulated, order, size, firsts)
    logs = log_likelihood_ratios(power / noise, weight / noise, trial_amplitudes(weight / noise))
    return Line(
        evidence=float(logsumexp(logs, b=AMPLITUDE_WEIGHTS)),
        position=order,
        amplitude=amplitude(power / noise, weight / noise),
        peak=float(logs.max()),
    )


#: Shares [-] of the highest speed below which stick-slip is looked for; spacing of the frequencies [Hz].
_SLOW_SHARES, _SPACING = (0.05, 0.08, 0.125, 0.2, 0.4), 0.125
#: Bins on either side of a frequency from which on the noise level is taken; farther in short windows.
_NEAREST_BIN = 10
#: Relative amplitude [-] of a second harmonic, and the prior probability of one.
_SECOND_HARMONIC, _SECOND_PROBABILITY = 0.33, 0.4
#: Windows in which a line is looked for, taken evenly, and in which a frequency must be visible.
_MOST_WINDOWS, _FEWEST_WINDOWS = 400, 3
#: [s] In which a swing is taken to rise once the shaft enters a window: it may take none to some of its own periods.
_RISE_SECONDS = 0.12
#: Multiples [-] of the lowest frequency that the spline leaves untouched: from the first on a line is looked for, from the
#: second on a frequency may give the noise level beside one.
_VISIBLE_ABOVE, _COMPARED_ABOVE = 0.8, 0.4


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows:
    """Windows [w] of raw records, and frequencies [f] at multiples of the spacing."""

    sums: ComplexArray  # D [w, f]
    weight: FloatArray  # N [w, f]
    beside: Bools  # [w, f] where they may give the noise level beside a line
    visible: Bools  # [w, f] where a line itself is seen
    slowest: FloatArray  # speed [w] rad/s
    fastest: FloatArray
    torque: FloatArray  # mean [w] Nm
    length: float  # the usual one [s]


def windows_of(
    records: Sequence[WhitenedRecord], below: float, longest: float, highest: float, above: float = 0.0
) -> Windows | None:
    """Windows of all records, up to `longest` [s], in which the shaft is slower than the share `below` of its highest speed
    and faster than the share `above`, with frequencies up to `highest` [Hz]; None where they are too few."""
    top = max(float(np.abs(record.speed).max()) for record in records)
    places = [
        (record, first, stop)
        for record in records
        # slower on average than 0.004 of the highest speed the shaft stands still
        for first, stop in _passages(record, above * top, below * top, 0.004 * top, longest)
    ]
    if len(places) > _MOST_WINDOWS:
        places = [places[i] for i in np.linspace(0, len(places) - 1, _MOST_WINDOWS).astype(int)]
    if len(places) < _FEWEST_WINDOWS:
        return None
    count = 1 + int(min(highest, max(record.highest for record in records)) / _SPACING)
    frequency = _SPACING * np.arange(count, dtype=np.float64)
    sums, weight = np.zeros((len(places), count), dtype=np.complex128), np.zeros((len(places), count))
    lowest_line = _VISIBLE_ABOVE * np.array([[record.lowest] for record, _, _ in places])
    for row, place in enumerate(places):
        bins, matched, power = _matched_spectrum(*place, frequency)
        sums[row, bins], weight[row, bins] = matched, power
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


def _matched_spectrum(
    record: WhitenedRecord, first: int, stop: int, frequency: FloatArray
) -> tuple[IntArray, ComplexArray, FloatArray]:
    """Matched spectrum of the record in the window of samples [first, stop): the indices [b] of the frequencies [f] Hz
    that it shows, and the matched sum D [b] and the weight N [b] of each (`whitened_torque`).

    The swing is taken to rise from nothing with the time constant _RISE_SECONDS."""
    inside = (frequency > _COMPARED_ABOVE * record.lowest) & (frequency < record.highest)
    size = round(1.0 / (_SPACING * record.step))
    slot = np.minimum(np.round((record.time[first:stop] - record.time[first]) / record.step).astype(int), size - 1)
    envelope = -np.expm1(-np.arange(stop - first) * (record.step / _RISE_SECONDS))
    spectrum = np.fft.rfft(np.bincount(slot, record.matched[first:stop] * envelope, size))  # one bin a _SPACING
    bins = np.flatnonzero(inside[: spectrum.size])
    weight = float(record.weight[first:stop] @ envelope**2) * record.response(frequency[bins])
    return bins, spectrum[bins], weight


def _passages(
    record: WhitenedRecord, above: float, below: float, standstill: float, longest: float
) -> list[tuple[int, int]]:
    """Samples [first, stop) of windows with speeds [rad/s] between `above` and `below`, and on average above `standstill`;
    passages longer than `longest` [s] are cut into equal parts."""
    passages = []
    speed = uniform_filter1d(np.abs(record.speed), max(1, round(0.1 / record.step)), mode="nearest")
    within = (speed >= above) & (speed <= below)
    for first, stop in itertools.pairwise(record.starts):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], within[first:stop], [False]]).astype(np.int8)))
        for enter, leave in zip(first + edges[::2], first + edges[1::2], strict=True):
            if (leave - enter) * record.step < 0.5:
                continue
            parts = int(np.ceil((leave - enter) * record.step / longest))
            bounds = np.linspace(enter, leave, parts + 1).astype(int)
            passages += [(int(a), int(b)) for a, b in itertools.pairwise(bounds) if speed[a:b].mean() > standstill]
    return passages


#: Phases of the first harmonic, and lags of the second, over which a tied second harmonic is averaged.
_PHASES, _LAGS = 16, 6


def best_slow_line(records: Sequence[WhitenedRecord], order: Line | None = None) -> Line:
    """The line of highest evidence at low speed, its amplitude proportional to the load's root; windows in which
    `order` passes its frequency are left out."""
    lines = []
    for share in _SLOW_SHARES:
        windows = windows_of(records, share, 2.5, 45.0)  # windows of 2.5 s, frequencies up to 45 Hz
        if windows is not None:
            size = np.sqrt(windows.torque / max(float(np.mean(windows.torque)), 1e-300))
            lines.append(_line(windows, size, order, share))
    if not lines:
        return Line()
    average = float(logsumexp([line.evidence for line in lines]) - np.log(len(_SLOW_SHARES)))
    return replace(max(lines, key=lambda line: line.evidence), evidence=average)


def best_line(records: Sequence[WhitenedRecord], order: Line | None = None, above: float = 0.0) -> Line:
    """The line of highest evidence at all speeds alike, or at all above a share of the highest."""
    windows = windows_of(records, 1.0, 2.0, np.inf, above)
    return Line() if windows is None else _line(windows, np.ones_like(windows.torque), order, 1.0)


def _line(windows: Windows, size: FloatArray, order: Line | None, share: float) -> Line:
    """The line of highest evidence in these windows, for a relative amplitude [w], with evidence averaged over all
    frequencies by a prior ∝ 1/f; at low speed it may have a second harmonic."""
    clear = _clear_of_order(windows, order)
    visible, beside = windows.visible & clear, windows.beside & clear
    least = max(_FEWEST_WINDOWS, 0.3 * visible.shape[0])
    frequencies = np.flatnonzero(visible.sum(axis=0) >= least)  # as multiples of the spacing
    if frequencies.size == 0:
        return Line(speed_share=share)
    power = np.where(beside, np.abs(windows.sums) ** 2 / np.maximum(windows.weight, 1e-300), 0.0)
    noise = _noise_levels(power, beside, _SPACING * windows.length)
    sums = np.where(visible, windows.sums * size[:, np.newaxis] / noise, 0.0)
    weight = np.where(visible, windows.weight * (size**2)[:, np.newaxis] / noise, 0.0)
    power = np.where(visible, power / noise, 0.0)
    logs = _log_likelihoods(power, sums, weight, frequencies, second_harmonic=share < 1.0)
    prior = 1.0 / frequencies / float(np.sum(1.0 / frequencies))
    evidence = float(logsumexp(logs, b=AMPLITUDE_WEIGHTS[:, np.newaxis] * prior))
    _, _, column = np.unravel_index(int(logs.argmax()), logs.shape)
    near = frequencies[np.abs(frequencies - frequencies[column]) < _NEAREST_BIN]
    # where the windows with most weight agree
    best = near[int((power[:, near] * weight[:, near]).sum(axis=0).argmax())]
    shown = visible[:, best]
    return Line(
        evidence=evidence,
        position=float(_SPACING * best),
        amplitude=amplitude(power[shown, best], weight[shown, best]),
        speed_share=share,
        peak=float(logs.max()),
    )


def _log_likelihoods(
    power: FloatArray, sums: ComplexArray, weight: FloatArray, frequencies: IntArray, *, second_harmonic: bool
) -> FloatArray:
    """Log likelihood ratios log L(a)/L(0) [2, s, f] without and with a second harmonic, the log of their prior
    probabilities included.

    At the frequencies where a second harmonic promises most its phase is tied to the first's; elsewhere it is free."""
    amplitudes = trial_amplitudes(weight[:, frequencies])
    first = log_likelihood_ratios(power[:, frequencies], weight[:, frequencies], amplitudes)
    both = first.copy()
    if second_harmonic:
        double = 2 * frequencies
        inside = np.flatnonzero(double < power.shape[1])
        both[:, inside] += log_likelihood_ratios(
            power[:, double[inside]], weight[:, double[inside]], _SECOND_HARMONIC * amplitudes[:, inside]
        )
        for column in inside[np.argsort(-both[:, inside].max(axis=0))[:4]]:  # the four most promising
            pair = [frequencies[column], double[column]]
            both[:, column] = _tied(sums[:, pair], weight[:, pair], amplitudes[:, column])
    return np.stack([first + np.log(1 - _SECOND_PROBABILITY), both + np.log(_SECOND_PROBABILITY)])


def _tied(sums: ComplexArray, weight: FloatArray, amplitudes: FloatArray) -> FloatArray:
    """Log likelihood ratios log L(a)/L(0) [s] of a first and a second harmonic, D and N [w, 2], whose phases keep a lag
    ψ that all windows share:

    Σ_w ln mean_φ exp(a Re[D₁ e^{-iφ} + q D₂ e^{-i(2φ + ψ)}] - a² (N₁ + q² N₂)/4),   averaged over ψ
    """
    phases = np.exp(-2j * np.pi * np.arange(_PHASES) / _PHASES)
    lags = np.exp(-2j * np.pi * np.arange(_LAGS) / _LAGS)
    first = (sums[:, :1] * phases).real
    second = (lags[:, np.newaxis, np.newaxis] * (sums[:, 1:] * phases**2)).real
    along = first + _SECOND_HARMONIC * second
    cost = 0.25 * (weight[:, 0] + _SECOND_HARMONIC**2 * weight[:, 1])
    top = along.max(axis=-1)
    logs = []
    for a in amplitudes:
        by_window = a * top + np.log(np.exp(a * (along - top[..., np.newaxis])).mean(axis=-1)) - a**2 * cost
        logs.append(logsumexp(np.minimum(by_window, MOST_PER_STRETCH).sum(axis=-1)) - np.log(_LAGS))
    return np.array(logs)


def _clear_of_order(windows: Windows, order: Line | None) -> Bools:
    """Mask [w, f], false where the order, or its double, passes the frequency in the window."""
    frequency = _SPACING * np.arange(windows.sums.shape[1])
    if order is None:
        return np.ones(windows.sums.shape, dtype=np.bool_)
    low, high = (order.position / (2 * np.pi) * speed[:, np.newaxis] for speed in (windows.slowest, windows.fastest))
    edge = 2.0 / windows.length
    clear = (frequency < low - edge) | (frequency > high + edge)
    return clear & ((frequency < 2 * low - edge) | (frequency > 2 * high + edge))


def _noise_levels(power: FloatArray, beside: Bools, independent: float) -> FloatArray:
    """Noise level [f] beside each frequency, the mean of u on the louder side; 1 unless many windows show another.

    Where it is louder, something other than noise remains, with crests of its own: there it is the highest crest.
    `independent` is how many independent values a bin counts for."""
    total, count = np.where(beside, power, 0.0).sum(axis=0), beside.sum(axis=0).astype(float)
    width = max(1, round(1.0 / independent))
    near, side = max(_NEAREST_BIN, 3 * width // 2), max(34 - _NEAREST_BIN, 4 * width)
    mean = _smoothed(total, count, side, independent, PRIOR_STRETCHES)
    loud = _smoothed(total, count, side, independent, 1.0)
    crest = maximum_filter1d(_smoothed(total, count, width, independent, 1.0), side)
    pad, shift = near + side, near + side // 2
    padded = np.arange(total.size) + pad
    mean, loud, crest = (
        np.maximum(*(np.pad(level, pad, mode="edge")[padded + offset] for offset in (-shift, shift)))
        for level in (mean, loud, crest)
    )
    return np.asarray(np.where(mean > 1.3, np.maximum(loud, crest), mean))  # more than noise alone


def _smoothed(total: FloatArray, count: FloatArray, width: int, independent: float, prior: float) -> FloatArray:
    """Moving mean of u [f] over `width` bins, shrunk towards 1 by a weight of `prior` windows."""
    sums, counts = (independent * width * uniform_filter1d(values, width, mode="constant") for values in (total, count))
    return np.asarray((sums + prior) / (counts + prior))
