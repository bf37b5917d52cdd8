"""Whether the service can work now: its database, its disk, its memory and its workers.

One thread looks at everything, for all who ask at that moment; a second asks the store of raw records, which may hang. No
lock is taken, so that nobody who holds one makes the service look dead.
"""

import asyncio
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from service.jobs.queue import JobQueue
from service.jobs.workers import Workers
from service.web.limits import LONGEST_LOOK_SECONDS, LONGEST_RAW_LOOK_SECONDS, RAW_LOOK_SECONDS
from storage.blobs import raw_stores
from storage.blobs.stores import open_store
from storage.engine.database import Database
from storage.engine.errors import RawStoreUnavailable, StorageError

#: What is looked at, in the order of the answer; `raw`, the store of raw records, is in it where it cannot be used.
PARTS = ("database", "disk", "memory", "workers")
_MEMORY = Path("/proc/meminfo")
_GROUP = Path("/proc/self/cgroup")
_GROUPS = Path("/sys/fs/cgroup")
#: What a group gives back when it is needed: what files and their names are cached in.
_GIVEN_BACK = ("inactive_file", "active_file", "slab_reclaimable")


class Readiness:
    """Checks whether the service can work: disk, memory, database, workers, jobs and store of raw records; needs at
    least `least_disk` and `least_memory` free bytes. Call it from the event loop; `close` at the end."""

    def __init__(
        self, database: Database, workers: Workers, jobs: JobQueue, *, least_disk: int, least_memory: int
    ) -> None:
        self._database = database
        self._workers = workers
        self._jobs = jobs
        self._least_disk, self._least_memory = least_disk, least_memory
        # looks at everything
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="readiness")
        # asks the store of raw records, and may hang in it
        self._raw_thread = ThreadPoolExecutor(1, thread_name_prefix="raw records")
        # the last look at the store, which may still be on its way
        self._raw: Future[str | None] | None = None
        # when the store is looked at again, by the monotonic clock [s]
        self._look_again = 0.0
        # whether that look has come to the store itself: before, it waits for the database
        self._asking_store = False
        # the look at everything that all who ask now wait for
        self._looking: asyncio.Future[dict[str, str]] | None = None

    async def faults(self) -> dict[str, str]:
        """The faults found, by part, each a sentence; empty if the service can work."""
        if self._looking is None or self._looking.done():
            self._looking = asyncio.get_running_loop().run_in_executor(self._thread, self._look)
        try:
            return await asyncio.wait_for(asyncio.shield(self._looking), LONGEST_LOOK_SECONDS)
        except TimeoutError:
            part, place = ("database", "server") if self._database.path is None else ("disk", "database's disk")
            return {part: f"the {place} has not answered for {LONGEST_LOOK_SECONDS:g} s"}

    def close(self) -> None:
        self._thread.shutdown(wait=False)
        self._raw_thread.shutdown(wait=False)

    def _look(self) -> dict[str, str]:
        """The faults that keep the service from working, each a sentence by what it concerns."""
        wrong = self._database.faults(least_free=self._least_disk)
        if "database" not in wrong and (away := self._fault_of_raw_records()) is not None:
            wrong["raw"] = away
        left = available_memory()
        if left is not None and left < self._least_memory:
            wrong["memory"] = f"{left >> 20} MiB of memory are left, {self._least_memory >> 20} are needed"
        if not self._jobs.is_working():
            wrong["workers"] = "a thread that runs jobs has ended: restart the service"
        elif ended := self._workers.ended():
            lanes = ", ".join(lane.name.lower() for lane in ended)
            wrong["workers"] = f"a worker process has ended and is being started again: {lanes}"
        return wrong

    def _fault_of_raw_records(self) -> str | None:
        """Why the store of raw records cannot be used, by its latest check; None if it can."""
        if self._raw is None or (self._raw.done() and time.monotonic() >= self._look_again):
            self._raw = self._raw_thread.submit(self._look_at_raw_records)
        try:
            return self._raw.result(LONGEST_RAW_LOOK_SECONDS)
        except TimeoutError:
            if not self._asking_store:  # whoever holds the database does not make the store look away
                return None
            return f"the store of raw records has not answered for {LONGEST_RAW_LOOK_SECONDS:g} s"

    def _look_at_raw_records(self) -> str | None:
        """The fault of the store of raw records; None if it answers and is this database's."""
        try:
            with self._database.reading() as connection:
                store = raw_stores.in_use(connection)
            self._asking_store = True
            if store is not None and open_store(store.address).mark() != store.mark:
                return f"{store.address} is not marked as this database's"
        except RawStoreUnavailable as error:
            return str(error)
        except StorageError:  # that of the database is said beside
            return None
        finally:
            self._asking_store = False
            self._look_again = time.monotonic() + RAW_LOOK_SECONDS
        return None


def available_memory() -> int | None:
    """Available memory [bytes] within the limits of the machine and of the process's control group (version 2); None if
    the system does not report it."""
    left = []
    try:
        lines = (line.split() for line in _MEMORY.read_text(encoding="ascii").splitlines())
        left += [int(words[1]) << 10 for words in lines if words[0] == "MemAvailable:"]
    except OSError:
        pass
    try:
        group = _GROUPS / _GROUP.read_text(encoding="utf-8").strip().rpartition("::")[2].lstrip("/")
        most = int((group / "memory.max").read_text(encoding="ascii"))
        statistics = dict(line.split() for line in (group / "memory.stat").read_text(encoding="ascii").splitlines())
        used = int((group / "memory.current").read_text(encoding="ascii"))
        left.append(most - used + sum(int(statistics[name]) for name in _GIVEN_BACK))
    except (OSError, ValueError, KeyError):  # no such group, or one without a bound ("max")
        pass
    return min(left, default=None)
