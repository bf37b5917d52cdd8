"""What the store reports where the file cannot be used."""

from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from storage import clutches
from storage.engine.database import Database
from storage.engine.errors import DatabaseTooOld, StorageUnavailable
from storage.engine.opening import find_database, open_database
from tests.storage.samples import OLD, clutch_row, old_database, store_run


def test_an_unreachable_file_is_named(tmp_path: Path) -> None:
    for path in (tmp_path / "no such folder" / "a.db", tmp_path):
        with pytest.raises(StorageUnavailable, match="cannot be opened") as failure:
            open_database(f"sqlite:///{path}")
        assert str(path) in str(failure.value)


def test_a_file_that_is_no_database_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("not a database, " * 100)
    with pytest.raises(StorageUnavailable, match="is not a database"):
        open_database(f"sqlite:///{path}")
    assert path.read_text() == "not a database, " * 100


def test_a_damaged_file_is_said_to_be_damaged(tmp_path: Path) -> None:
    path = tmp_path / "a.db"
    with closing(open_database(f"sqlite:///{path}")) as database, database.writing() as connection:
        clutches.insert(connection, clutch_row())
    content = bytearray(path.read_bytes())
    content[4096:] = b"\xa5" * (len(content) - 4096)
    path.write_bytes(content)
    with pytest.raises(StorageUnavailable, match="damaged"):
        open_database(f"sqlite:///{path}")


def test_a_full_disk_changes_nothing(database: Database) -> None:
    with database.writing() as connection:
        clutches.insert(connection, clutch_row())

    def overfill() -> None:
        with database.writing() as connection:
            pages = connection.exec_driver_sql("PRAGMA page_count").scalar_one()
            connection.exec_driver_sql(f"PRAGMA max_page_count={pages}")
            store_run(connection, 0, length=10_000)

    with pytest.raises(StorageUnavailable, match="full"):
        overfill()
    with database.writing() as connection:
        connection.exec_driver_sql("PRAGMA max_page_count=1000000")
        assert clutches.get(connection, "bench3-017") == clutch_row()
        store_run(connection, 0, length=10_000)


def test_a_read_only_database_is_said_to_be_so(database: Database) -> None:
    def write() -> None:
        with database.writing() as connection:
            connection.exec_driver_sql("PRAGMA query_only=ON")
            clutches.insert(connection, clutch_row())

    with pytest.raises(StorageUnavailable, match="read-only"):
        write()


def test_a_mistake_in_the_program_is_not_disguised(database: Database) -> None:
    with pytest.raises(OperationalError, match="no such table"), database.reading() as connection:
        connection.execute(text("SELECT * FROM no_such"))


@pytest.mark.usefixtures("later_step")
def test_a_found_database_is_read_at_its_own_revision_and_never_changed(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    before = path.read_bytes()
    with closing(find_database(f"sqlite:///{path}")) as found:
        with found.reading() as connection:
            assert connection.exec_driver_sql("SELECT count(*) FROM clutch").scalar() == 1
        with pytest.raises(DatabaseTooOld, match=rf"{OLD}, this program needs s\d{{4}}_.*clutchlife serve"):  # noqa: SIM117
            with found.reading() as connection:
                connection.exec_driver_sql("SELECT later FROM clutch")
        with pytest.raises(StorageUnavailable, match="read-only"), found.writing() as connection:
            connection.exec_driver_sql("DELETE FROM clutch")
    assert path.read_bytes() == before


def test_nothing_is_found_where_there_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(StorageUnavailable, match="cannot be opened"):
        find_database(f"sqlite:///{tmp_path}/none.db")
    assert not (tmp_path / "none.db").exists()
