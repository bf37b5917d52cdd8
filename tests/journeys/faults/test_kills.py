"""Killed at any moment, in whatever it does, the service and its commands lose nothing and leave nothing half done.

Kills are spread evenly over the time that the work takes; `make faults` makes many more of them.
"""

import os
import random
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import httpx2
import numpy as np
import pytest

from service.queries.verification import check_results, check_runs
from service.workflows.adopt_model import adopt
from storage import assumptions, channels, clutches, runs
from storage.engine.integrity import other_schema
from storage.engine.opening import find_database, open_database
from storage.engine.sqlite.backup import restore
from storage.engine.sqlite.database import back_up
from storage.migrations.upgrade import head
from tests.service.workflows.benches import Bench, body, stood_in
from tests.storage.engine.postgresql.server import PostgresServer
from tests.storage.samples import OLD, integrity, old_database, revision
from tests.support import Server, stationary

#: Channels of runs, bit for bit, by clutch and run.
Acknowledged = dict[tuple[str, str], dict[str, bytes]]


def kills(few: int, many: int) -> pytest.MarkDecorator:
    cases = [pytest.param(few, id=f"{few} kills"), pytest.param(many, id=f"{many} kills", marks=pytest.mark.slow)]
    return pytest.mark.parametrize("number", cases)


def killed_after(seconds: float, act: Callable[[], object]) -> bool:
    """Do something in a process that is killed after some time; whether it had come to its end."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            act()
            code = 0
        finally:
            os._exit(code)
    time.sleep(seconds)
    os.kill(child, signal.SIGKILL)  # a process that has ended is there until it is waited for
    _, status = os.waitpid(child, 0)
    assert not os.WIFEXITED(status) or os.WEXITSTATUS(status) == 0, "it failed by itself"
    return os.WIFEXITED(status)


def duration(act: Callable[[], object]) -> float:
    """Seconds that something takes in a process of its own."""
    started = time.perf_counter()
    child = os.fork()
    if child == 0:
        try:
            act()
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    return time.perf_counter() - started


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
                columns = channels.read(connection, row.run_key)
                content[name, row.run_id] = {channel: column.tobytes() for channel, column in columns.items()}
    return content


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
                sent = stationary(100 * index, run_id=f"r{index}", pressures=(4.0, 6.0))
                assert http.post(f"/v1/clutches/{clutch}/runs", json=sent).status_code == 201
                bits = {name: np.array(column).tobytes() for name, column in sent["channels"].items()}
                acknowledged[clutch, f"r{index}"] = bits
        except httpx2.TransportError:
            return


@pytest.mark.usefixtures("later_step")
@kills(5, 50)
def test_a_migration_that_is_killed_is_whole_or_not_begun(tmp_path: Path, number: int) -> None:
    source = old_database(tmp_path)
    path = tmp_path / "a.db"
    url = f"sqlite:///{path}"
    shutil.copyfile(source, path)
    longest = duration(lambda: open_database(url).close())
    name = f"a.db-before-{head()}"
    seen = set()
    for kill in range(number):
        for left in tmp_path.glob("a.db*"):
            left.unlink()
        shutil.copyfile(source, path)
        killed_after(longest * kill / number, lambda: open_database(url).close())
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
    url = f"sqlite:///{filled}"
    content = stored(filled)
    longest = duration(lambda: back_up(url, tmp_path / "first.db"))
    for kill in range(number):
        copy = tmp_path / f"copy-{kill}.db"
        ended = killed_after(longest * kill / number, lambda copy=copy: back_up(url, copy))
        whole = copy.exists() and copy.stat().st_size > 0
        assert whole or not ended
        if whole:
            assert stored(copy) == content
    assert findings(filled) == []


@kills(5, 50)
def test_a_restore_that_is_killed_leaves_one_of_the_two_whole(tmp_path: Path, filled: Path, number: int) -> None:
    url, backup = f"sqlite:///{filled}", tmp_path / "backup.db"
    back_up(url, backup)
    with closing(open_database(url)) as database, database.writing() as connection:
        connection.exec_driver_sql("UPDATE clutch SET created_at = 'since'")
    back_up(url, tmp_path / "since.db")
    longest = duration(lambda: restore(url, backup))
    for kill in range(number):
        for left in tmp_path.glob("a.db*"):
            left.unlink()
        shutil.copyfile(tmp_path / "since.db", filled)
        killed_after(longest * kill / number, lambda: restore(url, backup))
        assert integrity(filled) == ["ok"]
        kept = [each for each in tmp_path.glob("a.db-replaced*") if created(each) == "since"]
        assert created(filled) == "since" or kept
        restore(url, backup)
        assert created(filled) != "since"


def created(path: Path) -> str:
    with closing(find_database(f"sqlite:///{path}")) as database, database.reading() as connection:
        clutch = clutches.get(connection, "c1")
    assert clutch is not None
    return clutch.created_at


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
        longest = duration(lambda: adopt_on(url))
        for kill in range(number):
            for left in tmp_path.glob("a.db*"):
                left.unlink()
            shutil.copyfile(tmp_path / "before.db", tmp_path / "a.db")
            ended = killed_after(longest * kill / number, lambda: adopt_on(url))
            with closing(open_database(url)) as database, database.reading() as connection:
                versions = assumptions.adoptions_of(connection, "c1")
            assert len(versions) in ((1,) if ended else (0, 1))
            assert findings(tmp_path / "a.db") == []


def adopt_on(url: str) -> None:
    with closing(open_database(url)) as database:
        adopt(database, "c1", "d0", "2026-11-02T10:00:00+00:00")
