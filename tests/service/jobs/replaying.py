"""Clutches that are to be replayed by a job, seen and ended midway: what the tests of replays as jobs share."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import httpx2
from sqlalchemy import text

from service.api.clutch import ClutchIn
from service.changes.edit_clutch import register
from service.changes.ingest_run import ingest
from service.changes.replay import clutch_ids, replay
from service.jobs.executor import Executor, Item, Outcome, Result, called
from service.runs.json_run import read_run
from storage import jobs
from storage.encoding import to_text
from storage.engine.database import Database
from storage.tables import filter_state, fit, prediction
from storage.transfer import digest
from tests.service.jobs.waiting import until
from tests.storage.samples import reseal
from tests.support import ONCE, Server, stationary

AT = "2026-11-02T10:00:00+00:00"
#: So many that a replay is seen midway.
CLUTCHES = 6
WAIT = {"Prefer": "wait=120"}
RESULTS = (fit, prediction, filter_state)
#: What code versions each clutch's results have.
VERSIONS = (
    "SELECT run.clutch_id, fit.code_version FROM fit JOIN run ON run.run_key = fit.run_key "
    "UNION SELECT clutch_id, code_version FROM prediction UNION SELECT clutch_id, code_version FROM filter_state"
)
OLD = "0.0.1"


class InThread(Executor):
    """In the thread that asks, and as soon as any other."""

    elsewhere = False

    def map(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        *,
        in_order: bool = True,  # noqa: ARG002  (as they come is in order)
    ) -> Iterator[Outcome[Result]]:
        """As `Executor.map`."""
        for index, item in enumerate(items):
            result, error = called(function, item)
            yield Outcome(index=index, result=result, error=error)


def stock(database: Database, clutches: int = CLUTCHES, tests: int = 2) -> dict[str, tuple[int, str]]:
    """Clutches with some tests each; what a replay in this process stores of them."""
    for number in range(clutches):
        register(database, ClutchIn(clutch_id=f"c{number}"), created_at=AT)
        for each in range(tests):
            sent = stationary(1000 * each + number, run_id=f"r{each}", pressures=(5.0,))
            ingest(database, f"c{number}", read_run(to_text(sent).encode()), received_at=AT)
    assert all(replayed.error is None for replayed in replay(database, clutch_ids(database), InThread()))
    return stored(database)


def replay_clutch(database: Database, clutch_id: str) -> int:
    """Replay one clutch in this process; returns how many runs it has. Raises what its replay did."""
    (replayed,) = replay(database, [clutch_id], InThread())
    if replayed.error is not None:
        raise replayed.error
    return 0 if replayed.result is None else len(replayed.result.receipts)


def stored(database: Database) -> dict[str, tuple[int, str]]:
    with database.reading() as connection:
        return {table.name: digest(connection, table) for table in RESULTS}


def age(database: Database) -> None:
    """Have all results be those of an earlier release, with other numbers."""
    with database.writing() as connection:
        for table in RESULTS:
            connection.execute(table.update().values(code_version=OLD))
        connection.execute(text("UPDATE fit SET mean_cof = 0.25"))
        reseal(connection)


def aged(database: Database) -> set[str]:
    """The clutches whose results are old; of none some are."""
    with database.reading() as connection:
        rows = [tuple(row) for row in connection.execute(text(VERSIONS))]
    old = {clutch_id for clutch_id, version in rows if version == OLD}
    assert old.isdisjoint(clutch_id for clutch_id, version in rows if version != OLD), "a clutch is half done"
    return old


def midway(get: Callable[[str], httpx2.Response], job_id: str, url: str) -> None:
    """Wait until some of a replay is done, of the database at the address."""

    def some_is_done() -> bool:
        job = get(f"/v1/jobs/{job_id}").json()
        done = job["progress"] is not None and job["progress"]["done"] > 0
        assert not done or (job["state"], len(processes(url))) == ("running", 1), job
        return done

    until(some_is_done, within=120.0)


def processes(url: str) -> list[str]:
    """The processes of jobs on the database at that address."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            command, environment = (path / "cmdline").read_bytes(), (path / "environ").read_bytes()
        except OSError:  # it has ended, or is another user's
            continue
        if b"service.jobs." in command and url.encode() in environment:
            found.append(path.name)
    return found


def until_none(url: str) -> None:
    until(lambda: not processes(url))


def ended(server: Server, job_id: str) -> dict[str, Any]:
    """The job once it has ended; the database may be away for a while."""

    def job() -> dict[str, Any] | None:
        answer = ONCE.get(f"{server.url}/v1/jobs/{job_id}")
        found: dict[str, Any] = answer.json()
        return found if answer.status_code == 200 and found["state"] not in jobs.OPEN else None

    return until(job, within=180.0)
