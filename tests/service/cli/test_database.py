"""Backup, restore, verify and replay, as an operator sees them; a command that only reads changes nothing."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.settings import Settings
from storage.engine.sqlite.connect import service_lock
from tests.service.clients import client_on, clutchlife
from tests.storage.samples import OLD, integrity, old_database, revision
from tests.support import stationary


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with the clutches a, b and c, of which b has tests."""
    path = tmp_path_factory.mktemp("stored") / "clutchlife.db"
    with client_on(f"sqlite:///{path}") as client:
        for clutch_id in "abc":
            assert client.post("/v1/clutches", json={"clutch_id": clutch_id}).status_code == 201
            assert client.post(f"/v1/clutches/{clutch_id}/runs", json=stationary(0, run_id="s0")).status_code == 201
    return path


@pytest.fixture
def path(stored: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may change."""
    clutchlife("backup", tmp_path / "a.db", "--database", f"sqlite:///{stored}")
    return tmp_path / "a.db"


def execute(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        assert connection.execute(statement).rowcount > 0


@pytest.mark.usefixtures("later_step")
def test_commands_that_read_leave_an_older_file_as_it_is(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    before, url = path.read_bytes(), ("--database", f"sqlite:///{path}")
    names = sorted(each.name for each in tmp_path.iterdir())
    clutchlife("backup", tmp_path / "copy.db", *url)
    assert "no prior has been learned" in clutchlife("fleet", *url)
    assert f"is at revision {OLD}: its runs can be checked only at" in clutchlife("verify", *url, code=1)
    assert path.read_bytes() == before
    assert sorted(each.name for each in tmp_path.iterdir()) == ["copy.db", *names]
    assert revision(tmp_path / "copy.db") == OLD
    clutchlife("replay", *url)  # it writes, so it migrates, and keeps a copy
    kept = [each.name for each in tmp_path.glob("old.db-before-*")]
    assert (revision(path), kept) == ("s9000_later", ["old.db-before-s9000_later"])


def test_a_database_without_keys_says_so(path: Path) -> None:
    assert clutchlife("key", "list", "--database", f"sqlite:///{path}").strip() == "no key exists"


def test_verify_is_clean_on_what_a_service_stored(path: Path) -> None:
    url = ("--database", f"sqlite:///{path}")
    assert "3 runs of 3 clutches were checked, 3 of the clutches computed again: 0 findings" in clutchlife(
        "verify", *url
    )
    assert "3 clutches were checked, 1 of the clutches computed again" in clutchlife("verify", "--sample", "1", *url)


def test_verify_names_a_damaged_page(path: Path) -> None:
    whole = path.read_bytes()
    page = len(whole) // 2 // 4096 * 4096
    path.write_bytes(whole[:page] + b"\xff" * 4096 + whole[page + 4096 :])
    assert "damaged" in clutchlife("verify", "--database", f"sqlite:///{path}", code=1)


def test_what_needs_a_file_names_what_does_it_on_a_server(tmp_path: Path) -> None:
    url = ("--database", "postgresql+psycopg://u:s3cr3t@127.0.0.1:1/db")
    for command, program in (("backup", "pg_dump"), ("restore", "pg_restore")):
        output = clutchlife(command, tmp_path / "backup.db", *url, code=64)
        assert program in output
        assert "s3cr3t" not in output
    output = clutchlife("verify", *url, code=1)
    assert "the server cannot be used" in output
    assert "s3cr3t" not in output


def test_a_backup_is_restored_unless_a_service_runs(path: Path, tmp_path: Path) -> None:
    url = ("--database", f"sqlite:///{path}")
    clutchlife("backup", tmp_path / "backup.db", *url)
    execute(path, "DELETE FROM prediction")
    with service_lock(path):
        assert "a service uses this database already" in clutchlife("restore", tmp_path / "backup.db", *url, code=1)
    output = clutchlife("restore", tmp_path / "backup.db", *url)
    assert f"kept as {path}-replaced" in output
    clutchlife("verify", *url)
    clutchlife("verify", "--database", f"sqlite:///{path}-replaced", code=1)
    assert integrity(path) == ["ok"]
    assert "there is no backup at" in clutchlife("restore", tmp_path / "none.db", *url, code=64)


def test_replay_goes_on_after_a_clutch_that_it_refuses_and_names_it_at_the_end(path: Path) -> None:
    url = ("--database", f"sqlite:///{path}")
    execute(path, "UPDATE channel SET data = zeroblob(9) WHERE run_key = 1 AND position = 0")
    execute(path, "UPDATE fit SET rmse = 2 * rmse WHERE run_key = 3")
    output = clutchlife("replay", *url, code=1)
    assert "a: not replayed: run s0 is damaged: channel" in output
    assert "b: 1 runs" in output
    assert "c: 1 runs" in output
    assert output.strip().endswith("1 clutches keep their previous results: a")
    assert "c: " not in clutchlife("verify", *url, code=1)


def test_a_second_service_on_the_same_database_does_not_start(path: Path) -> None:
    with TestClient(create_app(Settings(workers=0, database=f"sqlite:///{path}"))):
        output = clutchlife("serve", "--port", "0", "--database", f"sqlite:///{path}", code=1)
    assert "a service uses this database already (process " in output
