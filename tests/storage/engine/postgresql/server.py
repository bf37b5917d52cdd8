"""A PostgreSQL server for tests: in a folder of its own, of an ordinary user, reached by a socket in that folder."""

import os
import pwd
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

import pytest
import sqlalchemy as sa

from storage.engine.postgresql.database import open_server

MISSING = "PostgreSQL is not installed: on Debian and Ubuntu, apt install postgresql"
#: PostgreSQL refuses to run as root: then it is that of one of these users.
ORDINARY = ("postgres", "nobody")
#: What is lost without these two is what a power cut takes; tests cut no power.
SETTINGS = {"fsync": "off", "full_page_writes": "off", "listen_addresses": "", "max_connections": "200"}
TEMPLATE = "template_of_tests"


def programs() -> Path | None:
    """The folder of the server's programs, None where PostgreSQL is not installed."""
    places = [Path(found).parent for name in ("initdb", "postgres") if (found := shutil.which(name))]
    if shutil.which("pg_config"):
        shown = subprocess.run(["pg_config", "--bindir"], capture_output=True, text=True, check=False)
        places.append(Path(shown.stdout.strip()))
    places += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    needed = ("initdb", "postgres", "pg_isready")
    return next((place for place in places if all((place / name).exists() for name in needed)), None)


class PostgresServer:
    """A server; `start` and `stop` it, `kill` it as a crash would."""

    def __init__(self, folder: Path, **settings: str) -> None:
        place = programs()
        if place is None:
            pytest.skip(MISSING)
        self.programs = place
        self.folder = folder
        self.settings = SETTINGS | settings
        self.process: subprocess.Popen[bytes] | None = None
        self.user = "postgres"
        self._identity = {}
        self._made = 0
        if os.getuid() == 0:
            owner = next(pwd.getpwnam(name) for name in ORDINARY if name in {each.pw_name for each in pwd.getpwall()})
            os.chown(folder, owner.pw_uid, owner.pw_gid)
            self._identity = {"user": owner.pw_uid, "group": owner.pw_gid, "extra_groups": []}
        initdb = [place / "initdb", "--pgdata", folder / "data", "--username", self.user, "--auth", "trust"]
        encoding = ["--encoding", "UTF8", "--locale", "C.UTF-8", "--no-sync"]
        subprocess.run([*initdb, *encoding], check=True, capture_output=True, cwd=folder, **self._identity)

    def start(self) -> None:
        """Start and wait until it answers."""
        settings = [part for name, value in self.settings.items() for part in ("-c", f"{name}={value}")]
        command = [self.programs / "postgres", "-D", self.folder / "data", "-k", self.folder, *settings]
        with (self.folder / "log").open("ab") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log, cwd=self.folder, **self._identity)
        deadline = time.monotonic() + 60
        ready = [self.programs / "pg_isready", "--host", self.folder, "--quiet"]
        while subprocess.run(ready, check=False).returncode != 0:
            assert self.process.poll() is None, (self.folder / "log").read_text()
            assert time.monotonic() < deadline, "PostgreSQL was not ready within 60 s"
            time.sleep(0.02)

    def kill(self) -> None:
        """An immediate shutdown: nothing is written any more, the next start recovers from the log."""
        self._end(signal.SIGQUIT)

    def stop(self) -> None:
        """End it with all its sessions."""
        self._end(signal.SIGINT)

    def _end(self, how: signal.Signals) -> None:
        self.process.send_signal(how)
        self.process.wait(60)

    def url(self, name: str) -> str:
        """The address of a database."""
        return f"postgresql+psycopg://{self.user}@/{name}?host={self.folder}"

    def execute(self, statement: str, name: str = "postgres") -> None:
        """Run a statement outside transactions."""
        engine = sa.create_engine(self.url(name), isolation_level="AUTOCOMMIT", poolclass=sa.NullPool)
        with engine.connect() as connection:
            connection.exec_driver_sql(statement)

    def empty(self) -> str:
        """The address of a new database without tables."""
        self._made += 1
        self.execute(f"CREATE DATABASE test_{self._made}")
        return self.url(f"test_{self._made}")

    def make_template(self) -> None:
        """A database with all tables, of which the others are copies."""
        self.execute(f"CREATE DATABASE {TEMPLATE}")
        open_server(sa.make_url(self.url(TEMPLATE)), lock_timeout=10.0).close()

    def fresh(self) -> str:
        """The address of a new database with all tables, empty."""
        self._made += 1
        self.execute(f"CREATE DATABASE test_{self._made} TEMPLATE {TEMPLATE} STRATEGY FILE_COPY")
        return self.url(f"test_{self._made}")

    def drop(self, url: str) -> None:
        """Remove a database, whoever uses it."""
        self.execute(f"DROP DATABASE {sa.make_url(url).database} WITH (FORCE)")


@contextmanager
def postgresql_server(**settings: str) -> Iterator[PostgresServer]:
    """A running server, with other settings than the tests' where they are given, stopped and removed at the end.

    Skips the test where PostgreSQL is not installed.
    """
    folder = Path(mkdtemp(prefix="pg-"))  # the path of a socket must be short
    try:
        server = PostgresServer(folder, **settings)
        server.start()
        try:
            server.make_template()
            yield server
        finally:
            if server.process is not None and server.process.poll() is None:
                server.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
