"""Numbers in a table that are no measurements: values that stand for none (-9999), and rows of means or sums at its end.

No list of values decides: a value stands for none where it lies so far from all others of its column that these cannot have
led to it. One that begins with n nines (999, -9999, -999.25), or is the end of an integer type, is met by chance once in
10^n values, and lies far that much sooner. It may still be a measurement: it is refused, and `missing` settles which it is.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.channels import LineOf, place
from service.errors import InvalidError, Notice
from service.readers.numerals import NUMBER, plain
from service.readers.table import NO_MISSING, Reading, Table, fills_down, marks

#: A value that is so many times as large as all others stands for none, a common one (more than a tenth of the rows) only
#: farther off. Chosen: between neighbours of a test's values lie ten (speeds 1, 10, 100), and from an idle valve's 0.02 to
#: the 5 bar of every other row 250.
_FAR, _FAR_COMMON, _RARE = 1e2, 1e4, 0.1
#: The same for one of three nines, each further nine a tenth of it; and for one below zero where no other value is. Chosen:
#: 999 rpm in steps of ten (1, 10, 100, 999) is read, 999 Nm among 20 is not.
_FAR_NINES, _FAR_BELOW = 10.0, 0.3
#: A value of nines within the others' range stands for none where it lies so many usual steps off its neighbours, which lie
#: close together. Chosen: noise gives five.
_JUMP, _CLOSE = 20.0, 0.1
#: Ends of integer types, as recorders write them; as good as five nines.
_ENDS = {2**bits - end for bits in (15, 16, 31, 32) for end in (0, 1)}
#: Values at either end of a column that may each stand for none, rows at a table's end that may each be made of those above,
#: and rows of a table beyond which nobody writes such ones. Chosen.
_MAX_KINDS, _MAX_TOTALS, _LONGEST = 3, 8, 100_000
#: Rows of a level that may have a mean below it, and of a table with such levels. Chosen: fewer are one by chance too often,
#: and a person writes no more.
_SHORTEST_LEVEL, _LONGEST_OF_LEVELS = 5, 2000
#: Rows by which the decimals of a column are counted. Chosen: of so many, not all end in zeros by chance.
_MAX_LOOKED_AT = 50
#: Values by which the usual size of a column is found. Chosen: their median is known to some percent; ten times is asked.
_MAX_SAMPLED = 1000
#: Probability that measured rows are by chance the means, sums, maxima ... of those above, below which they are left out;
#: for columns' own values, the maxima, minima and medians, where together they stand in no row above. Chosen: a row of five
#: plateaus' means has 1e-5, one of their maxima 0.04; of 4,800 pieces of real records one was left out wrongly.
_BY_CHANCE, _BY_CHANCE_OWN = 0.002, 0.05
_OWN = {"maxima", "minima", "medians"}
#: Rows of a torque of zero that are asked about, and the share of the largest speed and pressure below which there may be
#: none. Chosen.
_MIN_ZEROS, _OF_LARGEST = 3, 0.05
#: Those that stand only beside others.
_BESIDE = {"numbers", "scatters"}
#: Those that are not rounded.
_EXACT = {"maxima", "minima", "ranges"}
_STATISTICS: dict[str, Callable[[FloatArray], float]] = {
    "means": lambda column: float(column.mean()),
    "sums": lambda column: float(column.sum()),
    "maxima": lambda column: float(column.max()),
    "minima": lambda column: float(column.min()),
    "medians": lambda column: float(np.median(column)),
    "standard deviations": lambda column: float(column.std(ddof=1)),
    "standard deviations of all": lambda column: float(column.std()),
    "ranges": lambda column: float(np.ptp(column)),
    "numbers": lambda column: float(column.size),
    "scatters": lambda column: float(100 * column.std(ddof=1) / column.mean()) if column.mean() else 0.0,
}


def mask_stated_marks(values: NDArray[Any], reading: Reading, channel: str) -> NDArray[Any]:
    """Numbers [n] with the caller's marks masked, and NaN too if any mark is given; with ABOVE a missing value is
    replaced by the one above it."""
    if fills_down(reading.missing) and channel != "time_s":
        values = _filled_down(values)
    stated = marks(reading.missing, channel)
    if not stated or values.dtype.kind not in "iuf":
        return values
    numbers = [float(mark) for mark in stated if NUMBER.fullmatch(mark)]
    missing = np.isin(values, numbers) | np.isnan(values) | np.ma.getmaskarray(values)
    return np.ma.MaskedArray(np.where(missing, np.nan, values), mask=missing)


def _filled_down(values: NDArray[Any]) -> NDArray[Any]:
    """Values [n] with each masked value replaced by the last unmasked one above it."""
    gaps = np.ma.getmaskarray(values)
    last = np.maximum.accumulate(np.where(gaps, 0, np.arange(gaps.size)))
    return np.ma.MaskedArray(np.ma.getdata(values)[last], mask=gaps[last])


def refuse_no_torque(columns: Mapping[str, FloatArray], line_of: LineOf | None, reading: Reading) -> None:
    """Raise InvalidError if the torque is exactly zero in several successive rows under pressure and speed: friction
    gives a torque there, and a sensor noise."""
    needed = [columns.get(name) for name in ("pressure_bar", "speed_rpm", "torque_nm")]
    pressure, speed, torque = needed
    if reading.missing == NO_MISSING or pressure is None or speed is None or torque is None:
        return
    if not _MIN_ZEROS <= torque.size - np.count_nonzero(torque) < torque.size:
        return
    slips = (np.abs(speed) > _OF_LARGEST * np.abs(speed).max()) & (pressure > _OF_LARGEST * pressure.max())
    zero = np.concatenate([[0], (slips & (torque == 0)).view(np.int8), [0]])
    starts, ends = np.flatnonzero(np.diff(zero) == 1), np.flatnonzero(np.diff(zero) == -1)
    longest = int((ends - starts).argmax()) if starts.size else 0
    if not starts.size or ends[longest] - starts[longest] < _MIN_ZEROS:
        return
    row, count = int(starts[longest]), int(ends[longest] - starts[longest])
    stated = [mark.strip() for mark in reading.missing.split(",") if mark.strip()]
    missing = ",".join([*stated, "torque_nm:0"])
    message = (
        f"{place('torque_nm', row, line_of)} is exactly 0, as in the {count - 1} rows after it, at {speed[row]:.6g} rpm and "
        f"{pressure[row]:.6g} bar: was the sensor off? To leave these rows out, add missing={missing}; to use them, add "
        f"missing={NO_MISSING}"
    )
    raise InvalidError.of(message, code="no_value", pointer=f"/channels/torque_nm/{row}", row=row + 1, value="0")


def refuse_stand_ins(name: str, values: NDArray[Any], line_of: LineOf | None, reading: Reading) -> None:
    """Raise InvalidError on the first number of a column [n] that may be the mark of a missing value, with ways to
    state its meaning."""
    if reading.missing == NO_MISSING or values.dtype.kind not in "iuf":
        return
    column = plain(values)
    with np.errstate(over="ignore"):  # 1e308 less -1e308 is far enough
        value = _stand_in(column, unbounded=name == "time_s")
    if value is None:
        return
    row = int(np.argmax(column == value))
    measured = column[np.isfinite(column) & (column != value)]
    shown = f"{value:.9g}"
    missing = ",".join([mark for mark in reading.missing.split(",") if mark.strip()] + [shown])
    message = (
        f"{place(name, row, line_of)} is {shown}, as in {np.count_nonzero(column == value)} of {column.size} rows. Is this "
        f"the mark of a missing value? Half of the other values lie between {np.quantile(measured, 0.25):.6g} and "
        f"{np.quantile(measured, 0.75):.6g}. To leave these rows out, add missing={missing}; to use them, add "
        f"missing={NO_MISSING}"
    )
    raise InvalidError.of(message, code="no_value", pointer=f"/channels/{name}/{row}", row=row + 1, value=shown)


def _stand_in(column: FloatArray, *, unbounded: bool) -> float | None:
    """A value of a column [n] that seems to mark missing values; `unbounded`: values may grow throughout a record, as
    times do."""
    outermost = float(column.min(initial=np.inf)), float(column.max(initial=-np.inf))
    finite_values = column if np.isfinite(outermost).all() else column[np.isfinite(column)]
    if finite_values.size < 2:
        return None
    if finite_values is not column:
        outermost = float(finite_values.min()), float(finite_values.max())
    usual = float(np.median(np.abs(finite_values[:: max(1, finite_values.size // _MAX_SAMPLED)])))
    if not any(map(_nines, outermost)) and max(map(abs, outermost)) < _FAR_NINES * usual:
        return None if unbounded else _jumped_to(finite_values, *outermost)  # no value is far off by any rule
    ends = sorted(_ends(finite_values, np.min) | _ends(finite_values, np.max), key=abs, reverse=True)
    other_values = finite_values[~np.isin(finite_values, [end for end in ends if _nines(end)])]
    for end in ends:
        nines = _nines(end)
        usual_values = other_values if nines else other_values[np.abs(other_values) < abs(end)]
        if usual_values.size < 2 or (unbounded and not nines):
            continue
        low, high = usual_values.min(), usual_values.max()
        scale = max(-low, high)
        below = end < 0 and low > -_CLOSE * scale  # zero, with its noise, and no other value below it
        common = np.count_nonzero(np.abs(finite_values) >= abs(end)) > max(1.0, _RARE * finite_values.size)
        far = (_FAR_BELOW if below else _FAR_NINES) / 10.0 ** (nines - 3) if nines else _FAR_COMMON if common else _FAR
        far = min(far, _FAR_NINES) if below and not common else far
        if 0 < far * scale <= max(low - end, end - high):
            return end
    return None if unbounded else _jumped_to(finite_values, *outermost)


def _ends(inner_values: FloatArray, end_of: Callable[[FloatArray], Any]) -> set[float]:
    """The outermost values at one end."""
    ends: set[float] = set()
    while inner_values.size and len(ends) < _MAX_KINDS:
        ends.add(float(end_of(inner_values)))
        inner_values = inner_values[inner_values != end_of(inner_values)]
    return ends


def _nines(value: float) -> int:
    """A number's leading nines, if there are at least three; five for the ends of an integer type; at any decimal
    point."""
    digits = f"{abs(value):.15g}".replace(".", "").lstrip("0")
    nines = len(digits) - len(digits.lstrip("9"))
    return 5 if digits.isdecimal() and int(digits) in _ENDS else nines if nines >= 3 and "e" not in digits else 0


def _jumped_to(held: FloatArray, low: float, high: float) -> float | None:
    """A value of nines to which samples [n] jump and from which they return to their former level."""
    for value in (999.0, -999.0, 9999.0, -9999.0):
        if not low <= value <= high:
            continue
        rows = np.flatnonzero(held == value)
        rows = rows[(rows > 0) & (rows < held.size - 1)]
        if rows.size == 0:
            continue
        before, after = held[rows - 1], held[rows + 1]
        usual = np.median(np.abs(np.diff(held)))
        jump = np.minimum(np.abs(before - value), np.abs(after - value))
        if ((jump > _JUMP * usual) & (np.abs(before - after) < _CLOSE * jump) & (usual > 0)).any():
            return value
    return None


def drop_totals(
    columns: Mapping[int, NDArray[Any]], measured: list[int], table: Table
) -> tuple[dict[int, NDArray[Any]], Table]:
    """Columns [n] by index and their table, without rows at the end of it or of a level that are means, sums or maxima
    of the other rows."""
    measured_columns = [columns[index] for index in measured]
    sizes = {column.size for column in measured_columns}
    numeric = all(column.dtype.kind in "iuf" for column in measured_columns)
    if len(sizes) != 1 or max(sizes) > _LONGEST or not numeric:
        return dict(columns), table
    blocks = [*pairwise([0, *table.breaks, *sizes])]
    keep = np.ones(max(sizes), dtype=np.bool_)
    notices = []
    ends = [(*block, above, _MAX_TOTALS) for block in blocks for above in (True, False)]
    levels = [(*level, True, 1) for level in _levels(measured_columns)]
    for start, end, above, most in [*ends, *levels]:
        order = 1 if above else -1
        made_of = _totals([plain(column[start:end])[::order] for column in measured_columns], most)
        line = end - len(made_of) if above else start
        if made_of and keep[line : line + len(made_of)].all():
            keep[line : line + len(made_of)] = False
            where = f"line {table.line_of(line)}" if table.line_of else f"row {line + 1}"
            noun, side = "row" if len(made_of) == 1 else "rows", "above" if above else "below"
            rows_of = f"the {', '.join(made_of[::order])} of the rows {side}"
            message = f"left out: {len(made_of)} {noun} from {where} on, {rows_of}"
            notices.append(Notice(code="lines_left_out", message=message))
    if not notices:
        return dict(columns), table
    rows, line_of = np.flatnonzero(keep), table.line_of
    table = replace(
        table,
        line_of=None if line_of is None else lambda row: line_of(int(rows[row])),
        breaks=[int(np.count_nonzero(keep[:row])) for row in table.breaks],
        notices=[*table.notices, *notices],
    )
    return {index: column[keep] if column.size == keep.size else column for index, column in columns.items()}, table


def _levels(columns: Sequence[NDArray[Any]]) -> list[tuple[int, int]]:
    """The first and last rows of stretches in which a column is constant: levels of a test, each of which may end with
    a row of means."""
    found = []
    for column in columns if columns[0].size <= _LONGEST_OF_LEVELS else ():
        ends = [0, *(np.flatnonzero(np.diff(plain(column)) != 0) + 1), column.size]
        if 1 < len(ends) - 1 <= column.size / _SHORTEST_LEVEL:
            found += [(start, end) for start, end in pairwise(map(int, ends)) if end - start >= _SHORTEST_LEVEL]
    return found


def _totals(columns: list[FloatArray], most: int = _MAX_TOTALS) -> list[str]:
    """The statistics in the last rows of columns [n], at most `most`, one word per row; empty if the rows may be
    measured."""
    for count in range(min(most, columns[0].size - 3), 0, -1):
        above = [column[:-count] for column in columns]
        made_of, by_chance = [], 1.0
        for row in range(-count, 0):
            values = [float(column[row]) for column in columns]
            chance, name = min((_chance(above, values, name), name) for name in _STATISTICS)
            if not np.isfinite(chance):
                break
            same = [column == value for column, value in zip(above, values, strict=True)]
            repeated = name in _OWN and np.logical_and.reduce(same).any()
            made_of.append(name)
            by_chance *= 1.0 if repeated else chance
        limit = _BY_CHANCE_OWN if set(made_of) <= _OWN else _BY_CHANCE
        if len(set(made_of)) == count and by_chance < limit and not set(made_of) <= _BESIDE:
            return made_of
    return []


def _chance(above: list[FloatArray], row: list[float], name: str) -> float:
    """The probability that a measured row equals a statistic of all columns above it by chance, over their finite
    values; infinite if it does not equal it."""
    chance = 1.0
    for held, value in zip(above, row, strict=True):
        column = held[np.isfinite(held)]
        if column.size < 2 or not np.isfinite(value):
            return np.inf
        total, spread = _STATISTICS[name](column), float(np.ptp(column))
        written = min(map(_half_a_digit, column[:_MAX_LOOKED_AT].tolist()))
        rounded = 0.0 if name in _EXACT else _half_a_digit(value) + written * (column.size if name == "sums" else 1)
        if not abs(value - total) <= rounded + 1e-9 * abs(total):
            return np.inf
        if name in _OWN and 2 * np.unique(column).size <= column.size:
            continue  # set points that are repeated in every order, their highest in the last row too
        near = np.count_nonzero(np.abs(column - total) <= rounded) / column.size
        chance *= min(1.0, max(near, 2 * rounded / spread if spread else 1 / column.size))
    return chance


def _half_a_digit(value: float) -> float:
    """Half a unit of a number's last written decimal."""
    decimals = len(f"{value:.9g}".partition(".")[2])
    return 0.5 * 10.0**-decimals
