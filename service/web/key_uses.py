"""When each key was last used, noted once an hour: a commit at every request would cost more than the request."""

import asyncio
import logging
import time
from datetime import UTC, datetime

from fastapi.concurrency import run_in_threadpool

from service.web.limits import USE_NOTED_SECONDS
from storage import keys
from storage.engine.database import Database
from storage.engine.errors import StorageError

_log = logging.getLogger("clutchlife")


class KeyUses:
    """Which keys were noted lately. Used from the event loop alone."""

    def __init__(self) -> None:
        self._due: dict[str, float] = {}
        self._storing: set[asyncio.Task[None]] = set()

    def note(self, database: Database, key_id: str) -> None:
        """Have a use of the key stored, where the last one that was is an hour old; nobody waits for it."""
        now = time.monotonic()
        if now < self._due.get(key_id, now):
            return
        self._due[key_id] = now + USE_NOTED_SECONDS
        storing = asyncio.create_task(run_in_threadpool(_store, database, key_id))
        self._storing.add(storing)
        storing.add_done_callback(self._storing.discard)


def _store(database: Database, key_id: str) -> None:
    try:
        with database.writing(of=key_id) as connection:
            keys.note_use(connection, key_id, datetime.now(UTC).isoformat(timespec="seconds"))
    except StorageError as error:
        _log.warning("the use of key %s could not be noted: %s", key_id, error)
