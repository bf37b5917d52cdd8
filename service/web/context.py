"""What a route is given: the service's parts, and arguments that many routes take."""

import asyncio
import logging
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from fastapi import Header, Query
from fastapi.concurrency import run_in_threadpool

from models.prognosis.criteria import HORIZON
from service.alarms.outbox import Outbox
from service.answers.store import AnswerStore
from service.api.parameters import SHORT
from service.jobs.queue import JobQueue
from service.jobs.workers import Workers
from service.paging import ALL_ITEMS, LONGEST_CURSOR
from service.settings import Settings
from service.web.files import Copies
from service.web.limits import MAX_HORIZONS, MAX_ITEMS, MAX_PRESSURE_BAR, USE_NOTED_SECONDS
from service.web.metrics import Metrics
from service.web.readiness import Readiness
from storage import keys
from storage.engine.database import Database
from storage.engine.errors import StorageError

_log = logging.getLogger("clutchlife")


class KeyUses:
    """Stores when each key was last used, at most once an hour: a commit costs more than a request. For the event loop
    alone."""

    def __init__(self) -> None:
        self._due: dict[str, float] = {}
        self._storing: set[asyncio.Task[None]] = set()

    def note(self, database: Database, key_id: str) -> None:
        """Store that the key was used, unless a use was stored in the last hour; runs in the background."""
        now = time.monotonic()
        if now < self._due.get(key_id, now):
            return
        self._due[key_id] = now + USE_NOTED_SECONDS
        storing = asyncio.create_task(run_in_threadpool(_store, database, key_id))
        self._storing.add(storing)
        storing.add_done_callback(self._storing.discard)


def _store(database: Database, key_id: str) -> None:
    """Store that a key was used; a database that is away is only logged."""
    try:
        with database.writing(of=key_id) as connection:
            keys.note_use(connection, key_id, datetime.now(UTC).isoformat(timespec="seconds"))
    except StorageError as error:
        _log.warning("the use of key %s could not be noted: %s", key_id, error)


@dataclass(frozen=True, slots=True, kw_only=True)
class Context:
    """The service's parts, made when it starts and closed when it stops."""

    database: Database
    answers: AnswerStore
    metrics: Metrics
    jobs: JobQueue
    outbox: Outbox
    workers: Workers
    settings: Settings
    readiness: Readiness
    #: Where files are kept while they come in and go out.
    folder: Path
    #: Copies of runs while they are sent.
    copies: Copies
    key_uses: KeyUses = field(default_factory=KeyUses)


Limit = Annotated[int, SHORT, Query(ge=1, le=MAX_ITEMS, description="Items per page")]
Whole = Annotated[int, SHORT, Query(ge=1, le=ALL_ITEMS, description="Items per page; default: all")]
Cursor = Annotated[str | None, Query(max_length=LONGEST_CURSOR, description="`next` of the previous page")]
PressureBar = Annotated[
    float | None,
    SHORT,
    Query(
        ge=0,
        le=MAX_PRESSURE_BAR,
        allow_inf_nan=False,
        description="A pressure of the first stationary test; default: the mean over its pressures",
    ),
]
Until = Annotated[
    float | None,
    SHORT,
    Query(gt=0, le=HORIZON * MAX_HORIZONS, allow_inf_nan=False, description="Trajectories end at these cycles"),
]
AtCycles = Annotated[
    float | None,
    SHORT,
    Query(
        ge=0,
        le=HORIZON * MAX_HORIZONS,
        allow_inf_nan=False,
        description="The prediction with the runs up to these cycles only",
    ),
]
Prefer = Annotated[
    str | None,
    Header(
        max_length=200, description="`wait=SECONDS`: how long to wait for the newest answer while the service is busy"
    ),
]
