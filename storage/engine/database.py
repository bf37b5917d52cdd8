"""The open database, of either kind: its transactions, cheap checks without one (`Watch`), values kept in memory that were
read from it (`Kept`), and answers that services share.

Made by `opening`.
"""

import asyncio
import json
import threading
import time
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
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
from storage.migrations.upgrade import current, head

#: Spans of what writes, `store`: made where an SDK of OpenTelemetry is there.
tracer = get_tracer("clutchlife")
#: [s] How long a transaction waits for the write lock before it gives up with DatabaseBusy. Chosen; no table.
LOCK_TIMEOUT = 10.0
#: Bytes of what reading transactions found that are kept in the memory of a process. Chosen: a clutch of 1,000 tests with
#: all its fits, or ten without; there are some six processes.
MAX_KEPT_BYTES = 32 * 2**20
#: What is kept: histories, and filter states, each up to so many bytes.
HISTORIES, STATES = "histories", "states"
#: The option of a connection by which what is kept is found.
_KEPT = "clutchlife_kept"


@dataclass(frozen=True, slots=True)
class GrantedKey:
    """The permissions of an active key; `clutches` None: not bound to clutches, `expires_at` None: without expiry."""

    key_id: str
    scope: str
    note: str
    clutches: frozenset[str] | None
    expires_at: str | None


@dataclass(frozen=True, slots=True)
class Question:
    """The clutch that a request is about, and the hash of its key; None for either if there is none."""

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
    """Answers requests' questions about key and clutch from one cheap look at the database; threads share it.

    Questions from the event loop are asked in a thread, with one look for all that wait, so that the loop never waits
    for the database. No answer is older than its question: requests that come during a look share the next.
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
        """Snapshots for several questions, all at the same moment."""

    async def look(self, question: Question) -> Snapshot:
        """A snapshot for a caller on the event loop. Raises StorageUnavailable if the database does not answer."""
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
        """End the thread; later callers get StorageUnavailable. May be called twice."""
        self._closed = True
        self._thread.shutdown()

    def refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"{self._name} has been closed")

    async def _ask(self) -> None:
        """Answer all waiting callers, look by look, until none waits."""
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
    """The permissions in a key's row: id, scope, note, clutches (JSON) and expiry."""
    key_id, scope, note, clutches, expires_at = row
    return GrantedKey(key_id, scope, note, None if clutches is None else frozenset(json.loads(clutches)), expires_at)


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedAnswer:
    """An answer about a clutch by its name, computed by one build of a release at one revision of the clutch."""

    clutch_id: str
    name: str
    release: str
    revision: int
    body: bytes


class Kept:
    """A cache by name of values read from a database, in the memory of this process; the least recently used go first.

    Threads share it, and a value is never changed in place. Whoever keeps a value keeps with it what shows that the database
    still gives it: a clutch's revision.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._values: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()
        self._bytes = 0

    def get(self, name: Hashable) -> Any:
        """The value cached under a name, else None."""
        with self._lock:
            if name not in self._values:
                return None
            self._values.move_to_end(name)
            return self._values[name][0]

    def put(self, name: Hashable, value: object, size: int) -> None:
        """Cache a value of about `size` bytes, replacing the one of that name, unless it exceeds the cache's limit."""
        with self._lock:
            self._bytes -= self._values.pop(name, (None, 0))[1]
            if size > self._most_bytes:
                return
            self._values[name] = value, size
            self._bytes += size
            while self._bytes > self._most_bytes:
                self._bytes -= self._values.popitem(last=False)[1][1]


def kept_of(connection: Connection, what: str = HISTORIES) -> Kept | None:
    """A memory cache of a database, for a read-only transaction; None in a writing one, whose changes may be rolled
    back."""
    kept: dict[str, Kept] | None = connection.get_execution_options().get(_KEPT)
    return None if kept is None else kept[what]


class Database(ABC):
    """An open database: its transactions, cheap checks without one, and its health; threads share it.

    `name` is its name in messages; `found`: it is only read, at the revision at which it was found. `url` is the
    address by which another process opens it, which may hold a password; `path` its file, None if it is on a server;
    `journal_mode` is SQLite's.
    """

    url: str
    path: Path | None
    journal_mode: str | None
    watch: Watch

    def __init__(self, name: str, *, found: bool) -> None:
        self.name = name
        self._found = found
        self._closed = False
        self.kept = {what: Kept(MAX_KEPT_BYTES) for what in (HISTORIES, STATES)}

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A read transaction: its connection sees one state of the database until the block ends. Keep it short,
        because the log grows meanwhile.

        Raises DatabaseTooOld if a query needs a later revision than that at which the database was found.
        """
        self._refuse_closed()
        try:
            with self._read() as connection:
                yield connection.execution_options(**{_KEPT: self.kept})
        except (OperationalError, ProgrammingError) as error:
            if not self._found or (revision := self._revision()) == head():
                raise
            note = "" if self.path is None else ", and keeps a copy of the file beside it"
            raise DatabaseTooOld(
                f"{self.name} is at revision {revision}, this program needs {head()}: `clutchlife serve` migrates it{note}"
            ) from error

    @abstractmethod
    def _read(self) -> AbstractContextManager[Connection]:
        """The engine's read transaction."""

    def _revision(self) -> str | None:
        with self._read() as connection:
            return current(connection)

    def _refuse_closed(self) -> None:
        if self._closed:
            raise StorageUnavailable(f"{self.name} has been closed")

    def where(self, check: Callable[[Connection], object]) -> Self:
        """The database itself, after `check` of its content; closed if the check raises an error."""
        try:
            with self.reading() as connection:
                check(connection)
        except BaseException:
            self.close()
            raise
        return self

    @abstractmethod
    def writing(self, *, of: str | None = None) -> AbstractContextManager[Connection]:
        """A write transaction: committed when the block ends, rolled back on any exception.

        `of` names a clutch, or another thing that the block alone writes: if the database allows several writers at
        once, no other writes this thing meanwhile. None: no other writes at all. Raises DatabaseBusy if another writes
        for too long, StorageUnavailable if the database cannot be written.
        """

    def shared_answer(self, clutch_id: str, name: str, release: str) -> SharedAnswer | None:  # noqa: ARG002
        """The last shared answer of that name from a service of that build; None if there is none, and always on a
        file, which has one service."""
        return None

    def share(self, answer: SharedAnswer) -> None:  # noqa: B027  (a file's service keeps its own)
        """Store an answer for all services on the database, unless one of a later revision is stored."""

    @abstractmethod
    def faults(self, *, least_free: int) -> dict[str, str]:
        """Faults that keep the database (`database`) or its disk (`disk`) from being used, each a sentence; empty if
        there are none.

        `least_free` [byte] must be free on the disk. Nothing is written, and no lock is taken or waited for.
        """

    @abstractmethod
    def damage(self, connection: Connection) -> list[str]:
        """Damage to the storage below the rows, each a sentence; empty if there is none."""

    @abstractmethod
    def close(self) -> None:
        """Close all connections; any later use raises StorageUnavailable. May be called twice."""


@contextmanager
def translated_by(
    own: Callable[[Exception], StorageError | None], kinds: tuple[type[Exception], ...]
) -> Iterator[None]:
    """Context that raises errors of driver and pool as the StorageError from `own`; others (a constraint, bad SQL) pass
    unchanged."""
    try:
        yield
    except kinds as error:
        translated = own(error)
        if translated is None:
            raise
        raise translated from error
