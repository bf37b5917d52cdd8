"""Whoever sends much, and whatever hangs, takes the service from nobody: bodies share room, hung processes are replaced."""

import asyncio
import gzip
import os
import signal
import tempfile
import threading
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock, Mock

import httpx2
import pytest
from fastapi.testclient import TestClient

from service.answers import scores
from service.answers.raw_run import copy_file
from service.errors import BusyError
from service.jobs.workers import Lane
from service.web import bodies, files, limits
from service.web.bodies import Takes
from service.web.files import Copies, emptied_folder
from service.web.middleware import Answers
from service.web.routes import inspections, rigs, runs
from storage.encoding import to_text
from tests.lab.benchmarks.memory import family, resident
from tests.service.clients import client_on, csv_text
from tests.service.jobs.waiting import until
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


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("PATCH", "/v1/clutches/runs"),
        ("PATCH", "/v1/clutches/photographs"),
        ("PUT", "/v1/rigs/runs"),
        ("PATCH", "/v1/clutches/c1/runs/file"),
        ("POST", "/v1/clutches/runs/runs/file/withdraw"),
    ],
)
def test_no_name_lifts_the_bound_of_a_body(client: TestClient, method: str, path: str) -> None:
    """A clutch called `runs` might send 64 MiB, a run called `file` 1 GiB: the bound was chosen by the end of the path."""
    assert client.post("/v1/clutches", json={"clutch_id": "runs"}).status_code == 201
    answer = client.request(method, path, content=b"{" + b" " * 2**18, headers=JSON)
    assert (answer.status_code, answer.json()["detail"]) == (413, f"a request may hold at most {2**18} bytes here")


def test_each_route_declares_what_it_takes_and_the_others_take_little() -> None:
    routes = [(route.path, takes) for endpoint, takes in bodies.declared.items() for route in _routes_of(endpoint)]
    assert sorted(routes, key=str) == [
        ("/v1/clutches/{clutch_id}/inspections/{inspection_id}/photographs", Takes.PHOTOGRAPH),
        ("/v1/clutches/{clutch_id}/runs", Takes.RUN),
        ("/v1/clutches/{clutch_id}/runs/file", Takes.FILE),
        ("/v1/import/preview", Takes.FILE),
    ]


def _routes_of(endpoint: Any) -> list[Any]:
    routers = (runs.router, inspections.router, rigs.import_router)
    return [route for router in routers for route in router.routes if getattr(route, "endpoint", None) is endpoint]


@pytest.mark.parametrize("size", [1 << 12, 1 << 17], ids=["short", "long"])
def test_a_long_body_is_not_checked_on_the_event_loop(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, size: int
) -> None:
    on_loop: list[bool] = []
    check = bodies.checked

    def noted(*arguments: Any) -> Any:
        try:
            asyncio.get_running_loop()
            on_loop.append(True)
        except RuntimeError:
            on_loop.append(False)
        return check(*arguments)

    monkeypatch.setattr(bodies, "checked", noted)
    body = to_text({"clutch_id": "d1"}).encode().ljust(size)
    assert client.post("/v1/clutches", content=body, headers=JSON).status_code == 201
    assert on_loop == [size <= limits.MAX_CHECKED_BYTES]


def test_what_unpacks_to_more_than_200_times_its_bytes_is_refused(client: TestClient) -> None:
    """1 MiB unpacked to 1 GiB, on the event loop."""
    packed = JSON | {"Content-Encoding": "gzip"}
    bomb = client.post(ADDRESS, content=gzip.compress(b"\0" * (8 << 20)), headers=packed)
    assert bomb.status_code == 413
    assert bomb.json()["detail"] == "the body unpacks to more than 200 times its bytes: send it plain"
    assert list(context_of(client).folder.iterdir()) == []
    run = gzip.compress(padded(0.0, limits.PIECE_BYTES))
    assert client.post(RUNS, content=run, headers=packed).status_code == 201, "a short one may be of blanks"


def test_a_body_is_unpacked_in_a_thread_piece_by_piece(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    made = zlib.decompressobj
    pieces: list[tuple[bool, int]] = []

    class Noted:
        def __init__(self, form: int) -> None:
            self._of = made(form)

        def __getattr__(self, name: str) -> Any:
            return getattr(self._of, name)

        def decompress(self, packed: bytes, most: int) -> bytes:
            piece = self._of.decompress(packed, most)
            pieces.append((threading.current_thread().name.startswith("AnyIO"), len(piece)))
            return piece

    monkeypatch.setattr("service.web.middleware.zlib.decompressobj", Noted)
    text = "\n".join(f"{number % 977:03}" for number in range(250_000)).encode()
    answer = client.post(ADDRESS, content=gzip.compress(text), headers={"Content-Encoding": "gzip"})
    assert answer.status_code == 422
    assert all(in_thread for in_thread, _ in pieces)
    assert max(size for _, size in pieces) == limits.PIECE_BYTES


# --- What is sent is counted as what comes in is, and a disk that hangs holds up nobody who does not need it.


async def answered(room: int, contents: list[bytes]) -> list[int]:
    """The statuses of answers, of which as many bytes have room; their readers have begun to read, and stopped."""
    statuses: list[int] = []
    taken = asyncio.Event()

    async def app(scope: Any, _receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": contents[scope["number"]]})

    async def send(message: Any) -> None:
        if message["type"] == "http.response.start":
            statuses.append(message["status"])
        else:
            assert len(message["body"]) <= limits.PIECE_BYTES
            await taken.wait()

    answers = Answers(app)
    answers.room = bodies.Room(room)
    async with asyncio.TaskGroup() as group:
        for number in range(len(contents)):
            group.create_task(answers({"type": "http", "number": number}, AsyncMock(), send))
        await asyncio.sleep(0.01)
        assert len(statuses) == len(contents)
        taken.set()
    assert answers.room.left == room
    return statuses


def test_answers_that_nobody_reads_share_room_and_the_same_one_is_held_once() -> None:
    """120 readers of 16 MiB held 2 GiB."""
    size, each = 1 << 20, [bytes([number]) * (1 << 20) for number in range(4)]
    assert sorted(asyncio.run(answered(2 * size, each))) == [200, 200, 503, 503]
    assert asyncio.run(answered(size, [each[0]] * 120)) == [200] * 120
    assert asyncio.run(answered(0, [b"short"] * 9)) == [200] * 9


async def copied(client: TestClient, free: list[int], *tags: str) -> list[int]:
    """The bytes of copies that are held beside each other while so much of the disk is free, one after the other; in the end
    all are left."""
    copies, sizes = Copies(context_of(client).folder, 1 << 30), []
    try:
        for tag, left in zip(tags, free, strict=True):
            with pytest.MonkeyPatch.context() as patched:
                patched.setattr("service.web.files.shutil.disk_usage", lambda _, left=left: SimpleNamespace(free=left))
                sizes.append((await copies.of(tag, partial(submitted, client))).size)
    finally:
        for tag in tags[: len(sizes)]:
            copies.leave(tag)
        while copies._ending:
            await asyncio.sleep(0.001)
    assert copies._room.left == 1 << 30
    return sizes


def submitted(client: TestClient, path: Path) -> Any:
    return context_of(client).workers.submit(Lane.RECORDS, partial(copy_file, path=path), "c1", "a")


def test_copies_of_runs_share_the_room_on_the_disk(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sixty readers of a file of 14 MiB filled a disk of 1 GiB."""
    assert client.post(f"{ADDRESS}&run_id=a", content=TEXT).status_code == 201
    size = len(TEXT)
    assert asyncio.run(copied(client, [3 * size, 2 * size], "a", "b")) == [size, size]
    with pytest.raises(BusyError, match="copies of runs"):
        asyncio.run(copied(client, [3 * size, size], "a", "b"))
    assert asyncio.run(copied(client, [3 * size, 0], "a", "a")) == [size, size], "the same is there once"
    monkeypatch.setattr("service.web.files.shutil.disk_usage", lambda _: SimpleNamespace(free=size // 2))
    for path in (f"{RUNS}/a/file", f"{RUNS}/a"):
        refused = client.get(path)
        assert (refused.status_code, refused.headers["Retry-After"]) == (503, "1")
    monkeypatch.undo()
    assert client.get(f"{RUNS}/a/file").text == TEXT
    assert list(context_of(client).folder.iterdir()) == []


def test_a_disk_that_does_not_answer_holds_up_no_probe(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    """The event loop itself waited for it, and nobody was answered."""
    watch, asked, hangs = context_of(client).database.watch, threading.Event(), threading.Event()
    version = watch._version

    def hanging() -> int:
        asked.set()
        return hangs.wait(30) and version()

    monkeypatch.setattr(watch, "_version", hanging)
    monkeypatch.setattr(watch, "_patience", 60.0)
    with ThreadPoolExecutor(4) as pool:
        waiting = [pool.submit(client.get, "/v1/clutches") for _ in range(4)]
        assert asked.wait(60)
        for probe in ("/livez", "/readyz"):
            assert client.get(probe).status_code == 200
        assert not any(answer.done() for answer in waiting), "who is answered has not waited for the disk"
        hangs.set()
        assert {answer.result().status_code for answer in waiting} == {200}
        hangs.clear()
        monkeypatch.setattr(watch, "_patience", 0.5)
        waiting = [pool.submit(client.get, "/v1/clutches") for _ in range(4)]
        assert {answer.result().status_code for answer in waiting} == {503}
        assert client.get("/v1/clutches").status_code == 503, "and at once: it still has not answered"
    hangs.set()
    until(lambda: client.get("/v1/clutches").status_code == 200)


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
def test_every_post_is_answered_where_every_child_is_stopped(tmp_path: Path, at_work: bool) -> None:
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

        def post(number: int) -> int:
            return ONCE.post(f"{server.url}{RUNS}", json=stationary(1000.0 + number), timeout=300).status_code

        looking = threading.Thread(target=look)
        looking.start()
        with ThreadPoolExecutor(8) as pool:
            answers = list(pool.map(post, range(8)))
        ended.set()
        looking.join()
        assert set(answers) <= {201, 503}
        assert {"runs", "a worker process has ended and is being started again: runs"} <= seen
        until(lambda: post(100) in (200, 201))
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

    monkeypatch.setattr(files.tempfile, "TemporaryDirectory", folder)


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


def test_the_file_of_a_form_is_written_beside_the_database_at_once(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its first MiB was in memory and counted nowhere, the rest in the system's folder: 500 where there is none."""
    monkeypatch.setattr(tempfile, "tempdir", "/nowhere")
    spooled = Mock(side_effect=AssertionError("a form's file was held in memory"))
    monkeypatch.setattr(tempfile.SpooledTemporaryFile, "write", spooled)
    assert client.post(ADDRESS, files={"file": ("a.csv", TEXT + "\n" * (3 << 20))}).status_code == 201
    assert not spooled.called


@pytest.mark.parametrize(
    ("form", "status", "words"),
    [
        ({"data": {"profile": "x" * (1 << 17)}, "files": {"file": ("a.csv", TEXT)}}, 422, "valid JSON"),
        ({"data": {"profile": "x" * (1 << 17), "note": "y"}, "files": {"file": ("a.csv", TEXT)}}, 413, "131072 bytes"),
        ({"files": {"file": (None, TEXT), "other": (None, b"")}}, 422, "a field with a file name"),
        ({"files": {"file": ("a.csv", TEXT), "other": ("b.csv", TEXT)}}, 422, "cannot be read: Too many files"),
    ],
)
def test_a_form_has_one_file_and_little_text(client: TestClient, form: dict[str, Any], status: int, words: str) -> None:
    answer = client.post(ADDRESS, **form)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    assert words in answer.text
    assert client.get("/v1/clutches/c1/runs").json()["items"] == []


def test_what_a_killed_service_left_of_files_is_gone(tmp_path: Path) -> None:
    left = tmp_path / "a.db-files" / "tmp1234" / "run"
    left.parent.mkdir(parents=True)
    left.write_text("half a run")
    assert list(emptied_folder(tmp_path / "a.db").iterdir()) == []
