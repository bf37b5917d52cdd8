"""Lists and their pages: the place where a page ended, the cursor that names it, and the shape of every list."""

import base64
import binascii
import json
import math
from collections.abc import Sequence
from typing import Any

from service.errors import FieldError, InvalidError

#: Items of a list that is answered whole where no limit is given.
ALL_ITEMS = 1_000_000
#: Characters of a cursor that are read. Derived: a clutch's name has 128, base64 makes a third more of them.
LONGEST_CURSOR = 600
#: Where a page ended: a number, and a name where that is not unique.
Place = tuple[float, str]


def to_cursor(place: Place | None) -> str | None:
    return None if place is None else base64.urlsafe_b64encode(json.dumps(place).encode()).decode().rstrip("=")


def from_cursor(cursor: str | None) -> Place | None:
    """The inverse of `to_cursor`; InvalidError on anything else."""
    if cursor is None:
        return None
    try:
        number, name = json.loads(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)))
        place = (float(number), str(name).encode().decode())
    except (ValueError, TypeError, OverflowError, RecursionError, binascii.Error):
        place = (math.nan, "")
    if not math.isfinite(place[0]):
        message = "cursor must be one that an earlier page gave as next"
        shown = cursor[:80]
        error = FieldError(pointer="/query/cursor", code="cursor", message=f"{message}, got {shown!r}", value=shown)
        raise InvalidError(error.message, errors=[error])
    return place


def sliced(items: Sequence[Any], limit: int, after: Place | None) -> dict[str, Any]:
    """A page out of a list that is known whole: the place in it is the cursor."""
    start = 0 if after is None else max(0, int(after[0]))
    stop = start + limit
    return page(items[start:stop], (float(stop), "") if stop < len(items) else None)


def paged(items: Sequence[Any], limit: int, after: Place | None) -> dict[str, Any]:
    """The same, and the whole list where all of it was asked for."""
    return page(items, None) if limit == ALL_ITEMS and after is None else sliced(items, limit, after)


def page(items: Sequence[Any], after: Place | None) -> dict[str, Any]:
    """The shape of every list."""
    return {"items": items, "next": to_cursor(after)}


def page_as_bytes(items: Sequence[bytes], after: Place | None) -> bytes:
    """The same as JSON, of items that are JSON."""
    return b'{"items":[' + b",".join(items) + b'],"next":' + json.dumps(to_cursor(after)).encode() + b"}"
