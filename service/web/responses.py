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
    """A table that is exported: the `rows` of an answer of a type, and their columns where there are none."""

    answer: type[AnswerType]
    rows: Callable[[AnswerType], Iterable[Cells]]
    columns: Sequence[str]

    def page(self, answer: AnswerType, part: Part = WHOLE) -> CsvPage:
        """The part of an answer's rows that was asked for; the table goes on where the part or the answer does."""
        page = part.sliced(list(self.rows(answer)))
        return CsvPage(encode_table(self.columns, page.items), page.next or getattr(answer, "next", None))

    def page_of_json(self, body: bytes, part: Part) -> CsvPage:
        """The same of an answer's JSON."""
        return self.page(self.answer.model_validate_json(body), part)


def encode_table(columns: Sequence[str], rows: Sequence[Cells]) -> bytes:
    """CSV after RFC 4180 in UTF-8, a header row first; null is an empty field.

    A first row with other names than `columns` gives the columns. Text that a spreadsheet would take for a formula has an
    apostrophe before it: a note that a rig has sent must compute nothing, and send nothing, where an engineer opens it.
    """
    text = io.StringIO()
    writer = csv.DictWriter(text, columns if not rows or rows[0].keys() == set(columns) else tuple(rows[0]))
    writer.writeheader()
    writer.writerows({name: _cell(value) for name, value in row.items()} for row in rows)
    return text.getvalue().encode()


def _cell(value: object) -> object:
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
    """A GET's answer that is made again each time; its ETag is that of the bytes: it changes when and only when they do."""
    return tagged(request, CachedAnswer.of(await run_in_threadpool(lambda: to_json(query(*given, **more)))), JSON_TYPE)


async def cached_answer(
    context: Context, key: Hashable, version: Hashable, make: Callable[[], bytes | CsvPage]
) -> CachedAnswer:
    """What the cache has for `key` at `version`; where it has nothing yet, `make` is called in a thread."""
    answer = context.answers.held(key, version)
    if answer is not None:
        return answer
    return await run_in_threadpool(context.answers.answer, key, version, make)


@dataclass(frozen=True, slots=True, kw_only=True)
class OfClutch:
    """A request about one clutch: which page of the answer."""

    request: Request
    context: Context
    clutch_id: str
    part: Part = WHOLE

    @property
    def database(self) -> Database:
        return self.context.database

    @property
    def whole(self) -> "OfClutch":
        """The request for all items, for answers that cut the page themselves."""
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
    """An intermediate result of a clutch's revision that an answer needs. Raises NotFoundError."""
    key = (of.clutch_id, name_of(query))
    return (await cached_answer(of.context, key, _revision(of), lambda: query(of.database, of.clutch_id))).body


async def clutch_answer(of: OfClutch, query: Callable[..., BaseModel | bytes], *arguments: Hashable) -> Response:
    """A GET's answer that follows from a clutch's revision: `query(database, clutch_id, *arguments)`, whose bytes are JSON.

    Where it was made for this revision already, nothing is read. Raises NotFoundError.
    """

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
    """The CSV export of a page that follows from a clutch's revision. Raises NotFoundError."""
    revision = _revision(of)
    key = (of.clutch_id, f"{name_of(query)}.csv", *arguments)
    make = partial(query, of.database, of.clutch_id, *arguments)
    return tagged(
        of.request, await cached_answer(of.context, key, revision, lambda: table.page(make())), CSV_TYPE, revision
    )


async def computed_answer(
    of: OfClutch, query: Query[BaseModel], *arguments: Hashable, prefer: str | None = None, lane: Lane = Lane.ANSWERS
) -> Response:
    """A GET's answer that takes long: `query(database, clutch_id, *arguments)`, computed by a worker of that lane; a page of
    its items where one was asked for. `prefer` is what the sender prefers. Raises NotFoundError."""
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
    """The CSV export of the same: a page of the rows of its JSON, which goes on where that does. Raises NotFoundError."""
    revision, answer = await _computed(of, _revision(of), query, arguments, prefer)
    key = (of.clutch_id, f"{name_of(query)}.csv", *arguments, of.part)
    page = await cached_answer(of.context, key, revision, lambda: table.page_of_json(answer.body, of.part))
    return tagged(of.request, page, CSV_TYPE, revision)


async def computed_of_each(
    request: Request, context: Context, answered: type[AnswerType], query: Query[AnswerType], *arguments: Hashable
) -> list[AnswerType]:
    """The newest answers of a type that a query gives about each clutch, one after the other: the same that are given for
    the clutch alone.

    Raises ClientDisconnect where nobody waits for them any more.
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
    """Hold the answer of a clutch that has just been registered, so that the one after its first run is not waited for."""
    revision, body = await run_in_threadpool(revision_and_json, context.database, query, clutch_id, ())
    context.answers.begin((clutch_id, name_of(query)), revision, body)


def repeated_answer(context: Context, key: Hashable, *, of_clutch: bool = True) -> Again:
    """What answers the same address again by what the cache holds of the clutch's revision, or of the last commit of all."""

    def again(request: Request) -> Response | None:
        snapshot = snapshot_of(request)
        cached = context.answers.held(key, snapshot.revision if of_clutch else snapshot.version)
        return None if cached is None else tagged(request, cached, JSON_TYPE, snapshot.revision if of_clutch else None)

    return again


def preferred_wait(prefer: str | None) -> int | None:
    """Seconds that the sender prefers to wait (RFC 7240: `Prefer: wait=SECONDS`), None where it does not say."""
    preferred = _WAIT.search(prefer or "")
    return None if preferred is None else min(int(preferred[1]), LONGEST_WAIT_SECONDS)


def _revision(of: OfClutch) -> int:
    """The revision of the clutch in the path when the request came in. Raises NotFoundError."""
    revision = snapshot_of(of.request).revision
    if revision is None:
        raise unknown_clutch(of.clutch_id)
    return revision


async def table(request: Request, make: Callable[[], CsvPage]) -> Response:
    """A GET's answer as CSV that is made again each time, a page of it."""
    return tagged(request, CachedAnswer.of(await run_in_threadpool(make)), CSV_TYPE)


def tagged(request: Request, answer: CachedAnswer, media_type: str, revision: int | None = None) -> Response:
    """The answer, or 304 where `If-None-Match` names it; with the clutch's revision that it is of, where it is of one."""
    headers = {"ETag": answer.tag, "Cache-Control": "no-cache"}
    if revision is not None:
        headers["Clutchlife-Revision"] = str(revision)
    if answer.next is not None:
        headers["Link"] = f'<{_following(request, answer.next)}>; rel="next"'
    return unchanged(request, headers) or Response(content=answer.body, media_type=media_type, headers=headers)


def _following(request: Request, cursor: str) -> str:
    """The address of the next page, relative to this service: behind a proxy its own name is not known."""
    url = request.url.include_query_params(cursor=cursor)
    return f"{url.path}?{url.query}"


def json_answer(content: BaseModel, status: int = 200, **headers: str) -> Response:
    """An answer to a change, or to a question that is asked once: JSON without a tag."""
    return Response(content=to_json(content), status_code=status, media_type=JSON_TYPE, headers=headers)


def unchanged(request: Request, headers: Mapping[str, str]) -> Response | None:
    """304 where `If-None-Match` names the `ETag` of the headers, else None."""
    asked_for = request.headers.get("if-none-match", "")
    if asked_for.strip() == "*" or headers["ETag"] in (tag.strip().removeprefix("W/") for tag in asked_for.split(",")):
        return Response(status_code=304, headers=dict(headers))
    return None


async def sent(request: Request, schema: type[Body]) -> Body:
    """The body of a request that says it is JSON; a browser cannot send such a one across sites unasked.

    Raises UnsupportedMediaTypeError, and InvalidError, which names every place that is wrong.
    """
    require_json(request)
    return await parsed(schema, await request.body())


def require_json(request: Request) -> None:
    """Raise UnsupportedMediaTypeError where a request does not say that its body is JSON."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json" and not kind.endswith("+json"):
        raise UnsupportedMediaTypeError(f"send the body as application/json, not as {kind[:80]!r}")


class TakingRoute(TypedDict):
    """What FastAPI is told of a route that takes a body."""

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
    """How a route that takes a body is described, since it reads that itself: the body with an example, its answer, and what
    other statuses `also` mean that come with the same answer."""
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
    """What a worker returns that changes a clutch. The changes of one clutch take turns."""
    submit, clutch_id = of.context.workers.submit, of.clutch_id
    changing = submit(Lane.RUNS, change, clutch_id, *arguments, turn=clutch_id, seconds=CHANGE_SECONDS)
    return await asyncio.wrap_future(changing)


Looked = TypeVar("Looked")
#: [s] Between two looks whether a job has ended: first, by how much longer each, and longest. Chosen: a look reads a few
#: rows, and the quickest job takes a second.
_FIRST_PAUSE, _GROWTH, _LONGEST_PAUSE = 0.05, 1.5, 0.4


async def until_ended(look: Callable[[], Looked], has_ended: Callable[[Looked], bool], wait: float) -> Looked:
    """Look repeatedly until the thing has ended, at most for `wait` [s]; returns the last look."""
    deadline = time.monotonic() + wait
    pause = _FIRST_PAUSE
    while True:
        state = await run_in_threadpool(look)
        left = deadline - time.monotonic()
        if has_ended(state) or left <= 0:
            return state
        await asyncio.sleep(min(pause, left))
        pause = min(_GROWTH * pause, _LONGEST_PAUSE)
