"""Cells -> numbers and points in time: which sign is the decimal's and which groups thousands, dates of every usual order.

A file has one decimal sign. Where each of its signs stands before exactly three digits, 1.100 may be 1.1 or 1100: that is
refused, not guessed.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import date, datetime, time, timedelta
from decimal import Decimal
from itertools import zip_longest
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.channels import LineOf, place
from service.errors import MAX_ERRORS, MAX_QUOTED, FieldError, InvalidError
from service.readers.table import ABOVE, Reading, Table, fills_down, marks
from service.readers.unit_table import is_unit

#: A number: no hexadecimals, no underscores, no words but nan and inf, which `check_columns` refuses with their row. Digits
#: are never given back, or a long run of them with a letter behind it would be tried from every digit to every other.
NUMBER = re.compile(r"[+-]?(\d++(\.\d*+)?|\.\d++)([eE][+-]?\d{1,4})?|[+-]?(nan|inf|infinity)", re.IGNORECASE | re.ASCII)
#: Thousands apart by an apostrophe or a blank, at the beginning of a cell.
_APART = re.compile(r"^[+-]?[1-9]\d{0,2}(?:['’ \u00a0\u202f\u2009]\d{3})+(?![\d'’ \u00a0\u202f\u2009])", re.MULTILINE)


def _readable(decimal: str, groups: str) -> re.Pattern[str]:
    """The cells that are numbers with `decimal` as decimal sign and `groups` as possible separator of thousands (1,100;
    1,23,456)."""
    d, g = re.escape(decimal), re.escape(groups)
    grouped = rf"(?!0)\d{{1,3}}(?:{g}\d{{2,3}})*{g}\d{{3}}(?:{d}\d*)?"
    return re.compile(rf"[+-]?(?:{grouped}|\d+{d}?\d*(?:[eE][+-]?\d+)?|{d}\d+(?:[eE][+-]?\d+)?)", re.ASCII)


#: What stands in a cell for the value above it.
_DITTO = frozenset(["″", '"', "〃", "''", "“", "”", "„", "do.", "dto.", "dito", "ditto", "idem", "同上"])
#: A number with its unit behind it.
_WITH_UNIT = re.compile(
    r"(?P<number>[+−-]? *(?:\d[\d.,'’\u00a0\u202f\u2009]*+|[.,]\d++)(?:[eE][+-]?\d{1,4})?) ?"
    r"(?P<unit>(?:1/)?[^\W\d_].{0,20}|[°%].{0,9})"
)


def with_unit_apart(cell: Any) -> tuple[Any, str]:
    """The number and the unit in a cell that holds both (`12,5 Nm`); any other cell unchanged, without a unit."""
    match = _WITH_UNIT.fullmatch(cell.strip()) if isinstance(cell, str) else None
    return (match["number"], match["unit"]) if match and is_unit(match["unit"]) else (cell, "")


_READABLE = {".": _readable(".", ","), ",": _readable(",", ".")}


def _decimals(cell: Any) -> list[str]:
    """The possible decimal signs of a cell."""
    if not isinstance(cell, str) or ("." not in cell and "," not in cell):
        return []
    bare = with_unit_apart(cell)[0].strip()
    return [decimal for decimal, number in _READABLE.items() if number.fullmatch(bare)]


class Numerals:
    """Converts the cells of one file: its decimal sign is given, or found from the first unambiguous cell ("" until
    then), the dates of each column have one order of day and month, and all points in time count from the same moment.
    """

    def __init__(self, reading: Reading) -> None:
        self.decimal = reading.decimal
        self._missing, self._fills_down = {"", *marks(reading.missing)}, fills_down(reading.missing)
        self._stamps: dict[int, Stamps] = {}
        self._units: dict[int, str] = {}
        self._origin: dict[bool, int] = {}
        self._zones: set[str] = set()

    def settle(self, columns: Sequence[Sequence[Any]]) -> bool:
        """Learn the decimal sign from columns of cells; true if it is still open and a cell is ambiguous."""
        doubtful = False
        for row in zip_longest(*columns) if not self.decimal else ():
            for signs in map(_decimals, row):
                if len(signs) == 1:
                    self.decimal = signs[0]
                    return False
                doubtful = doubtful or len(signs) > 1
        return doubtful

    def values(
        self,
        channels: Mapping[int, str],
        columns: Sequence[Sequence[Any]],
        line_of: LineOf | None = None,
        before: int = 0,
    ) -> list[NDArray[Any]]:
        """Columns [n] converted to values, by their index, each for a channel: numbers as float64, masked where cells
        are empty; points in time as in numpy; for no channel ("") the cells themselves.

        `before` is the number of rows read already. Raises InvalidError naming the rows of cells that are neither, or
        ambiguous.
        """
        if self.settle([cells for name, cells in zip(channels.values(), columns, strict=True) if name]):
            for name, cells in zip(channels.values(), columns, strict=True):
                for row, cell in enumerate(cells):
                    if len(_decimals(cell)) > 1:
                        raise _doubtful(name, before + row, with_unit_apart(cell)[0].strip(), line_of)
        for index, cells in zip(channels, columns, strict=True):
            units = (with_unit_apart(cell)[1] for cell in cells if any(map(str.isdigit, _shown(cell))))
            self._units.setdefault(index, "" if before else next(units, ""))
        read: list[NDArray[Any]] = []
        wrong: list[tuple[int, str, str, str]] = []
        total = 0
        for (index, name), cells in zip(channels.items(), columns, strict=True):
            values = self._column(index, name, cells)
            for row, rule in self._wrong(index, name, cells) if values is None else ():
                total += 1
                if len(wrong) < MAX_ERRORS * len(channels):
                    wrong.append((before + row, name, _shown(cells[row]), rule))
            read += [] if values is None else [values]
        if wrong:
            raise _wrong(sorted(wrong)[:MAX_ERRORS], total, line_of, before + len(columns[0]) - 1)
        return read

    def _column(self, index: int, name: str, cells: Sequence[Any]) -> NDArray[Any] | None:
        """One column's values; None if a cell is no number by this file's decimal sign, in the unit of the column's
        first cell."""
        if not name:
            objects = np.empty(len(cells), dtype=object)
            objects[:] = cells
            return objects
        values = self._moments(index, cells) if name == "time_s" else None
        unit = self._units.get(index, "")
        values = self._floats(cells) if values is None and not unit else values
        if values is not None:
            return values
        bare = [cell.strip() if isinstance(cell, str) else cell for cell in cells]
        if unit:
            if not all(cell in (None, "") or (isinstance(cell, str) and cell.endswith(unit)) for cell in bare):
                return None
            bare = [(cell or "").removesuffix(unit).rstrip() for cell in bare]
        gaps = [cell is None or (isinstance(cell, str) and self._is_mark(cell)) for cell in bare]
        values = self._floats(["nan" if gap else cell for cell, gap in zip(bare, gaps, strict=True)])
        return values if values is None or not any(gaps) else np.ma.MaskedArray(values, mask=gaps)

    def _is_mark(self, cell: str) -> bool:
        return cell.casefold() in self._missing or (self._fills_down and is_ditto(cell))

    def _moments(self, index: int, cells: Sequence[Any]) -> NDArray[Any] | None:
        """Dates, times of day or durations of a column; None if its cells are numbers or of several types."""
        kinds = set(map(type, cells))
        if kinds and kinds <= {datetime, date}:
            plain = [
                cell.replace(tzinfo=None) - (cell.utcoffset() or timedelta()) if isinstance(cell, datetime) else cell
                for cell in cells
            ]
            return np.array(plain, dtype="datetime64[us]")
        if kinds == {timedelta}:
            return np.array(cells, dtype="timedelta64[us]")
        if kinds == {time}:
            cells = [cell.isoformat() for cell in cells]
        elif kinds != {str} or (index not in self._stamps and not is_stamp(cells[0])):
            return None
        return self._stamps.setdefault(index, Stamps(self._origin, self._zones)).since_first(cells)

    def _floats(self, cells: Sequence[Any]) -> FloatArray | None:
        """Cells as numbers; None if any cell is no number by this file's decimal sign."""
        texts = [cell for cell in cells if isinstance(cell, str)]
        if not texts or len(texts) < len(cells):
            kinds = set(map(type, cells))
            read = self._floats(texts) if texts and kinds <= {str, int, float, Decimal} else np.empty(0)
            if read is None or not kinds <= {str, int, float, Decimal}:
                return None
            numbers = iter(read.tolist())
            return np.array([next(numbers) if isinstance(cell, str) else cell for cell in cells], dtype=np.float64)
        text = "\n".join([cell.strip() for cell in texts])
        if not text.isascii() or "'" in text or " " in text:
            text = _APART.sub(lambda match: re.sub(r"[^\d+-]", "", match[0]), text.replace("−", "-"))
        other = "," if self.decimal == "." else "."
        if other in text and self.decimal:
            if not all(_READABLE[self.decimal].fullmatch(cell) for cell in text.split("\n") if other in cell):
                return None
            text = text.replace(other, "")
        text = text.replace(",", ".")
        if " " in text:
            text = re.sub(r"(?m)^([+-]) +(?=[.\d])", r"\1", text)
        texts = re.sub(r"(?<=[.\d])[dD](?=[+-]?\d)", "e", text).split("\n")
        return np.array(list(map(float, texts))) if all(map(NUMBER.fullmatch, texts)) else None

    def _wrong(self, index: int, name: str, cells: Sequence[Any]) -> Iterator[tuple[int, str]]:
        """The rows of a column with no numbers, each with the broken rule."""
        swapped = Numerals(Reading(decimal="," if self.decimal == "." else "."))
        unit = self._units.get(index, "")
        for row, cell in enumerate(cells):
            if self._column(index, "no time", [cell]) is None:
                rule = f"must be a number in {unit}, as in the first row" if unit else "must be a number"
                if self.decimal and not unit and isinstance(cell, str) and swapped._floats([cell]) is not None:
                    rule = f"must have the decimal sign {self.decimal!r}, as earlier numbers have"
                elif name == "time_s":
                    rule = rule.replace("a number", "a number or a time such as 2026-11-02 07:00:00.5")
                yield row, rule


def read_cells(table: Table, channels: Mapping[int, str], reading: Reading) -> dict[int, NDArray[Any]]:
    """A table's columns [n] by index, with cells of any kind converted to numbers and points in time. Raises as
    `Numerals.values` does."""
    read = dict(zip(channels, table.read(channels), strict=True))
    cells = {index: _cells(column) for index, column in read.items() if column.dtype.kind in "OUS"}
    named = {index: channels[index] for index in cells}
    return read | dict(zip(cells, Numerals(reading).values(named, list(cells.values()), table.line_of), strict=True))


def plain(values: NDArray[Any]) -> FloatArray:
    """Numbers [n] with NaN for masked ones; all NaN if they are no numbers."""
    if values.dtype.kind not in "iuf":
        return np.full(values.size, np.nan)
    return np.array(np.ma.filled(np.ma.asarray(values, dtype=np.float64), np.nan))


def _cells(column: NDArray[Any]) -> list[Any]:
    return [cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell for cell in column.tolist()]


def _shown(cell: Any) -> str:
    return str("" if cell is None else cell).strip()[:MAX_QUOTED]


def is_ditto(cell: Any) -> bool:
    """Whether a cell says that the value above it stands here too; dashes may stand around the mark."""
    return isinstance(cell, str) and cell.strip("-–— ").casefold() in _DITTO


def _remedy(shown: str) -> str:
    """The advice for an empty cell, a formula, or a word or sign that may mark a missing value."""
    if not shown:
        return ": fill the cell, or add missing=empty to leave out such rows"
    if shown.startswith("="):
        return ": no program has computed this formula. Open the workbook in Excel or LibreOffice, and save it"
    if is_ditto(shown):
        return (
            f": add missing={ABOVE} to have it stand for the value above it, or missing={shown} to leave out such rows"
        )
    number = any(map(str.isdigit, shown)) and "#" not in shown  # `1.#QNAN` is none
    return "" if number or "," in shown else f": add missing={shown} to leave out such rows"


def empty_cells(name: str, rows: Sequence[int], line_of: LineOf | None, last: int) -> InvalidError:
    """The error for empty cells that should hold numbers."""
    wrong = [(row, name, "", "must be a number") for row in rows[:MAX_ERRORS]]
    return _wrong(wrong, len(rows), line_of, last)


def _wrong(wrong: Sequence[tuple[int, str, str, str]], total: int, line_of: LineOf | None, last: int) -> InvalidError:
    """The error for cells that are no numbers: row, channel, text and rule of each; `last` is the last row read."""
    errors = [
        FieldError(
            pointer=f"/channels/{name}/{row}",
            row=row + 1,
            value=shown,
            code="not_a_number",
            message=f"{place(name, row, line_of)} {rule}, got {shown!r}{_remedy(shown)}",
        )
        for row, name, shown, rule in wrong
    ]
    end = f"line {line_of(last)}" if line_of else f"row {last + 1}"
    more = "" if total == 1 else f"; {total} errors up to {end}"
    return InvalidError(errors[0].message + more, errors=errors, total=total)


def _doubtful(name: str, row: int, cell: str, line_of: LineOf | None) -> InvalidError:
    """The error for an ambiguous cell, with both readings."""
    sign, other = (",", ".") if "," in cell else (".", ",")
    as_decimal, as_thousands = f"{float(cell.replace(sign, '.')):.9g}", cell.replace(sign, "")
    message = (
        f"{place(name, row, line_of)} may be {as_decimal} or {as_thousands}, got {cell!r}. Add decimal={sign} if it is "
        f"{as_decimal}, or decimal={other} if it is {as_thousands}"
    )
    return InvalidError.of(message, code="ambiguous_number", pointer="/decimal", row=row + 1, value=cell)


# --- points in time ---

_DATE = r"(?P<date>\d{1,4}[-/.年]\d{1,2}[-/.月]\d{1,4}日?)"
#: Beginnings of the months' names in English, German, French, Spanish, Italian and Portuguese.
_MONTHS = {
    name: month
    for month, names in {
        1: "jan jän gen ene", 2: "feb fév fev", 3: "mar mär mrz", 4: "apr avr abr", 5: "may mai mag", 6: "jun juin giu",
        7: "jul juil lug", 8: "aug aoû ago", 9: "sep set", 10: "oct okt ott out", 11: "nov", 12: "dec dez déc dic",
    }.items()
    for name in names.split()
}  # fmt: skip
_NAMED = re.compile(
    r"(?:[^\W\d]{2,10}[.,]{0,2} )?(?:(?P<day>\d{1,2})(?:\.|st|nd|rd|th)?[ /-]?(?:de )?)?(?P<month>[^\W\d]{3,10})\.?[ /-]?"
    r"(?:de )?(?(day)|(?P<second>\d{1,2},? ))(?P<year>\d{4}|\d\d)(?!\d)"
)
_STAMP = re.compile(
    rf"(?:{_DATE}[T ,]*)?(?:(?P<days>-?\d+) days?,? *)?"
    r"(?:(?P<sign>[+-]?)(?P<first>\d{1,4}):(?P<second>\d{1,2})(?::(?P<third>\d{1,2}))?(?:[.,:](?P<fraction>\d{1,9}))?)?"
    r" ?(?P<half>[AaPp]\.? ?[Mm]\.?)?(?: ?(?:(?P<utc>Z|UTC|GMT)|(?P<zone>[+-]\d\d:?\d\d)))?"
    r"(?: ?\[?(?P<named>[A-Z]{2,5}|[A-Z][A-Za-z]{1,14}/[A-Z][A-Za-z_]{1,20})\]?)?",
    re.ASCII,
)
#: Dates that numpy may read: two dashes, and no zone behind them.
_ISO = re.compile(r"(?:19|20)\d\d-\d\d-\d\d[T ][\d:.]*\d", re.ASCII)
#: Durations by ISO 8601 (`PT0.01S`), as polars writes them.
_DURATION = re.compile(
    r"(?P<sign>[+-]?)P(?:(?P<days>\d{1,6})D)?T(?=\d)(?:(?P<hours>\d{1,6})H)?(?:(?P<minutes>\d{1,6})M)?"
    r"(?:(?P<seconds>\d{1,9}(?:\.\d{1,12})?)S)?",
    re.ASCII,
)
_SECONDS = {"seconds": 1, "minutes": 60, "hours": 3600, "days": 86_400}
#: Orders of a date's parts, but for those with slashes.
_ORDERS = ["%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%Y年%m月%d日", "%d.%m.%Y", "%d-%m-%Y", "%d.%m.%y"]
#: The day from which days are counted, so that nanoseconds fit 64 bits.
_EPOCH = datetime(2000, 1, 1)
_DAY = 86_400 * 10**9
#: The time before the date, as LabVIEW writes both in some languages.
_TIME_FIRST = re.compile(r"(\d{1,2}:\d\d:[\d:.,]+) (\d{1,4}[-./]\d{1,2}[-./]\d{2,4})$")
#: The order of C's ctime: `Fri Nov 27 07:00:00 2026`.
_CTIME = re.compile(r"[^\W\d]{2,3} ([^\W\d]{3}) +(\d{1,2}) ([\d:.]{5,15}) (\d{4})")


def _in_numbers(cell: str) -> str:
    """A date with the name of the month as digits: `27. Nov. 2026 07:00` as `27.11.2026 07:00`."""
    cell = _TIME_FIRST.sub(r"\2 \1", cell)
    cell = _CTIME.sub(r"\2 \1 \4 \3", cell) if cell[:1].isalpha() else cell
    match = _NAMED.match(cell) if cell[:1].isalnum() else None
    name = match["month"].casefold() if match else ""
    month, day = _MONTHS.get(name[:4]) or _MONTHS.get(name[:3]), match and (match["day"] or match["second"])
    if match is None or month is None or not day:
        return cell
    return f"{day.strip(', ')}.{month}.{match['year']}{cell[match.end() :]}"


def is_stamp(cell: str) -> bool:
    """Whether a text has the form of a point in time or of a duration with colons."""
    cell = cell.strip()
    match = _STAMP.fullmatch(_in_numbers(cell))
    return (match is not None and bool(match["date"] or match["first"])) or _DURATION.fullmatch(cell) is not None


class Stamps:
    """Points in time as text -> nanoseconds since `origin`, the first moment of a file's columns with a date, or of those
    without one: dates of every usual order, times of day, durations. A zone's name (`CET`) is one for all `zones` of the
    file, and shifts nothing."""

    def __init__(self, origin: dict[bool, int], zones: set[str]) -> None:
        self._origin, self._zones = origin, zones
        self._last: int | None = None
        self._days = 0
        self._has_date = True
        self._dates: dict[str, int | None] = {}
        self._orders: set[str] = {"%d/%m/%Y", "%m/%d/%Y"}

    def since_first(self, cells: Sequence[str]) -> NDArray[np.timedelta64] | None:
        """The next cells [n] as points in time; None if one is none. Raises InvalidError on unclear dates."""
        nanoseconds = self._iso(cells)
        if nanoseconds is None:
            self._narrow(cells)
            parsed = [self._nanoseconds(cell) for cell in cells]
            if any(moment is None or abs(moment) >= 2**62 for moment in parsed):
                return None
            nanoseconds = np.array(parsed, dtype=np.int64)
            self._has_date = bool(self._dates)
            if not self._has_date:
                nanoseconds = self._past_midnight(nanoseconds)
        origin = self._origin.setdefault(self._has_date, int(nanoseconds[0]))
        return (nanoseconds - origin).astype("timedelta64[ns]")

    def _past_midnight(self, times: NDArray[np.int64]) -> NDArray[np.int64]:
        """Times of day continued into the next day at each step back by more than half a day."""
        before = times[0] if self._last is None else self._last
        days = self._days + np.cumsum(np.diff(times, prepend=before) < -_DAY // 2)
        self._last, self._days = int(times[-1]), int(days[-1])
        return times + days * _DAY

    def _iso(self, cells: Sequence[str]) -> NDArray[np.int64] | None:
        """Times parsed by numpy if all are ISO 8601 without a time zone; else None."""
        if not all(len(cell) >= 16 and _ISO.fullmatch(cell) for cell in cells):
            return None
        try:
            return np.array(cells, dtype="datetime64[ns]").astype(np.int64)
        except ValueError:
            return None

    def _nanoseconds(self, cell: str) -> int | None:
        match = _STAMP.fullmatch(_in_numbers(cell.strip()))
        if match is None or not (match["date"] or match["first"]):
            return _duration(cell.strip())
        first, second, third = (int(match[name] or 0) for name in ("first", "second", "third"))
        if match["first"] and not match["third"]:
            if match["fraction"]:
                first, second, third = 0, first, second
            elif not match["date"]:
                return None  # 07:30 may be hours or minutes
        if match["half"]:
            first = first % 12 + 12 * (match["half"][0].lower() == "p")
        total = ((first * 60 + second) * 60 + third) * 10**9 + int((match["fraction"] or "").ljust(9, "0"))
        total *= -1 if match["sign"] == "-" else 1
        zone = (match["zone"] or "").replace(":", "")
        if match["date"]:
            self._zones.add("UTC" if zone or match["utc"] else match["named"] or "")
        if len(self._zones) > 1 and self._zones != {"", "UTC"}:
            shown = " and ".join(sorted(name or "none" for name in self._zones))
            message = f"the times must be in one zone, or each with its offset from UTC (+01:00), got {shown}"
            raise InvalidError.of(message, code="ambiguous_date", pointer="/channels/time_s")
        if zone:
            total -= (1 if zone[0] == "+" else -1) * (int(zone[1:3]) * 60 + int(zone[3:])) * 60 * 10**9
        day = self._day(match["date"]) if match["date"] else 0
        return None if day is None else total + (int(match["days"] or 0) + day) * _DAY

    def _narrow(self, cells: Sequence[str]) -> None:
        """Learn from dates with slashes whether the day or the month comes first.

        Raises InvalidError where several days may be of either order.
        """
        slashed = (re.match(r"\s*(\d{1,2}/\d{1,2}/\d{1,4})", cell) for cell in cells if "/" in cell)
        dates = {match[1] for match in slashed if match} - self._dates.keys()
        for written in dates:
            self._orders = {order for order in self._orders if _day_by(written, order) is not None} or self._orders
        if len(self._orders) > 1 and len(dates | {written for written in self._dates if "/" in written}) > 1:
            got = f"got {min(dates)[:MAX_QUOTED]!r}: write them as 2026-11-02"
            message = f"the dates of the time column may be day/month or month/day, {got}"
            raise InvalidError.of(message, code="ambiguous_date", pointer="/channels/time_s")

    def _day(self, written: str) -> int | None:
        """The day as a number; None if it is no date. Orders that cannot be mistaken are tried first."""
        if written not in self._dates:
            days = (_day_by(written, order) for order in (*_ORDERS, *sorted(self._orders)))
            self._dates[written] = next((number for number in days if number is not None), None)
        return self._dates[written]


def _duration(cell: str) -> int | None:
    """A duration in nanoseconds; None if the text is no duration."""
    match = _DURATION.fullmatch(cell)
    if match is None:
        return None
    total = sum(round(float(match[name] or 0) * seconds * 1e9) for name, seconds in _SECONDS.items())
    return -total if match["sign"] == "-" else total


def _day_by(written: str, order: str) -> int | None:
    try:
        return (datetime.strptime(written, order) - _EPOCH).days
    except ValueError:
        return None
