"""Killed at any moment, in whatever they do, the service, its commands and its PostgreSQL server lose nothing and leave
nothing half done.

Kills are spread evenly over the time that the work takes; `make faults` makes many more of them.
"""

import os
import random
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest

from service.answers.verification import check_results, check_runs
from service.changes.adopt_model import adopt
from service.client.clutchlife import Client, ServiceAwayError
from storage import assumptions, clutches, jobs, raw_columns, runs
from storage.engine.database import Database
from storage.engine.integrity import other_schema
from storage.engine.opening import find_database, open_database
from storage.engine.sqlite.backup import restore
from storage.engine.sqlite.database import back_up
from storage.migrations.upgrade import head
from tests.service.alarms.receiving import SECRET, Receiver, receiving
from tests.service.changes import stand_in_engine
from tests.service.changes.benches import Bench, body, stood_in
from tests.service.jobs.replaying import ended
from tests.service.jobs.waiting import until
from tests.storage.engine.postgresql.server import PostgresServer, postgresql_server
from tests.storage.samples import OLD, integrity, old_database, read_from, reseal, revision
from tests.support import ONCE, Server, one_quick, serving, stationary

#: Channels of runs, bit for bit, by clutch and run.
Acknowledged = dict[tuple[str, str], dict[str, bytes]]


def kills(few: int, many: int) -> pytest.MarkDecorator:
    cases = [pytest.param(few, id=f"{few} kills"), pytest.param(many, id=f"{many} kills", marks=pytest.mark.slow)]
    return pytest.mark.parametrize("number", cases)


def forked(act: Callable[[], object]) -> int:
    """The number of a process that does something."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            act()
            code = 0
        finally:
            os._exit(code)
    return child


def killed_after(seconds: float, act: Callable[[], object]) -> bool:
    """Do something in a process that is killed after some time; whether it had come to its end."""
    child = forked(act)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)  # a process that has ended is there until it is waited for
    _, status = os.waitpid(child, 0)
    assert not os.WIFEXITED(status) or os.WEXITSTATUS(status) == 0, "it failed by itself"
    return os.WIFEXITED(status)


def duration(act: Callable[[], object]) -> float:
    """Seconds that something takes in a process of its own."""
    started = time.perf_counter()
    os.waitpid(forked(act), 0)
    return time.perf_counter() - started


def kills_of(act: Callable[[], object], number: int, lay: Callable[[], object] = lambda: None) -> Iterator[bool]:
    """Do something so many times, each from the start that `lay` makes, killed a little later each time; whether it had
    come to its end."""
    longest = duration(act)
    for kill in range(number):
        lay()
        yield killed_after(longest * kill / number, act)


def lay_again(path: Path, source: Path) -> None:
    """A copy of a database in place of one and of all that lies beside it."""
    for left in path.parent.glob(f"{path.name}*"):
        left.unlink()
    shutil.copyfile(source, path)


def address_of(database: Path | str) -> str:
    """The address of a database that is given as such, or by its path."""
    return database if isinstance(database, str) else f"sqlite:///{database}"


def findings(path: Path | str) -> list[str]:
    """What `clutchlife verify` would find."""
    with closing(find_database(address_of(path))) as database:
        with database.reading() as connection:
            wrong = database.damage(connection) + other_schema(connection)
            names = clutches.all_ids(connection)
        for name in names:
            wrong += [*check_runs(database, name).findings, *check_results(database, name).findings]
    return wrong


def stored(path: Path | str) -> Acknowledged:
    """Every run's channels, bit for bit."""
    content = {}
    with closing(find_database(address_of(path))) as database, database.reading() as connection:
        for name in clutches.all_ids(connection):
            for row in runs.page(connection, name):
                columns = raw_columns.values_of(raw_columns.stored_of_run(connection, row.run_key))
                content[name, row.run_id] = {channel: column.tobytes() for channel, column in columns.items()}
    return content


def numbered(number: int) -> dict[str, Any]:
    """The test of that number in a clutch's life."""
    return stationary(100 * number, run_id=f"r{number}", pressures=(4.0, 6.0))


def bits(sent: dict[str, Any]) -> dict[str, bytes]:
    """The channels of a body, bit for bit."""
    return {name: np.array(column).tobytes() for name, column in sent["channels"].items()}


def require_all(database: Path | str, acknowledged: Acknowledged, on_their_way: int) -> None:
    """Every acknowledged run is there bit for bit, with results that follow, and at most those beside it that were sent."""
    content = stored(database)
    assert {run: content.get(run) for run in acknowledged} == acknowledged
    assert len(content) <= len(acknowledged) + on_their_way
    assert findings(database) == []


@pytest.fixture(params=["file", "server"])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Path | str]:
    """The path of a file that is to be, or the address of an empty database on a server."""
    if request.param == "file":
        yield tmp_path / "clutchlife.db"
    else:
        server: PostgresServer = request.getfixturevalue("postgresql")
        yield (url := server.fresh())
        server.drop(url)


@kills(2, 100)
def test_every_run_that_was_acknowledged_is_there_bit_for_bit_after_kills(database: Path | str, number: int) -> None:
    """The service is killed while runs come in, and comes back; the sender sends again what was not acknowledged."""
    rng = random.Random(number)  # noqa: S311 - moments, not secrets
    acknowledged: Acknowledged = {}
    server = Server(database, loaded=True)
    for kill in range(number):
        server.start()
        poster = threading.Thread(target=post_until_killed, args=(server.url, f"c{kill}", acknowledged))
        before = len(acknowledged)
        poster.start()
        while len(acknowledged) < before + 2 and poster.is_alive():
            time.sleep(0.001)
        time.sleep(rng.uniform(0.0, 0.08))
        server.kill()
        poster.join()
    assert len(acknowledged) >= 2 * number
    require_all(database, acknowledged, on_their_way=number)


def post_until_killed(url: str, clutch: str, acknowledged: Acknowledged) -> None:
    with httpx2.Client(base_url=url, timeout=60) as http:
        try:
            assert http.post("/v1/clutches", json={"clutch_id": clutch}).status_code == 201
            for index in range(40):
                sent = numbered(index)
                assert http.post(f"/v1/clutches/{clutch}/runs", json=sent).status_code == 201
                acknowledged[clutch, f"r{index}"] = bits(sent)
        except httpx2.TransportError:
            return


@pytest.mark.usefixtures("later_step")
@kills(5, 50)
def test_a_migration_that_is_killed_is_whole_or_not_begun(tmp_path: Path, number: int) -> None:
    source = old_database(tmp_path)
    path = tmp_path / "a.db"
    url = f"sqlite:///{path}"
    shutil.copyfile(source, path)
    name = f"a.db-before-{head()}"
    seen = set()
    for _ in kills_of(lambda: open_database(url).close(), number, lambda: lay_again(path, source)):
        seen.add(revision(path))
        assert integrity(path) == ["ok"]
        if revision(path) == head():
            assert revision(tmp_path / name) == OLD
        open_database(url).close()
        assert (revision(path), revision(tmp_path / name)) == (head(), OLD)
        assert [each.name for each in tmp_path.glob("a.db-before*")] == [name]
    assert seen <= {OLD, head()}
    assert OLD in seen


@pytest.fixture
def filled(tmp_path: Path) -> Path:
    """A database with some tests of a clutch."""
    bench = Bench(tmp_path / "a.db")
    for cycles in (0, 1000, 2000):
        bench.send(body("test", f"r{cycles}", cycles))
    bench.database.close()
    return tmp_path / "a.db"


@kills(5, 50)
def test_a_backup_that_is_killed_harms_nothing_and_is_never_half_a_file(
    tmp_path: Path, filled: Path, number: int
) -> None:
    url, copy = f"sqlite:///{filled}", tmp_path / "copy.db"
    content = stored(filled)
    for finished in kills_of(lambda: back_up(url, copy), number, lambda: copy.unlink(missing_ok=True)):
        whole = copy.exists() and copy.stat().st_size > 0
        assert whole or not finished
        if whole:
            assert stored(copy) == content
    assert findings(filled) == []


@kills(5, 50)
def test_a_restore_that_is_killed_leaves_one_of_the_two_whole(tmp_path: Path, filled: Path, number: int) -> None:
    url, backup = f"sqlite:///{filled}", tmp_path / "backup.db"
    back_up(url, backup)
    with closing(open_database(url)) as database, database.writing() as connection:
        connection.exec_driver_sql("UPDATE clutch SET created_at = 'since'")
        reseal(connection)
    back_up(url, tmp_path / "since.db")
    for _ in kills_of(lambda: restore(url, backup), number, lambda: lay_again(filled, tmp_path / "since.db")):
        assert integrity(filled) == ["ok"]
        kept = [each for each in tmp_path.glob("a.db-replaced*") if created(each) == "since"]
        assert created(filled) == "since" or kept
        restore(url, backup)
        assert created(filled) != "since"


def created(path: Path) -> str:
    with closing(find_database(f"sqlite:///{path}")) as database:
        return read_from(database, clutches.get, "c1").created_at


@kills(2, 50)
def test_an_adoption_that_is_killed_is_whole_or_not_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    with stood_in(monkeypatch):
        bench = Bench(tmp_path / "a.db")
        for cycles in (0, 1000, 2000, 3000):
            bench.send(body("test", f"r{cycles}", cycles))
        bench.diagnose("d0", "")
        bench.database.close()
        url = f"sqlite:///{tmp_path / 'a.db'}"
        back_up(url, tmp_path / "before.db")
        laid = partial(lay_again, tmp_path / "a.db", tmp_path / "before.db")
        for finished in kills_of(lambda: adopt_on(url), number, laid):
            with closing(open_database(url)) as database:
                versions = read_from(database, assumptions.adoptions_of, "c1")
            assert len(versions) in ((1,) if finished else (0, 1))
            assert findings(tmp_path / "a.db") == []


def adopt_on(url: str) -> None:
    with closing(open_database(url)) as database:
        adopt(database, "c1", "d0", "2026-11-02T10:00:00+00:00")


# --- On PostgreSQL: the server is killed, or one of several services.

#: The clutch that is diagnosed, by an engine that takes two seconds; a killed service's job is begun again soon.
DIAGNOSED = "diagnosed"
SEVERAL = {"CLUTCHLIFE_ENGINE": f"{stand_in_engine.__name__}:slow", "CLUTCHLIFE_JOB_LEASE_SECONDS": "2"}


@pytest.fixture
def postgres() -> Iterator[PostgresServer]:
    """A server of the test's own, which it may kill."""
    with postgresql_server() as server:
        yield server


@pytest.mark.slow
@kills(3, 50)
def test_no_acknowledged_run_is_lost_where_postgresql_is_killed(postgres: PostgresServer, number: int) -> None:
    """The service lives on: it refuses what it cannot store, and goes on when the server is back."""
    url, rng = postgres.fresh(), random.Random(number)  # noqa: S311 - moments, not secrets
    acknowledged: Acknowledged = {}
    refused: list[int] = []
    done = threading.Event()
    with serving(url, loaded=True) as server:
        poster = threading.Thread(target=post_until_done, args=(server.url, acknowledged, refused, done))
        poster.start()
        try:
            for _ in range(number):
                wait_for_runs(acknowledged, 2)
                time.sleep(rng.uniform(0.0, 0.08))
                postgres.kill()
                time.sleep(0.1)
                postgres.start()
            wait_for_runs(acknowledged, 2)
        finally:
            done.set()
            poster.join()
        items = server.http.get("/v1/clutches/c1/runs", params={"limit": 1000}).json()["items"]
    assert set(refused) <= {503}
    assert {("c1", item["run_id"]) for item in items} >= acknowledged.keys()
    require_all(url, acknowledged, on_their_way=0)


@pytest.mark.slow
@kills(1, 20)
def test_what_a_killed_service_of_several_was_diagnosing_another_makes(postgres: PostgresServer, number: int) -> None:
    """Runs are posted at all services; the one that has a diagnosis is killed, and comes back later."""
    url, rng = postgres.fresh(), random.Random(number)  # noqa: S311 - moments, not secrets
    acknowledged: Acknowledged = {}
    with ExitStack() as stack:
        servers = [
            stack.enter_context(serving(url, loaded=True, environment=SEVERAL)) for _ in range(2 if number == 1 else 3)
        ]
        database = stack.enter_context(closing(find_database(url)))
        ONCE.post(f"{servers[0].url}/v1/clutches", json={"clutch_id": DIAGNOSED}).raise_for_status()
        for kill in range(number):
            asked_of = f"{servers[kill % len(servers)].url}/v1/clutches/{DIAGNOSED}"
            ONCE.post(f"{asked_of}/runs", json=numbered(kill)).raise_for_status()
            acknowledged[DIAGNOSED, f"r{kill}"] = bits(numbered(kill))
            posters = [
                threading.Thread(target=post_until_killed, args=(server.url, f"c{kill}-{place}", acknowledged))
                for place, server in enumerate(servers)
            ]
            for poster in posters:
                poster.start()
            job_id = ONCE.post(f"{asked_of}/diagnoses", json={}, headers={"Prefer": "wait=0"}).json()["diagnosis_id"]
            killed = next(each for each in servers if each.pid == claimer(database, job_id))
            time.sleep(rng.uniform(0.0, 0.3))
            killed.kill()
            other = next(each for each in servers if each is not killed)
            job = ended(other, job_id)
            assert (job["state"], job["attempts"]) == ("finished", 2), job
            for poster in posters:
                poster.join()
            killed.start()
        found = ONCE.get(f"{servers[0].url}/v1/clutches/{DIAGNOSED}/diagnoses").json()["items"]
    assert [item["status"] for item in found] == ["finished"] * number
    assert len(acknowledged) > 40 * (len(servers) - 1) * number, "the others went on"
    require_all(url, acknowledged, on_their_way=number)


def claimer(database: Database, job_id: str) -> int:
    """The number of the process that has the job, once one has."""

    def look() -> str | None:
        job = read_from(database, jobs.get, job_id)
        return None if job is None else job.claimed_by

    return int((until(look) or "").split(":")[1])


def wait_for_runs(acknowledged: Acknowledged, number: int) -> None:
    """Wait until so many more runs are acknowledged."""
    enough = len(acknowledged) + number
    until(lambda: len(acknowledged) >= enough)


def post_until_done(url: str, acknowledged: Acknowledged, refused: list[int], done: threading.Event) -> None:
    """Post runs of one clutch, each until it is acknowledged."""
    with httpx2.Client(base_url=url, timeout=60) as http:
        http.post("/v1/clutches", json={"clutch_id": "c1"}).raise_for_status()
        for number in range(100_000):
            sent, status = numbered(number), 0
            while status not in (200, 201):
                with suppress(httpx2.TransportError):
                    status = http.post("/v1/clutches/c1/runs", json=sent).status_code
                if status not in (200, 201):
                    refused.append(status)
                    time.sleep(0.02)
            acknowledged["c1", f"r{number}"] = bits(sent)
            if done.is_set():
                return


# --- Between raising an alarm and delivering it: delivered once or twice, never not.


def prepared(server: Server, receiver: Receiver) -> None:
    """A clutch whose next test raises an alarm, and the receiver."""
    with Client(server.url) as client:
        client.register("e")
        for cycles in (0.0, 1000.0, 2000.0, 3000.0):
            client.post_run("e", stationary(cycles))
        client.service.post("/v1/webhooks", {"url": receiver.url, "secret": SECRET})
        client.service.post("/v1/alarms", {"clutch_id": "e", "quantity": "held_runs"})


def raise_alarm(server: Server) -> None:
    """Post the test; the service may be killed before it has answered, and has stored it then."""
    with Client(server.url, patience=0.0) as client, suppress(ServiceAwayError):
        assert client.post_run("e", stationary(4000.0, wear=0.0))["state"] == "held"


@pytest.mark.parametrize("answers", one_quick([True, False]), ids=["while it is asked", "before the receiver is asked"])
def test_a_killed_service_delivers_after_its_next_start(tmp_path: Path, answers: bool) -> None:
    server = Server(tmp_path / "clutchlife.db", loaded=True)
    server.start()
    with receiving() as receiver:
        prepared(server, receiver)
        if answers:  # the request has arrived, and its answer never does
            receiver.before = lambda _handler: server.kill() if server.exit_code() is None else None
            raise_alarm(server)
            receiver.await_requests(1)
        else:
            receiver.status = 503  # taken by nobody
            raise_alarm(server)
            server.kill()
            receiver.status = 200
        receiver.before = lambda _handler: None
        before = len(receiver.requests)
        server.start()
        try:
            bodies = receiver.await_requests(before + 1)
            assert len({body["event"]["event_id"] for body in bodies}) == 1
            assert len({body["delivery_id"] for body in bodies}) == 1
            with Client(server.url, frames="list") as client:
                (webhook,) = client.service.pages("/v1/webhooks")
                address = f"/v1/webhooks/{webhook['webhook_id']}/deliveries"
                (item,) = client.service.pages(address)
            assert item["state"] in ("delivered", "waiting")
            assert len(bodies) - before <= 1
        finally:
            server.stop()
