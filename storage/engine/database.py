"""The open database, of either kind: its transactions, cheap checks without one (`Watch`), and answers that services share.

Made by `opening`.
"""

import asyncio
import json
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

from opentelemetry.trace import get_tracer
from sqlalchemy import Connection
from sqlalchemy.exc import OperationalError, ProgrammingError

from storage.engine.errors import DatabaseTooOld, StorageError, StorageUnavailable
from storage.engine.kept import Kept
from storage.migrations.upgrade import current, head

#: Spans of what writes, `store`: made where an SDK of OpenTelemetry is there.
tracer = get_tracer("clutchlife")
#: [s] How long a transaction waits for the write lock before it gives up with DatabaseBusy. Chosen; no table.
LOCK_TIMEOUT = 10.0
#: Bytes of what reading transactions found that are kept in the memory of a process. Chosen: a clutch of 1,000 tests with
#: all its fits, or ten without; there are some six processes.
MAX_KEPT_BYTES = 32 * 2**20
#: The option of a connection by which what is kept is found.
_KEPT = "clutchlife_kept"


@dataclass(frozen=True, slots=True)
class GrantedKey:
    """What an active key grants: `clutches` None where it is bound to none, `expires_at` None where it does not expire."""

    key_id: str
    scope: str
    note: str
    clutches: frozenset[str] | None
    expires_at: str | None


@dataclass(frozen=True, slots=True)
class Question:
    """The clutch that a request is about and the hash of its key, None where it names none."""

    clutch_id: str | None = None
    secret_sha256: str | None = None


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Key, clutch revision and commit number, read together at the start of a request.

    `version`: a number that changes with every commit, whichever process made it; compare it only with those of the same
    watch. Read before a query, it shows later whether the query would still give the same rows.
    `keys_are_needed`: whether a key was ever made; revoking the last one opens nothing.
    `key`: what the key grants, None where there is none with that hash or it was revoked; whether it has expired the caller
    looks at. `revision`: the clutch's, None where there is no such clutch.
    """

    version: int
    keys_are_needed: bool
    key: GrantedKey | None
    revision: int | None


class Watch(ABC):
    """Answers the questions; threads share it.

    Those of the event loop are asked in a thread, one look for all who ask at that moment: whatever the database waits for,
    the loop does not. No answer is older than its question: requests that come during a look share the next.
    """

    def __init__(self, name: str, patience: float) -> None:
        self._name = name
        self._patience = patience  # [s] for which a look may take before those who wait for it are told so
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="watch")
        self._waiting: list[tuple[Question, asyncio.Future[Snapshot]]] = []
        self._asking: asyncio.Task[None] | None = None
        self._begun = 0.0  # when the look under way was begun, by the monotonic clock [s]
        self._closed = False

    @abstractmethod
    def snapshots(self, questions: Sequence[Question]) -> list[Snapshot]:
        """Snapshots for several questions, all of the same moment."""

    async def look(self, question: Question) -> Snapshot:
        """A snapshot for a caller on the event loop. Raises StorageUnavailable where the database does not answer."""
        self.refuse_closed()
        answer: asyncio.Future[Snapshot] = asyncio.get_running_loop().create_future()
        if self._asking is None:
            self._begun = time.monotonic()
            self._asking = asyncio.create_task(self._ask())
        self._waiting.append((question, answer))
        while not answer.done():
            left = self._begun + self._patience - time.monotonic()
            if left <= 0:
                answer.cancel()
                raise StorageUnavailable(f"{self._name} has not answered for {self._patience:g} s")
            await asyncio.wait([answer], timeout=left)
        return answer.result()

    def close(self) -> None:
        """End the thread; who asks from then on is told that the database was closed. May be called twice."""
        self._closed = True
        self._thread.shutdown()

    def refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"{self._name} has been closed")

    async def _ask(self) -> None:
        """Ask for all who wait, until nobody does."""
        try:
            while self._waiting:
                questions, self._waiting = self._waiting, []
                self._begun = time.monotonic()
                await self._ask_for(questions)
        finally:
            self._asking = None

    async def _ask_for(self, questions: list[tuple[Question, asyncio.Future[Snapshot]]]) -> None:
        try:
            self.refuse_closed()
            snapshots = await asyncio.get_running_loop().run_in_executor(
                self._thread, self.snapshots, [question for question, _ in questions]
            )
        except Exception as error:  # noqa: BLE001  (raised again for each who asked)
            for _, answer in questions:
                if not answer.done():
                    answer.set_exception(error)
        else:
            for (_, answer), snapshot in zip(questions, snapshots, strict=True):
                if not answer.done():  # who asked may have gone
                    answer.set_result(snapshot)

    def snapshot(self, clutch_id: str | None = None, secret_sha256: str | None = None) -> Snapshot:
        """A snapshot of one clutch and one key."""
        return self.snapshots([Question(clutch_id, secret_sha256)])[0]


@lru_cache(maxsize=256)
def granted(row: tuple[Any, ...]) -> GrantedKey:
    """What a row of a key grants: its id, scope, note, clutches (JSON) and end."""
    key_id, scope, note, clutches, expires_at = row
    return GrantedKey(key_id, scope, note, None if clutches is None else frozenset(json.loads(clutches)), expires_at)


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedAnswer:
    """The answer of that name about a clutch, computed by that build of a release from that revision of the clutch."""

    clutch_id: str
    name: str
    release: str
    revision: int
    body: bytes


def kept_of(connection: Connection) -> Kept | None:
    """What is kept of a database, for a transaction that only reads; None for one that writes, as what it has changed may be
    rolled back."""
    kept: Kept | None = connection.get_execution_options().get(_KEPT)
    return kept


class Database(ABC):
    """An open database: its transactions, what is asked of it outside them, and its health. Threads share it.

    `name` is what messages call it; `found`: it is only read, at the revision that it was found at. `url` is the address by
    which another process opens it, which may hold a password; `path` its file, None where it is on a server; `journal_mode`
    is SQLite's.
    """

    url: str
    path: Path | None
    journal_mode: str | None
    watch: Watch

    def __init__(self, name: str, *, found: bool) -> None:
        self.name = name
        self._found = found
        self._closed = False
        self._kept = Kept(MAX_KEPT_BYTES)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection that sees one state of the database until the block ends. Keep it short: a log grows meanwhile.

        Raises DatabaseTooOld where what is asked for came with a later revision than a database was found at.
        """
        self._refuse_closed()
        try:
            with self._read() as connection:
                yield connection.execution_options(**{_KEPT: self._kept})
        except (OperationalError, ProgrammingError) as error:
            if not self._found or (revision := self._revision()) == head():
                raise
            note = "" if self.path is None else ", and keeps a copy of the file beside it"
            raise DatabaseTooOld(
                f"{self.name} is at revision {revision}, this program needs {head()}: `clutchlife serve` migrates it{note}"
            ) from error

    @abstractmethod
    def _read(self) -> AbstractContextManager[Connection]:
        """A transaction that reads."""

    def _revision(self) -> str | None:
        with self._read() as connection:
            return current(connection)

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"{self.name} has been closed")

    def where(self, check: Callable[[Connection], object]) -> Self:
        """The database itself; closed where the check of what is read of it raises an error."""
        try:
            with self.reading() as connection:
                check(connection)
        except BaseException:
            self.close()
            raise
        return self

    @abstractmethod
    def writing(self, *, of: str | None = None) -> AbstractContextManager[Connection]:
        """A connection that alone writes: committed when the block ends, rolled back on any exception.

        `of` names a clutch, or another thing of which alone the block writes: where the database can have several writers
        at once, it is then the only one of that thing. None: the only one of all.

        Raises DatabaseBusy where another writes for too long, StorageUnavailable where the database cannot be written.
        """

    def shared_answer(self, clutch_id: str, name: str, release: str) -> SharedAnswer | None:  # noqa: ARG002
        """The last answer of that name that a service of that build computed; None where there is none, and of a file, which
        has one service."""
        return None

    def share(self, answer: SharedAnswer) -> None:  # noqa: B027  (a file's service keeps its own)
        """Keep an answer for all services on the database, unless one of a later revision is kept."""

    @abstractmethod
    def faults(self, *, least_free: int) -> dict[str, str]:
        """What keeps the database (`database`) or its disk (`disk`) from being used, in words; empty where nothing does.

        `least_free` [byte] must be free on the disk. Nothing is written, and no lock is taken or waited for.
        """

    @abstractmethod
    def damage(self, connection: Connection) -> list[str]:
        """What is wrong with the content of the storage below the rows, in words; empty where nothing is."""

    @abstractmethod
    def close(self) -> None:
        """Close all connections; any later use raises StorageUnavailable. May be called twice."""


@contextmanager
def translated_by(
    own: Callable[[Exception], StorageError | None], kinds: tuple[type[Exception], ...]
) -> Iterator[None]:
    """Raise the store's own error for what driver and pool raise inside; what has none (a constraint, bad SQL) passes."""
    try:
        yield
    except kinds as error:
        translated = own(error)
        if translated is None:
            raise
        raise translated from error
