"""The command line, as a rig's engineer uses it."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import ONCE, Server, clutchlife, serving


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated campaign as files."""
    folder = tmp_path_factory.mktemp("campaign")
    output = clutchlife("simulate", "--seed", "7", "--no-dynamic", "--tests", "4", "--out", folder)
    assert "simulated" in output
    return folder


def test_a_campaign_is_pushed_exported_and_pushed_again(campaign: Path, server: Server, tmp_path: Path) -> None:
    runs = len({path.name for path in campaign.glob("*.json")} - {"answer.json", "clutch.json"})
    inspections = len(list(campaign.glob("inspections/*.json")))
    push = ("push", campaign, "--clutch", "sim-7", "--url", server.url, "--spool", tmp_path / "spool")
    assert f"{runs + inspections} stored now, 0 stored before, 0 refused" in clutchlife(*push)
    assert f"0 stored now, {runs + inspections} stored before, 0 refused" in clutchlife(*push)
    inspected = server.http.get("/v1/clutches/sim-7/inspections").json()["items"]
    tests = server.http.get("/v1/clutches/sim-7/stribeck?limit=1000").json()["items"]
    assert [item["cycles"] for item in inspected] == [item["cycles"] for item in tests]
    assert len(inspected) == inspections
    roughness = [item["roughness_um"] for item in inspected]
    assert (roughness[0], roughness) == (9.52, sorted(roughness, reverse=True))
    assert {item["origin"] for item in inspected} == {"simulated"}
    address = "/v1/clutches/sim-7/remaining-useful-life"
    first = ONCE.get(server.url + address).json()
    assert first["origin"] == "simulated"
    clutchlife("export", "sim-7", "--out", tmp_path / "export", "--url", server.url)
    exported = json.loads((tmp_path / "export" / "results" / "remaining-useful-life-particle.json").read_bytes())
    assert exported == first
    with serving(tmp_path / "second.db", loaded=True) as second:
        output = clutchlife(
            "push", tmp_path / "export", "--clutch", "sim-7", "--url", second.url, "--spool", tmp_path / "spool"
        )
        assert f"{runs} stored" in output
        assert ONCE.get(second.url + address).json() == first


def test_a_key_that_a_command_revokes_is_refused_by_a_service_on_a_file(tmp_path: Path) -> None:
    with serving(tmp_path / "keys.db", loaded=True) as server:
        database = f"sqlite:///{server.database}"
        assert "scope must be one of" in clutchlife("key", "create", "--scope", "all", "--database", database, code=64)
        key = clutchlife("key", "create", "--scope", "read", "--database", database).strip()
        headers, key_id = {"Authorization": f"Bearer {key}"}, key.split("_")[1]
        assert ONCE.get(f"{server.url}/v1/clutches", headers=headers).status_code == 200
        assert key_id in clutchlife("key", "list", "--database", database)
        clutchlife("key", "revoke", key_id, "--database", database)
        assert [ONCE.get(f"{server.url}/v1/clutches", headers=sent).status_code for sent in ({}, headers)] == [401, 401]


def test_the_command_starts_without_database_and_numerics() -> None:
    """They take more than a second to load; only commands that need them do."""
    heavy = ("alembic", "fastapi", "numpy", "pydantic", "scipy", "sqlalchemy")
    looked = f"import sys, service.cli.main; print([name for name in {heavy!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", looked], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_wrong_arguments_are_reported_in_a_line(tmp_path: Path) -> None:
    """No traceback, and no new database where the address was mistyped."""
    absent = f"sqlite:///{tmp_path / 'mistyped.db'}"
    (tmp_path / "file").write_text("not a folder")
    calls: list[tuple[str | Path, ...]] = [
        ("backup", tmp_path / "copy.db", "--database", absent),
        ("key", "list", "--database", absent),
        ("replay", "--database", "postgres://somewhere"),
        ("key", "create", "--scope", "read", "--database", "sqlite:////no/such/folder/x.db"),
        ("key", "create", "--scope", "all", "--database", absent),
        ("serve", "--log-level", "loud", "--database", absent),
        ("simulate", "--out", tmp_path / "file"),
        ("export", "c1", "--out", tmp_path / "file"),
        ("push", tmp_path / "file", "--clutch", "c1", "--url", "http://[::1", "--spool", tmp_path / "spool"),
        ("push", tmp_path / "file", "--clutch", "c1", "--url", "nowhere", "--spool", tmp_path / "spool"),
    ]
    for call in calls:
        called = [sys.executable, "-m", "service.cli.main", *map(str, call)]
        done = subprocess.run(called, capture_output=True, text=True, check=False)
        assert done.returncode in (1, 64, 65), (call, done.stderr)
        assert "Traceback" not in done.stderr, call
        assert "clutchlife: " in done.stderr, call
    assert not (tmp_path / "mistyped.db").exists()


@pytest.mark.slow
def test_the_demo_shows_a_life_and_leaves_its_dashboard_open_up_to_date_with_friction_loops_and_inspections() -> None:
    """Until Ctrl-C; `--exit` ends by itself instead."""
    called = [sys.executable, "-u", "-m", "service.cli.main", "demo", "--no-browser"]
    with subprocess.Popen(called, stdout=subprocess.PIPE, text=True, start_new_session=True) as demo:
        output = ""
        try:
            for line in demo.stdout:
                output += line
                if "all clutches: http" in line:
                    break
            url = line.rpartition("all clutches: ")[2].strip()
            loops = ONCE.get(f"{url}/v1/clutches/sim-1/loops").json()["items"]
            inspections = ONCE.get(f"{url}/v1/clutches/sim-1/inspections").json()["items"]
            (diagnosed,) = ONCE.get(f"{url}/v1/clutches/sim-1/diagnoses").json()["items"]
        finally:
            os.killpg(demo.pid, signal.SIGINT)
            rest = demo.communicate(timeout=60)[0]
    life, _, diagnosis = output.partition("What does the simulation get wrong?")
    rows = [line.split() for line in life.splitlines() if line[:7].strip().isdigit()]
    assert len(rows) > 8
    assert "simulated clutch" in life
    assert "The truth: it halved at" in life
    assert rows[-1][-2] == "reached"
    assert "The hidden cause, oil temperature, was found." in diagnosis
    assert not diagnosed["stale"]
    assert len({loop["cycles"] for loop in loops}) == len({loop["pressure_bar"] for loop in loops}) == 3
    assert all(loop["loop_area_nm_m_s"] is not None for loop in loops)
    roughness = [inspection["roughness_um"] for inspection in inspections]
    assert roughness == sorted(roughness, reverse=True)
    assert (roughness[0], roughness[-1]) == (9.52, 1.94), "the reference's linings before and after its tests"
    assert {inspection["origin"] for inspection in inspections} == {"simulated"}
    assert "closing" in rest
    assert demo.returncode == 0
