"""Computed answers as JSON or CSV bytes, by what they depend on: bounded, shared between threads, and each made once.

Where several ask for an answer that is not there yet, one computes it and the others wait for it.
"""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from storage import clutches
from storage.encoding.json_text import to_text
from storage.engine.database import Database


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer's bytes, and the strong entity tag that follows from them."""

    body: bytes
    tag: str

    @classmethod
    def of(cls, body: bytes) -> "Answer":
        """The answer with its tag."""
        return cls(body, f'"{hashlib.sha256(body).hexdigest()[:32]}"')


def to_json(payload: object) -> bytes:
    """JSON in UTF-8; ValueError on a number that JSON cannot carry: none may leave."""
    return to_text(payload).encode()


def revision_and_json(
    database: Database, query: Callable[..., dict[str, Any]], clutch_id: str, arguments: tuple[Hashable, ...]
) -> tuple[int, bytes]:
    """A clutch's revision, and what `query(database, clutch_id, *arguments)` gives at that or a later one, as JSON."""
    with database.reading() as connection:
        revision = clutches.revision(connection, clutch_id)
    return revision or 0, to_json(query(database, clutch_id, *arguments))


class AnswerCache:
    """The last answers; the least lately asked for goes first. `most_bytes` bounds their sizes together."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._held = 0
        self._answers: OrderedDict[Hashable, Answer] = OrderedDict()
        self._making: dict[Hashable, Future[Answer]] = {}
        self._lock = threading.Lock()

    def held(self, key: Hashable) -> Answer | None:
        """The answer for `key` where it is there."""
        with self._lock:
            if key in self._answers:
                self._answers.move_to_end(key)
            return self._answers.get(key)

    def answer(self, key: Hashable, make: Callable[[], bytes]) -> Answer:
        """The answer for `key`, made by `make` where it is not there. What `make` raises is raised for all who wait."""
        with self._lock:
            if key in self._answers:
                self._answers.move_to_end(key)
                return self._answers[key]
            pending = self._making.get(key)
            if pending is not None:
                mine = False
            else:
                mine, pending = True, Future()
                self._making[key] = pending
        if mine:
            self._make(key, make, pending)
        return pending.result()

    def _make(self, key: Hashable, make: Callable[[], bytes], pending: "Future[Answer]") -> None:
        try:
            answer = Answer.of(make())
        except BaseException as error:  # noqa: BLE001  (raised again for each who asked)
            with self._lock:
                del self._making[key]
            pending.set_exception(error)
            return  # who asked is told by `pending`, as all who wait are
        with self._lock:
            if len(answer.body) <= self._most:
                self._held += len(answer.body)
                self._answers[key] = answer
            while self._held > self._most:
                self._held -= len(self._answers.popitem(last=False)[1].body)
            del self._making[key]
        pending.set_result(answer)
