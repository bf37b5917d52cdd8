"""Reads request bodies and writes answers: JSON or CSV, entity tags, 304 for unchanged answers, cursors for pages.

What follows from a clutch's revision alone is made once and kept (`clutch_answer`); what takes long is computed by a worker
(`computed_answer`); what a job does is waited for (`until_ended`).
"""

import asyncio
import csv
import io
import json
import re
import time
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Annotated, Any, Generic, ParamSpec, TypedDict, TypeVar

from fastapi import Depends, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import Response
from pydantic import BaseModel
from starlette.requests import ClientDisconnect

from service.answers.store import Again, CachedAnswer, CsvPage, Made, name_of, revision_and_json, to_json
from service.api.parameters import ClutchId
from service.errors import UnsupportedMediaTypeError, unknown_clutch
from service.jobs.workers import CHANGE_SECONDS, Lane
from service.paging import ALL_ITEMS, WHOLE, Part, from_cursor
from service.tables import Cells
from service.web.auth import Admin, Reader, grant_of, snapshot_of
from service.web.bodies import parsed
from service.web.context import Context, Cursor, Limit, Whole
from service.web.limits import LONGEST_WAIT_SECONDS, USUAL_ITEMS, WAIT_SECONDS
from service.web.middleware import remember
from service.web.problems import CHANGING, Described
from storage import clutches
from storage.encoding import to_text
from storage.engine.database import Database

Given = ParamSpec("Given")
Body = TypeVar("Body", bound=BaseModel)
AnswerType = TypeVar("AnswerType", bound=BaseModel)
#: What computes an answer of a database, a clutch's name and further arguments.
Query = Callable[..., AnswerType]
#: How a text begins that spreadsheets take for a formula. Source: https://owasp.org/www-community/attacks/CSV_Injection.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


@dataclass(frozen=True, slots=True)
class ExportedTable(Generic[AnswerType]):
    """An exportable table: the `rows` function of an answer's type, and the columns of an empty table."""

    answer: type[AnswerType]
    rows: Callable[[AnswerType], Iterable[Cells]]
    columns: Sequence[str]

    def page(self, answer: AnswerType, part: Part = WHOLE) -> CsvPage:
        """The requested page of an answer's rows; its cursor is set while the rows or the answer continue."""
        page = part.sliced(list(self.rows(answer)))
        return CsvPage(encode_table(self.columns, page.items), page.next or getattr(answer, "next", None))

    def page_of_json(self, body: bytes, part: Part) -> CsvPage:
        """`page` for an answer given as JSON."""
        return self.page(self.answer.model_validate_json(body), part)


def encode_table(columns: Sequence[str], rows: Sequence[Cells]) -> bytes:
    """A table as CSV by RFC 4180 in UTF-8, with a header row; null is an empty field.

    If the first row has other names than `columns`, it gives the columns. Text that a spreadsheet would take for a
    formula is preceded by an apostrophe, so that a rig's note cannot compute or send anything when an engineer opens
    it.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns if not rows or rows[0].keys() == set(columns) else tuple(rows[0]))
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    return text.getvalue().encode()


def _cell(value: object) -> object:
    """A value as CSV has it: null is empty, and text like a formula is quoted by an apostrophe."""
    if isinstance(value, str) and value.startswith(_FORMULA):
        return f"'{value}"
    return "" if value is None else value


JSON_TYPE = "application/json"
CSV_TYPE = "text/csv; charset=utf-8"

_WAIT = re.compile(r'(?:^|[,;\s])wait\s*=\s*"?(\d{1,9})"?\s*(?:$|[,;])', re.IGNORECASE)


def now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")


async def answer(
    request: Request, query: Callable[Given, BaseModel], *given: Given.args, **more: Given.kwargs
) -> Response:
    """The response to a GET, computed at each request; its ETag is a hash of the bytes."""
    return tagged(request, CachedAnswer.of(await run_in_threadpool(lambda: to_json(query(*given, **more)))), JSON_TYPE)


async def cached_answer(
    context: Context, key: Hashable, version: Hashable, make: Callable[[], bytes | CsvPage]
) -> CachedAnswer:
    """The cached response for `key` at `version`; if there is none, `make` computes it in a thread."""
    answer = context.answers.held(key, version)
    if answer is not None:
        return answer
    return await run_in_threadpool(context.answers.answer, key, version, make)


@dataclass(frozen=True, slots=True, kw_only=True)
class OfClutch:
    """A request about one clutch: the context, the clutch and the requested page."""

    request: Request
    context: Context
    clutch_id: str
    part: Part = WHOLE

    @property
    def database(self) -> Database:
        return self.context.database

    @property
    def whole(self) -> "OfClutch":
        """The same request for all items, for answers that cut the page themselves."""
        return replace(self, part=WHOLE)


async def _of_clutch(request: Request, context: Reader, clutch_id: ClutchId) -> OfClutch:
    return OfClutch(request=request, context=context, clutch_id=clutch_id)


async def _change_of_clutch(request: Request, context: Admin, clutch_id: ClutchId) -> OfClutch:
    return OfClutch(request=request, context=context, clutch_id=clutch_id)


#: A request about one clutch that its sender may read, and one that the sender may change.
Of = Annotated[OfClutch, Depends(_of_clutch)]
ChangeOf = Annotated[OfClutch, Depends(_change_of_clutch)]


async def _page(limit: Limit = USUAL_ITEMS, cursor: Cursor = None) -> Part:
    return Part(limit, from_cursor(cursor))


async def _whole(limit: Whole = ALL_ITEMS, cursor: Cursor = None) -> Part:
    return Part(limit, from_cursor(cursor))


#: The part of a list that is asked for: of the usual length or, where no limit is given, all of it.
Paged = Annotated[Part, Depends(_page)]
WholePaged = Annotated[Part, Depends(_whole)]


async def _page_of_clutch(of: Of, part: Paged) -> OfClutch:
    return replace(of, part=part)


async def _whole_of_clutch(of: Of, part: WholePaged) -> OfClutch:
    return replace(of, part=part)


#: The same of a clutch.
PageOf = Annotated[OfClutch, Depends(_page_of_clutch)]
WholeOf = Annotated[OfClutch, Depends(_whole_of_clutch)]


async def clutch_bytes(of: OfClutch, query: Callable[[Database, str], bytes]) -> bytes:
    """An intermediate result that an answer needs, cached per revision of the clutch. Raises NotFoundError."""
    key = (of.clutch_id, name_of(query))
    return (await cached_answer(of.context, key, _revision(of), lambda: query(of.database, of.clutch_id))).body


async def clutch_answer(of: OfClutch, query: Callable[..., BaseModel | bytes], *arguments: Hashable) -> Response:
    """The response to a GET of `query(database, clutch_id, *arguments)` as JSON, cached per revision of the clutch.
    Raises NotFoundError."""

    def make() -> bytes:
        made = query(of.database, of.clutch_id, *arguments)
        return made if isinstance(made, bytes) else to_json(made)

    # the revision before the rest is read: what is committed meanwhile is kept under one that nobody asks for again
    revision = _revision(of)
    key = (of.clutch_id, name_of(query), *arguments)
    answer = await cached_answer(of.context, key, revision, make)
    remember(of.request, repeated_answer(of.context, key))
    return tagged(of.request, answer, JSON_TYPE, revision)


async def clutch_table(
    of: OfClutch, query: Query[AnswerType], table: ExportedTable[AnswerType], *arguments: Hashable
) -> Response:
    """A page as CSV, cached per revision of the clutch. Raises NotFoundError."""
    revision = _revision(of)
    key = (of.clutch_id, f"{name_of(query)}.csv", *arguments)
    make = partial(query, of.database, of.clutch_id, *arguments)
    return tagged(
        of.request, await cached_answer(of.context, key, revision, lambda: table.page(make())), CSV_TYPE, revision
    )


async def computed_answer(
    of: OfClutch, query: Query[BaseModel], *arguments: Hashable, prefer: str | None = None, lane: Lane = Lane.ANSWERS
) -> Response:
    """The response to an expensive GET: `query(database, clutch_id, *arguments)`, computed by a worker process of that
    lane, or a page of its items. `prefer` is the request's `Prefer` header. Raises NotFoundError."""
    revision, answer = await _computed(of, _revision(of), query, arguments, prefer, lane)
    if of.part == WHOLE:
        remember(of.request, repeated_answer(of.context, (of.clutch_id, name_of(query), *arguments)))
        return tagged(of.request, answer, JSON_TYPE, revision)

    def page_of_cached() -> bytes:
        whole = json.loads(answer.body)
        return to_text(whole | of.part.sliced(whole["items"])._asdict()).encode()

    key = (of.clutch_id, f"{name_of(query)}.page", *arguments, of.part)
    return tagged(of.request, await cached_answer(of.context, key, revision, page_of_cached), JSON_TYPE, revision)


async def computed_table(
    of: OfClutch,
    query: Query[AnswerType],
    table: ExportedTable[AnswerType],
    *arguments: Hashable,
    prefer: str | None = None,
) -> Response:
    """The CSV export of `computed_answer`: a page of rows of the same JSON, with the same continuation. Raises
    NotFoundError."""
    revision, answer = await _computed(of, _revision(of), query, arguments, prefer)
    key = (of.clutch_id, f"{name_of(query)}.csv", *arguments, of.part)
    page = await cached_answer(of.context, key, revision, lambda: table.page_of_json(answer.body, of.part))
    return tagged(of.request, page, CSV_TYPE, revision)


async def computed_of_each(
    request: Request, context: Context, answered: type[AnswerType], query: Query[AnswerType], *arguments: Hashable
) -> list[AnswerType]:
    """The newest cached answers of a query, clutch after clutch, the same as for each clutch alone.

    Raises ClientDisconnect once the client has gone.
    """

    def newest() -> dict[str, int]:
        with context.database.reading() as connection:
            return clutches.revisions(connection)

    items = []
    for clutch_id, revision in (await run_in_threadpool(newest)).items():
        if await request.is_disconnected():
            raise ClientDisconnect
        of = OfClutch(request=request, context=context, clutch_id=clutch_id)
        _, answer = await _computed(of, revision, query, arguments, f"wait={LONGEST_WAIT_SECONDS}")
        items.append(await run_in_threadpool(answered.model_validate_json, answer.body))
    return items


async def _computed(
    of: OfClutch,
    revision: int,
    query: Query[BaseModel],
    arguments: tuple[Hashable, ...],
    prefer: str | None,
    lane: Lane = Lane.ANSWERS,
) -> tuple[int, CachedAnswer]:
    """The revision and the answer of an expensive query: cached, or computed by a worker, as long as the caller waits."""
    context, clutch_id = of.context, of.clutch_id
    preferred = preferred_wait(prefer)
    wait = preferred if preferred is not None else WAIT_SECONDS if context.workers.are_idle() else 0

    def compute(waited_for: bool) -> "Future[Made]":
        lane_used = lane if waited_for or lane is not Lane.ANSWERS else Lane.RENEWALS
        turn = f"{lane_used.name} for {grant_of(of.request).name}"
        return context.workers.submit(lane_used, revision_and_json, query, clutch_id, arguments, turn=turn)

    key = (clutch_id, name_of(query), *arguments)
    if not arguments and not context.answers.knows(key):
        await run_in_threadpool(context.answers.begin_shared, key, query, clutch_id)
    return await context.answers.renewed(key, revision, compute, wait=wait)


async def begin_computed(context: Context, clutch_id: str, query: Query[BaseModel]) -> None:
    """Put the answer of a newly registered clutch into the cache, so that a request after its first run need not wait."""
    revision, body = await run_in_threadpool(revision_and_json, context.database, query, clutch_id, ())
    context.answers.begin((clutch_id, name_of(query)), revision, body)


def repeated_answer(context: Context, key: Hashable, *, of_clutch: bool = True) -> Again:
    """A function for `remember` that answers from the cache, at the clutch's present revision or the database's last
    commit."""

    def again(request: Request) -> Response | None:
        snapshot = snapshot_of(request)
        cached = context.answers.held(key, snapshot.revision if of_clutch else snapshot.version)
        return None if cached is None else tagged(request, cached, JSON_TYPE, snapshot.revision if of_clutch else None)

    return again


def preferred_wait(prefer: str | None) -> int | None:
    """Seconds to wait by the header `Prefer: wait=SECONDS` (RFC 7240); None if it does not say."""
    preferred = _WAIT.search(prefer or "")
    return None if preferred is None else min(int(preferred[1]), LONGEST_WAIT_SECONDS)


def _revision(of: OfClutch) -> int:
    """The revision of the request's clutch, read when the request came in. Raises NotFoundError."""
    revision = snapshot_of(of.request).revision
    if revision is None:
        raise unknown_clutch(of.clutch_id)
    return revision


async def table(request: Request, make: Callable[[], CsvPage]) -> Response:
    """A page as CSV, computed at each request."""
    return tagged(request, CachedAnswer.of(await run_in_threadpool(make)), CSV_TYPE)


def tagged(request: Request, answer: CachedAnswer, media_type: str, revision: int | None = None) -> Response:
    """The response with its ETag and, if given, the clutch's revision; 304 if `If-None-Match` has the tag."""
    headers = {"ETag": answer.tag, "Cache-Control": "no-cache"}
    if revision is not None:
        headers["Clutchlife-Revision"] = str(revision)
    if answer.next is not None:
        headers["Link"] = f'<{_following(request, answer.next)}>; rel="next"'
    return unchanged(request, headers) or Response(content=answer.body, media_type=media_type, headers=headers)


def _following(request: Request, cursor: str) -> str:
    """The link to the next page, relative to this service: behind a proxy the service does not know its own host name."""
    url = request.url.include_query_params(cursor=cursor)
    return f"{url.path}?{url.query}"


def json_answer(content: BaseModel, status: int = 200, **headers: str) -> Response:
    """A JSON response without ETag, for changes and one-off questions."""
    return Response(content=to_json(content), status_code=status, media_type=JSON_TYPE, headers=headers)


def unchanged(request: Request, headers: Mapping[str, str]) -> Response | None:
    """A response 304 if `If-None-Match` names the `ETag` of the headers, else None."""
    asked_for = request.headers.get("if-none-match", "")
    if asked_for.strip() == "*" or headers["ETag"] in (tag.strip().removeprefix("W/") for tag in asked_for.split(",")):
        return Response(status_code=304, headers=dict(headers))
    return None


async def sent(request: Request, schema: type[Body]) -> Body:
    """The request body, which must be declared as JSON: browsers do not send that across sites unasked.

    Raises UnsupportedMediaTypeError, and InvalidError, which names every wrong place.
    """
    require_json(request)
    return await parsed(schema, await request.body())


def require_json(request: Request) -> None:
    """Raise UnsupportedMediaTypeError if the request does not declare its body as JSON."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json" and not kind.endswith("+json"):
        raise UnsupportedMediaTypeError(f"send the body as application/json, not as {kind[:80]!r}")


class TakingRoute(TypedDict):
    """Arguments of FastAPI's route decorator for a route that reads its request body itself."""

    response_model: type[BaseModel]
    responses: Described
    openapi_extra: dict[str, object]


def taking(
    body: type[BaseModel] | Mapping[str, object],
    answered: type[BaseModel],
    example: Mapping[str, object],
    responses: Described = CHANGING,
    also: Mapping[int, str] | None = None,
    *,
    required: bool = True,
) -> TakingRoute:
    """The OpenAPI description of a route that reads its body itself: the body with an example, the response, and the
    meaning of other statuses (`also`) with the same response."""
    described = body.model_json_schema() if isinstance(body, type) else body
    content = {"application/json": {"schema": described, "example": example}}
    other_responses: Described = {
        status: {"model": answered, "description": meaning} for status, meaning in (also or {}).items()
    }
    return {
        "response_model": answered,
        "responses": {**responses, **other_responses},
        "openapi_extra": {"requestBody": {"required": required, "content": content}},
    }


Changed = TypeVar("Changed")


async def changed(of: OfClutch, change: Callable[..., Changed], *arguments: Any) -> Changed:
    """The result of a change, made by a worker process in the lane of runs. The changes of one clutch take turns."""
    submit, clutch_id = of.context.workers.submit, of.clutch_id
    changing = submit(Lane.RUNS, change, clutch_id, *arguments, turn=clutch_id, seconds=CHANGE_SECONDS)
    return await asyncio.wrap_future(changing)


Looked = TypeVar("Looked")
#: [s] Between two looks whether a job has ended: first, by how much longer each, and longest. Chosen: a look reads a few
#: rows, and the quickest job takes a second.
_FIRST_PAUSE, _GROWTH, _LONGEST_PAUSE = 0.05, 1.5, 0.4


async def until_ended(look: Callable[[], Looked], has_ended: Callable[[Looked], bool], wait: float) -> Looked:
    """Look repeatedly until the thing has ended or `wait` [s] is over; returns the last look."""
    deadline = time.monotonic() + wait
    pause = _FIRST_PAUSE
    while True:
        state = await run_in_threadpool(look)
        left = deadline - time.monotonic()
        if has_ended(state) or left <= 0:
            return state
        await asyncio.sleep(min(pause, left))
        pause = min(_GROWTH * pause, _LONGEST_PAUSE)
