"""Every table of `storage/tables.py` goes from one database into another and back, whatever interrupts it."""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from storage import transfer as transfers
from storage.engine.errors import ServiceRuns, TargetInUse, UnfinishedMigration
from storage.engine.opening import find_database, open_database, service_lock
from storage.tables import metadata
from storage.transfer import digest, transfer
from tests.storage.engine.postgresql.server import PostgresServer
from tests.support import one_quick

ROWS = 7
#: Where a row has a number, these: the last digits, the smallest, the largest and a whole one, which SQLite packs.
NUMBERS = (0.1, 5e-324, -1.7976931348623157e308, 3.0, 1 / 3, -0.1, 2.0**60)


def value(column: sa.Column[Any], number: int) -> Any:
    """A value of a column in the row of that number: keys go up, and foreign keys point at rows that are there."""
    if isinstance(column.type, sa.LargeBinary):
        return bytes(range(256)) * number
    if isinstance(column.type, sa.Integer):
        return 10 * number
    if isinstance(column.type, sa.Text):
        return f"Ö\U0001f600 {number}"
    if column.nullable and number == 2:
        return None
    return float(number) if column.primary_key else NUMBERS[number % len(NUMBERS)]


def fill(url: str) -> None:
    """Rows in every table."""
    with closing(open_database(url)) as database, database.writing() as connection:
        for table in metadata.sorted_tables:
            rows = [{column.name: value(column, number) for column in table.columns} for number in range(1, ROWS + 1)]
            connection.execute(sa.insert(table), rows)


def digests(url: str) -> dict[str, tuple[int, str]]:
    with closing(find_database(url)) as database, database.reading() as connection:
        return {table.name: digest(connection, table) for table in metadata.sorted_tables}


def moved(source: str, target: str) -> list[str]:
    """A whole migration; what differs."""
    with transfer(source, target) as moving:
        moving.copy()
        differing = moving.differing()
        moving.release()
    return differing


@pytest.fixture
def in_file(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/source.db"


@pytest.fixture(params=["file", "server"])
def target(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    if request.param == "file":
        yield f"sqlite:///{tmp_path}/target.db"
        return
    postgresql: PostgresServer = request.getfixturevalue("postgresql")
    url = postgresql.empty()
    yield url
    postgresql.drop(url)


def test_there_and_back_every_table_is_the_same(in_file: str, target: str, tmp_path: Path) -> None:
    fill(in_file)
    assert moved(in_file, target) == []
    back = f"sqlite:///{tmp_path}/back.db"
    assert moved(target, back) == []
    before = digests(in_file)
    assert before == digests(target) == digests(back)
    assert {rows for rows, _ in before.values()} == {ROWS}
    assert len({sha256 for _, sha256 in before.values()}) == len(metadata.sorted_tables)


def test_a_key_that_a_database_gives_after_a_migration_is_a_new_one(in_file: str, target: str) -> None:
    fill(in_file)
    moved(in_file, target)
    with closing(open_database(target)) as database, database.writing() as connection:
        for table in metadata.sorted_tables:
            key = table.autoincrement_column
            if key is None or key.foreign_keys:
                continue
            row = {
                column.name: value(column, 1 if column.foreign_keys else ROWS + 1)
                for column in table.columns
                if column is not key
            }
            given = connection.execute(sa.insert(table).returning(key), row).scalar_one()
            assert given == 10 * ROWS + 1, table.name


def killed(source: str, target: str, after: int) -> None:
    """A migration whose process is killed after so many batches."""
    transfers.MAX_ROWS = 2
    batches = 0

    def advance(_: str, rows: int) -> None:
        nonlocal batches
        batches += rows > 0
        if batches == after:
            os.kill(os.getpid(), signal.SIGKILL)

    with transfer(source, target) as moving:
        moving.copy(advance)


@pytest.mark.parametrize("target", one_quick(["server", "file"]), indirect=True)
def test_a_killed_migration_goes_on_where_it_was_and_is_used_by_nobody_before(
    in_file: str, target: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(in_file)
    batches = 4 * len(metadata.sorted_tables)
    for after in (1, 3, 4, batches // 2):
        process = multiprocessing.get_context("forkserver").Process(target=killed, args=(in_file, target, after))
        process.start()
        process.join()
        assert process.exitcode == -signal.SIGKILL
        with pytest.raises(
            UnfinishedMigration, match=r"a migration from the file .*source\.db into this database is not finished"
        ):
            open_database(target)
        with pytest.raises(UnfinishedMigration):
            find_database(target)
    monkeypatch.setattr(transfers, "MAX_ROWS", 2)
    stored: list[tuple[str, int]] = []
    with transfer(in_file, target) as moving:
        assert moving.rows() == ROWS * len(metadata.sorted_tables)
        moving.copy(lambda name, rows: stored.append((name, rows)))
        assert moving.differing() == []
        moving.release()
    assert sum(rows for _, rows in stored) == ROWS * len(metadata.sorted_tables)
    first = metadata.sorted_tables[0].name
    assert [rows for name, rows in stored if name == first] == [ROWS], "what was there was not copied again"
    assert digests(target) == digests(in_file)


def test_a_row_that_was_changed_on_the_way_is_found(in_file: str, target: str) -> None:
    fill(in_file)
    with transfer(in_file, target) as moving:
        moving.copy()
        with moving.target.writing() as connection:
            connection.execute(sa.text("UPDATE fit SET rmse = 0.3333333333333334 WHERE run_key = 40"))
            connection.execute(sa.text("DELETE FROM corrected_cof WHERE run_key = 20"))
        found = moving.differing()
    assert [line.split(":")[0] for line in found] == ["table corrected_cof", "table fit"]
    assert f"{ROWS} rows of sha256" in found[0]
    assert f"became {ROWS - 1} of" in found[0]


def test_a_target_with_other_content_and_another_source_are_refused(in_file: str, target: str, tmp_path: Path) -> None:
    fill(in_file)
    fill(target)
    before = digests(target)
    with pytest.raises(TargetInUse, match=r"has rows in .*clutch.*: the target of a migration must be empty"):
        moved(in_file, target)
    assert digests(target) == before
    other, begun = f"sqlite:///{tmp_path}/other.db", f"sqlite:///{tmp_path}/begun.db"
    fill(other)
    with transfer(in_file, begun):
        pass
    with pytest.raises(TargetInUse, match=r"an unfinished migration from the file .*source\.db, not from"):
        moved(other, begun)


@pytest.mark.slow
def test_it_is_refused_while_a_service_runs_on_either_side(in_file: str, target: str) -> None:
    fill(in_file)
    for used in (in_file, target):
        if used == target:
            open_database(target).close()
        with (
            service_lock(used),
            closing(open_database(used, serving=True)),
            pytest.raises(ServiceRuns, match="a service uses this database"),
        ):
            moved(in_file, target)
    assert moved(in_file, target) == []
