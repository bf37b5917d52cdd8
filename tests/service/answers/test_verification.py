"""What is stored is held against itself: a stored bit that is changed is found, and nothing else is."""

import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from service.answers.verification import Checked, check_inspections, check_results, check_runs
from storage.engine.database import Database
from storage.engine.opening import find_database, open_database
from storage.engine.sqlite.database import back_up
from tests.service.clients import client_of, clutchlife, post_run
from tests.service.web.routes.surfaces import FRESH, WORN, inspected, png, sha256
from tests.storage.samples import reseal
from tests.support import stationary

BASE = "/v1/clutches/c1"
DAMAGE = "UPDATE channel SET data = zeroblob(9) WHERE run_key = 1 AND position = 0"


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clutch with runs of all kinds, one that is held, one corrected, one that came late and one withdrawn."""
    path = tmp_path_factory.mktemp("stored") / "clutchlife.db"
    with client_of(path) as client:
        fill(client)
    return path


@pytest.fixture
def life(stored: Path, tmp_path: Path) -> str:
    """A copy of it that a test may change."""
    back_up(f"sqlite:///{stored}", tmp_path / "copy.db")
    return f"sqlite:///{tmp_path}/copy.db"


def execute(url: str, statement: str) -> None:
    """Change rows, and their checksums with them: as if the program had stored them so."""
    with closing(sqlite3.connect(url.removeprefix("sqlite:///"))) as connection, connection:
        assert connection.execute(statement).rowcount > 0
    with closing(open_database(url)) as database, database.writing() as connection:
        reseal(connection)


def checked(url: str, check: Callable[[Database, str], Checked]) -> Checked:
    with closing(find_database(url)) as database:
        return check(database, "c1")


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
        post_run(client, body)
    corrected = client.patch(f"{BASE}/runs/s3000", json={"cycles": 3500, "reason": "mistyped"})
    withdrawn = client.post(f"{BASE}/runs/gone/withdraw", json={"reason": "unplugged"})
    assert (corrected.status_code, withdrawn.status_code) == (200, 200)
    states = {item["run_id"]: item["state"] for item in client.get(f"{BASE}/runs").json()["items"]}
    assert (states["zeros"], states["gone"]) == ("held", "withdrawn")


def test_nothing_is_found_where_all_is_as_it_was_stored_and_the_file_is_only_read(life: str, tmp_path: Path) -> None:
    before = (tmp_path / "copy.db").read_bytes()
    assert checked(life, check_runs) == Checked(runs=9, findings=())
    assert checked(life, check_results) == Checked(findings=(), earlier={})
    assert (tmp_path / "copy.db").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["copy.db"]


@pytest.mark.parametrize(
    ("tampered", "says"),
    [
        ("UPDATE run SET cycles = 1001 WHERE run_id = 's1000'", "run s1000 differs from what was sent"),
        ("UPDATE run SET started_at = '2026-01-01T00:00:00Z' WHERE run_id = 's0'", "run s0 differs from what was sent"),
        (DAMAGE, "c1: run s0 is damaged: channel pressure_bar: "),
        ("DELETE FROM channel WHERE run_key = 1 AND position = 0", "run s0 differs from what was sent"),
    ],
)
def test_a_run_that_is_not_what_was_sent_is_named(life: str, tampered: str, says: str) -> None:
    execute(life, tampered)
    (finding,) = checked(life, check_runs).findings
    assert says in finding


@pytest.mark.parametrize(
    ("tampered", "says"),
    [
        ("UPDATE fit SET static_torque = 1.001 * static_torque WHERE run_key = 2", "the fit of run s1000"),
        ("DELETE FROM prediction WHERE cycles = 1000 AND method = 'ukf'", "is missing, although the runs give it"),
        (DAMAGE, "results cannot be computed again: run s0 is damaged: channel"),
        (
            "UPDATE prediction SET payload = json_set(payload, '$.remaining_cycles.\"0.5\"', 7) WHERE cycles = 2000",
            "/remaining_cycles/0.5 is 7",
        ),
    ],
)
def test_a_result_that_does_not_follow_from_the_runs_is_named(life: str, tampered: str, says: str) -> None:
    execute(life, tampered)
    findings = checked(life, check_results).findings
    assert any(says in line for line in findings), findings


def test_results_of_an_earlier_release_are_counted_and_no_finding(life: str) -> None:
    execute(life, "UPDATE fit SET code_version = '0.1.0', static_torque = 1")
    results = checked(life, check_results)
    assert results.findings == ()
    assert set(results.earlier) == {"0.1.0"}


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
                assert client.post(f"{address}/photographs", content=png(red), headers=headers).status_code == 201
    return f"sqlite:///{path}"


@pytest.fixture
def copy(inspected_twice: str, tmp_path: Path) -> str:
    """A backup of it."""
    back_up(inspected_twice, tmp_path / "copy.db")
    return f"sqlite:///{tmp_path}/copy.db"


def test_a_backup_holds_inspections_and_photographs_and_verify_checks_them(copy: str) -> None:
    assert checked(copy, check_inspections) == Checked(inspections=2, photographs=3, findings=())
    assert "2 inspections with 3 photographs were checked" in clutchlife("verify", "--database", copy)


@pytest.mark.parametrize(
    ("tampered", "says"),
    [
        ("UPDATE photograph SET data = x'00' WHERE rowid = 2", f"photograph {sha256(png(2))}"),
        ("UPDATE inspection SET content = replace(content, '9.52', '9.25')", "differs from what was sent"),
        ("UPDATE inspection SET cycles = 10 WHERE cycles = 0", "(stored at 10 cycles)"),
        (
            "DELETE FROM photograph WHERE data = (SELECT data FROM photograph LIMIT 1)",
            "refers to a row of photograph that",
        ),
    ],
)
def test_verify_names_what_is_not_as_it_was_sent(copy: str, tampered: str, says: str) -> None:
    execute(copy, tampered)
    output = clutchlife("verify", "--database", copy, code=1)
    assert says in output
    assert output.count("differs from what was sent") == (not tampered.startswith("DELETE"))
