"""The same run comes in more than once at a time: it is stored once, and every other answer is its receipt."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Connection

from service.lives.incoming_run import IncomingRun, name_run
from service.schemas.clutch import ClutchIn
from service.workflows import edit_clutch
from service.workflows.ingest_run import ingest
from storage import clutches, runs
from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.runs import RunRow

AT = "2026-11-02T10:00:00+00:00"


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'a.db'}"


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    opened = open_database(url)
    edit_clutch.register(opened, ClutchIn(clutch_id="c1"), created_at=AT)
    yield opened
    opened.close()


def oil_change() -> IncomingRun:
    details = {"event": "oil_change", "note": ""}
    return name_run(IncomingRun(kind="maintenance", cycles=5.0, run_id="oil", details=details))


def test_the_same_run_of_two_threads_is_stored_once(database: Database) -> None:
    answers: list[bool] = []

    def send() -> None:
        answers.append(ingest(database, "c1", oil_change(), received_at=AT)[1])

    senders = [threading.Thread(target=send) for _ in range(4)]
    for thread in senders:
        thread.start()
    for thread in senders:
        thread.join(120)
    assert sorted(answers) == [False, False, False, True]


def test_a_run_that_another_process_stores_after_it_was_not_found_is_a_repeat(
    database: Database, url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is looked for twice, before and after its curves are fitted; it comes when it has just not been found again."""
    get, calls = runs.get, []

    def overtaken(connection: Connection, clutch_id: str, run_id: str) -> RunRow | None:
        found = get(connection, clutch_id, run_id)
        calls.append(found)
        if len(calls) == 2:
            other = open_database(url)
            assert ingest(other, "c1", oil_change(), received_at=AT)[1]
            other.close()
        return found

    monkeypatch.setattr(runs, "get", overtaken)
    receipt, new = ingest(database, "c1", oil_change(), received_at=AT)
    assert receipt["duplicate"]
    assert not new
    assert calls[:2] == [None, None]
    with database.reading() as connection:
        assert clutches.revision(connection, "c1") == 1
