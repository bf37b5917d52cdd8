"""A damaged value is never taken for what was stored: it is found, and computed again from the runs."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.service.clients import client_of, client_on, clutchlife, post_run
from tests.support import post_tests, stationary

CYCLES = (0.0, 1000.0, 2000.0, 3000.0, 4000.0)
NEXT = stationary(5000.0, run_id="next")


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two clutches that are tracked."""
    path = tmp_path_factory.mktemp("stored") / "a.db"
    with client_of(path) as client:
        assert client.post("/v1/clutches", json={"clutch_id": "c2"}).status_code == 201
        for name in ("c1", "c2"):
            post_tests(client, *CYCLES, to=name)
    return path


@pytest.fixture
def path(stored: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(stored, tmp_path / "copy.db"))


def damage(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as connection, connection:
        assert connection.execute(statement).rowcount > 0


def answers(client: TestClient) -> list[Any]:
    """What is said of the clutch after its next test, without what says when."""
    receipt = post_run(client, NEXT)
    (listed,) = client.get("/v1/clutches?find=c1").json()["items"]
    remaining = client.get("/v1/clutches/c1/remaining-useful-life").json()
    del receipt["received_at"], remaining["revision"]
    return [receipt, remaining, listed["summary"], listed["state"]]


@pytest.fixture(scope="module")
def intact(stored: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    path = shutil.copy(stored, tmp_path_factory.mktemp("intact") / "copy.db")
    with client_on(f"sqlite:///{path}") as client:
        return answers(client)


#: What follows from runs, and how it is damaged.
RESULTS = {
    "a bit of a particle filter": "UPDATE filter_state SET arrays = substr(arrays, 1, 999) || x'aa' || substr(arrays, 1001)"
    " WHERE clutch_id = 'c1' AND method = 'particle'",
    "a state cut off": "UPDATE filter_state SET arrays = x'00' WHERE clutch_id = 'c1'",
    "a digit of a summary": "UPDATE clutch SET summary = replace(summary, 'at_least\":', 'at_least\":9')"
    " WHERE clutch_id = 'c1'",
    "a summary cut off": "UPDATE clutch SET summary = substr(summary, 1, 20) WHERE clutch_id = 'c1'",
    "a mean COF": "UPDATE fit SET mean_cof = 1.01 * mean_cof WHERE run_key = 2",
    "a receipt": "UPDATE run SET receipt = replace(receipt, 'mean_cof\":0', 'mean_cof\":1') WHERE clutch_id = 'c1'"
    " AND run_id = 'r2000'",
    "the last prediction": "UPDATE prediction SET payload = '{}' WHERE clutch_id = 'c1' AND cycles = 4000",
}


@pytest.mark.parametrize("what", RESULTS)
def test_a_damaged_result_is_computed_again_before_the_next_test_is_tracked(
    path: Path, what: str, intact: list[Any], caplog: pytest.LogCaptureFixture
) -> None:
    """The next test was tracked from it, or refused for ever."""
    damage(path, RESULTS[what])
    said = clutchlife("verify", "--database", f"sqlite:///{path}", code=1)
    assert "c1: " in said
    assert "10 runs of 2 clutches were checked, 1 of the clutches computed again" in said
    assert "c2" not in said
    with client_on(f"sqlite:///{path}") as client:
        assert answers(client) == intact
    assert any("again from its runs" in record.getMessage() for record in caplog.records)
    assert "0 findings" in clutchlife("verify", "--database", f"sqlite:///{path}")


@pytest.mark.parametrize(
    ("read", "put_back"),
    [
        ("SELECT * FROM filter_state WHERE clutch_id = 'c1'", "REPLACE INTO filter_state VALUES (?, ?, ?, ?, ?, ?, ?)"),
        (
            "SELECT rank, summary, state, states_sum, revision, checksum, clutch_id FROM clutch WHERE clutch_id = 'c1'",
            "UPDATE clutch SET rank = ?, summary = ?, state = ?, states_sum = ?, revision = ?, checksum = ?"
            " WHERE clutch_id = ?",
        ),
    ],
    ids=["filter states", "a clutch"],
)
def test_a_row_of_an_earlier_revision_is_not_taken_for_the_present_one(
    path: Path, read: str, put_back: str, caplog: pytest.LogCaptureFixture
) -> None:
    """A filter state of as many tests, with its own valid checksum, was carried on: the last test was corrected since."""
    with client_on(f"sqlite:///{path}") as client:
        with closing(sqlite3.connect(path)) as connection:
            before = connection.execute(read).fetchall()
        moved = {"cycles": 4400.0, "reason": "mistyped"}
        assert client.patch("/v1/clutches/c1/runs/r4000", json=moved).status_code == 200
    intact = Path(shutil.copy(path, path.with_name("intact.db")))
    with client_on(f"sqlite:///{intact}") as client:
        wanted = answers(client)
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.executemany(put_back, before)
    said = clutchlife("verify", "--database", f"sqlite:///{path}", code=1)
    assert "the filter states of clutch 'c1' are not those of its revision" in said
    with client_on(f"sqlite:///{path}") as client:
        assert answers(client) == wanted
    assert any("tracked again from its runs" in record.getMessage() for record in caplog.records)
    assert "0 findings" in clutchlife("verify", "--database", f"sqlite:///{path}")


def test_a_damaged_clutch_is_listed_as_such_beside_the_others(path: Path) -> None:
    """It was listed with nine times its safe bound."""
    damage(path, RESULTS["a digit of a summary"])
    with client_on(f"sqlite:///{path}") as client:
        items = {item["clutch_id"]: item for item in client.get("/v1/clutches").json()["items"]}
        assert (items["c1"]["state"]["name"], items["c1"]["summary"]) == ("check", None)
        assert "its stored results are damaged" in items["c1"]["state"]["why"]
        assert "clutchlife replay" in items["c1"]["action"]
        assert items["c2"]["summary"] is not None
        alone = client.get("/v1/clutches/c1")
        assert (alone.status_code, alone.json()["type"]) == (503, "urn:clutchlife:problem:damaged")
        assert client.get("/v1/clutches/c2").status_code == 200
    clutchlife("replay", "c1", "--database", f"sqlite:///{path}")
    with client_on(f"sqlite:///{path}") as client:
        assert client.get("/v1/clutches/c1").json()["summary"] == items["c2"]["summary"]


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE fit SET covariance = substr(covariance, 1, 20) WHERE run_key = 2",
        "UPDATE fit SET mean_cof = 1.01 * mean_cof WHERE run_key = 2",
        "UPDATE run SET receipt = cast(x'7bff7d' AS TEXT) WHERE clutch_id = 'c1' AND run_id = 'r2000'",
        "UPDATE run SET receipt = '{' WHERE clutch_id = 'c1' AND run_id = 'r2000'",
        "UPDATE prediction SET payload = '[' WHERE clutch_id = 'c1' AND cycles = 2000",
    ],
)
def test_verify_says_of_each_clutch_what_is_damaged(path: Path, statement: str) -> None:
    """One unreadable value ended it with a traceback, and the other clutches were not looked at."""
    damage(path, statement)
    damage(path, "UPDATE channel SET data = zeroblob(9) WHERE run_key = 7 AND position = 0")
    said = clutchlife("verify", "--database", f"sqlite:///{path}", code=1).splitlines()
    assert any(line.startswith("c1: ") for line in said), said
    assert any(line.startswith("c2: run r1000 is damaged") for line in said), said


def test_a_replay_mends_results_and_leaves_what_was_sent(path: Path) -> None:
    url = f"sqlite:///{path}"
    damage(path, "UPDATE fit SET mean_cof = 1.01 * mean_cof WHERE run_key = 2")
    damage(path, "UPDATE run SET receipt = '{' WHERE clutch_id = 'c1' AND run_id = 'r2000'")
    damage(path, "UPDATE prediction SET payload = '[' WHERE clutch_id = 'c2'")
    clutchlife("replay", "--database", url)
    assert "0 findings" in clutchlife("verify", "--database", url)
    damage(path, "UPDATE run SET cycles = cycles + 1 WHERE clutch_id = 'c1' AND run_id = 'r2000'")
    assert "c1: not replayed" in clutchlife("replay", "c1", "--database", url, code=1)
    assert "c1: run (run_key 3) is not what was stored" in clutchlife("verify", "--database", url, code=1)


@pytest.mark.parametrize(
    "column",
    [
        "state = 'withdrawn'",
        "state = 'held'",
        "details = replace(details, 'origin', 'x')",
        "details = substr(details, 1, 20)",
    ],
)
def test_what_nobody_said_of_a_run_is_never_taken_for_what_was_decided(path: Path, column: str) -> None:
    """A run whose state was damaged counted no more, and a replay gave it the checksum of that state."""
    url = f"sqlite:///{path}"
    damage(path, f"UPDATE run SET {column} WHERE clutch_id = 'c1' AND run_id = 'r2000'")  # noqa: S608  (our own words)
    with client_on(url) as client:
        refused = client.post("/v1/clutches/c1/runs", json=NEXT)
        assert (refused.status_code, refused.json()["type"]) == (503, "urn:clutchlife:problem:damaged")
        assert post_run(client, NEXT, "c2")["state"] == "accepted"
    assert "c1: not replayed" in clutchlife("replay", "c1", "--database", url, code=1)
    assert "c1: run (run_key 3) is not what was stored" in clutchlife("verify", "--database", url, code=1)


def test_a_run_that_somebody_withdrew_stays_so_where_its_receipt_is_damaged(path: Path) -> None:
    url, run = f"sqlite:///{path}", "/v1/clutches/c1/runs/r2000"
    with client_on(url) as client:
        assert client.post(f"{run}/withdraw", json={"reason": "no oil"}).status_code == 200
    damage(path, RESULTS["a receipt"])
    with client_on(url) as client:
        assert post_run(client, NEXT)["state"] == "accepted"
        assert client.get(run).json()["state"] == "withdrawn"
    assert "0 findings" in clutchlife("verify", "--database", url)


def test_a_damaged_rule_of_alarms_keeps_no_run_out_and_is_found(path: Path) -> None:
    with client_on(f"sqlite:///{path}") as client:
        assert client.post("/v1/alarms", json={"quantity": "remaining_cycles", "below": 1.0}).status_code == 201
    damage(path, "UPDATE alarm SET saved_by = 'nobody'")
    with client_on(f"sqlite:///{path}") as client:
        assert post_run(client, NEXT)["state"] == "accepted"
    said = clutchlife("verify", "--database", f"sqlite:///{path}", code=1)
    assert "alarm (alarm_id" in said


def test_a_clutch_of_which_the_record_is_damaged_takes_no_run(path: Path) -> None:
    damage(
        path,
        "UPDATE clutch SET record = replace(record, '\"friction_faces\":2', '\"friction_faces\":4') WHERE clutch_id = 'c1'",
    )
    with client_on(f"sqlite:///{path}") as client:
        refused = client.post("/v1/clutches/c1/runs", json=NEXT)
        assert (refused.status_code, refused.json()["type"]) == (503, "urn:clutchlife:problem:damaged")
        assert "restore a backup" in refused.json()["detail"]
        assert post_run(client, NEXT, "c2")["state"] == "accepted"
