"""Answers that stay the same until the clutch's revision moves on: their bytes are made once and remembered."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from fastapi import Request
from fastapi.responses import Response

from service import records
from service.web.context import Context
from service.web.pages import CSV_TYPE, JSON_TYPE, encode, encode_table, tagged


def lasting_answer(request: Request, context: Context, clutch_id: str, said: Callable[[], object]) -> Response:
    """A GET's answer, JSON. Raises NotFoundError."""
    return tagged(request, _body(request, context, clutch_id, lambda: encode(said())), JSON_TYPE)


def lasting_table(
    request: Request,
    context: Context,
    clutch_id: str,
    columns: Sequence[str],
    rows: Callable[[], Iterable[Mapping[str, Any]]],
) -> Response:
    """A GET's answer, CSV. Raises NotFoundError."""
    return tagged(request, _body(request, context, clutch_id, lambda: encode_table(columns, rows())), CSV_TYPE)


def _body(request: Request, context: Context, clutch_id: str, make: Callable[[], bytes]) -> bytes:
    with context.database.reading() as connection:
        # before the rest is read: what is committed meanwhile is remembered under a revision that nobody asks for again
        revision = records.revision(connection, clutch_id)
    key = (request.url.path, request.url.query, revision)
    body: bytes | None = context.pages.find(key)
    if body is None:
        body = make()
        context.pages.keep(key, body, len(body))
    return body
