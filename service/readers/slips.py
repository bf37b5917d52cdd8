"""Rows of a run in which a number is in another unit than in all others, or has its decimal point elsewhere.

Friction tells it: torque per pressure changes with speed and wear by some ten percent, and in rows of another unit by its
factor. A speed has the other rows' levels for a witness. Such rows are refused; `missing` settles what they are.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.channels import CHANNELS, RADIANS_PER_SECOND_PER_RPM, LineOf, place
from service.errors import InvalidError
from service.readers.table import NO_MISSING, Reading

#: Factors between units of a channel, and those of a misplaced decimal point.
_UNITS: Mapping[str, Sequence[float]] = {
    "pressure_bar": (14.5038, 100.0, 0.1, 1000.0, 1e5, 0.0689476),
    "torque_nm": (1e-3, 100.0, 1000.0, 0.737562),
    "speed_rpm": (RADIANS_PER_SECOND_PER_RPM, 1 / 60, 1 / RADIANS_PER_SECOND_PER_RPM, 60.0),
}
_POINTS = (10.0, 0.1, 100.0)
#: Torque per pressure of a row that may be another unit's, off the usual one; how near to it the right one comes; and how
#: far outside the others' range such a value lies. Chosen: between tests' rows lie three (a steep curve at 20 rpm and at
#: 3,000), and the least factor but for psi is ten.
_OFF, _NEAR, _OUTSIDE = 5.0, 1.6, 1.25
#: Rows of a sampled record that are no noise, rows of any run by which the others are known, and groups that are looked at.
_MIN_SAMPLES, _MIN_ROWS, _MAX_GROUPS = 3, 6, 100
#: Rows of a record that are looked at, of longer ones every n-th. Chosen: 1.4 million then take 0.03 s, all of them 0.4 s.
_MAX_LOOKED_AT = 10_000
#: Shares of the largest or usual value below which a clutch is open or at rest, by which levels differ, and by which one
#: is that of other rows; and a speed's noise as a share of the largest speed. Chosen.
_AT_REST, _LEVEL, _SAME, _NOISE = 0.05, 0.05, 0.02, 0.005
#: Levels of pressure by which a single speed or a level's torques are judged; and the logarithm by which torques may miss a
#: line over pressure. Chosen: a spring's preload keeps the line, and a COF of p^-0.25 lies 0.1 from lbf·ft's factor; of
#: 3,000 simulated tests with both none was asked about, and of those with a level in lbf·ft 54 %.
_MIN_LEVELS, _SAME_CURVE = 3, 0.06
#: A step of a logarithm that is none of a unit. Chosen: less than half of the least, that of rad/s (2.26).
_SMOOTH = 0.9


def refuse_slips(columns: Mapping[str, FloatArray], line_of: LineOf | None, reading: Reading) -> None:
    """Raise InvalidError naming the first row of those in which a pressure, torque or speed is in another unit, or has its
    decimal point elsewhere."""
    needed = ("pressure_bar", "speed_rpm", "torque_nm")
    if reading.missing == NO_MISSING or not columns.keys() >= {*needed} or columns["speed_rpm"].size < _MIN_ROWS:
        return
    sampled, step = "time_s" in columns, max(1, columns["speed_rpm"].size // _MAX_LOOKED_AT)
    pressure, speed, torque = (columns[name][::step] for name in needed)
    found = _by_friction(pressure, speed, torque, sampled=sampled) or _by_levels(
        pressure, speed, torque, sampled=sampled
    )
    found = found or (_by_jumps(speed) if sampled else None)
    if found is None:
        return
    channel, rows, factor = found
    first, unit, count = step * int(rows[0]), CHANNELS[channel].unit, step * rows.size
    value = columns[channel][first]
    more = f", as {count} of {columns[channel].size} rows" if count > 1 else ""
    question = "another unit" if count > 1 else "its decimal point elsewhere"
    message = (
        f"{place(channel, first, line_of)} is {value:.6g} {unit}{more}: {factor:.4g} times what the other rows suggest; "
        f"{'are these rows in' if count > 1 else 'has this number'} {question}? Correct the file; to use the values as "
        f"they are, add missing={NO_MISSING}"
    )
    raise InvalidError.of(message, code="mixed_units", pointer=f"/channels/{channel}/{first}", row=first + 1)


_Found = tuple[str, NDArray[np.intp], float]


def _by_friction(pressure: FloatArray, speed: FloatArray, torque: FloatArray, *, sampled: bool) -> _Found | None:
    """The channel, the rows and the factor of a pressure or torque that friction contradicts."""
    size = np.abs(torque)
    share = _AT_REST if sampled else 0.0
    slips = (np.abs(speed) > share * np.abs(speed).max()) & (pressure > share * np.median(pressure)) & (size > 0)
    if np.count_nonzero(slips) < _MIN_ROWS:
        return None
    ratio = np.divide(size, pressure, out=np.ones_like(size), where=slips)
    usual = float(np.median(ratio[slips]))
    off = slips & ((ratio * _OFF < usual) | (ratio > _OFF * usual))
    fine = slips & ~off
    if not off.any() or 2 * np.count_nonzero(off) > np.count_nonzero(slips):
        return None
    ends = np.flatnonzero(np.diff(np.concatenate([[0], off.view(np.int8), [0]])))
    for start, end in zip(ends[::2][:_MAX_GROUPS], ends[1::2], strict=False):
        if sampled and end - start < _MIN_SAMPLES:
            continue
        rows = np.arange(start, end)
        for channel, values, power in (("pressure_bar", pressure, -1), ("torque_nm", size, 1)):
            value, low, high = float(np.median(values[rows])), values[fine].min(), values[fine].max()
            if low / _OUTSIDE <= value <= high * _OUTSIDE:
                continue
            for factor in (*_UNITS[channel], *(() if sampled else _POINTS)):
                right = float(np.median(ratio[rows])) / factor**power / usual
                reach = _OUTSIDE if rows.size < _MIN_SAMPLES else _OFF  # a level may be the highest
                if 1 / _NEAR < right < _NEAR and low / reach <= value / factor <= high * reach:
                    return channel, rows, factor
    return None


def _by_levels(pressure: FloatArray, speed: FloatArray, torque: FloatArray, *, sampled: bool) -> _Found | None:
    """The rows of a level of pressure in which the speeds, one of them, or the torques are those of the other levels but for
    a factor."""
    steps = np.abs(np.diff(pressure)) > _LEVEL * np.maximum(np.abs(pressure[1:]), np.abs(pressure[:-1]))
    ends = [0, *(np.flatnonzero(steps) + 1).tolist(), speed.size]
    blocks = [np.arange(a, b) for a, b in pairwise(ends) if b - a >= _MIN_SAMPLES]
    if not 1 < len(blocks) <= _MAX_GROUPS:
        return None
    levels = [_levels(speed[rows], _MIN_SAMPLES if sampled else 1) for rows in blocks]
    for at, (rows, own) in enumerate(zip(blocks, levels, strict=True)):
        others = np.concatenate([held for k, held in enumerate(levels) if k != at])
        strange = own[~_among(own, others)]
        if others.size >= _MIN_SAMPLES and strange.size >= max(_MIN_SAMPLES, own.size / 2):
            for factor in _UNITS["speed_rpm"]:
                if _among(strange / factor, others).all():
                    return "speed_rpm", rows[_among(speed[rows], strange)], factor
    if sampled or len(blocks) < _MIN_LEVELS:
        return None
    return _one_speed(speed, blocks, levels) or _torques_of_a_level(pressure, speed, torque, blocks)


def _one_speed(speed: FloatArray, blocks: Sequence[NDArray[np.intp]], levels: Sequence[FloatArray]) -> _Found | None:
    """The only speed without whose factor all levels of pressure would have the same speeds."""
    for at, (rows, own) in enumerate(zip(blocks, levels, strict=True)):
        others = [held for k, held in enumerate(levels) if k != at]
        for number, factor in product(range(own.size), _POINTS):
            right = np.append(np.delete(own, number), own[number] / factor)
            if all(_alike(held, right) and not _alike(held, own) for held in others):
                return "speed_rpm", rows[speed[rows] == own[number]], factor
    return None


def _torques_of_a_level(
    pressure: FloatArray, speed: FloatArray, torque: FloatArray, blocks: Sequence[NDArray[np.intp]]
) -> _Found | None:
    """The level of pressure whose torques, at each speed, are a unit's factor off the line through those of the others."""
    blocks = [rows[np.argsort(speed[rows])] for rows in blocks]
    if not all(_alike(speed[rows], speed[blocks[0]]) for rows in blocks):
        return None
    pressures, torques = np.array([pressure[rows].mean() for rows in blocks]), np.abs([torque[rows] for rows in blocks])
    found: tuple[float, _Found | None] = (_SAME_CURVE, None)
    for at, rows in enumerate(blocks):
        others = np.arange(len(blocks)) != at
        if np.unique(pressures[others]).size < len(blocks) - 1:
            return None
        slope, start = np.polyfit(pressures[others], torques[others], 1)
        line = slope * pressures[at] + start
        if pressures[at] < pressures[others].min() or not ((line > 0).all() and (torques[at] > 0).all()):
            continue  # below all others the line is too uncertain
        off = np.log(torques[at] / line)
        for factor in _UNITS["torque_nm"]:
            far = float(np.abs(off - np.log(factor)).max())
            found = min(found, (far, ("torque_nm", rows, factor)), key=lambda one: one[0])
    return found[1]


def _alike(speeds: FloatArray, others: FloatArray) -> bool:
    """Whether two levels of pressure have the same speeds, in any order, but for noise."""
    if speeds.size != others.size:
        return False
    speeds, others = np.sort(np.abs(speeds)), np.sort(np.abs(others))
    return bool((np.abs(speeds - others) <= np.maximum(_SAME * others, _NOISE * others[-1])).all())


def _levels(values: FloatArray, least: int) -> FloatArray:
    """The levels of a column [n] that hold for `least` rows."""
    ends = np.flatnonzero(np.abs(np.diff(values)) > 2 * _LEVEL * np.maximum(np.abs(values[1:]), 1.0)) + 1
    parts = np.split(values, ends) if ends.size < values.size / least else []
    return np.array([float(np.median(part)) for part in parts if part.size >= least])


def _among(values: FloatArray, others: FloatArray) -> NDArray[np.bool_]:
    """Which values [n] are some of the others [m]."""
    return np.asarray((np.abs(values[:, None] - others) <= _SAME * np.abs(others)).any(axis=1))


def _by_jumps(speed: FloatArray) -> _Found | None:
    """The rows between two jumps of a sampled speed, to a multiple and back, where it changes little from row to row."""
    size = np.abs(speed)
    logs = np.log(np.where(size > 0, size, np.nan))
    steps = np.diff(logs)
    smooth = np.abs(steps) < _SMOOTH
    jumps = np.flatnonzero(~smooth[1:-1] & smooth[:-2] & smooth[2:]) + 1
    if not 1 < jumps.size <= _MAX_GROUPS:
        return None
    off = steps[jumps] - (steps[jumps - 1] + steps[jumps + 1]) / 2
    for factor in _UNITS["speed_rpm"]:
        to, back = (jumps[np.abs(off - sign * np.log(factor)) < 2 * _SAME] for sign in (1, -1))
        for start in to:
            end = next((int(at) for at in back if at > start + _MIN_SAMPLES), None)
            if end is not None:
                return "speed_rpm", np.arange(start + 1, end + 1), factor
    return None
