"""From an empty file to the tables, once, whoever comes first; and never backwards."""

import sqlite3
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from models.prognosis.ended_lives import ObservedLife
from storage import assumptions, clutches, diagnoses
from storage.encoding import to_text
from storage.engine.database import Database
from storage.engine.errors import DatabaseTooNew, StorageUnavailable
from storage.engine.opening import open_database
from storage.migrations import upgrade as migrations
from storage.tables import metadata
from tests.storage.samples import (
    CLUTCH,
    OLD,
    child,
    clutch_row,
    integrity,
    new_diagnosis,
    old_database,
    revision,
    write_to,
)


@pytest.fixture
def database(in_file: Database) -> Database:
    """A database on a server starts at the newest revision; tests of its migration are among those of its engine."""
    return in_file


STARTER = """
import sys
import storage.engine.sqlite.connect
import storage.engine.opening
storage.engine.sqlite.connect.JOURNAL_MODE = sys.argv[1]
print("loaded", flush=True)
for line in sys.stdin:
    database = storage.engine.opening.open_database(f"sqlite:///{line.strip()}")
    print(not database.faults(least_free=0), flush=True)
    database.close()
"""


def test_the_migrated_schema_is_that_of_the_tables(database: Database) -> None:
    with database.reading() as connection:
        context = MigrationContext.configure(
            connection, opts={"compare_type": True, "compare_server_default": True, "render_as_batch": True}
        )
        assert compare_metadata(context, metadata) == []
    with database.writing() as connection:  # the comparison can fail
        connection.exec_driver_sql("ALTER TABLE clutch ADD COLUMN forgotten TEXT")
        connection.exec_driver_sql("DROP INDEX run_in_order")
        assert len(compare_metadata(MigrationContext.configure(connection), metadata)) == 2


def test_keys_of_the_migrated_tables_are_those_of_the_metadata(database: Database) -> None:
    """What the comparison above does not look at."""
    with closing(sqlite3.connect(database.path)) as connection:
        for table in metadata.sorted_tables:
            info = connection.execute(f"PRAGMA table_info({table.name})").fetchall()
            keyed = [name for _, name in sorted((row[5], row[1]) for row in info if row[5])]
            assert keyed == [column.name for column in table.primary_key]
            assert [row[1] for row in info] == [column.name for column in table.columns]
            assert [bool(row[3]) for row in info] == [not column.nullable for column in table.columns]


def test_a_second_start_changes_nothing(database: Database) -> None:
    write_to(database, clutches.insert, clutch_row())
    before = database.path.read_bytes()
    with closing(open_database(f"sqlite:///{database.path}")) as again, again.reading() as connection:
        assert clutches.get(connection, CLUTCH) == clutch_row()
        assert migrations.current(connection) == migrations.head()
    assert database.path.read_bytes() == before
    assert list(database.path.parent.glob("*-before-*")) == []


@pytest.mark.usefixtures("later_step")
def test_an_older_file_is_brought_up_keeps_what_it_holds_and_is_kept_as_it_was(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    with closing(open_database(f"sqlite:///{path}")) as new, new.writing() as connection:
        assert migrations.current(connection) == migrations.head() == "s9000_later"
        (row,) = connection.exec_driver_sql("SELECT clutch_id, later FROM clutch").fetchall()
        assert tuple(row) == (CLUTCH, None)
        assert clutches.get(connection, CLUTCH) is not None, "it has its checksum"
        diagnoses.insert(connection, new_diagnosis(0))
        assert diagnoses.running(connection, CLUTCH, 1) == ["d0"]
    kept = path.with_name(f"old.db-before-{migrations.head()}")
    assert (revision(kept), integrity(path), integrity(kept)) == (OLD, ["ok"], ["ok"])
    with closing(sqlite3.connect(kept)) as old:
        assert old.execute("SELECT clutch_id FROM clutch").fetchall() == [(CLUTCH,)]
        assert "later" not in {row[1] for row in old.execute("PRAGMA table_info(clutch)")}
    open_database(f"sqlite:///{path}").close()
    assert [each.name for each in tmp_path.glob("*-before-*")] == [kept.name]


def test_ended_lives_that_were_stored_before_they_had_a_law_can_be_read(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    ended = {"end": 9e3, "fraction": 0.5, "progress": [0.0, 4e3], "damage": [0.0, 0.3], "energy": None}
    ended |= {"deviation": 0.0, "censored": False}
    content = to_text({"clutches": 3, "ended": [ended], "censored": [ended | {"censored": True}]})
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("INSERT INTO fleet_prior VALUES ('{}', 1, '', '', '[]', ?, '1.0.0')", (content,))
    with closing(open_database(f"sqlite:///{path}")) as database, database.reading() as connection:
        (row,) = assumptions.current_fleet_priors(connection)
    lives = [ObservedLife.from_dict(life) for name in ("ended", "censored") for life in row.content[name]]
    unknown = ended | {"laws": [0.0] * 6}
    assert [life.to_dict() for life in lives] == [unknown, unknown | {"censored": True}]


def test_a_file_of_the_last_step_is_as_it_is(tmp_path: Path) -> None:
    """Files were brought to this step by way of another that was never released."""
    path = old_database(tmp_path)
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = 's0003_laws_of_ended_lives'")
    with closing(open_database(f"sqlite:///{path}")) as database, database.reading() as connection:
        assert clutches.get(connection, CLUTCH) is not None
        assert migrations.current(connection) == migrations.head()


def test_steps_are_one_line_and_named_after_their_files() -> None:
    scripts = ScriptDirectory(Path(migrations.__file__).parent)
    steps = list(scripts.walk_revisions())
    assert [Path(step.path).stem for step in steps] == [step.revision for step in steps]
    assert all(step.doc and len(step.revision) <= 32 for step in steps)
    assert migrations.revisions() == {step.revision for step in steps}
    assert migrations.head() == scripts.get_current_head()


def test_a_newer_database_is_refused_and_left_alone(database: Database) -> None:
    with database.writing() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = 's9999_from_the_future'")
    before = database.path.read_bytes()
    with pytest.raises(DatabaseTooNew, match=r"s9999_from_the_future, .* knows only up to s\d{4}_"):
        open_database(f"sqlite:///{database.path}")
    assert database.path.read_bytes() == before
    assert database.faults(least_free=0)


def test_a_step_that_fails_leaves_the_file_empty(tmp_path: Path) -> None:
    path = tmp_path / "foreign.db"
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("CREATE TABLE prediction (of_a_ball TEXT)")  # what the step cannot make again
    with pytest.raises(Exception, match="table prediction already exists"):
        open_database(f"sqlite:///{path}")
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("SELECT name FROM sqlite_master").fetchall() == [("prediction",)]


def test_a_step_that_breaks_references_is_undone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def breaking(connection: object) -> None:
        migrations.upgrade(connection)  # type: ignore[arg-type]
        connection.exec_driver_sql("INSERT INTO prediction VALUES ('nobody', 'q', 0, 0, '{}', '', 0)")  # type: ignore[attr-defined]

    monkeypatch.setattr("storage.engine.sqlite.database.upgrade", breaking)
    with pytest.raises(StorageUnavailable, match="refer to missing rows"):
        open_database(f"sqlite:///{tmp_path}/a.db")
    monkeypatch.undo()
    with closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        assert integrity(database.path) == ["ok"]


def test_processes_that_start_at_once_all_succeed(tmp_path: Path, journal_mode: str) -> None:
    with ExitStack() as stack:
        starters = [stack.enter_context(child(STARTER, journal_mode)) for _ in range(3)]
        for _, _, says in starters:
            assert says.readline() == "loaded\n"
        for number in range(6):
            for _, hears, _ in starters:
                print(f"{tmp_path}/{number}.db", file=hears, flush=True)
            assert [says.readline() for _, _, says in starters] == ["True\n"] * 3
    assert integrity(tmp_path / "0.db") == ["ok"]


@pytest.mark.usefixtures("later_step")
def test_a_migration_that_is_tried_again_replaces_no_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same content is kept once; a file that was worked on in between is kept beside it."""
    path = old_database(tmp_path)
    with monkeypatch.context() as failing:
        failing.setattr("storage.engine.sqlite.database.upgrade", lambda _: 1 / 0)
        for _ in range(2):
            with pytest.raises(ZeroDivisionError):
                open_database(f"sqlite:///{path}")
    name = f"old.db-before-{migrations.head()}"
    first = (tmp_path / name).read_bytes()
    assert [each.name for each in tmp_path.glob("*-before-*")] == [name]
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("UPDATE clutch SET created_at = 'later'")
    open_database(f"sqlite:///{path}").close()
    assert sorted(each.name for each in tmp_path.glob("*-before-*")) == [name, f"{name}.2"]
    assert (tmp_path / name).read_bytes() == first
