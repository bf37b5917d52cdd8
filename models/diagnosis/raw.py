"""Evidence that only raw records hold: lines of the shaft's orders, stick-slip, dwells that end before torque has settled.

- `shaft_ripple`: torque swings k times a revolution (a wobbling shaft, a disc out of true, teeth of a coupling). Its
  frequency goes with the speed, so the windows of all speeds are asked for one order k together.
- `stick_slip`: at low speed, where torque falls with speed, the shaft's torsional mode is excited: a line of one
  frequency, whatever the speed, that is there below some speed and not above it. A line of one frequency at all speeds
  alike (mains, a pump, structure) is neither, and said in a note.
- `unsettled_dwell`: the exponential approach on a dwell is too slow for the dwell's length.

Evidence is the log likelihood ratio of the best amplitude (`models.diagnosis.spectra`), less a price for the orders,
frequencies and speeds that were tried.
"""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.cleaning import clean
from models.diagnosis.campaign import Campaign, DynamicRun, StationaryRun
from models.diagnosis.report import Estimate
from models.diagnosis.spectra import OWN, PADDING, Windows, amplitudes, in_angle, in_time, rice
from models.plateaus import PlateauCut, cut_plateaus
from models.runs import Record
from models.settling import SETTLING

#: Orders of the shaft that are looked for.
ORDERS = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
#: Length of a window [s]: orders on steady dwells, where a line is sharp; lines at any speed.
ORDER_WINDOW, LINE_WINDOW = 4.0, 1.0
#: Shares of the windows, slowest first, in which stick-slip is looked for.
SLOW_SHARES = (0.05, 0.1, 0.2, 0.4)
#: Log likelihood ratio [nats] less price from which a line counts as evidence: noise whose spectrum an autoregression does
#: not quite meet makes 6 in one campaign of a hundred.
SEEN = 10.0
#: No window counts for more [nats]: one burst is no order.
MOST_A_WINDOW = 25.0
#: Fewer windows show no order: of one record (they tell what is usual beside it), of all records.
FEWEST_OF_ONE, FEWEST_WINDOWS = 2, 4
#: A dwell has not settled where its settling time is beyond this share of it.
SETTLED_SHARE = 0.8
#: Records analysed at most, evenly over life: each costs about half a second.
MOST_RECORDS = 8


IntArray = NDArray[np.intp]
Run = TypeVar("Run", StationaryRun, DynamicRun)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawEvidence:
    """Of one effect: log_evidence [nats] against none, its amplitude, and a sentence on how it was seen."""

    effect: str
    log_evidence: float
    estimate: Estimate
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    gain: float
    at: float
    amplitude: float
    share: float = 1.0


def raw_evidence(campaign: Campaign) -> tuple[RawEvidence, ...]:
    """What the raw records of a campaign show; nothing where there are none or they are too slow or too short."""
    cuts = [(run.record, _cut(run.record)) for run in _spread(campaign.stationary) if run.record is not None]
    dwells = [(record, cut) for record, cut in cuts if cut is not None]
    orders = [w for record, cut in dwells if (w := _windows(record, _spans(cut), ORDER_WINDOW)) is not None]
    lines = [w for record, cut in dwells if (w := _windows(record, _spans(cut), LINE_WINDOW)) is not None]
    for run in _spread(campaign.dynamic):
        whole = np.array([[run.record.time[0], run.record.time[-1]]])
        if (windows := _windows(run.record, whole, LINE_WINDOW)) is not None:
            lines.append(windows)
        if (turned := _windows(run.record, None, LINE_WINDOW)) is not None:
            orders.append(turned)
    return (*_lines(orders, lines), *_unsettled([cut for _, cut in dwells]))


def _spread(runs: tuple[Run, ...]) -> list[Run]:
    if len(runs) <= MOST_RECORDS:
        return list(runs)
    return [runs[i] for i in np.linspace(0, len(runs) - 1, MOST_RECORDS).round().astype(int)]


def _cut(record: Record | None) -> PlateauCut | None:
    try:
        return None if record is None else cut_plateaus(record)
    except ValueError:  # a record without dwells says nothing here; the run that it came with said so
        return None


def _spans(cut: PlateauCut) -> FloatArray:
    return np.stack([cut.start, cut.stop], axis=1)


def _windows(record: Record, spans: FloatArray | None, length: float) -> Windows | None:
    """Windows by time within spans, or by angle where there are none."""
    try:
        cleaned, _, _ = clean(record)
    except ValueError:
        return None
    if spans is None:
        return in_angle(cleaned)
    return in_time(cleaned, spans, min(length, float(np.max(spans[:, 1] - spans[:, 0]))))


def _lines(orders: list[Windows], lines: list[Windows]) -> list[RawEvidence]:
    """Ripple and stick-slip; what explains more is taken out of the windows before the other is asked for."""
    order, line = _order(orders, None), _line(lines, None)
    if order.gain >= line.gain:
        line = _line(lines, order if order.gain > SEEN else None)
    else:
        order = _order(orders, line if line.gain > SEEN else None)
    found = []
    if order.gain > SEEN:
        note = f"torque swings {order.at:g} times a revolution at every speed"
        estimate = Estimate(name="ripple amplitude", value=order.amplitude, sd=_deviation(order), unit="Nm")
        found.append(RawEvidence(effect="shaft_ripple", log_evidence=order.gain, estimate=estimate, note=note))
    if line.gain > SEEN:
        estimate = Estimate(name="line amplitude", value=line.amplitude, sd=_deviation(line), unit="Nm")
        slow = line.share < 1.0
        where = (
            f"in the slowest {100 * line.share:.0f} % of the windows and not above" if slow else "at all speeds alike"
        )
        note = f"torque swings at {line.at:.3g} Hz {where}"
        effect = "stick_slip" if slow else "fixed_line"
        found.append(RawEvidence(effect=effect, log_evidence=line.gain, estimate=estimate, note=note))
    return found


def _deviation(line: _Line) -> float:
    # λ goes with A², so log L near its maximum has a curvature of about 4 gain / A²
    return line.amplitude / max(2.0 * math.sqrt(line.gain), 1.0)


def _order(groups: list[Windows], line: _Line | None) -> _Line:
    """The best order; windows in which a fixed line would lie on it are left out."""
    best = _Line(gain=0.0, at=0.0, amplitude=0.0)
    if sum(group.turns.size for group in groups) < FEWEST_WINDOWS:
        return best
    tried = amplitudes(groups[0])
    for order in ORDERS:
        total = np.zeros(tried.size)
        for group in groups:
            total += _on_order(group, order, tried, line)
        at = int(total.argmax())
        gain = float(total[at]) - float(np.log(len(ORDERS) * tried.size))
        if gain > best.gain:
            best = _Line(gain=gain, at=order, amplitude=float(tried[at]))
    return best


def _on_order(group: Windows, order: float, tried: FloatArray, line: _Line | None) -> FloatArray:
    """log L [a] of an order: z where each window should show it, against what orders beside it show in the same windows."""
    wanted = order * group.turns
    step = float(group.frequency[1] - group.frequency[0])
    guard = OWN * PADDING * step
    inside = (wanted > group.frequency[0] + guard) & (wanted < group.frequency[-1] - guard)
    if line is not None:
        inside &= np.abs(wanted * group.hertz - line.at) > 2 * guard * group.hertz
    rows = np.flatnonzero(inside)
    if rows.size < FEWEST_OF_ONE:
        return np.zeros(tried.size)
    column = np.searchsorted(group.frequency, wanted[rows])
    z, gain = group.z[rows, column], group.gain[rows, column]
    aside = [np.clip(column + shift * OWN * PADDING, 0, group.frequency.size - 1) for shift in (-3, -2, 2, 3)]
    usual = max(float(np.mean([group.z[rows, other].mean() for other in aside])), 0.5)
    each = rice(z / usual, gain * np.square(tried)[:, np.newaxis])
    return np.asarray(np.minimum(each, MOST_A_WINDOW).sum(axis=1))


def _line(groups: list[Windows], order: _Line | None) -> _Line:
    """The best line of one frequency, in the slowest windows or in all."""
    best = _Line(gain=0.0, at=0.0, amplitude=0.0)
    for group in groups[:1]:
        tried = amplitudes(group)
        same = [other for other in groups if other.frequency.shape == group.frequency.shape]
        frequency = group.frequency
        if not np.all([np.allclose(other.frequency, frequency, rtol=0.02) for other in same]):
            same = [group]
        z = np.concatenate([other.z for other in same])
        gain = np.concatenate([other.gain for other in same])
        turns = np.concatenate([other.turns for other in same])
        best = _best_line(frequency, z, gain, turns, tried, order)
    return best


def _best_line(
    frequency: FloatArray, z: FloatArray, gain: FloatArray, turns: FloatArray, tried: FloatArray, order: _Line | None
) -> _Line:
    slowest_first = np.argsort(turns, kind="stable")
    edge = 3 * OWN * PADDING
    bins = np.arange(edge, frequency.size - edge, PADDING // 2)
    counts = sorted({max(3, round(share * turns.size)) for share in SLOW_SHARES} | {turns.size})
    best, price = (
        _Line(gain=0.0, at=0.0, amplitude=0.0),
        float(np.log(max(bins.size * len(counts) * tried.size, 1) / 4)),
    )
    for count in counts:
        rows = slowest_first[:count]
        total = _levelled(z[rows], gain[rows], bins, tried, _clear(frequency[bins], turns[rows], order))
        at, column = np.unravel_index(int(total.argmax()), total.shape) if total.size else (0, 0)
        found = float(total[at, column]) - price if total.size else 0.0
        if found > best.gain:
            share = count / turns.size
            best = _Line(gain=found, at=float(frequency[bins[column]]), amplitude=float(tried[at]), share=share)
    return best


def _clear(frequency: FloatArray, turns: FloatArray, order: _Line | None) -> FloatArray:
    """[w, f]: 0 where an order that was found lies on the frequency, else 1."""
    if order is None:
        return np.ones((turns.size, frequency.size))
    return np.where(np.abs(frequency - order.at * turns[:, np.newaxis]) < 2.0 / LINE_WINDOW, 0.0, 1.0)


def _levelled(z: FloatArray, gain: FloatArray, bins: IntArray, tried: FloatArray, clear: FloatArray) -> FloatArray:
    """log L [a, f] of lines in these windows against what the frequencies on either side of each show in them."""
    mean = z.mean(axis=0)
    sides = [np.mean([mean[bins + sign * OWN * PADDING * k] for k in (2, 3)], axis=0) for sign in (-1, 1)]
    usual = np.maximum(np.maximum(*sides), 0.7)
    total = np.zeros((tried.size, bins.size))
    for rows in np.array_split(np.arange(z.shape[0]), max(1, z.shape[0] // 64)):
        here, weight = z[np.ix_(rows, bins)] / usual, gain[np.ix_(rows, bins)]
        for row, amplitude in enumerate(tried):
            total[row] += (clear[rows] * np.minimum(rice(here, weight * amplitude**2), MOST_A_WINDOW)).sum(axis=0)
    return total


def _unsettled(cuts: list[PlateauCut]) -> list[RawEvidence]:
    """Dwells that ended before torque had settled: how many, and the time constant of their approach."""
    late = [
        (SETTLING * cut.time_constant > SETTLED_SHARE * (cut.stop - cut.start + cut.settling_time)) | ~cut.settled
        for cut in cuts
    ]
    rows = np.concatenate(late) if late else np.zeros(0, dtype=np.bool_)
    seen = int(np.count_nonzero(rows))
    if rows.size == 0 or seen < max(4, 0.25 * rows.size):
        return []
    constants = np.concatenate([cut.time_constant for cut in cuts])[rows]
    known = constants[np.isfinite(constants)]
    if known.size < 4:
        return []
    spread = float(1.4826 * np.median(np.abs(known - np.median(known)))) / np.sqrt(known.size)
    estimate = Estimate(name="settling time constant", value=float(np.median(known)), sd=spread, unit="s")
    note = f"{seen} of {rows.size} dwells ended before their torque had settled"
    return [RawEvidence(effect="unsettled_dwell", log_evidence=0.5 * seen, estimate=estimate, note=note)]
