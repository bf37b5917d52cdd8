"""From an empty file to the tables, once, whoever comes first; and never backwards."""

import sqlite3
from contextlib import ExitStack, closing
from dataclasses import fields
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, insert

from storage import channels, clutches, diagnoses, runs, tables
from storage.encoding.json_text import to_text
from storage.engine.database import Database
from storage.engine.errors import DatabaseTooNew, StorageUnavailable
from storage.engine.integrity import other_schema
from storage.engine.opening import open_database
from storage.migrations import upgrade as migrations
from storage.tables import metadata
from tests.storage.engine.postgresql.server import PostgresServer
from tests.storage.samples import (
    OLD,
    child,
    clutch_row,
    columns,
    integrity,
    new_diagnosis,
    new_run,
    old_database,
    revision,
    store_run,
    take_back,
)

CLUTCH = "bench3-017"

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


def test_a_column_that_no_step_makes_would_be_noticed(database: Database) -> None:
    with database.writing() as connection:
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
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())
    before = database.path.read_bytes()
    with closing(open_database(f"sqlite:///{database.path}")) as again, again.reading() as connection:
        assert clutches.get(connection, "bench3-017") == clutch_row()
        assert migrations.current(connection) == migrations.head()
    assert database.path.read_bytes() == before


def insert_as_before(connection: Connection) -> None:
    """A clutch and a run as the first release stored them, in the columns that it had."""
    row = {field.name: getattr(clutch_row(), field.name) for field in fields(clutch_row())}
    for name in ("archived", "registered", "state", "disputed", "silent"):
        del row[name]
    row |= {name: to_text(row[name]) for name in ("record", "summary")}
    connection.execute(insert(tables.clutch), row)
    sent = {field.name: getattr(new_run(1), field.name) for field in fields(new_run(1))}
    for name in ("state", "sent_cycles", "doubts", "received_by"):
        del sent[name]
    sent |= {name: to_text(sent[name]) for name in ("details", "receipt")}
    connection.execute(insert(tables.run), sent)


def test_an_older_file_is_brought_up_and_keeps_what_it_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "old.db"
    whole = command.upgrade
    monkeypatch.setattr(command, "upgrade", lambda config, _: whole(config, "s0001_first_tables"))
    with closing(open_database(f"sqlite:///{path}")) as old, old.writing() as connection:
        insert_as_before(connection)
    monkeypatch.undo()
    with closing(sqlite3.connect(path)) as connection:
        names = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        assert "diagnosis" not in names
        assert connection.execute("SELECT version_num FROM alembic_version").fetchall() == [("s0001_first_tables",)]
    with closing(open_database(f"sqlite:///{path}")) as new, new.writing() as connection:
        assert migrations.current(connection) == migrations.head()
        assert clutches.get(connection, CLUTCH) == clutch_row()
        (row,) = runs.page(connection, CLUTCH)
        assert (row.run_id, row.state, row.sent_cycles, row.doubts) == ("run-0001", "accepted", None, ())
        assert [row.run_id for row in runs.in_order(connection, CLUTCH)] == ["run-0001"]
        diagnoses.insert(connection, new_diagnosis(0))
        assert diagnoses.running(connection, CLUTCH, 1) == "d0"
    assert integrity(path) == ["ok"]


def test_a_report_of_an_earlier_release_reads_with_the_new_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports of earlier releases hold a gain's former key; its value, other keys and quoted text stay as they are."""
    path = tmp_path / "old.db"
    whole = command.upgrade
    monkeypatch.setattr(command, "upgrade", lambda config, _: whole(config, "s0003_fleet_priors"))
    former = "foretelling_log_score_gain"
    notes = [f'the key "{former}": of an earlier release']
    with closing(open_database(f"sqlite:///{path}")) as old, old.writing() as connection:
        insert_as_before(connection)
        for number in range(3):
            diagnoses.insert(connection, new_diagnosis(number))
        diagnoses.finish(connection, "d0", "later", {"gain": {"log_score_gain": 2.5, former: 1.25}, "notes": notes}, {})
        diagnoses.finish(connection, "d1", "later", {"gain": {former: None}}, None)
    monkeypatch.undo()
    with closing(open_database(f"sqlite:///{path}")) as new, new.reading() as connection:
        reports = {row.diagnosis_id: row.report for row in diagnoses.page(connection, CLUTCH, limit=10)}
    gain = {"log_score_gain": 2.5, "prediction_log_score_gain": 1.25}
    assert reports == {
        "d0": {"gain": gain, "notes": notes},
        "d1": {"gain": {"prediction_log_score_gain": None}},
        "d2": None,
    }


def test_steps_are_one_line_and_named_after_their_files() -> None:
    steps = list(ScriptDirectory.from_config(migrations._config()).walk_revisions())
    assert [Path(step.path).stem for step in steps] == [step.revision for step in steps]
    assert all(step.doc and len(step.revision) <= 32 for step in steps)
    assert {path.stem for path in Path(migrations.__file__).parent.glob("versions/s*.py")} == {
        s.revision for s in steps
    }


def test_a_newer_database_is_refused_and_left_alone(database: Database) -> None:
    with database.writing() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = 's9999_from_the_future'")
    before = database.path.read_bytes()
    with pytest.raises(DatabaseTooNew, match=r"s9999_from_the_future, .* knows up to s\d{4}_"):
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
        connection.exec_driver_sql("INSERT INTO prediction VALUES ('nobody', 'q', 0, 0, '{}', '')")  # type: ignore[attr-defined]

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


def test_a_migration_keeps_a_copy_of_the_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = old_database(tmp_path, monkeypatch)
    kept = path.with_name(f"old.db-before-{migrations.head()}")
    open_database(f"sqlite:///{path}").close()
    assert (revision(path), revision(kept), integrity(kept)) == (migrations.head(), OLD, ["ok"])
    with closing(sqlite3.connect(kept)) as connection:
        assert connection.execute("SELECT clutch_id FROM clutch").fetchall() == [("bench3-017",)]
    open_database(f"sqlite:///{path}").close()
    assert [each.name for each in tmp_path.glob("*-before-*")] == [kept.name]


def test_a_migration_that_is_tried_again_replaces_no_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same content is kept once; a file that was worked on in between is kept beside it."""
    path = old_database(tmp_path, monkeypatch)
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


def test_a_new_file_needs_no_copy(database: Database) -> None:
    assert list(database.path.parent.glob("*-before-*")) == []


def test_a_server_of_an_earlier_release_is_brought_up(postgresql: PostgresServer) -> None:
    """The first revision that PostgreSQL had, with a run; its channels stay in the database."""
    url = postgresql.fresh()
    with closing(open_database(url)) as old, old.writing() as connection:
        clutches.insert(connection, clutch_row())
        run_key = store_run(connection, 1)
        take_back(connection, "s0007_inspections")
    with closing(open_database(url)) as new, new.reading() as connection:
        assert migrations.current(connection) == migrations.head()
        assert other_schema(connection) == []
        kept = channels.read(connection, run_key)
        assert all(kept[name].tobytes() == column.tobytes() for name, column in columns(1).items())
        collations = connection.exec_driver_sql(
            "SELECT count(*) FROM information_schema.columns WHERE collation_name = 'C' "
            "AND (table_name, column_name) IN (('channel', 'blob'), ('raw_store', 'address'), ('raw_removal', 'blob'))"
        ).scalar_one()
        assert collations == 3
    postgresql.drop(url)
