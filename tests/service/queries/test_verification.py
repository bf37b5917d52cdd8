"""What is stored is held against itself: a stored bit that is changed is found, and nothing else is."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from service.cli.main import app
from service.queries.verification import (
    CheckedInspections,
    CheckedResults,
    CheckedRuns,
    check_inspections,
    check_results,
    check_runs,
)
from storage.engine.opening import find_database
from storage.engine.sqlite.database import back_up
from tests.service.clients import client_of, client_on
from tests.service.web.routes.surfaces import FRESH, WORN, inspected, png, sha256
from tests.support import stationary

BASE = "/v1/clutches/c1"


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clutch with runs of all kinds, one that is held, one corrected, one that came late and one withdrawn."""
    path = tmp_path_factory.mktemp("stored") / "clutchlife.db"
    with client_on(f"sqlite:///{path}") as client:
        assert client.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        fill(client)
    return path


@pytest.fixture
def life(stored: Path, tmp_path: Path) -> str:
    """A copy of it that a test may change."""
    back_up(f"sqlite:///{stored}", tmp_path / "copy.db")
    return f"sqlite:///{tmp_path}/copy.db"


def fill(client: TestClient) -> None:
    channels = {"time_s": [0, 1, 2], "pressure_bar": [5, 5, 5], "speed_rpm": [0, 9, 1], "torque_nm": [1, 2, 3]}
    bodies = [stationary(cycles, run_id=f"s{cycles}") for cycles in (0, 1000, 3000, 2000)]
    bodies += [
        {"kind": "duty_cycles", "cycles": 3000, "duty": {"cycles": 1000, "energy_per_cycle_kj": 18}},
        {"kind": "dynamic_stribeck", "cycles": 3000, "channels": channels, "run_id": "d"},
        {"kind": "maintenance", "cycles": 3000, "event": "oil_change", "started_at": "2026-11-02T08:00:00+01:00"},
        stationary(40_000_000, run_id="zeros", wear=0.3),
        stationary(4000, run_id="gone"),
    ]
    for body in bodies:
        assert client.post(f"{BASE}/runs", json=body).status_code == 201
    changes = (
        ("PATCH", "s3000", {"cycles": 3500, "reason": "mistyped"}),
        ("POST", "gone/withdraw", {"reason": "unplugged"}),
    )
    for method, address, change in changes:
        assert client.request(method, f"{BASE}/runs/{address}", json=change).status_code == 200
    states = {item["run_id"]: item["state"] for item in client.get(f"{BASE}/runs").json()["items"]}
    assert (states["zeros"], states["gone"]) == ("held", "withdrawn")


def test_nothing_is_found_where_all_is_as_it_was_stored_and_the_file_is_only_read(life: str, tmp_path: Path) -> None:
    before = (tmp_path / "copy.db").read_bytes()
    with closing(find_database(life)) as database:
        assert check_runs(database, "c1") == CheckedRuns(runs=9, findings=())
        assert check_results(database, "c1") == CheckedResults(findings=(), earlier={})
    assert (tmp_path / "copy.db").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["copy.db"]


@pytest.mark.parametrize(
    ("tampered", "says"),
    [
        ("UPDATE run SET cycles = 1001 WHERE run_id = 's1000'", "run s1000 differs from what was sent"),
        (
            "UPDATE run SET started_at = '2026-01-01T00:00:00+00:00' WHERE run_id = 's0'",
            "run s0 differs from what was sent",
        ),
        (
            "UPDATE channel SET data = zeroblob(9) WHERE run_key = 1 AND position = 0",
            "c1: run s0 is damaged: channel pressure_bar: ",
        ),
        ("DELETE FROM channel WHERE run_key = 1 AND position = 0", "run s0 differs from what was sent"),
    ],
)
def test_a_run_that_is_not_what_was_sent_is_named(life: str, tampered: str, says: str) -> None:
    execute(life, tampered)
    with closing(find_database(life)) as database:
        findings = check_runs(database, "c1").findings
    assert len(findings) == 1
    assert says in findings[0]


@pytest.mark.parametrize(
    ("tampered", "says"),
    [
        ("UPDATE fit SET static_torque = 1.001 * static_torque WHERE run_key = 2", "the fit of run s1000"),
        ("DELETE FROM prediction WHERE cycles = 1000 AND method = 'ukf'", "is missing, although the runs give it"),
        (
            "UPDATE prediction SET payload = json_set(payload, '$.remaining_cycles.\"0.5\"', 7) WHERE cycles = 2000",
            "/remaining_cycles/0.5 is 7",
        ),
    ],
)
def test_a_result_that_does_not_follow_from_the_runs_is_named(life: str, tampered: str, says: str) -> None:
    execute(life, tampered)
    with closing(find_database(life)) as database:
        findings = check_results(database, "c1").findings
    assert any(says in line for line in findings), findings


def test_a_run_that_cannot_be_evaluated_is_a_finding(life: str) -> None:
    execute(life, "UPDATE channel SET data = zeroblob(9) WHERE run_key = 1 AND position = 0")
    with closing(find_database(life)) as database:
        (finding,) = check_results(database, "c1").findings
    assert "results cannot be computed again: run s0 is damaged: channel" in finding


def test_results_of_an_earlier_release_are_counted_and_no_finding(life: str) -> None:
    execute(life, "UPDATE fit SET code_version = '0.1.0', static_torque = 1")
    with closing(find_database(life)) as database:
        results = check_results(database, "c1")
    assert results.findings == ()
    assert set(results.earlier) == {"0.1.0"}


def execute(url: str, statement: str) -> None:
    with closing(sqlite3.connect(url.removeprefix("sqlite:///"))) as connection, connection:
        assert connection.execute(statement).rowcount > 0


# --- A stored inspection or photograph that differs from what was sent is named; a backup holds them all.


@pytest.fixture(scope="module")
def inspected_twice(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A database with two inspections, which show the same photograph, and one of them another."""
    path = tmp_path_factory.mktemp("inspected") / "clutchlife.db"
    with client_of(path) as client:
        for body, reds in ((FRESH, (1,)), (WORN, (1, 2))):
            address = inspected(client, body)
            for red in reds:
                headers = {"Content-Type": "image/png"}
                answer = client.post(f"{address}/photographs", content=png(red), headers=headers)
                assert answer.status_code == 201
    return f"sqlite:///{path}"


@pytest.fixture
def copy(inspected_twice: str, tmp_path: Path) -> str:
    """A backup of it."""
    back_up(inspected_twice, tmp_path / "copy.db")
    return f"sqlite:///{tmp_path}/copy.db"


def verify(url: str, *, code: int = 0) -> str:
    done = CliRunner().invoke(app, ["verify", "--database", url], catch_exceptions=False)
    assert done.exit_code == code, done.output
    return done.output


def test_a_backup_holds_inspections_and_photographs_and_verify_checks_them(copy: str) -> None:
    with closing(find_database(copy)) as database:
        assert check_inspections(database, "c1") == CheckedInspections(inspections=2, photographs=3, findings=())
    assert "2 inspections with 3 photographs were checked" in verify(copy)


@pytest.mark.parametrize(
    ("tampered", "says"),
    [
        ("UPDATE photograph SET data = x'00' WHERE rowid = 2", f"photograph {sha256(png(2))}"),
        ("UPDATE inspection SET content = replace(content, '9.52', '9.25')", "differs from what was sent"),
        ("UPDATE inspection SET cycles = 10 WHERE cycles = 0", "(stored at 10 cycles)"),
    ],
)
def test_verify_names_what_is_not_as_it_was_sent(copy: str, tampered: str, says: str) -> None:
    with closing(sqlite3.connect(copy.removeprefix("sqlite:///"))) as connection, connection:
        connection.execute(tampered)
    output = verify(copy, code=1)
    assert says in output
    assert output.count("differs from what was sent") == 1


def test_verify_names_a_photograph_that_is_gone(copy: str) -> None:
    with closing(sqlite3.connect(copy.removeprefix("sqlite:///"))) as connection, connection:
        connection.execute("DELETE FROM photograph WHERE data = (SELECT data FROM photograph LIMIT 1)")
    assert "refers to a row of photograph that is missing" in verify(copy, code=1)
