"""A complete reading of a file that is not read without a question, for a person to confirm: columns, units, clock, marks.

In: a table, how it was asked to be read. Out: how it may be read, with a confidence, or nothing. What is proposed was tried:
the file can be read so. Nothing here is ever used to read a file that nobody has confirmed.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.channels import CHANNELS
from service.errors import FieldError, InvalidError
from service.readers.assemble import as_seconds, runs_on, to_channels
from service.readers.column_names import choices_of, column_of, like_a_time
from service.readers.constants import value_of_column, value_of_part, value_within
from service.readers.limits import LONGEST_TITLE, Limits
from service.readers.long_table import in_columns
from service.readers.meanings import (
    MEANS,
    SLIDING,
    SYMBOLS,
    Sense,
    has_noun,
    is_another,
    is_short_for,
    meaning,
    measures,
    words,
)
from service.readers.numerals import plain, read_cells, with_unit_apart
from service.readers.table import ALL, CELLS, COLUMNS, NO_TIME, SHEETS, ColumnChoice, FileColumn, Reading, Table, labels
from service.readers.table_finder import CORNER, is_value
from service.readers.unit_table import conversion, is_unit

#: The channels that every test needs.
_NEEDED = ("torque_nm", "speed_rpm", "pressure_bar")
#: Those that may be constant in each part of a file.
_STATED = ("pressure_bar", "speed_rpm")
#: How sure a column's name makes of its channel. Chosen; by a draw of files (tests/lab/files).
_SURE = {Sense.WHOLE: 1.0, Sense.FOREIGN: 0.98, Sense.PART: 0.8}
#: The same of a name that says nothing: short for the channel, with a unit of it; a unit alone; short, or with a letter for
#: it (`T_clutch`), without a unit.
_SHORT_IN_UNIT, _UNIT_ALONE, _SHORT_ALONE, _SYMBOL_ALONE = 0.75, 0.6, 0.4, 0.3
#: A rival that is so likely beside the best column makes this of its confidence. Chosen.
_RIVAL, _WITH_RIVAL = 0.8, 0.6
#: What is left of the confidence after each thing that only its values suggest. Chosen.
_UNIT_BY_SIZE, _CONSTANT, _MARK, _SIGN, _CLOCK, _FIRST_OF_SEVERAL = 0.7, 0.8, 0.9, 0.7, 0.8, 0.5
#: Units that a channel may be in, and the sizes that its largest values may have in the channel's own. Chosen: wide.
_SIZES: Mapping[str, tuple[tuple[str, ...], float, float]] = {
    "pressure_bar": (("bar", "kPa", "MPa", "mbar", "Pa"), 0.2, 80.0),
    "torque_nm": (("Nm", "kNm", "Nmm"), 0.3, 5000.0),
    "speed_rpm": (("rpm", "1/s"), 5.0, 20_000.0),
    "oil_temperature_c": (("°C", "K"), -40.0, 220.0),
}
#: Steps of a time without a unit that are milliseconds, s, and rows that are samples. Chosen: no rig samples every two
#: seconds for thousands of rows, and no test has so many plateaus.
_MS_STEPS, _MANY_ROWS = 2.0, 500
#: Things that are mended one after the other.
_MAX_STEPS = 6
_MARK_NAMED = re.compile(r"missing=(\S+?)(?:;| to )")
#: Rivals that differ by less than this share of the largest value hold the same; and a pressure that the torque goes by.
#: Chosen.
_SAME, _FOLLOWS = 0.01, 0.8
#: A rate; and the least that is one of samples, Hz. Chosen: records have at least 10 Hz, rigs oscillate slower.
_HERTZ, _SLOWEST = re.compile(r"(\d+(?:[.,]\d+)?) ?(k?)Hz"), 10.0
_UNIT_NAMED = re.compile(r"may be (\S+): state it with map=(\w+):")


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """A suggested reading of a file with its confidence, 0 to 1; `titles`: all columns of the file as a profile names
    them."""

    reading: Reading
    confidence: float
    titles: tuple[str, ...] = ()


def propose(
    read_table: Callable[[Reading], Table], reading: Reading, limits: Limits, filename: str = ""
) -> Proposal | None:
    """A reading by which the file gives the channels of a test; None if none is found. `read_table` reads its table.

    A file of several similar parts is read as all of them. Raises TooLargeError as reading does.
    """
    whole = replace(reading, table=ALL)
    if not reading.table and _has_parts(read_table, whole):
        found = _attempt(read_table, whole, limits, filename)
        if found is not None:
            return found
    return _attempt(read_table, reading, limits, filename)


def _has_parts(read_table: Callable[[Reading], Table], whole: Reading) -> bool:
    try:
        return len(read_table(whole).parts) > 1
    except InvalidError:
        return False


def _attempt(
    read_table: Callable[[Reading], Table], reading: Reading, limits: Limits, filename: str
) -> Proposal | None:
    """The reading corrected step by step, each time as the error of an attempt to read demands; None if it fails."""
    confidence, asked, clock = 1.0, reading, False
    for _ in range(_MAX_STEPS):
        try:
            table = read_table(asked)
            named, sure = _named(table, asked, filename, clock=clock)
            columns = to_channels(table, named, limits).columns
        except InvalidError as error:
            wrong = error.errors[0] if error.errors else None
            asks = ("ambiguous", "/time"), ("missing_unit", "/channels/time_s")
            if wrong is not None and (wrong.code, wrong.pointer) in asks and not clock:
                clock, confidence = True, min(confidence, _CLOCK)  # which of several times
                continue
            mended = None if wrong is None else _mended(wrong, error.detail, asked, read_table, limits, filename)
            if mended is None or mended[0] == asked:
                return None
            asked, confidence = mended[0], min(confidence, mended[1])
        else:
            if not columns.keys() >= {*_NEEDED}:
                return None
            timeless = not asked.time and "time_s" not in columns and columns["torque_nm"].size > _MANY_ROWS
            if timeless and (rate := _rate(table, filename)):
                named = replace(named, mapping={**named.mapping, "time_s": ColumnChoice(column=rate)})
                sure = min(sure, _FIRST_OF_SEVERAL)
            confidence = min(confidence, sure, _CONSTANT if asked.table == ALL else 1.0)
            return Proposal(reading=named, confidence=round(confidence, 2), titles=_titles(table, named))
    return None


def _titles(table: Table, reading: Reading) -> tuple[str, ...]:
    """All columns by their names in a profile."""
    wide, _ = in_columns(table, reading)
    return tuple(
        dict.fromkeys(_title(own) for own in wide.columns if own.title and own.name and not own.name.startswith("="))
    )


# --- columns ---


def _named(table: Table, asked: Reading, filename: str, *, clock: bool) -> tuple[Reading, float]:
    """The reading with a column for each channel that has one, and its confidence; `clock`: also one of several times."""
    if (crossed := _crossed(table, asked)) is not None:
        return crossed
    wide, wide_reading = in_columns(table, asked)
    mapping, confidence = dict(asked.mapping), 1.0
    least = 1.0 if {*_NEEDED} <= mapping.keys() else 0.0  # a caller who named them all wants no other guess
    given = {choice.column for choice in choices_of(asked).values()}
    free = {
        at: own for at, own in enumerate(wide.columns) if own.name and not {own.title, own.name, _title(own)} & given
    }
    for channel in (*_NEEDED, *(name for name in CHANNELS if name not in (*_NEEDED, "time_s"))):
        scores = {at: _likelihood(own, channel) for at, own in free.items()} if channel not in mapping else {}
        scores = {at: score for at, score in scores.items() if score > 0 and score >= least}
        at, sure = _settled(wide, scores, channel, mapping, wide_reading) if channel in _NEEDED else _best(scores)
        if at is not None:
            mapping[channel], by_size = _choice(wide, at, channel, wide_reading)
            confidence = min(confidence, sure, by_size) if channel in _NEEDED else confidence
            del free[at]
    for channel in _STATED:
        if channel not in mapping and (constant := _constant(table, filename, asked, channel)):
            mapping[channel] = ColumnChoice(column=constant)
            confidence = min(confidence, _CONSTANT)
            if constant == COLUMNS:
                only = replace(asked, mapping={**asked.mapping, channel: mapping[channel]})
                named, sure = _named(table, only, filename, clock=clock)
                return named, min(sure, confidence)
    named = replace(asked, mapping=mapping)
    if wide_reading is not asked or asked.time or "time_s" in mapping:
        return named, confidence
    at, sure = _time(wide, free, wide_reading, needed=clock)
    if at is not None:
        mapping["time_s"], by_size = _choice(wide, at, "time_s", wide_reading)
        return replace(asked, mapping=mapping), min(confidence, sure, by_size)
    return named, confidence


def _crossed(table: Table, asked: Reading) -> tuple[Reading, float] | None:
    """The reading of a two-way table: its titles are values (of pressure over a column of speeds, or of speed over a
    column of pressures) and its cells are torques; None for a table of another form."""
    over = [own for own in table.columns[1:] if own.title]
    plain_values = all(is_value(with_unit_apart(own.title)[0]) for own in over)
    if len(over) < 2 or asked.mapping or not (plain_values or any(_all_values(over, of) for of in _NEEDED)):
        return None
    down = table.columns[0]
    texts = [part for row in (table.heads or [()])[0] for cell in row for part in CORNER.split(cell)]
    likely = {
        channel: max(_likelihood(down, channel), _UNIT_ALONE * measures(channel, down.unit))
        for channel in ("speed_rpm", "pressure_bar")
    }
    if not max(likely.values()):
        return None
    under, across = sorted(likely, key=lambda channel: likely[channel], reverse=True)
    in_titles = _all_values(over, across)
    stated = None if in_titles else _unit_among(texts, across)
    mapping = {
        under: ColumnChoice(column=_title(down), unit=None if down.unit else _unit_among(texts, under)),
        across: ColumnChoice(column=COLUMNS, unit=stated),
        "torque_nm": ColumnChoice(column=CELLS, unit=_unit_among(texts, "torque_nm")),
    }
    sure = (stated or in_titles) and mapping["torque_nm"].unit and (down.unit or mapping[under].unit)
    if not stated and not in_titles:
        mapping[across] = replace(mapping[across], unit=CHANNELS[across].unit)
    return replace(asked, mapping=mapping), _CONSTANT if sure else _UNIT_BY_SIZE


def _all_values(columns: Sequence[FileColumn], channel: str) -> bool:
    """Whether all columns' titles consist of a channel's value alone (`p=2bar`)."""
    return all((value_of_column(own, channel) or (0, ""))[1] == CELLS for own in columns)


def _unit_among(texts: Sequence[str], channel: str) -> str | None:
    """The first unit of a channel in one of the texts, in brackets or at their end."""
    return next(
        (unit for text in texts if (unit := column_of(text[:LONGEST_TITLE]).unit) and measures(channel, unit)), None
    )


def _settled(
    table: Table, scores: Mapping[int, float], channel: str, mapping: Mapping[str, ColumnChoice], reading: Reading
) -> tuple[int | None, float]:
    """The likeliest column and its confidence. Rivals must all hold the same values, in any units; a pressure may be
    the one that torque follows, a speed the only one that is called that between both sides. None if only a person can
    decide."""
    best = max(scores.values(), default=0.0)
    rivals = [at for at, score in scores.items() if score >= _RIVAL * best]
    rivals = [at for at in rivals if table.columns[at].unit is not None] or rivals
    if len(rivals) < 2:
        return (rivals[0], best) if rivals else (None, 1.0)
    sliding = [at for at in rivals if channel == "speed_rpm" and SLIDING & {*words(table.columns[at].name)}]
    if len(sliding) == 1:
        return sliding[0], _WITH_RIVAL * best
    chosen_torque = mapping.get("torque_nm")
    of_torque = (
        at for at in range(len(table.columns)) if chosen_torque and _address(table, at) == chosen_torque.column
    )
    torque = next(of_torque, None)
    # read together: the last row may be cut in one of them
    asked = dict.fromkeys(rivals, channel) | ({} if torque is None else {torque: "torque_nm"})
    cells = read_cells(table, asked, reading)
    own = {at: _converted(cells[at], table.columns[at], channel) for at in rivals}
    first, *others = own.values()
    scale = float(np.nanmax(np.abs(first), initial=0.0))
    if all(np.allclose(first, other, rtol=0, atol=_SAME * scale, equal_nan=True) for other in others):
        return next((at for at in rivals if table.columns[at].unit == CHANNELS[channel].unit), rivals[0]), best
    if channel != "pressure_bar" or torque is None:
        return None, 1.0
    torques = np.abs(_converted(cells[torque], table.columns[torque], "torque_nm"))
    follows = {at: _correlation(values, torques) for at, values in own.items()}
    chosen, *rest = sorted(follows, key=lambda at: follows[at], reverse=True)
    clear = follows[chosen] > _FOLLOWS and all(follows[at] < _FOLLOWS - 0.3 for at in rest)
    return (chosen, _WITH_RIVAL * best) if clear else (None, 1.0)


def _converted(cells: NDArray[Any], column: FileColumn, channel: str) -> FloatArray:
    """A column's values [n] in the channel's unit if it states one, else unchanged."""
    values = plain(cells)
    converted = conversion(channel, column.unit or "")
    if converted is not None:
        converted.apply(values)
    return values


def _correlation(values: FloatArray, others: FloatArray) -> float:
    both = np.isfinite(values) & np.isfinite(others) if values.size == others.size else np.zeros(0, dtype=bool)
    if np.count_nonzero(both) < 3 or not np.ptp(values[both]) or not np.ptp(others[both]):
        return 0.0
    return float(np.corrcoef(values[both], others[both])[0, 1])


def _address(table: Table, at: int) -> str:
    """A column's name for a map: with its unit, or its number if several columns share the name."""
    column = table.columns[at]
    name = _title(column)
    equal = [other for other, own in enumerate(table.columns) if _title(own) == name]
    if len(equal) == 1:
        return name
    units = [table.columns[other].unit for other in equal]
    return (
        f"{name} [{column.unit}]" if column.unit and units.count(column.unit) == 1 else f"{name}#{equal.index(at) + 1}"
    )


def _title(column: FileColumn) -> str:
    """A column's name in a profile."""
    return f"{column.group}/{column.name}" if column.group else column.name


def _likelihood(column: FileColumn, channel: str) -> float:
    """The probability that a column holds a channel, by its name and unit."""
    of, sense = meaning(column.name, column.unit)
    if column.unit is None and _ends_in_another_unit(channel, column.name):
        return 0.0
    if channel != "time_s" and has_noun("time_s", column.name):
        return 0.0  # the time of another column (`time_Torque`)
    if of is None and column.unit is None:  # what it may be, if it is in the channel's unit
        assumed = meaning(column.name, CHANNELS[channel].unit)
        if has_noun(channel, column.name) or is_short_for(channel, column.name):
            of, sense = (channel, Sense.PART) if assumed[1] is Sense.UNKNOWN or assumed[0] == channel else assumed
    fits = measures(channel, column.unit)
    if sense is Sense.OTHER or is_another(column.name) or is_another(column.group) or (column.unit and not fits):
        return 0.0
    score = _SURE.get(sense, 0.0) if of == channel else 0.0
    if of != channel and channel in _NEEDED and sense is Sense.UNKNOWN:
        short = is_short_for(channel, column.name)
        symbol = any(channel in SYMBOLS.get(word, ()) for word in words(column.name))
        alone = _SHORT_ALONE if short else _SYMBOL_ALONE if symbol else 0.0
        score = (_SHORT_IN_UNIT if short else _UNIT_ALONE) if fits else alone
    return score * (0.6 if MEANS & {*words(column.name)} else 1.0)


def _ends_in_another_unit(channel: str, name: str) -> bool:
    """Whether a name's last word is a unit of another quantity (`Axial_Force_kN`)."""
    *others, last = re.split(r"[\s_]+", name.strip())
    return bool(others) and is_unit(last) and not (conversion(channel, last) or conversion(channel, last.upper()))


def _best(scores: Mapping[int, float]) -> tuple[int | None, float]:
    """The likeliest column (the first of equal ones), and its confidence in view of its rivals."""
    if not scores:
        return None, 1.0
    at = max(scores, key=lambda place: scores[place])
    rivals = [score for place, score in scores.items() if place != at and score >= _RIVAL * scores[at]]
    return at, scores[at] * (_WITH_RIVAL if rivals else 1.0)


def _choice(table: Table, at: int, channel: str, reading: Reading) -> tuple[ColumnChoice, float]:
    """A column with its unit, or the unit that its values suggest if it states none; and its confidence."""
    column, title = table.columns[at], _address(table, at)
    if column.unit is not None or column.name == channel:
        return ColumnChoice(column=title), 1.0
    values = plain(read_cells(table, {at: channel}, reading)[at])
    return ColumnChoice(column=title, unit=_unit_by_size(channel, values)), _UNIT_BY_SIZE


def _unit_by_size(channel: str, values: FloatArray) -> str:
    """The first unit in which values [n] have a plausible size for the channel; the channel's own if none fits."""
    finite = values[np.isfinite(values)]
    if channel == "time_s":
        steps = np.diff(finite)
        return "ms" if finite.size > _MANY_ROWS and steps.size and np.median(steps) >= _MS_STEPS else "s"
    if channel not in _SIZES or finite.size == 0:
        return CHANNELS[channel].unit
    units, least, most = _SIZES[channel]
    large = float(np.quantile(np.abs(finite), 0.9))
    for unit in units:
        converted = conversion(channel, unit)
        if converted is not None and least <= large * converted.factor + converted.offset <= most:
            return unit
    return CHANNELS[channel].unit


def _time(table: Table, free: Mapping[int, FileColumn], reading: Reading, *, needed: bool) -> tuple[int | None, float]:
    """The column that is the time, and its confidence; none if the file's own names or clocks state it, and no choice
    is `needed`."""
    whole = [at for at, own in free.items() if meaning(own.name, own.unit) == ("time_s", Sense.WHOLE)]
    stated = any(column.clock is not None for column in table.columns)
    unitless = len(whole) == 1 and free[whole[0]].unit is None
    if not needed and not unitless and (whole or stated):
        return None, 1.0
    scores = {}
    likely = [at for at, own in free.items() if like_a_time(own) or is_short_for("time_s", own.name)]
    of_columns = [at for at, own in free.items() if has_noun("time_s", own.name)]  # the same of each, or none of all
    asked = dict.fromkeys(whole or likely or of_columns, "time_s")
    read = read_cells(table, asked, reading) if asked else {}
    if not whole and not likely and any(not np.array_equal(read[at], read[of_columns[0]]) for at in of_columns):
        return None, 1.0
    for at in read:
        if runs_on(free[at], as_seconds(free[at], read[at])):
            of, sense = meaning(free[at].name, free[at].unit)
            scores[at] = _SURE.get(sense, 0.0) if of == "time_s" else _UNIT_ALONE
    return _best(scores)


def _constant(table: Table, filename: str, asked: Reading, channel: str) -> str | None:
    """Where a channel's value stands that no column holds: in the titles of columns, in the names of the file's parts or
    above them, or in the file's name."""
    within = [value_of_column(column, channel) for column in table.columns]
    if any(within):
        return COLUMNS
    if asked.reads_all() and value_of_part(table.name, (table.heads or [table.above])[0], channel) is not None:
        return SHEETS
    for label, text in labels((table.heads or [table.above])[0]).items():
        name = label.rstrip(":= ")
        own = column_of(name)
        of, sense = meaning(own.name, own.unit)
        if of == channel and sense in _SURE and re.match(r"[+-]?\d+(?:[.,]\d+)?\s*\S{0,6}$", text):
            return f"={name}"
    held = value_within(PurePath(filename).stem.replace("_", " ").replace("-", " "), channel)
    return f"={held[0]:g} {CHANNELS[channel].unit}" if held else None


def _rate(table: Table, filename: str) -> str | None:
    """A rate that may be that of the rows, where no column or clock of the file is a time: the only one above the table, or
    in the file's name."""
    stated = {f"={label.rstrip(':= ')}": text for label, text in labels(table.above).items()}
    stated |= {f"={match[0]}": match[0] for match in _HERTZ.finditer(PurePath(filename).stem.replace("_", " "))}
    rates = {column: match for column, text in stated.items() if (match := _HERTZ.fullmatch(text))}
    fast = [at for at, match in rates.items() if float(match[1].replace(",", ".")) * 1e3 ** bool(match[2]) >= _SLOWEST]
    return fast[0] if len(fast) == 1 else None


# --- what is wrong besides ---


def _mended(
    wrong: FieldError,
    detail: str,
    asked: Reading,
    read_table: Callable[[Reading], Table],
    limits: Limits,
    filename: str,
) -> tuple[Reading, float] | None:
    """The reading corrected as a refusal's error demands, and the confidence in that; None if only a person can decide."""
    if wrong.code == "which_table" and not asked.table:
        return _table_chosen(wrong.value, asked, read_table)
    if wrong.code == "perhaps_the_time":
        return replace(asked, time=wrong.value), _CLOCK
    if wrong.code == "time_stands" and asked.time != NO_TIME:
        mapping = {channel: choice for channel, choice in asked.mapping.items() if channel != "time_s"}
        return replace(asked, time=NO_TIME, mapping=mapping), _FIRST_OF_SEVERAL
    if wrong.code == "ambiguous_number" and not asked.decimal:
        return _sign_chosen(asked, read_table, limits, filename)
    if wrong.code == "which_is_good" and not asked.good:
        return replace(asked, good=wrong.value), _SIGN
    if (unit := _UNIT_NAMED.search(detail)) and unit[2] in asked.mapping:
        choice = replace(asked.mapping[unit[2]], unit=unit[1])
        return replace(asked, mapping={**asked.mapping, unit[2]: choice}), _UNIT_BY_SIZE
    if mark := _MARK_NAMED.search(detail):
        stated = dict.fromkeys(filter(None, [*asked.missing.split(","), *mark[1].split(",")]))
        return replace(asked, missing=",".join(stated)), _MARK
    return None


def _table_chosen(first: str, asked: Reading, read_table: Callable[[Reading], Table]) -> tuple[Reading, float]:
    """The reading of all parts, if they are alike; else of the first table."""
    whole = replace(asked, table=ALL)
    parts = read_table(whole).parts
    return (
        (replace(asked, table=first), _FIRST_OF_SEVERAL)
        if len(parts) == 1 and len(read_table(whole).others) > 1
        else (whole, _CONSTANT)
    )


def _sign_chosen(
    asked: Reading, read_table: Callable[[Reading], Table], limits: Limits, filename: str
) -> tuple[Reading, float] | None:
    """The reading with the decimal sign by which values change least from row to row, with its other corrections."""
    changes: dict[str, float] = {}
    mended: dict[str, Proposal] = {}
    for sign in (",", "."):
        found = _attempt(read_table, replace(asked, decimal=sign), limits, filename)
        if found is not None:
            columns = to_channels(read_table(found.reading), found.reading, limits).columns
            changes[sign], mended[sign] = sum(_changes(columns.values())), found
    if not changes:
        return None
    found = mended[min(changes, key=lambda sign: changes[sign])]
    return found.reading, min(_SIGN, found.confidence)


def _changes(columns: Iterable[FloatArray]) -> Iterator[float]:
    """The mean step of the logarithm of the absolute values, for each column [n]."""
    for column in columns:
        yield float(np.abs(np.diff(np.log(np.abs(column) + 1e-3))).mean()) if column.size > 1 else 0.0
