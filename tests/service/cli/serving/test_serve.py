"""`clutchlife serve` as an operator sees it: its log, from the settings at the start to the stop."""

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

from service.cli.serving import listening
from tests.support import ONCE, free_port, stationary, wait_until_ready


def served(folder: Path, environment: Mapping[str, str], *arguments: str) -> tuple[str, dict[str, httpx2.Response]]:
    """What a service with two workers says on standard error while a run is posted, and the answers."""
    port = free_port()
    command = [sys.executable, "-m", "service.cli.main", "serve", "--port", str(port), *arguments]
    command += ["--database", f"sqlite:///{folder / 'a.db'}"]
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
    said, answers = served(tmp_path, {"CLUTCHLIFE_LOG_FORMAT": "json"})
    lines: list[dict[str, Any]] = [json.loads(line) for line in said.splitlines()]
    assert lines[0]["message"] == "settings"
    assert lines[0]["workers"] == 2
    assert {"clutchlife.start", "clutchlife.access", "uvicorn.error"} <= {line["logger"] for line in lines}
    ours = [line for line in lines if line.get("request_id") == "rig-7"]
    assert [(line["method"], line["status"]) for line in ours] == [("POST", 201), ("POST", 201), ("GET", 404)]
    assert [answer.headers["X-Request-ID"] for answer in answers.values()] == ["rig-7"] * 3
    assert not any(line.get("route") == "/readyz" for line in lines), "probes are not logged"
    assert "forged" not in said
    assert any("no key exists" in line["message"] for line in lines)


def test_an_answers_body_does_not_wait_until_its_head_was_received() -> None:
    """asyncio sends at once (TCP_NODELAY) on connections whose protocol it knows."""
    (at,) = listening.bound("127.0.0.1", 0)
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
            command = [sys.executable, "-m", "service.cli.main", "serve", "--port", port, "--host", host]
            command += ["--database", f"sqlite:///{tmp_path / 'a.db'}"]
            ended = subprocess.run(command, capture_output=True, text=True, check=False)
            assert ended.returncode == 64
            said = (ended.stdout + ended.stderr).splitlines()
            assert said == [
                f"clutchlife: port {port} at {'127.0.0.1' if host == every else host} is in use, perhaps by another "
                "service: stop it, or give another port with --port"
            ]
    assert list(tmp_path.iterdir()) == []


def test_a_start_says_where_the_page_and_the_database_are(tmp_path: Path) -> None:
    environment = {"CLUTCHLIFE_LOG_FORMAT": "text", "CLUTCHLIFE_WORKERS": "0", "CLUTCHLIFE_ROOT_PATH": "/clutch"}
    said, _ = served(tmp_path, environment)
    found = re.search(r"the page is at (http://127\.0\.0\.1:\d+/clutch/), the database at (.*)", said)
    assert found is not None
    assert found[2] == str(tmp_path / "a.db")
