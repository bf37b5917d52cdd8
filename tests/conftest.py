"""What holds for all tests: how long a property's inputs take to draw is the machine's affair, and fails nothing.

And the one PostgreSQL server, and the one that speaks S3, of those that need it; a database of its own for every test, a
file or one on the server; a place of its own for raw records, a folder or a bucket."""

import gc
import subprocess
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from service.jobs import process
from storage.blobs.stores import open_store
from storage.engine.database import Database
from storage.engine.opening import open_database
from tests.storage.blobs.stores import new_bucket, s3_server, use_endpoint
from tests.storage.engine.postgresql.server import PostgresServer, postgresql_server
from tests.storage.samples import later_step, lay_empty
from tests.support import FORKING

settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


#: Fixtures, and values of fixtures, that start a server or a browser.
OUTSIDE = {"postgresql", "s3", "on_server", "in_bucket", "browser", "server"}
#: Folders, files and tests that take longer than 0.1 s of the processor; `make quick ARGS=--durations=20` shows what belongs
#: here.
LONG = frozenset(Path(__file__).with_name("long.txt").read_text(encoding="utf-8").split())


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """`make quick` does not import a file of which it would run nothing."""
    named = collection_path.relative_to(config.rootpath).as_posix()
    return True if "not long" in config.option.markexpr and named in LONG else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What needs more than its own process is marked `outside`: `make quick` leaves it out. Tests of the service that say
    the same of a server again are slow; those of storage run on both databases in every run."""
    for item in items:
        drawn = getattr(getattr(item, "callspec", None), "params", {})
        used = {*getattr(item, "fixturenames", ()), *(value for value in drawn.values() if isinstance(value, str))}
        if used & OUTSIDE or "journeys" in item.path.parts:
            item.add_marker("outside")
        if item.nodeid.partition("[")[0] in LONG:
            item.add_marker("long")
        if "on_server" in used and "/tests/service/" in item.path.as_posix():
            item.add_marker("slow")


def pytest_collection_finish() -> None:
    """What was collected stays: nothing is gained by looking through it again and again for what can go."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _forked_jobs() -> Iterator[None]:
    """Processes of jobs are forked off one that has loaded the library, here as in services that are forked: most of what
    a stand-in's job takes is loading. `own_processes` has them begun as a service does."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(process, "subprocess", FORKING)
        yield


@pytest.fixture
def own_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "subprocess", subprocess)


@pytest.fixture(scope="session")
def postgresql() -> Iterator[PostgresServer]:
    with postgresql_server() as server:
        yield server


@pytest.fixture(name="later_step")
def _later_step() -> Iterator[None]:
    """The code of a later release, with one migration more."""
    with later_step():
        yield


@pytest.fixture
def in_file(tmp_path: Path) -> Iterator[Database]:
    lay_empty(tmp_path / "clutches.db")
    with closing(open_database(f"sqlite:///{tmp_path}/clutches.db")) as opened:
        yield opened


@pytest.fixture
def on_server(postgresql: PostgresServer) -> Iterator[Database]:
    url = postgresql.fresh()
    with closing(open_database(url)) as opened:
        yield opened
    postgresql.drop(url)


@pytest.fixture(params=["in_file", "on_server"])
def database(request: pytest.FixtureRequest) -> Database:
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="session")
def s3() -> Iterator[str]:
    with s3_server() as endpoint:
        yield endpoint


@pytest.fixture
def in_folder(tmp_path: Path) -> str:
    return f"folder://{tmp_path}/raw"


@pytest.fixture
def in_bucket(s3: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    use_endpoint(monkeypatch, s3)
    yield new_bucket(s3)
    open_store.cache_clear()


@pytest.fixture(params=["in_folder", "in_bucket"])
def raw_address(request: pytest.FixtureRequest) -> str:
    """Where raw records go: each kind of store."""
    return request.getfixturevalue(request.param)
