"""Bodies in, answers out: JSON or CSV with a strong entity tag, 304 where the asker has it already, cursors for pages.

What follows from a clutch's revision alone is computed once and kept (`clutch_answer`, `clutch_table`).
"""

import base64
import binascii
import csv
import hashlib
import io
import json
import math
import os
import re
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, BinaryIO

from fastapi import Request
from fastapi.responses import Response, StreamingResponse
from pydantic import BaseModel

from service.errors import FieldError, InvalidError, NotFoundError, UnsupportedMediaTypeError
from service.web.context import Context
from service.web.limits import ALL_ITEMS
from storage import clutches
from storage.encoding.json_text import to_text

JSON_TYPE = "application/json"
PARQUET_TYPE = "application/vnd.apache.parquet"
CSV_TYPE = "text/csv; charset=utf-8"
#: Bytes of a file that are sent at once. Chosen: a few writes to the socket.
_PIECE = 1 << 18

#: Where a page ended: a number, and a name where that is not unique.
Place = tuple[float, str]
Rows = Iterable[Mapping[str, Any]]


def to_json(payload: object) -> bytes:
    """JSON in UTF-8; ValueError on a number that JSON cannot carry: none may leave."""
    return to_text(payload).encode()


def now() -> str:
    """The time, UTC, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def answer(request: Request, payload: object) -> Response:
    """A GET's answer that is made anew each time; its ETag is that of the bytes: it changes when and only when they do."""
    return tagged(request, to_json(payload), JSON_TYPE)


def clutch_answer(
    request: Request, context: Context, clutch_id: str, name: str, make: Callable[[], object], *arguments: Hashable
) -> Response:
    """A GET's answer that follows from a clutch's revision, JSON. Raises NotFoundError.

    `name` and `arguments` tell the clutch's answers apart.
    """
    return tagged(request, _computed(context, clutch_id, name, make, arguments), JSON_TYPE)


def clutch_list_answer(
    request: Request,
    context: Context,
    clutch_id: str,
    name: str,
    make: Callable[[], dict[str, Any]],
    limit: int = ALL_ITEMS,
    cursor: str | None = None,
    *arguments: Hashable,
) -> Response:
    """The same of an answer with `items` that is computed whole, a page of it where one was asked for."""
    after = from_cursor(cursor)
    if limit == ALL_ITEMS and after is None:
        return clutch_answer(request, context, clutch_id, name, make, *arguments)

    def paged() -> object:
        whole = json.loads(_computed(context, clutch_id, name, make, arguments))
        return whole | sliced(whole["items"], limit, after)

    return clutch_answer(request, context, clutch_id, name, paged, *arguments, limit, after)


def clutch_table(
    request: Request,
    context: Context,
    clutch_id: str,
    name: str,
    make: Callable[[], object],
    rows: Callable[[Any], Rows],
    columns: Sequence[str],
    *arguments: Hashable,
) -> Response:
    """The CSV export of an answer that follows from a clutch's revision: `rows` of its JSON. Raises NotFoundError."""

    def table() -> bytes:
        return encode_table(columns, rows(json.loads(_computed(context, clutch_id, name, make, arguments))))

    key = (clutch_id, _revision(context, clutch_id), f"{name}.csv", *arguments)
    return tagged(request, context.cache.answer(key, table), CSV_TYPE)


def _computed(
    context: Context, clutch_id: str, name: str, make: Callable[[], object], arguments: tuple[Hashable, ...]
) -> bytes:
    # before the rest is read: what is committed meanwhile is kept under a revision that nobody asks for again
    key = (clutch_id, _revision(context, clutch_id), name, *arguments)
    return context.cache.answer(key, lambda: to_json(make()))


def _revision(context: Context, clutch_id: str) -> int:
    with context.database.reading() as connection:
        revision = clutches.revision(connection, clutch_id)
    if revision is None:
        raise NotFoundError(f"no clutch is known as {clutch_id!r}")
    return revision


def table(request: Request, columns: Sequence[str], rows: Rows) -> Response:
    """A GET's answer as CSV that is made anew each time."""
    return tagged(request, encode_table(columns, rows), CSV_TYPE)


def encode_table(columns: Sequence[str], rows: Rows) -> bytes:
    """CSV after RFC 4180 in UTF-8, a header row first; null is an empty field.

    A first row with other names than `columns` gives the columns.
    """
    text = io.StringIO()
    writer: csv.DictWriter[str] | None = None
    for row in rows:
        if writer is None:
            names = columns if row.keys() == set(columns) else tuple(row)
            writer = csv.DictWriter(text, fieldnames=names, extrasaction="raise", restval="")
            writer.writeheader()
        writer.writerow({name: "" if value is None else value for name, value in row.items()})
    if writer is None:
        csv.writer(text).writerow(columns)
    return text.getvalue().encode()


def tagged(request: Request, body: bytes, media_type: str) -> Response:
    """The body, or 304 where `If-None-Match` names it."""
    headers = {"ETag": f'"{hashlib.sha256(body).hexdigest()[:32]}"', "Cache-Control": "no-cache"}
    return unchanged(request, headers) or Response(content=body, media_type=media_type, headers=headers)


def unchanged(request: Request, headers: Mapping[str, str]) -> Response | None:
    """304 where `If-None-Match` names the `ETag` of the headers, else None."""
    asked_for = request.headers.get("if-none-match", "")
    if asked_for.strip() == "*" or headers["ETag"] in (tag.strip().removeprefix("W/") for tag in asked_for.split(",")):
        return Response(status_code=304, headers=dict(headers))
    return None


def preferred(request: Request, media_types: Sequence[str]) -> str:
    """The one of our media types that `Accept` weighs most, the first of them where none is named."""
    weights = {}
    for part in request.headers.get("accept", "").lower().split(","):
        name, *parameters = (word.strip() for word in part.split(";"))
        weight = next((word[2:] for word in parameters if word.startswith("q=")), "1")
        weights[name] = float(weight) if re.fullmatch(r"[01](\.\d{0,3})?", weight) else 0.0
    return max(media_types, key=lambda name: weights.get(name, 0.0))


def streamed(body: BinaryIO, media_type: str, headers: Mapping[str, str]) -> Response:
    """An open file as an answer, sent piece by piece and closed at its end."""
    size = {"Content-Length": str(os.fstat(body.fileno()).st_size)}

    def pieces() -> Iterator[bytes]:
        with body:
            while piece := body.read(_PIECE):
                yield piece

    return StreamingResponse(pieces(), media_type=media_type, headers=dict(headers) | size)


def to_cursor(place: Place | None) -> str | None:
    """Where a next page starts, as text that fits an address."""
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


def page(items: Sequence[Any], after: Place | None) -> dict[str, Any]:
    """The shape of every list."""
    return {"items": items, "next": to_cursor(after)}


async def json_body(request: Request) -> bytes:
    """The body of a request that says it is JSON; a browser cannot send such a one across sites unasked."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json" and not kind.endswith("+json"):
        raise UnsupportedMediaTypeError(f"send the body as application/json, not as {kind[:80]!r}")
    return await request.body()


def described_body(schema: type[BaseModel] | dict[str, Any], example: dict[str, Any]) -> dict[str, Any]:
    """The body for the API's description, since the routes read it themselves."""
    described = schema if isinstance(schema, dict) else schema.model_json_schema()
    content = {"application/json": {"schema": described, "example": example}}
    return {"requestBody": {"required": True, "content": content}}
