"""What keys protect is not readable by other users of the machine: the database, its log, its lock and its backups."""

import os
import stat
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from storage import clutches
from storage.engine.opening import open_database, service_lock
from storage.engine.sqlite.backup import copy
from tests.storage.samples import clutch_row


@pytest.fixture(autouse=True)
def _open_to_all() -> Iterator[None]:
    """The mask of a careless machine, under which what is made without a mode is open to all."""
    before = os.umask(0)
    yield
    os.umask(before)


def modes(folder: Path) -> dict[str, str]:
    return {path.name: oct(stat.S_IMODE(path.stat().st_mode)) for path in folder.iterdir()}


def test_other_users_read_no_file_of_a_new_database(tmp_path: Path) -> None:
    with service_lock(f"sqlite:///{tmp_path}/a.db"), closing(open_database(f"sqlite:///{tmp_path}/a.db")) as database:
        with database.writing() as connection:
            clutches.insert(connection, clutch_row())
        copy(tmp_path / "a.db", tmp_path / "backup.db", lock_timeout=1.0)
        found = modes(tmp_path)
    assert {"a.db", "a.db-wal", "a.db-shm", "a.db-lock", "a.db-service", "backup.db"} <= found.keys()
    assert set(found.values()) == {"0o600"}
    (tmp_path / "control").touch()
    assert modes(tmp_path)["control"] == "0o666", "the mask hides what is to be seen"


def test_a_mode_that_an_operator_chose_stays(tmp_path: Path) -> None:
    open_database(f"sqlite:///{tmp_path}/a.db").close()
    (tmp_path / "a.db").chmod(0o640)
    open_database(f"sqlite:///{tmp_path}/a.db").close()
    assert modes(tmp_path)["a.db"] == "0o640"
