"""Lists and their pages: the place where a page ended, the cursor that names it, and the shape of every list."""

import base64
import binascii
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

from service.api.base import Page
from service.errors import InvalidError

#: Items of a list that is answered whole where no limit is given.
ALL_ITEMS = 1_000_000
#: Characters of a cursor that are read. Derived: a clutch's name has 128, base64 makes a third more of them.
LONGEST_CURSOR = 600
#: The greatest number of a cursor. Derived: the greatest up to which doubles hold every whole number; databases refuse those
#: of more than 63 bits.
_GREATEST = 2.0**53
#: Where a page ended: a number, and a name where that is not unique.
Place = tuple[float, str]
Row = TypeVar("Row")
Listed = TypeVar("Listed", bound=Page[Any])


def to_cursor(place: Place | None) -> str | None:
    return None if place is None else base64.urlsafe_b64encode(json.dumps(place).encode()).decode().rstrip("=")


def from_cursor(cursor: str | None) -> Place | None:
    """The place in a list that a cursor encodes, the inverse of `to_cursor`; InvalidError on anything else."""
    if cursor is None:
        return None
    try:
        number, name = json.loads(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)))
        place = (float(number), str(name).encode().decode())
    except (ValueError, TypeError, OverflowError, RecursionError, binascii.Error):
        place = (math.nan, "")
    if not abs(place[0]) <= _GREATEST:  # NaN is not
        message = f"cursor must be the `next` of the previous page, got {cursor[:80]!r}"
        raise InvalidError.of(message, code="cursor", pointer="/query/cursor", value=cursor)
    return place


@dataclass(frozen=True, slots=True)
class Part:
    """The requested page of a list: at most `limit` items, after the place `after` at which the previous page ended."""

    limit: int = ALL_ITEMS
    after: Place | None = None

    @property
    def most(self) -> int:
        """The number of rows to read: one more than the limit, to see whether another page follows."""
        return self.limit + 1

    @property
    def number(self) -> float | None:
        """The number in the place `after`, None on the first page."""
        return None if self.after is None else self.after[0]

    @property
    def name(self) -> str:
        """The name in the place `after`, empty on the first page."""
        return "" if self.after is None else self.after[1]

    def of(
        self,
        page: type[Listed],
        rows: Sequence[Row],
        place: Callable[[Row], Place],
        item: Callable[[Row], object],
    ) -> Listed:
        """The page with the items of up to `most` rows; `place` returns a row's place in the list."""
        return page(items=[item(row) for row in rows[: self.limit]], next=to_cursor(self.next(rows, place)))

    def next(self, rows: Sequence[Row], place: Callable[[Row], Place]) -> Place | None:
        """The place at which the next page begins, None if these rows are the last."""
        return place(rows[self.limit - 1]) if len(rows) > self.limit else None

    def sliced(self, items: Sequence[Row]) -> "Slice[Row]":
        """This page of a complete list; its cursor is the position in the list."""
        start = int(max(0.0, self.number or 0.0))
        stop = start + self.limit
        return Slice(items[start:stop], to_cursor((float(stop), "") if stop < len(items) else None))


class Slice(NamedTuple, Generic[Row]):
    """The items of one page of a complete list, and the next page's cursor."""

    items: Sequence[Row]
    next: str | None


#: All of a list.
WHOLE = Part()


def by_name(name: str) -> Callable[[Any], Place]:
    """A function that returns a row's place in a list ordered by the field of that name."""
    return lambda row: (0.0, getattr(row, name))


def by_key(name: str) -> Callable[[Any], Place]:
    """A function that returns a row's place in a list ordered by a unique number."""
    return lambda row: (float(getattr(row, name)), "")


def by_cycles(name: str) -> Callable[[Any], Place]:
    """A function that returns a row's place in a list ordered by cycles and, at equal cycles, by a name."""
    return lambda row: (row.cycles, getattr(row, name))


def page_as_bytes(items: Sequence[bytes], after: Place | None) -> bytes:
    """A page as JSON bytes, from items that are JSON already."""
    return b'{"items":[' + b",".join(items) + b'],"next":' + json.dumps(to_cursor(after)).encode() + b"}"
