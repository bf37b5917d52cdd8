"""The store of answers: each is computed once for a version of what it follows from, and kept while there is room.

Where several ask for an answer that is not there yet, one computes it and the others wait for it (`answer`). What takes a
second to compute is given as it was while a worker makes a newer one (`renewed`). What was asked at an address before is
answered without looking at anything else (`again`). Services on one database share what workers have computed.
"""

import asyncio
import hashlib
import logging
import re
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import Future
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from pydantic import BaseModel

from service.api.base import Answer
from service.errors import BusyError
from service.paging import LONGEST_CURSOR
from service.settings import CODE_VERSION
from storage import clutches
from storage.encoding import to_text
from storage.engine.database import Database, SharedAnswer
from storage.engine.errors import StorageError

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response

_log = logging.getLogger("clutchlife")

#: Bytes that a kept answer takes beside its body: its key, its tag and its entry. Measured: 700 to 1,100 with a cursor.
KEPT_BESIDE_BYTES = 1024
#: The end of a list that is answered as JSON and goes on: the cursor of its next page.
_GOES_ON = re.compile(rb'"next":"([A-Za-z0-9_-]+)"\}$')


def build_of(folders: Iterable[Path]) -> str:
    """The release with a digest of the code in these folders and of the numerical libraries; it differs between any two
    builds."""
    digest = hashlib.sha256(f"numpy {version('numpy')} scipy {version('scipy')}".encode())
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            digest.update(f"\0{folder.name}/{path.relative_to(folder)}\0".encode() + path.read_bytes())
    return f"{CODE_VERSION}+{digest.hexdigest()[:16]}"


#: That of the code as it was loaded: what is installed under a running service later is another.
BUILD = build_of(Path(__file__).parents[2] / name for name in ("models", "storage", "service"))


@dataclass(frozen=True, slots=True)
class CsvPage:
    """A page as CSV bytes, and the cursor of the next page, for which CSV has no place (None on the last page)."""

    body: bytes
    next: str | None


@dataclass(frozen=True, slots=True)
class CachedAnswer:
    """A response body, its strong entity tag, and the next page's cursor if there is one."""

    body: bytes
    tag: str
    next: str | None = None

    @property
    def size(self) -> int:
        """The bytes counted against the cache's limit; even an empty answer counts, because its key takes room."""
        return len(self.body) + KEPT_BESIDE_BYTES

    @classmethod
    def of(cls, made: bytes | CsvPage) -> "CachedAnswer":
        """The answer with its entity tag. A page's tag covers its cursor, which is not in its bytes."""
        if isinstance(made, CsvPage):
            digest = hashlib.sha256(made.body + (made.next or "").encode())
            return cls(made.body, f'"{digest.hexdigest()[:32]}"', made.next)
        goes_on = _GOES_ON.search(made, max(0, len(made) - LONGEST_CURSOR - 32))
        return cls(made, f'"{hashlib.sha256(made).hexdigest()[:32]}"', None if goes_on is None else goes_on[1].decode())


def to_json(answer: BaseModel) -> bytes:
    """The JSON of any answer: UTF-8, fields in their declared order; ValueError on a number that JSON cannot represent."""
    return to_text(answer.model_dump(mode="json", exclude_unset=isinstance(answer, Answer))).encode()


def name_of(query: Callable[..., object]) -> str:
    """A query's name in the cache: module and function."""
    return f"{query.__module__}.{query.__qualname__}"


def revision_and_json(
    database: Database, query: Callable[..., BaseModel], clutch_id: str, arguments: tuple[Hashable, ...]
) -> tuple[int, bytes]:
    """The JSON of `query(database, clutch_id, *arguments)`, and the clutch's revision from which it was computed, at
    the least.

    Where several services share the database, what one of them computed without `arguments` is not computed again.
    """
    with database.reading() as connection:
        revision = clutches.revision(connection, clutch_id) or 0
    shared = None if arguments else shared_answer(database, query, clutch_id)
    if shared is not None and shared[0] >= revision:
        return shared
    body = to_json(query(database, clutch_id, *arguments))
    if not arguments:
        name = name_of(query)
        new_answer = SharedAnswer(clutch_id=clutch_id, name=name, release=BUILD, revision=revision, body=body)
        try:
            database.share(new_answer)
        except StorageError as error:  # as after a restart of the server: it is an answer all the same
            _log.warning("an answer could not be shared: %s", error)
    return revision, body


def shared_answer(database: Database, query: Callable[..., object], clutch_id: str) -> tuple[int, bytes] | None:
    """The newest shared answer of a query without arguments, and its revision; None if there is none or it cannot be
    read."""
    try:
        newest = database.shared_answer(clutch_id, name_of(query), BUILD)
    except StorageError as error:
        _log.warning("a shared answer could not be read: %s", error)
        return None
    return None if newest is None else (newest.revision, newest.body)


#: What a worker returns: the revision that it computed the answer from, and the answer's bytes.
Made = tuple[int, bytes]
Compute = Callable[[bool], "Future[Made]"]
_Making = asyncio.Task[tuple[int, CachedAnswer]]
#: The held answer to a request that was made before, None where there is none for the present version.
Again: TypeAlias = "Callable[[Request], Response | None]"


class AnswerStore:
    """A cache of answers, bounded by `most_bytes`; the least recently requested is dropped first.

    Each key has one version: the one whose computation began last. An answer that a worker is renewing is never
    dropped, because requests get it meanwhile.
    """

    def __init__(self, most_bytes: int, database: Database | None = None) -> None:
        self._most = most_bytes
        self._database = database
        self._held = 0
        self._begun = 0
        self._answers: OrderedDict[Hashable, tuple[Hashable, CachedAnswer, int]] = (
            OrderedDict()
        )  # and which begin it was
        self._making: dict[tuple[Hashable, Hashable], Future[CachedAnswer]] = {}
        self._lock = threading.Lock()
        # of a key one may be made for those who wait and one for later, both at once: who waits does not wait for a
        # renewal, which yields to all others; used from the event loop alone
        self._waited_for: dict[Hashable, _Making] = {}
        self._renewing: dict[Hashable, _Making] = {}
        self._asked: OrderedDict[Hashable, Again] = OrderedDict()

    def held(self, key: Hashable, version: Hashable) -> CachedAnswer | None:
        """The cached answer for `key` at exactly `version`, else None."""
        with self._lock:
            return self._current(key, version)

    def newest(self, key: Hashable) -> tuple[Any, CachedAnswer] | None:
        """The cached answer for `key` at any version, with that version; None if there is none."""
        with self._lock:
            if key not in self._answers:
                return None
            self._answers.move_to_end(key)
            return self._answers[key][:2]

    def put(self, key: Hashable, version: Hashable, answer: CachedAnswer) -> None:
        """Cache an answer computed elsewhere, replacing the present one."""
        with self._lock:
            self._begun += 1
            self._hold(key, version, answer, self._begun)

    def answer(self, key: Hashable, version: Hashable, make: Callable[[], bytes | CsvPage]) -> CachedAnswer:
        """The answer for `key` at `version`, computed by `make` if it is not cached. Concurrent requests share one
        computation and its error."""
        with self._lock:
            cached = self._current(key, version)
            if cached is not None:
                return cached
            pending = self._making.get((key, version))
            if pending is None:
                mine = self._making[key, version] = Future()
                self._begun += 1
                begun = self._begun
        if pending is not None:
            return pending.result()
        self._make(key, version, make, mine, begun)
        return mine.result()

    def _current(self, key: Hashable, version: Hashable) -> CachedAnswer | None:
        """The cached answer at exactly this version; the caller holds the lock."""
        cached_version, answer, _ = self._answers.get(key, (None, None, 0))
        if answer is None or cached_version != version:
            return None
        self._answers.move_to_end(key)
        return answer

    def _make(
        self,
        key: Hashable,
        version: Hashable,
        make: Callable[[], bytes | CsvPage],
        pending: "Future[CachedAnswer]",
        begun: int,
    ) -> None:
        """Compute an answer, cache it unless a later version came first, and give it to all who wait for `pending`."""
        try:
            answer = CachedAnswer.of(make())
        except BaseException as error:  # noqa: BLE001  (raised again for each who asked)
            with self._lock:
                del self._making[key, version]
            pending.set_exception(error)
            return  # who asked is told by `pending`, as all who wait are
        with self._lock:
            if key not in self._answers or self._answers[key][2] < begun:  # else a later version was quicker
                self._hold(key, version, answer, begun)
            del self._making[key, version]
        pending.set_result(answer)

    def _hold(self, key: Hashable, version: Hashable, answer: CachedAnswer, begun: int) -> None:
        """Cache an answer, and drop the least recently requested ones that no longer fit; the caller holds the lock."""
        self._drop(key)
        if answer.size <= self._most:
            self._held += answer.size
            self._answers[key] = version, answer, begun
        while self._held > self._most:
            oldest = next((name for name in self._answers if name != key and not self._is_renewed(name)), None)
            if oldest is None:
                break
            self._drop(oldest)

    def _drop(self, key: Hashable) -> None:
        if key in self._answers:
            self._held -= self._answers.pop(key)[1].size

    def knows(self, key: Hashable) -> bool:
        """Whether an answer for the key is cached, at any revision, or being computed."""
        return self._is_renewed(key) or self.newest(key) is not None

    def begin(self, key: Hashable, revision: int, body: bytes) -> None:
        """Cache an answer computed elsewhere, unless the key has one already."""
        if not self.knows(key):
            self.put(key, revision, CachedAnswer.of(body))

    def begin_shared(self, key: Hashable, query: Callable[..., object], clutch_id: str) -> None:
        """Cache the newest shared answer of a query without arguments, unless the key has one already."""
        if self._database is not None and not self.knows(key):
            shared = shared_answer(self._database, query, clutch_id)
            if shared is not None:
                self.begin(key, *shared)

    async def renewed(self, key: Hashable, revision: int, compute: Compute, *, wait: float) -> tuple[int, CachedAnswer]:
        """The answer at `revision` or later, or the previous one if it is not ready within `wait` [s]; and its
        revision. As stale-while-revalidate of RFC 5861; used from the event loop alone.

        Where none was ever made, it is waited for. `compute` is told whether who asks waits; what it raises is raised to
        those who do.
        """
        deadline = asyncio.get_running_loop().time() + wait
        newest = self.newest(key)
        while newest is None or newest[0] < revision:
            making, renewing = self._waited_for.get(key), self._renewing.get(key)
            if newest is None:
                newest = await asyncio.shield(making or self._begin(key, compute, waits=True))
                continue
            if making is None and (wait > 0 or renewing is None):
                try:
                    making = self._begin(key, compute, waits=wait > 0)
                except BusyError:
                    if wait > 0:
                        raise
                    break
            left = deadline - asyncio.get_running_loop().time()
            if making is None or left <= 0:
                break
            running = [task for task in (making, renewing) if task is not None]
            ended, _ = await asyncio.wait(running, timeout=left, return_when=asyncio.FIRST_COMPLETED)
            if not ended:
                break
            results = [task.result() for task in ended if task is making or not _failed(task)]
            newest = max([newest, *results], key=lambda answered: answered[0])
        return newest

    def _begin(self, key: Hashable, compute: Compute, *, waits: bool) -> _Making:
        """Start computing the next answer, with priority if a request `waits` for it. Raises BusyError."""
        tasks = self._waited_for if waits else self._renewing
        task = tasks[key] = asyncio.create_task(self._computed(key, compute(waits), tasks))
        task.add_done_callback(_logged)
        return task

    async def _computed(
        self, key: Hashable, computing: "Future[Made]", tasks: dict[Hashable, _Making]
    ) -> tuple[int, CachedAnswer]:
        """The answer that a worker computes, put into the cache; the cached one if that is of a later revision."""
        try:
            revision, body = await asyncio.wrap_future(computing)
        finally:
            del tasks[key]
        cached = self.newest(key)
        if cached is not None and revision < cached[0]:  # a later one was quicker
            return cached
        result = revision, CachedAnswer.of(body)
        self.put(key, *result)
        return result

    def _is_renewed(self, key: Hashable) -> bool:
        return key in self._waited_for or key in self._renewing

    def remember(self, asked: Hashable, again: Again, most: int) -> None:
        """Have later requests equal to `asked` answered by `again`; only the `most` recently used requests are kept."""
        self._asked[asked] = again
        while len(self._asked) > most:
            self._asked.popitem(last=False)

    def again(self, asked: Hashable) -> "Again | None":
        """The function that answers a remembered request; None if the request is not remembered."""
        return self._asked.get(asked)


def _failed(task: _Making) -> bool:
    return task.cancelled() or task.exception() is not None


def _logged(task: _Making) -> None:
    """Log a failed renewal: the caller has already got the previous answer and does not see the error."""
    if not task.cancelled() and task.exception() is not None:
        _log.warning("an answer could not be computed again: %s", task.exception())
