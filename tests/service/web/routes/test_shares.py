"""One caller cannot have the service to itself: shares of requests, bodies that trickle in, and lanes that fill."""

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.errors import BusyError
from service.jobs.workers import Lane
from tests.service.clients import client_on
from tests.service.jobs import calls
from tests.service.web.routes.granting import context_of, granted
from tests.support import post_tests, serving, stationary

CLUTCHES = "/v1/clutches"
WAIT = {"Prefer": "wait=60"}


def test_who_asks_too_often_is_told_when_to_come_back(database_url: str) -> None:
    with client_on(database_url, requests_per_second=1) as client:
        answers = [client.get(CLUTCHES) for _ in range(4)]
        assert [answer.status_code for answer in answers] == [200, 200, 429, 429]
        refused = answers[-1]
        assert (refused.headers["content-type"], refused.headers["retry-after"]) == ("application/problem+json", "1")
        assert refused.json()["type"] == "urn:clutchlife:problem:too-many-requests"
        assert client.get("/livez").status_code == client.get("/readyz").status_code == 200
        time.sleep(float(refused.headers["retry-after"]))
        assert client.get(CLUTCHES).status_code == 200, "and it holds"


def test_a_key_and_its_neighbours_at_one_address_have_a_share_each(database_url: str) -> None:
    with client_on(database_url, requests_per_second=1) as client:
        one, other = granted(client), granted(client)
        assert client.get(CLUTCHES, headers=one).status_code == 200
        assert client.get(CLUTCHES, headers=other).status_code == 200
        statuses = [client.get(CLUTCHES, headers=one).status_code for _ in range(3)]
        assert statuses == [200, 200, 429]
        assert client.get(CLUTCHES, headers=other).status_code == 200


def test_who_tries_keys_has_one_share(database_url: str) -> None:
    """Else every key that is tried would come with a share of its own."""
    with client_on(database_url, requests_per_second=1) as client:
        granted(client)
        tried = [client.get(CLUTCHES, headers={"Authorization": f"Bearer {number}"}) for number in range(4)]
        assert [answer.status_code for answer in tried] == [401, 401, 429, 429]


def test_the_load_of_a_test_field_is_not_hindered(client: TestClient) -> None:
    """Under the default settings, faster than 8 rigs and 20 pages ask."""
    assert {client.get(CLUTCHES).status_code for _ in range(300)} == {200}


def trickled(port: int, seconds: float) -> bytes:
    """What is answered to a body that comes a byte at a time."""
    head = f"POST {CLUTCHES} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Type: application/json\r\n"
    with socket.create_connection(("127.0.0.1", port), timeout=10) as line:
        line.sendall(f"{head}Content-Length: 9000\r\n\r\n".encode())
        line.settimeout(0.2)
        begun, answer = time.monotonic(), b""
        while time.monotonic() - begun < seconds and not answer:
            line.sendall(b" ")
            try:
                answer = line.recv(65536)
            except TimeoutError:
                continue
        line.settimeout(5)
        while answer and (more := line.recv(65536)):
            answer += more
    return answer


def test_a_body_that_trickles_in_ends_with_408_and_the_connection(tmp_path: Path) -> None:
    limits = {"CLUTCHLIFE_BODY_SECONDS": "1"}
    with serving(tmp_path / "a.db", loaded=True, environment=limits) as server:
        head, _, body = trickled(server.port, 60).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 408")
    assert b"connection: close" in head.lower()
    assert b"urn:clutchlife:problem:too-slow" in body


@pytest.fixture
def gate(tmp_path: Path) -> Path:
    """Calls of `calls.logged` end once it is there."""
    return tmp_path / "gate"


@contextmanager
def full(client: TestClient, lane: Lane, log: Path, gate: Path) -> Iterator[None]:
    """A lane that takes no more; its calls end with the block."""
    held = []
    with ExitStack() as stack:
        stack.callback(lambda: [call.result(60) for call in held])
        stack.callback(gate.touch)
        while True:
            try:
                held.append(context_of(client).workers.submit(lane, calls.logged, log, "x", gate))
            except BusyError:
                break
        yield


CSV = b"speed_rpm,torque_nm,pressure_bar\n" + b"".join(b"%d,20,5\n" % (20 + 50 * row) for row in range(30))


@pytest.mark.parametrize("lane", [Lane.FILES, Lane.SIMULATIONS])
def test_a_full_lane_refuses_its_own_and_leaves_all_else_alone(
    client: TestClient, lane: Lane, tmp_path: Path, gate: Path
) -> None:
    upload = f"{CLUTCHES}/c1/runs/file?kind=stationary_stribeck&cycles=9000"
    with full(client, lane, tmp_path / "log", gate):
        refused = client.post(upload, content=CSV) if lane is Lane.FILES else client.get(f"{CLUTCHES}/c1/engagement")
        assert (refused.status_code, refused.headers["retry-after"]) == (503, "1")
        assert client.get("/livez").status_code == 200
        assert client.post(f"{CLUTCHES}/c1/runs", json=stationary(0.0, run_id="a")).status_code == 201
        paths = ("", "/c1", "/c1/runs", "/c1/runs/a", "/c1/remaining-useful-life", "/c1/degradation", "/c1/series.csv")
        assert [client.get(CLUTCHES + path).status_code for path in paths] == [200] * len(paths)
    assert client.post(upload, content=CSV).status_code == 201, "and it holds"


def test_who_asks_for_many_answers_holds_up_nobody_else(client: TestClient, tmp_path: Path, gate: Path) -> None:
    """Six that take long are asked for before somebody else's one; callers take turns, so it is the second.

    Who asks for an answer that is being made waits for that one."""
    post_tests(client, 0.0, 2000.0, 4000.0)
    many, one = granted(client, "read"), granted(client, "read")
    workers, ended = context_of(client).workers, []
    held = workers.submit(Lane.ANSWERS, calls.logged, tmp_path / "log", "x", gate)

    def ask(headers: Any, at_cycles: int) -> None:
        status = client.get(f"{CLUTCHES}/c1/degradation?at_cycles={at_cycles}", headers=headers | WAIT).status_code
        ended.append((status, headers is one))

    threads = [threading.Thread(target=ask, args=(many, 100 * number)) for number in range(6)]
    threads.append(threading.Thread(target=ask, args=(one, 2500)))
    for asked, thread in enumerate(threads, start=2):
        thread.start()
        while workers.calls()[Lane.ANSWERS] < asked:
            time.sleep(0.01)
    same = [threading.Thread(target=ask, args=(many, 500)) for _ in range(8)]
    for thread in same:
        thread.start()
    time.sleep(0.5)
    assert workers.calls()[Lane.ANSWERS] == 1 + len(threads)
    gate.touch()
    held.result(60)
    for thread in threads + same:
        thread.join()
    assert [status for status, _ in ended] == [200] * 15
    assert [of_one for _, of_one in ended].index(True) <= 3
