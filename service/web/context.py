"""What a route is given: the service's parts, and arguments that many routes take."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from fastapi import Header, Query

from models.prognosis.criteria import HORIZON
from service.alarms.outbox import Outbox
from service.jobs.queue import JobQueue
from service.jobs.workers import Workers
from service.lists import ALL_ITEMS, LONGEST_CURSOR
from service.queries.cache import AnswerCache
from service.schemas.parameters import SHORT
from service.settings import Settings
from service.web.key_uses import KeyUses
from service.web.limits import MOST_HORIZONS, MOST_ITEMS, MOST_PRESSURE_BAR
from service.web.metrics import Metrics
from service.web.readiness import Readiness
from service.web.revalidation import Revalidation
from storage.engine.database import Database


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """The service's parts, made when it starts and closed when it stops."""

    database: Database
    cache: AnswerCache
    metrics: Metrics
    jobs: JobQueue
    outbox: Outbox
    workers: Workers
    settings: Settings
    revalidation: Revalidation
    readiness: Readiness
    #: Where files are kept while they come in and go out.
    folder: Path
    key_uses: KeyUses = field(default_factory=KeyUses)


Limit = Annotated[int, SHORT, Query(ge=1, le=MOST_ITEMS, description="Items a page")]
Whole = Annotated[int, SHORT, Query(ge=1, le=ALL_ITEMS, description="Items a page; left out, all of them")]
Cursor = Annotated[str | None, Query(max_length=LONGEST_CURSOR, description="Where an earlier page ended: its `next`")]
PressureBar = Annotated[
    float | None,
    SHORT,
    Query(
        ge=0,
        le=MOST_PRESSURE_BAR,
        allow_inf_nan=False,
        description="A pressure of the first stationary test; left out, their mean",
    ),
]
AtCycles = Annotated[
    float | None,
    SHORT,
    Query(ge=0, le=HORIZON * MOST_HORIZONS, allow_inf_nan=False, description="As it would have been predicted then"),
]
Prefer = Annotated[
    str | None,
    Header(
        max_length=200,
        description="`wait=SECONDS`: how long to wait for the newest answer where others wait for theirs",
    ),
]
