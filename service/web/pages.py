"""Answers: JSON or CSV with a strong entity tag, 304 where the asker has it already, and cursors for pages."""

import base64
import binascii
import csv
import hashlib
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fastapi import Request
from fastapi.responses import Response

from service.errors import FieldError, InvalidError

JSON_TYPE = "application/json"
CSV_TYPE = "text/csv; charset=utf-8"


def encode(payload: object) -> bytes:
    """JSON in UTF-8; ValueError on a number that JSON cannot carry: none may leave."""
    return json.dumps(payload, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()


def answer(request: Request, payload: object) -> Response:
    """A GET's answer; its ETag is that of the bytes, so it changes when and only when they do."""
    return tagged(request, encode(payload), JSON_TYPE)


def table(request: Request, columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> Response:
    """A GET's answer as CSV."""
    return tagged(request, encode_table(columns, rows), CSV_TYPE)


def encode_table(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> bytes:
    """CSV after RFC 4180 in UTF-8, a header row first; null is an empty field."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=columns, extrasaction="raise", restval="")
    writer.writeheader()
    writer.writerows({name: "" if value is None else value for name, value in row.items()} for row in rows)
    return text.getvalue().encode()


def tagged(request: Request, body: bytes, media_type: str) -> Response:
    """The body, or 304 where `If-None-Match` names it."""
    tag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache"}
    asked = request.headers.get("if-none-match", "")
    if asked.strip() == "*" or tag in (each.strip().removeprefix("W/") for each in asked.split(",")):
        return Response(status_code=304, headers=headers)
    return Response(content=body, media_type=media_type, headers=headers)


def to_cursor(place: tuple[float, str] | None) -> str | None:
    """Where a next page starts, as text that fits an address."""
    return None if place is None else base64.urlsafe_b64encode(json.dumps(place).encode()).decode().rstrip("=")


def from_cursor(cursor: str | None) -> tuple[float, str] | None:
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


def sliced(items: Sequence[Any], limit: int, after: tuple[float, str] | None) -> dict[str, Any]:
    """A page out of a list that is known whole: the place in it is the cursor."""
    start = 0 if after is None else max(0, int(after[0]))
    stop = start + limit
    return page(items[start:stop], (float(stop), "") if stop < len(items) else None)


def page(items: Sequence[Any], after: tuple[float, str] | None) -> dict[str, Any]:
    """The shape of every list."""
    return {"items": items, "next": to_cursor(after)}
