"""Whoever sends much, and whatever hangs, takes the service from nobody: bodies share room, hung processes are replaced."""

import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient

from service.answers import scores
from service.web import limits
from service.web.files import emptied_folder
from service.web.routes import runs
from storage.encoding import to_text
from tests.benchmarks.memory import family, resident
from tests.service.clients import client_on, csv_text
from tests.service.web.routes.granting import context_of
from tests.support import ONCE, serving, stationary

RUNS = "/v1/clutches/c1/runs"
JSON = {"Content-Type": "application/json"}


def padded(cycles: float, size: int) -> bytes:
    """A run of that many bytes."""
    return to_text(stationary(cycles)).encode().ljust(size)


@pytest.mark.slow
def test_twelve_bodies_of_18_mib_raise_the_service_by_160_mib_at_most(tmp_path: Path) -> None:
    """They raised it by 435 MiB."""
    with serving(tmp_path / "a.db") as server:
        with httpx2.Client(base_url=server.url, timeout=120) as http:
            assert http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
            assert http.post(RUNS, content=padded(0.0, 0), headers=JSON).status_code == 201
        before, peak, ended = resident(server.pid), 0, threading.Event()

        def look() -> None:
            nonlocal peak
            while not ended.wait(0.01):
                peak = max(peak, resident(server.pid))

        def post(number: int) -> httpx2.Response:
            body = padded(1000.0 * (number + 1), 18 << 20)
            with httpx2.Client(base_url=server.url, timeout=300) as http:
                return http.post(RUNS, content=body, headers=JSON)

        looking = threading.Thread(target=look)
        looking.start()
        with ThreadPoolExecutor(12) as pool:
            answers = list(pool.map(post, range(12)))
        ended.set()
        looking.join()
        assert peak - before < 160 << 20, f"{(peak - before) >> 20} MiB"
        assert {answer.status_code for answer in answers} <= {201, 503}
        assert all("Retry-After" in answer.headers for answer in answers if answer.status_code == 503)
        assert sum(answer.status_code == 201 for answer in answers) > 6
        assert list((tmp_path / "a.db-files").iterdir()) == [], "no body is left on disk"


@pytest.fixture
def small(database_url: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A service in which a body of 50 kB is long, and all together may have 100 kB in memory."""
    monkeypatch.setattr(limits, "MAX_BODIES_IN_MEMORY", 100_000)
    monkeypatch.setattr(limits, "MAX_BYTES_IN_MEMORY", 50_000)
    monkeypatch.setattr("service.web.files.MAX_BYTES_IN_MEMORY", 50_000)
    with client_on(database_url) as client:
        assert client.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        yield client


def test_a_long_run_waits_on_disk_and_is_read_as_a_short_one_is(
    small: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[list[str]] = []
    submit = context_of(small).workers.submit

    def noted(*arguments: Any, **more: Any) -> Any:
        seen.append([path.name for path in context_of(small).folder.iterdir()])
        return submit(*arguments, **more)

    monkeypatch.setattr(context_of(small).workers, "submit", noted)
    short, long = padded(0.0, 0), padded(1000.0, 200_000)
    assert small.post(RUNS, content=short, headers=JSON).status_code == 201
    assert small.post(RUNS, content=long, headers=JSON).status_code == 201
    assert small.post(RUNS, content=long.rstrip(), headers=JSON).json()["duplicate"]
    assert [len(names) for names in seen[:2]] == [0, 1]
    assert list(context_of(small).folder.iterdir()) == []
    refused = small.post(RUNS, content=b"{" + long, headers=JSON)
    assert (refused.status_code, refused.json()["errors"][0]["code"]) == (422, "json_invalid")
    assert list(context_of(small).folder.iterdir()) == []


def test_bodies_for_which_there_is_no_room_are_refused_with_503_and_room_comes_back(small: TestClient) -> None:
    for _ in range(5):
        refused = small.post("/v1/clutches", content=b"{}".ljust(150_000), headers=JSON)
        assert (refused.status_code, refused.headers["Retry-After"]) == (503, "1")
        assert "all available room" in refused.json()["detail"]
    for number in range(5):
        body = to_text({"clutch_id": f"d{number}"}).encode().ljust(90_000)
        assert small.post("/v1/clutches", content=body, headers=JSON).status_code == 201


def test_scores_of_the_fleet_are_computed_by_workers(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the exact filter they took a minute of the process that answers."""
    assert client.post("/v1/clutches", json={"clutch_id": "c2"}).status_code == 201
    for number in range(4):
        assert client.post(RUNS, json=stationary(1000.0 * number, wear=0.2 * number)).status_code == 201
    submit, submitted = context_of(client).workers.submit, []

    def noted(lane: Any, function: Any, *arguments: Any, **more: Any) -> Any:
        submitted.append(arguments[:2])
        return submit(lane, function, *arguments, **more)

    monkeypatch.setattr(context_of(client).workers, "submit", noted)
    for address in ("/v1/fleet/scores?method=grid", "/v1/fleet/scores?method=grid", "/v1/fleet/scores.csv?method=grid"):
        assert client.get(address).status_code == 200
    assert submitted == [(scores.scores_of_clutch, "c1"), (scores.scores_of_clutch, "c2")], "and once"
    own = client.get("/v1/clutches/c1/scores?method=grid").json()
    fleet = client.get("/v1/fleet/scores?method=grid").json()
    assert len(submitted) == 2
    assert fleet["overall"]["predictions"] == sum(len(life["predictions"]) for life in own["items"])


@pytest.mark.slow
@pytest.mark.parametrize("at_work", [False, True], ids=["idle", "at work"])
def test_every_post_is_answered_within_a_minute_where_every_child_is_stopped(tmp_path: Path, at_work: bool) -> None:
    """The workers and what starts them: every POST hung for ever, and `/readyz` said ok."""
    with serving(tmp_path / "a.db") as server, httpx2.Client(base_url=server.url, timeout=65) as http:
        assert http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        assert http.post(RUNS, json=stationary(0.0, run_id="first")).status_code == 201
        if at_work:
            with suppress(httpx2.TimeoutException):
                http.post(f"{RUNS}/first/confirm", json={"reason": "a"}, timeout=0.01)
        children = [pid for pid in family(server.pid) if pid != server.pid]
        assert len(children) > 3
        for pid in children:
            os.kill(pid, signal.SIGSTOP)
        seen: set[str] = set()
        ended = threading.Event()

        def look() -> None:
            while not ended.wait(0.2):
                answer = ONCE.get(f"{server.url}/readyz").json()
                seen.add(answer["checks"]["workers"])
                if answer["oldest_call"] is not None:
                    seen.add(answer["oldest_call"]["lane"])

        def post(number: int) -> tuple[int, float]:
            begun = time.monotonic()
            status = ONCE.post(f"{server.url}{RUNS}", json=stationary(1000.0 + number), timeout=90).status_code
            return status, time.monotonic() - begun

        looking = threading.Thread(target=look)
        looking.start()
        with ThreadPoolExecutor(8) as pool:
            answers = list(pool.map(post, range(8)))
        ended.set()
        looking.join()
        assert max(seconds for _, seconds in answers) < 60
        assert {status for status, _ in answers} <= {201, 503}
        assert {"runs", "a worker process has ended and is being started again: runs"} <= seen
        deadline = time.monotonic() + 60
        while post(100)[0] not in (200, 201):
            assert time.monotonic() < deadline, "it takes in no runs any more"
        assert server.stop() == 0


# --- A disk without room is said to be one, and what was sent is not half there.

ADDRESS = "/v1/clutches/c1/runs/file?kind=stationary_stribeck&cycles=0&filename=a.csv"


TEXT = csv_text(stationary(0)["channels"])


@pytest.fixture
def full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes in is written to the system's own full disk."""

    @contextmanager
    def folder(*, dir: Path) -> Iterator[str]:  # noqa: A002
        del dir
        place = tmp_path / "full"
        place.mkdir()
        (place / "run").symlink_to("/dev/full")
        try:
            yield str(place)
        finally:
            (place / "run").unlink()
            place.rmdir()

    monkeypatch.setattr(runs.tempfile, "TemporaryDirectory", folder)


def test_a_file_for_which_the_disk_has_no_room_is_refused_with_the_reason(
    client: TestClient, full: None, caplog: pytest.LogCaptureFixture
) -> None:
    del full
    for sent in ({"content": TEXT}, {"files": {"file": ("a.csv", TEXT)}}):
        answer = client.post(ADDRESS, **sent)  # type: ignore[arg-type]
        assert (answer.status_code, answer.headers["content-type"]) == (507, "application/problem+json")
        assert answer.json()["type"] == "urn:clutchlife:problem:no-room"
        assert "No space left on device" in answer.json()["detail"]
    said = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert [line.partition(": ")[0] for line in said] == ["POST /v1/clutches/{clutch_id}/runs/file"] * 2
    assert client.get("/v1/clutches/c1/runs").json()["items"] == []


def test_files_are_kept_beside_the_database_while_they_are_read(
    client: TestClient, database_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = Path(database_url.removeprefix("sqlite:///"))
    beside = path.with_name(f"{path.name}-files")
    seen: list[Path] = []
    read = runs.read_file_run

    def watched(given: Path, **of_run: object) -> object:
        seen.append(given)
        return read(given, **of_run)  # type: ignore[arg-type]

    monkeypatch.setattr(runs, "read_file_run", watched)
    assert client.post(ADDRESS, content=TEXT).status_code == 201
    assert [given.parent.parent for given in seen] == [beside]
    assert list(beside.iterdir()) == []


def test_what_a_killed_service_left_of_files_is_gone(tmp_path: Path) -> None:
    left = tmp_path / "a.db-files" / "tmp1234" / "run"
    left.parent.mkdir(parents=True)
    left.write_text("half a run")
    assert list(emptied_folder(tmp_path / "a.db").iterdir()) == []
