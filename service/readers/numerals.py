"""Columns of text -> float64: which sign is the decimal's and which groups thousands, and points in time.

Numbers are parsed by jiter (pydantic-core's reader of JSON) where they are plain, else by `float`. A file has one decimal
sign. Where each of its signs stands before exactly three digits, 1.100 may be 1.1 or 1100: that is refused, not guessed.
"""

import contextlib
import re
from collections.abc import Callable, Sequence
from datetime import date, datetime, timedelta
from datetime import time as dt_time
from decimal import Decimal
from typing import Any

import numpy as np
import pydantic_core
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.errors import MOST_ERRORS, MOST_QUOTED, FieldError, InvalidError

#: A number: no hexadecimals, no underscores, no words but nan and inf, which `check_arrays` refuses with their row. Digits
#: are never given back, or a long run of them with a letter behind it would be tried from every digit to every other.
NUMBER = re.compile(rb"[+-]?(\d++(\.\d*+)?|\.\d++)([eE][+-]?\d{1,4})?|[+-]?(nan|inf|infinity)", re.IGNORECASE)
_PLAIN = b"0123456789.eE+-\n"
_GROUPERS = re.compile("(?<=\\d)['’\u00a0\u202f\u2009](?=\\d{3})".encode())
_SIGNS = (b".", b",")


def _patterns(sign: bytes, other: bytes) -> tuple[re.Pattern[bytes], re.Pattern[bytes], re.Pattern[bytes]]:
    """Cells that show `sign` to be the decimal's; that show it to group; and that hold it as groups may."""
    c, d = re.escape(sign), re.escape(other)
    decimal = rb"^[+-]?(?:(?:0\d*|\d{4,}|)%b\d*|\d+%b(?:\d{0,2}|\d{4,})|\d*%b\d*[eE][+-]?\d+)$" % (c, c, c)
    groups = rb"[+-]?(?!0)\d{1,3}(?:%b\d{2,3})*%b\d{3}" % (c, c)
    grouping = rb"^(?:%b%b\d*|[+-]?\d{1,3}(?:%b\d{2,3})+%b\d{3})$" % (groups, d, c, c)
    return (
        re.compile(decimal, re.MULTILINE),
        re.compile(grouping, re.MULTILINE),
        re.compile(groups + rb"(?:%b\d*)?" % d),
    )


_DECIMAL, _GROUPING, _GROUPED = (
    dict(zip(_SIGNS, kind, strict=True)) for kind in zip(*(_patterns(*pair) for pair in (_SIGNS, _SIGNS[::-1])), strict=True)
)  # fmt: skip


class Undecided(Exception):  # noqa: N818 (no error: more of the file may decide)
    """A cell that may be read in two ways, and nothing yet that says which."""


class Numerals:
    """The signs of one file: its decimal sign is settled by the caller, or by the first cell that can be read in one way."""

    def __init__(self, decimal: str = "") -> None:
        self.decimal = decimal.encode()

    def settle(self, texts: Sequence[bytes]) -> None:
        """Learn the decimal sign from columns, the cells of each apart by line feeds. Raises Undecided."""
        if self.decimal:
            return
        doubtful, occurrences = False, []
        for text in texts:
            for sign, other in (_SIGNS, _SIGNS[::-1]):
                if sign in text:
                    occurrences += [(match.start(), sign) for match in (_DECIMAL[sign].search(text),) if match]
                    occurrences += [(match.start(), other) for match in (_GROUPING[sign].search(text),) if match]
                    doubtful = doubtful or any(_GROUPED[sign].fullmatch(cell) for cell in text.split(b"\n"))
        if occurrences:
            self.decimal = min(occurrences)[1]
        elif doubtful:
            raise Undecided

    def doubtful(self, text: bytes) -> tuple[int, bytes, str, str] | None:
        """A cell that may be read in two ways: its row, its text and both readings."""
        for row, cell in enumerate(text.split(b"\n")):
            for sign in _SIGNS:
                if sign in cell and _GROUPED[sign].fullmatch(cell):
                    return row, cell, f"{float(cell.replace(sign, b'.')):.9g}", cell.replace(sign, b"").decode()
        return None

    def floats(self, text: bytes) -> FloatArray | None:
        """A column's cells, apart by line feeds, as numbers; None where one is none, or not by this file's decimal sign."""
        if b" " in text or b"\t" in text:
            text = b"\n".join([cell.strip(b" \t") for cell in text.split(b"\n")])
        if not text.isascii() or b"'" in text:
            text = _GROUPERS.sub(b"", text)
        other = b"," if self.decimal == b"." else b"."
        if other in text and self.decimal:
            if not all(_GROUPED[other].fullmatch(cell) for cell in text.split(b"\n") if other in cell):
                return None
            text = text.replace(other, b"")
        text = text.replace(b",", b".")
        if not text.translate(None, _PLAIN):
            # +5, .5, 007 are numbers, and none of JSON's
            with contextlib.suppress(ValueError, OverflowError):
                numbers = np.array(pydantic_core.from_json(b"[%b]" % text.replace(b"\n", b",")), dtype=np.float64)
                return numbers if text else None
        cells = text.split(b"\n")
        return np.array([float(cell) for cell in cells]) if all(map(NUMBER.fullmatch, cells)) else None

    def wrong(self, text: bytes) -> list[tuple[int, str]]:
        """The rows of a column that are no numbers, each with the rule that it breaks."""
        broken_rules = []
        for row, cell in enumerate(text.split(b"\n")):
            if self.floats(cell) is None:
                swapped = Numerals("," if self.decimal == b"." else ".")
                rule = "must be a number"
                if self.decimal and swapped.floats(cell) is not None:
                    rule = f"must have the decimal sign {self.decimal.decode()!r} as before"
                broken_rules.append((row, rule))
        return broken_rules


_DATE = r"(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}[- ][A-Za-z]{3}[- ]\d{4})"
_STAMP = re.compile(
    rf"(?:{_DATE}[T ,]*)?(?:(?P<days>-?\d+) days?,? *)?"
    r"(?:(?P<sign>[+-]?)(?P<first>\d{1,4}):(?P<second>\d{1,2})(?::(?P<third>\d{1,2}))?(?:[.,:](?P<fraction>\d{1,9}))?)?"
    r" ?(?P<half>[AaPp][Mm])?(?: ?(?:Z|UTC)| ?(?P<zone>[+-]\d\d:?\d\d))?",
    re.ASCII,
)

#: Orders of a date's parts, but for those with slashes.
_ORDERS = ("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%d.%m.%Y", "%d-%m-%Y", "%d-%b-%Y", "%d %b %Y", "%d.%m.%y")


class Stamps:
    """Points in time as text -> seconds since the first: dates of every usual order, times of day, durations."""

    def __init__(self) -> None:
        self._first: int | None = None
        self._dates: dict[str, int] = {}
        self._orders: set[str] = {"%d/%m/%Y", "%m/%d/%Y"}

    def seconds(self, cells: Sequence[str]) -> FloatArray | None:
        """The next cells [n] as seconds [n]; None where one is no point in time. Raises InvalidError on unclear dates."""
        nanoseconds = self._iso(cells)
        if nanoseconds is None:
            self._narrow(cells)
            parsed = [self._nanoseconds(cell) for cell in cells]
            if any(moment is None or abs(moment) >= 2**63 for moment in parsed):
                return None
            nanoseconds = np.array(parsed, dtype=np.int64)
        if self._first is None and nanoseconds.size:
            self._first = int(nanoseconds[0])
        return np.asarray((nanoseconds - (self._first or 0)) * 1e-9, dtype=np.float64)

    def _iso(self, cells: Sequence[str]) -> NDArray[np.int64] | None:
        """By numpy where all are ISO 8601 without a zone."""
        if not cells or any(
            cell[:2] not in ("19", "20") or cell[4:5] != "-" or len(cell) < 16 or cell[-6:-5] in "+-" or cell[-1] == "Z"
            for cell in cells
        ):
            return None
        try:
            return np.array(cells, dtype="datetime64[ns]").astype(np.int64)
        except ValueError:
            return None

    def _nanoseconds(self, cell: str) -> int | None:
        match = _STAMP.fullmatch(cell.strip())
        if match is None or not (match["date"] or match["first"]):
            return None
        first, second, third = (int(match[name] or 0) for name in ("first", "second", "third"))
        if match["first"] and not match["third"]:
            if not match["fraction"]:
                if not match["date"]:
                    return None  # 07:30 may be hours or minutes
            else:
                first, second, third = 0, first, second
        if match["half"]:
            first = first % 12 + 12 * (match["half"].lower() == "pm")
        total = ((first * 60 + second) * 60 + third) * 10**9 + int((match["fraction"] or "").ljust(9, "0"))
        total *= -1 if match["sign"] == "-" else 1
        zone = (match["zone"] or "").replace(":", "")
        if zone:
            total -= (1 if zone[0] == "+" else -1) * (int(zone[1:3]) * 60 + int(zone[3:])) * 60 * 10**9
        days = int(match["days"] or 0)
        if match["date"]:
            day = self._day(match["date"])
            if day is None:
                return None
            days += day
        return total + days * 86400 * 10**9

    def _narrow(self, cells: Sequence[str]) -> None:
        """Learn from dates with slashes whether the day or the month comes first.

        Raises InvalidError where several days may be of either order.
        """
        dates = {cell.strip().partition(" ")[0] for cell in cells if "/" in cell} - self._dates.keys()
        for written in dates:
            possible = {order for order in self._orders if _day_by(written, order) is not None}
            self._orders = possible or self._orders
        if len(self._orders) > 1 and len(dates | {written for written in self._dates if "/" in written}) > 1:
            shown = min(dates)[:MOST_QUOTED]
            message = (
                f"the dates of the time column may be day/month or month/day, got {shown!r}: write them as 2026-11-02"
            )
            raise InvalidError(
                message, errors=[FieldError(pointer="/channels/time_s", code="ambiguous_date", message=message)]
            )

    def _day(self, date: str) -> int | None:
        """The day's number; None where it is no date."""
        if date not in self._dates:
            days = (_day_by(date, order) for order in (*_ORDERS, *sorted(self._orders)))
            day = next((number for number in days if number is not None), None)
            if day is None:
                return None
            self._dates[date] = day
        return self._dates[date]


#: The day from which days are counted, so that nanoseconds fit 64 bits.
_EPOCH = datetime(2000, 1, 1)


def _day_by(date: str, order: str) -> int | None:
    try:
        return (datetime.strptime(date, order) - _EPOCH).days
    except ValueError:
        return None


def column_values(
    channels: Sequence[str], columns: Sequence[Sequence[Any]], decimal: str, line_of: Callable[[int], int] | None = None
) -> list[NDArray[Any]]:
    """Columns of cells of any type, each for a channel: numbers as float64 [n], points in time as numpy has them [n].

    Raises InvalidError naming the row of a cell that is neither, or of one that may be read in two ways.
    """
    numerals = Numerals(decimal)
    texts = [b"\n".join(cell.strip().encode() for cell in cells if isinstance(cell, str)) for cells in columns]
    try:
        numerals.settle(texts)
    except Undecided:
        for name, text in zip(channels, texts, strict=True):
            if doubt := numerals.doubtful(text):
                raise doubtful_number(name, doubt, doubt[0], line_of) from None
    return [_values(name, cells, numerals, line_of) for name, cells in zip(channels, columns, strict=True)]


def _values(name: str, cells: Sequence[Any], numerals: Numerals, line_of: Callable[[int], int] | None) -> NDArray[Any]:
    if cells and name == "time_s" and not isinstance(cells[0], int | float):
        moments = _moments(cells)
        if moments is not None:
            return moments
    values, wrong = np.empty(len(cells)), []
    for row, cell in enumerate(cells):
        number = numerals.floats(cell.strip().encode()) if isinstance(cell, str) else None
        if number is not None and number.size == 1:
            values[row] = number[0]
        elif isinstance(cell, int | float | Decimal) and not isinstance(cell, bool):
            values[row] = cell
        else:
            wrong.append(row)
    if not wrong:
        return values
    errors = []
    for row in wrong[:MOST_ERRORS]:
        shown = str("" if cells[row] is None else cells[row])[:MOST_QUOTED]
        place = f"{name}[{row}]" + (f" (line {line_of(row)})" if line_of else "")
        message = f"{place} must be a number, got {shown!r}"
        pointer = f"/channels/{name}/{row}"
        errors.append(FieldError(pointer=pointer, row=row + 1, value=shown, code="not_a_number", message=message))
    more = "" if len(wrong) == 1 else f"; {len(wrong)} errors in all"
    raise InvalidError(errors[0].message + more, errors=errors, total=len(wrong))


def _moments(cells: Sequence[Any]) -> NDArray[Any] | None:
    """Dates, times of day, durations or their text; None where they are of several types."""
    kinds = set(map(type, cells))
    if kinds <= {datetime, date}:
        plain = [
            cell.replace(tzinfo=None) - (cell.utcoffset() or timedelta()) if isinstance(cell, datetime) else cell
            for cell in cells
        ]
        return np.array(plain, dtype="datetime64[us]")
    if kinds <= {dt_time}:
        cells = [datetime.combine(date.min, cell.replace(tzinfo=None)) - datetime.min for cell in cells]
        return np.array(cells, dtype="timedelta64[us]")
    if kinds <= {timedelta}:
        return np.array(cells, dtype="timedelta64[us]")
    if kinds <= {str}:
        seconds = Stamps().seconds(cells)
        return None if seconds is None else (seconds * 1e9).astype("timedelta64[ns]")
    return None


def doubtful_number(
    name: str, doubt: tuple[int, bytes, str, str], row: int, line_of: Callable[[int], int] | None
) -> InvalidError:
    """The error of a cell that may be read in two ways, with both."""
    _, cell, as_decimal, as_thousands = doubt
    sign, other = (",", ".") if b"," in cell else (".", ",")
    place = f"{name}[{row}]" + (f" (line {line_of(row)})" if line_of else "")
    message = (
        f"{place} may be {as_decimal} or {as_thousands}, got {cell.decode()!r}: every {sign!r} of the file stands before "
        f"exactly three digits; decimal={sign} reads {as_decimal}, decimal={other} reads {as_thousands}"
    )
    return InvalidError(
        message,
        errors=[
            FieldError(pointer="/decimal", row=row + 1, value=cell.decode(), code="ambiguous_number", message=message)
        ],
    )
