"""Rows to store, each recognisable by its number."""

import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection, text, true

from storage import clutches, raw_columns, results, runs
from storage.clutches import ClutchRow
from storage.diagnoses import DiagnosisRow
from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.migrations import upgrade as migrations
from storage.results import FitRow
from storage.rows import allow_damage, amend
from storage.runs import RunRow
from storage.tables import CHECKSUM, clutch, metadata

CLUTCH = "bench3-017"


def clutch_row(clutch_id: str = CLUTCH, *, rank: float = 0.0) -> ClutchRow:
    return ClutchRow(
        clutch_id=clutch_id,
        record={"clutch_id": clutch_id, "geometry": {"inner_diameter_mm": 99}, "fluid": "Öl"},
        content_sha256="ab" * 32,
        created_at="2026-11-02T08:00:00+00:00",
        revision=0,
        rank=rank,
        summary={"health": None},
    )


def new_run(number: int = 0, *, clutch_id: str = CLUTCH, cycles: float | None = None) -> RunRow:
    return RunRow(
        clutch_id=clutch_id,
        run_id=f"run-{number:04d}",
        kind="stationary_stribeck",
        cycles=1000.0 * number if cycles is None else cycles,
        started_at=None if number % 2 else "2026-11-02T08:00:00+01:00",
        received_at="2026-11-02T09:00:00+00:00",
        content_sha256=f"{number:064x}",
        details={"origin": "file", "duty": None},
        receipt={"run_id": f"run-{number:04d}", "mean_cof": 0.1 + 0.2},
        code_version="0.1.0",
    )


def new_diagnosis(number: int, clutch_id: str = CLUTCH, *, last_run_key: int = 1) -> DiagnosisRow:
    return DiagnosisRow(
        clutch_id=clutch_id,
        diagnosis_id=f"d{number}",
        created_at="2026-11-02T10:00:00+00:00",
        revision=3,
        last_run_key=last_run_key,
        life="",
        as_of_cycles=None if number % 2 else 1000.0,
        code_version="0.1.0",
    )


def columns(number: int, length: int = 40) -> dict[str, NDArray[np.float64]]:
    rng = np.random.default_rng(number)
    return {name: rng.standard_normal(length) for name in ("torque_nm", "pressure_bar", "speed_rpm")}


def fit_row(pressure: float, **changed: Any) -> FitRow:
    row = FitRow(
        pressure=pressure,
        mean_pressure=pressure + 12.5,
        static_torque=25.1,
        coulomb_ratio=0.8,
        stribeck_velocity=1.2,
        viscous_coefficient=-0.3,
        covariance=tuple(float(i) / 7 for i in range(16)),
        unbiased_covariance=tuple(float(i) / 9 for i in range(16)),
        status="at_bound",
        undetermined=("stribeck_velocity",),
        noise=0.1,
        mse_percent=1.7,
        rmse=0.11,
        points=40,
        speeds=39,
        mean_cof=0.12,
        mean_cof_sd=0.001,
        message="the Stribeck velocity lies at its bound",
        code_version="0.1.0",
        acceptable=True,
        measured=(0.5, 1.0, 20.0, 19.5, 1.0, 39.0),
    )
    return replace(row, **changed)


@cache
def _empty() -> bytes:
    with TemporaryDirectory() as folder:
        open_database(f"sqlite:///{folder}/empty.db").close()
        return Path(folder, "empty.db").read_bytes()


def lay_empty(path: Path) -> None:
    """A file with all tables, where there is none: a copy, for every migration of an empty file takes 0.1 s."""
    if not path.exists():
        path.touch(0o600)
        path.write_bytes(_empty())


def read_from(database: Database, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """What a function of storage reads, in a transaction of its own."""
    with database.reading() as connection:
        return function(connection, *arguments, **named)


def write_to(database: Database, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Have a function of storage write, in a transaction of its own; what it returns."""
    with database.writing() as connection:
        return function(connection, *arguments, **named)


def store_run(connection: Connection, number: int, *, length: int = 40) -> int:
    """One accepted run as a change writes it: the run, its channels and the clutch's revision."""
    run_key = runs.insert(connection, new_run(number))
    raw_columns.write(connection, run_key, raw_columns.encoded(columns(number, length)))
    clutches.bump_revision(connection, CLUTCH)
    return run_key


@contextmanager
def child(script: str, *arguments: object) -> Iterator[tuple["subprocess.Popen[str]", IO[str], IO[str]]]:
    """A process that runs `script`, what it reads and what it says; killed at the end at the latest."""
    command = [sys.executable, "-c", script, *map(str, arguments)]
    root = Path(__file__).parents[2]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=root) as process:
        try:
            yield process, process.stdin, process.stdout
        finally:
            process.kill()


#: The revision of the first release; `later_step` gives the newest one more.
OLD = "s0001_first_tables"
_LATER = Path(__file__).parent / "later_step"


@contextmanager
def later_step() -> Iterator[None]:
    """The code of a later release, with one step more, inside."""
    plain = migrations.FOLDERS
    migrations.FOLDERS = (*plain, _LATER)
    try:
        for known in (migrations.head, migrations.revisions):
            known.cache_clear()
        yield
    finally:
        migrations.FOLDERS = plain
        for known in (migrations.head, migrations.revisions):
            known.cache_clear()


def old_database(folder: Path) -> Path:
    """A file that the first release has left, at revision OLD, with a clutch; one file without a log."""
    path = folder / "old.db"
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.executescript(Path(__file__).with_name("first_release.sql").read_text(encoding="utf-8"))
        connection.execute("INSERT INTO alembic_version VALUES (?)", (OLD,))
        connection.execute(
            "INSERT INTO clutch (clutch_id, record, content_sha256, created_at, revision, rank, summary) "
            "VALUES ('bench3-017', '{\"clutch_id\": \"bench3-017\"}', '', '', 0, 0, '{}')"
        )
    return path


def revision(path: Path) -> str:
    """The revision that a file is at."""
    with closing(sqlite3.connect(path)) as connection:
        found: str = connection.execute("SELECT version_num FROM alembic_version").fetchone()[0]
    return found


def integrity(path: Path) -> list[str]:
    """What SQLite itself finds wrong with a file: `["ok"]` where nothing."""
    with closing(sqlite3.connect(path)) as connection:
        problems = [row[0] for row in connection.execute("PRAGMA integrity_check")]
        return problems + [str(row) for row in connection.execute("PRAGMA foreign_key_check")]


def reseal(connection: Connection) -> None:
    """Give every row the checksum of what it holds."""
    allow_damage(connection, everywhere=True)
    for table in metadata.sorted_tables:
        if CHECKSUM in table.c:
            amend(connection, table, [true()])
    for clutch_id in clutches.all_ids(connection):
        states_sum = results.states_sum(connection, clutch_id)
        amend(connection, clutch, [clutch.c.clutch_id == clutch_id], states_sum=states_sum)


def take_back(connection: Connection) -> None:
    """Bring a server's database to OLD, keeping what it holds."""
    connection.exec_driver_sql("ALTER TABLE clutch DROP COLUMN IF EXISTS later")
    connection.exec_driver_sql("ALTER TABLE job DROP COLUMN IF EXISTS renewals")
    connection.exec_driver_sql("ALTER TABLE job ADD COLUMN IF NOT EXISTS leased_until TEXT")
    for table, column in (("fit", "acceptable"), ("fit", "measured"), ("clutch", "states_sum")):
        connection.exec_driver_sql(f"ALTER TABLE {table} DROP COLUMN IF EXISTS {column}")
    for table in metadata.tables:
        connection.exec_driver_sql(f"ALTER TABLE {table} DROP COLUMN IF EXISTS checksum")
    connection.execute(text("UPDATE alembic_version SET version_num = :before"), {"before": OLD})
