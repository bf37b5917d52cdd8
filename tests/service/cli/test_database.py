"""Backup, restore, verify, replay and serve, as an operator sees them; a command that only reads changes nothing."""

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient

from service.app import create_app
from service.cli.serving.serve import bound
from service.settings import Settings
from storage.engine.sqlite.connect import service_lock
from tests.service.answers.test_verification import DAMAGE, execute
from tests.service.clients import client_of, client_on, clutchlife
from tests.storage.samples import OLD, integrity, old_database, revision
from tests.support import ONCE, free_port, stationary, wait_until_ready


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with the clutches a, b and c, each with a test."""
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


@pytest.mark.usefixtures("later_step")
def test_commands_that_read_leave_an_older_file_as_it_is(tmp_path: Path) -> None:
    path = old_database(tmp_path)
    before, url = path.read_bytes(), ("--database", f"sqlite:///{path}")
    names = sorted(each.name for each in tmp_path.iterdir())
    clutchlife("backup", tmp_path / "copy.db", *url)
    assert "no key exists" in clutchlife("key", "list", *url)
    assert f"is at revision {OLD}, this program needs" in clutchlife("fleet", *url, code=1)
    assert f"is at revision {OLD}: its runs can be checked only at" in clutchlife("verify", *url, code=1)
    assert path.read_bytes() == before
    assert sorted(each.name for each in tmp_path.iterdir()) == ["copy.db", *names]
    assert revision(tmp_path / "copy.db") == OLD
    clutchlife("replay", *url)  # it writes, so it migrates, and keeps a copy
    kept = [each.name for each in tmp_path.glob("old.db-before-*")]
    assert (revision(path), kept) == ("s9000_later", ["old.db-before-s9000_later"])


def test_verify_is_clean_on_what_a_service_stored_and_names_a_damaged_page(path: Path) -> None:
    url = ("--database", f"sqlite:///{path}")
    said = clutchlife("verify", *url)
    assert "3 runs of 3 clutches were checked, 3 of the clutches computed again: 0 findings" in said
    assert "3 clutches were checked, 1 of the clutches computed again" in clutchlife("verify", "--sample", "1", *url)
    assert clutchlife("key", "list", *url).strip() == "no key exists"
    whole = path.read_bytes()
    page = len(whole) // 2 // 4096 * 4096
    path.write_bytes(whole[:page] + b"\xff" * 4096 + whole[page + 4096 :])
    assert "damaged" in clutchlife("verify", *url, code=1)


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
    execute(url[1], "DELETE FROM prediction")
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
    execute(url[1], DAMAGE)
    execute(url[1], "UPDATE fit SET rmse = 2 * rmse WHERE run_key = 3")
    output = clutchlife("replay", *url, code=1)
    for line in ("a: not replayed: run s0 is damaged: channel", "b: 1 runs", "c: 1 runs"):
        assert line in output
    assert output.strip().endswith("1 clutches keep their previous results: a")
    assert "c: " not in clutchlife("verify", *url, code=1)


def test_a_second_service_on_the_same_database_does_not_start(path: Path) -> None:
    with TestClient(create_app(Settings(workers=0, database=f"sqlite:///{path}"))):
        output = clutchlife("serve", "--port", "0", "--database", f"sqlite:///{path}", code=1)
    assert "a service uses this database already (process " in output


# --- `clutchlife serve`: its log, from the settings at the start to the stop.


SERVE = [sys.executable, "-m", "service.cli.main", "serve"]


def served(folder: Path, environment: Mapping[str, str], *arguments: str) -> tuple[str, dict[str, httpx2.Response]]:
    """What a service with two workers says on standard error while a run is posted, and the answers."""
    port = free_port()
    command = [*SERVE, "--port", str(port), *arguments, "--database", f"sqlite:///{folder / 'a.db'}"]
    process = subprocess.Popen(command, env=os.environ | environment, stderr=subprocess.PIPE, text=True)
    try:
        url = f"http://127.0.0.1:{port}"
        wait_until_ready(url, lambda: process.poll() is not None)
        headers = {"X-Request-ID": "rig-7"}
        answers = {
            "register": ONCE.post(f"{url}/v1/clutches", json={"clutch_id": "c1"}, headers=headers),
            "post": ONCE.post(f"{url}/v1/clutches/c1/runs", json=stationary(0.0), headers=headers),
            "absent": ONCE.get(f"{url}/%0aWARNING%20clutchlife:%20forged", headers=headers),
        }
    finally:
        process.terminate()
        _, said = process.communicate(timeout=60)
    assert process.returncode == 0
    return said, answers


def test_every_line_of_a_service_is_json_from_its_start_to_its_stop(tmp_path: Path) -> None:
    said, answers = served(tmp_path, {"CLUTCHLIFE_LOG_FORMAT": "json", "CLUTCHLIFE_ROOT_PATH": "/clutch"})
    lines: list[dict[str, Any]] = [json.loads(line) for line in said.splitlines()]
    places = re.compile(r"the page is at http://127\.0\.0\.1:\d+/clutch/, the database at (.*)")
    assert [found[1] for line in lines if (found := places.search(line["message"]))] == [str(tmp_path / "a.db")]
    assert lines[0]["message"] == "settings"
    assert lines[0]["workers"] == 2
    assert {"clutchlife.start", "clutchlife.access", "uvicorn.error"} <= {line["logger"] for line in lines}
    ours = [line for line in lines if line.get("request_id") == "rig-7"]
    assert [(line["method"], line["status"]) for line in ours] == [("POST", 201), ("POST", 201), ("GET", 404)]
    assert [answer.headers["X-Request-ID"] for answer in answers.values()] == ["rig-7"] * 3
    assert not any(line.get("route") == "/readyz" for line in lines), "probes are not logged"
    assert "forged" not in said
    assert any("no key exists" in line["message"] for line in lines)
    with client_of(tmp_path / "threads.db") as client:
        by_threads = client.post("/v1/clutches/c1/runs", json=stationary(0.0)).json()
    assert answers["post"].json() == by_threads | {"received_at": answers["post"].json()["received_at"]}, "by processes"


def test_an_answers_body_does_not_wait_until_its_head_was_received() -> None:
    """asyncio sends at once (TCP_NODELAY) on connections whose protocol it knows."""
    (at,) = bound("127.0.0.1", 0)
    with at:
        at.listen()
        with socket.create_connection(at.getsockname()), at.accept()[0] as accepted:
            assert accepted.proto == socket.IPPROTO_TCP


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [("--log-level", "ERROR"), ()])
def test_the_level_is_that_of_the_option_or_else_of_the_environment_and_a_start_warns_at_any(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    environment = {"CLUTCHLIFE_LOG_FORMAT": "text", "CLUTCHLIFE_LOG_LEVEL": "info" if arguments else "Error"}
    environment |= {"CLUTCHLIFE_WORKERS": "0", "CLUTCHLIFE_MAX_BODY": "3", "CLUTCHLIFE_SERVICE_PORT": "8000"}
    said, _ = served(tmp_path, environment, *arguments)
    misspelt, open_to_all = said.splitlines()
    assert " WARNING clutchlife.start: CLUTCHLIFE_MAX_BODY is no setting" in misspelt
    assert misspelt.endswith("is CLUTCHLIFE_MAX_BODY_MB meant?")
    assert " WARNING clutchlife.start: no key exists" in open_to_all


@pytest.mark.slow
def test_a_busy_port_is_one_line_before_anything_is_made(tmp_path: Path) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = str(other.getsockname()[1])
        every = "0.0.0.0"  # noqa: S104  (without keys it listens at this machine only)
        for host in ("127.0.0.1", "localhost", every):
            command = [*SERVE, "--port", port, "--host", host, "--database", f"sqlite:///{tmp_path / 'a.db'}"]
            ended = subprocess.run(command, capture_output=True, text=True, check=False)
            assert ended.returncode == 64
            at = f"port {port} at {'127.0.0.1' if host == every else host}"
            advice = "perhaps by another service: stop it, or give another port with --port"
            assert (ended.stdout + ended.stderr).splitlines() == [f"clutchlife: {at} is in use, {advice}"]
    assert list(tmp_path.iterdir()) == []
