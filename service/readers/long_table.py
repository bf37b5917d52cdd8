"""A table of one value a row (time, channel's name, value) -> a table with a column for each name.

So write historians, databases and `melt`. That a column holds the channels' names is seen from its cells, where no title is
a measured channel's.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.errors import MAX_QUOTED, InvalidError, Notice
from service.readers.column_names import (
    choices_of,
    choose,
    column_of,
    is_time,
    perhaps_the_time,
    recognised,
    several_times,
)
from service.readers.constants import stacked_columns, with_constants
from service.readers.limits import LIMITS
from service.readers.meanings import Sense, known_channel, meaning
from service.readers.numerals import NUMBER, plain, read_cells
from service.readers.table import NO_MISSING, NO_TIME, Clock, FileColumn, Reading, Table, marks
from service.readers.table_finder import is_value
from service.readers.unit_table import is_unit

#: Rows of a table without lines by which its columns are judged, as many as others show.
_MAX_LOOKED_AT = 20
_VALUES = re.compile(r"val(?!id)|wert|reading|messung|数值|値|^y$", re.IGNORECASE)
#: A column that says which values are valid, of one whose title says what its flag means; and words for good and bad ones.
_QUALITY, _STATUS, _NOTES = (
    re.compile(names, re.IGNORECASE)
    for names in (
        "valid|qualit|gültig|outlier|ausrei(?:ss|ß)er",
        "status|zustand",
        r"bemerkung|kommentar|comment|remark|\bnotes?\b|notiz",
    )
)
_VALID, _INVALID = (re.compile(names, re.IGNORECASE) for names in ("valid|gültig", "invalid|ungültig"))
_GOOD = {"good", "ok", "valid", "gut", "gültig", "i.o.", "io", "pass", "passed"}
_BAD = {"bad", "nok", "invalid", "schlecht", "ungültig", "n.i.o.", "nio", "uncertain"} | {
    "fail", "failed", "fault", "error", "fehler", "alarm"
}  # fmt: skip
_FLAGS = {"true": 1.0, "false": 0.0}
#: OPC's codes. Source: OPC DA 3.0, 6.8 (of a byte, the two highest bits: 192 good, 64 uncertain, 0 bad); OPC UA part 4,
#: 7.39 (of four bytes, the two highest bits: 0 good, 0x40000000 uncertain, 0x80000000 bad).
_DA_GOOD, _DA_MOST, _UA_OTHER = 192, 255, 2**30
#: Distinct values that a column of codes has at most. Chosen: codes of one recorder; a quality in percent has more.
_MOST_CODES = 6
_SECOND = np.timedelta64(1, "s")


def says_valid(column: FileColumn, reading: Reading) -> bool:
    """Whether a column's title says that it marks valid rows, so that its values are to be checked."""
    if reading.good == NO_MISSING or reading.missing == NO_MISSING:
        return False
    return any(names.search(column.name) for names in (_QUALITY, _STATUS, _NOTES))


def valid_rows(column: FileColumn, cells: NDArray[Any], reading: Reading) -> NDArray[np.bool_] | None:
    """The valid rows [n] by a column's codes: the caller's codes, words, OPC's codes, or a flag with a title that
    states its meaning; None if all rows have one value, or the column holds none of these.

    Raises InvalidError if rows have different quality codes and it is not stated which of them are good.
    """
    codes = np.array([_code(word) for word in _stripped(cells)], dtype=object)
    values = set(codes)
    numbers = {value for value in values if isinstance(value, float)}
    good: set[str | float]
    if _NOTES.search(column.name) and not any(_has_word(value, _BAD) for value in values):
        return None
    if reading.good:
        good = {"" if word == "empty" else _code(word) for word in marks(reading.good)}
    elif values <= _GOOD | _BAD:
        good = {*_GOOD}
    elif _VALID.search(column.name) and numbers == values and numbers <= {0.0, 1.0}:
        good = {0.0 if _INVALID.search(column.name) else 1.0}
    elif not 1 < len(values) <= _MOST_CODES or not (
        _QUALITY.search(column.name) or any(_has_word(value, _GOOD | _BAD) for value in values)
    ):
        return None
    elif numbers == values and _DA_GOOD in numbers and max(numbers) <= _DA_MOST:
        good = {number for number in values if number in numbers and float(number) >= _DA_GOOD}
    elif numbers == values and 0.0 in numbers and min(numbers - {0.0}) >= _UA_OTHER:
        good = {0.0}
    else:
        raise _which_is_good(column, codes)
    return np.array([code in good for code in codes.tolist()])


def _has_word(code: str | float, words: set[str]) -> bool:
    """Whether a text has one of some words (`sensor fault`)."""
    return isinstance(code, str) and not words.isdisjoint(code.split())


def _code(word: str) -> str | float:
    """A code as a number or a flag if it is one, else as text."""
    word = word.casefold()
    return float(word) if NUMBER.fullmatch(word) else _FLAGS.get(word, word)


def _which_is_good(column: FileColumn, codes: NDArray[Any]) -> InvalidError:
    """The question for the good codes, with a suggestion: those that no word calls bad, else the most frequent."""
    counts = Counter(f"{code:g}" if isinstance(code, float) else code or "empty" for code in codes.tolist())
    shown = ", ".join(f"{code} in {count} rows" for code, count in counts.items())
    not_bad = [code for code in counts if not _has_word(code, _BAD)]
    good = ",".join(not_bad) if len(not_bad) < len(counts) else max(counts, key=lambda code: counts[code])
    message = (
        f"column {column.shown()} holds {shown}: which of them is good? Add good={good}, or whichever it is, to leave the "
        f"other rows out; good={NO_MISSING} reads all rows"
    )
    return InvalidError.of(message, code="which_is_good", pointer="/good", value=good)


def in_columns(table: Table, reading: Reading) -> tuple[Table, Reading]:
    """The table with a column for each quantity, and the reading for it: constants of parts beside the columns, values of
    titles below each other, names in cells as columns. Raises InvalidError as each step does."""
    return widened(stacked_columns(with_constants(table, reading), reading), reading)


def widened(table: Table, reading: Reading) -> tuple[Table, Reading]:
    """The table in wide form, with a column and times for each name in a column of names, and the reading for it; a
    table of another form unchanged.

    Raises InvalidError if the column of values or of times is ambiguous, or a channel has several units.
    """
    columns = table.columns
    named = [choice.column for channel, choice in choices_of(reading).items() if channel != "time_s"]
    titles = {text for column in columns for text in (column.title, column.name)}
    if len(columns) < 2 or titles & set(named) or {known_channel(name) for name in titles} - {None, "time_s"}:
        return table, reading
    head = _head(table)
    words = [index for index, cells in head.items() if cells and not any(map(is_value, cells))]
    best = max(words, key=lambda index: recognised(_distinct(head[index]), named), default=None)
    if best is None or not recognised(_distinct(head[best]), named):
        return table, reading
    unit = next((index for index in words if index != best and all(map(is_unit, head[index]))), None)
    timed = _time(table, reading)
    numeric = [index for index, cells in head.items() if cells and all(map(is_value, cells))]
    value = _value(columns, numeric, best, reading)
    marked = next((index for index, column in enumerate(columns) if says_valid(column, reading)), None)
    index_titles = {index: "" for index in (best, unit, marked) if index is not None} | {value: columns[value].shown()}
    cells = read_cells(table, index_titles | ({} if timed is None else {timed[0]: "time_s"}), reading)
    names = _stripped(cells[best])
    units = np.full(names.size, "", dtype=object) if unit is None else _stripped(cells[unit])
    if marked is not None:
        good = valid_rows(columns[marked], cells[marked], reading)
        good = np.ones(names.size, dtype=np.bool_) if good is None else good
        cells[value] = np.ma.MaskedArray(cells[value], mask=np.ma.getmaskarray(cells[value]) | ~good)
    times = None if timed is None else _seconds(cells[timed[0]], timed[1])
    rows = {name: np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist()) if name}
    LIMITS.require_columns(len(rows))

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        return [cells[value][list(rows.values())[index]] for index in taken]

    title = columns[best].shown()
    message = f"each row holds one value: the {len(rows)} channels named in {title} were read as columns"
    first_rows = [map(str, cells[value][own[:_MAX_LOOKED_AT]]) for own in rows.values()]
    wide = replace(
        table,
        columns=tuple(_column(name, set(units[own].tolist()), own, times) for name, own in rows.items()),
        read=read,
        head=tuple(zip(*first_rows, strict=False)),
        line_of=None,
        breaks=(),
        notices=[*table.notices, Notice(code="long_table", message=message)],
    )
    untimed = {channel: choice for channel, choice in reading.mapping.items() if channel != "time_s"}
    return wide, replace(reading, mapping=untimed, time=NO_TIME if reading.time == NO_TIME else "")


def _stripped(cells: NDArray[Any]) -> NDArray[Any]:
    return np.array([str(cell).strip() for cell in cells.tolist()], dtype=object)


def _head(table: Table) -> dict[int, list[Any]]:
    """The first non-empty cells of each column."""
    if table.head:
        width = range(len(table.columns))
        return {index: [row[index] for row in table.head if len(row) > index and row[index]] for index in width}
    texts = [index for index, column in enumerate(table.columns) if column.rows]
    return {index: table.read({index: ""})[0][:_MAX_LOOKED_AT].tolist() for index in texts}


def _distinct(cells: Sequence[Any]) -> list[str]:
    return list(dict.fromkeys(map(str, cells)))


def _time(table: Table, reading: Reading) -> tuple[int, Any] | None:
    """The column of times and its conversion to s; of several the only one that does not stand."""
    columns, named = table.columns, choices_of(reading).get("time_s")
    if reading.time == NO_TIME or (named and named.is_constant()):
        return None
    places = range(len(columns)) if named else [index for index, column in enumerate(columns) if is_time(column)]
    if len(places) > 1 and not named:
        cells = table.read(dict.fromkeys(places, ""))
        places = [at for at, held in zip(places, cells, strict=True) if (held != held[0]).any()]
    if len(places) > 1 and not named:
        shown = " and ".join(columns[index].shown() for index in places)
        raise several_times(shown)
    if not places:
        return None
    if not named and meaning(columns[places[0]].name, columns[places[0]].unit) != ("time_s", Sense.WHOLE):
        raise perhaps_the_time(columns[places[0]])
    taken = choose([columns[index] for index in places], Reading(mapping={"time_s": named} if named else {}))
    chosen, *_ = (column for column in taken if column.channel == "time_s")
    return places[chosen.index], chosen.conversion


def _value(columns: Sequence[FileColumn], numeric: Sequence[int], names: int, reading: Reading) -> int:
    """The column of values: the only numeric one that is no time, or the one named so."""
    timed = choices_of(reading).get("time_s")
    candidates = [index for index in numeric if not is_time(columns[index])]
    if timed is not None:
        candidates = [at for at in candidates if timed.column not in (columns[at].title, columns[at].name)]
    called = [index for index in candidates if _VALUES.search(columns[index].name)]
    for places in (called, candidates):
        if len(places) == 1:
            return places[0]
    shown = ", ".join(columns[index].shown() for index in called or candidates) or "none"
    message = (
        f"each row holds one value, of the channel named in {columns[names].shown()}. The column of values is not clear, "
        f"got {shown}: name one column 'value', or save the table with a column for each channel"
    )
    raise InvalidError.of(message, code="long_table")


def _seconds(times: NDArray[Any], conversion: Any) -> NDArray[np.float64]:
    if times.dtype.kind in "Mm":
        since = times - times[:1] if times.dtype.kind == "M" else times
        return np.asarray(since / _SECOND, dtype=np.float64)
    seconds = plain(times)
    conversion.apply(seconds)
    return seconds


def _column(name: str, units: set[str], rows: NDArray[np.intp], times: NDArray[np.float64] | None) -> FileColumn:
    if len(units) > 1:
        both = " and ".join(sorted(units))[:MAX_QUOTED]
        message = f"channel {name[:MAX_QUOTED]!r} must be in one unit, got {both}"
        raise InvalidError.of(message, code="mixed_units")
    clock = None if times is None else Clock(name, partial(times.__getitem__, rows))
    return replace(column_of(name, next(iter(units))), rows=rows.size, clock=clock)
