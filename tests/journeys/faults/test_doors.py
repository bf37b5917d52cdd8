"""What an attacker does who has read the operations page, at full strength: others are answered, and nothing is lost.

The quick form of each is in tests/service. Disks are mounted and frozen where this may be done, a clock is set by
libfaketime where it is installed.
"""

import gzip
import json
import os
import socket
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx2
import pytest

from service.alarms.outbox import CLOCK_SECONDS
from service.api.base import MAX_POINTS
from service.web.limits import TAKEN_SECONDS
from tests.lab.benchmarks.memory import processor_seconds, resident
from tests.lab.load.bodies import long_file
from tests.service.alarms.receiving import SECRET, receiving
from tests.service.jobs.waiting import until
from tests.service.web.routes.surfaces import png
from tests.support import Server, post_tests, serving, stationary

pytestmark = pytest.mark.slow

JSON = {"Content-Type": "application/json"}
RUNS = "/v1/clutches/c1/runs"
#: [s] of the processor's time that the service takes at most while /livez waits to be answered, whatever is sent: the least
#: that a probe waits for. The time that others take of the machine is none of it.
PATIENCE = 1.0


@contextmanager
def probed(server: Server) -> Iterator[list[float]]:
    """What the service worked while /livez was not answered, asked all the time."""
    seconds: list[float] = []
    ended = threading.Event()

    def probe() -> None:
        with httpx2.Client(base_url=server.url, timeout=60) as http:
            while not ended.wait(0.02):
                begun = processor_seconds(server.pid, waited=False)
                assert http.get("/livez").status_code == 200
                seconds.append(processor_seconds(server.pid, waited=False) - begun)

    probing = threading.Thread(target=probe)
    probing.start()
    try:
        yield seconds
    finally:
        ended.set()
        probing.join()


@contextmanager
def slow_readers(server: Server, paths: list[str]) -> Iterator[list[socket.socket]]:
    """Connections that have asked for these addresses and take nothing."""
    with ExitStack() as stack:
        lines = []
        for path in paths:
            line = stack.enter_context(socket.socket())
            line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 12)
            line.connect(("127.0.0.1", server.port))
            line.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            lines.append(line)
        yield lines


def post(server: Server, cycles: float) -> int:
    return server.http.post(RUNS, json=stationary(cycles)).status_code


@contextmanager
def mounted(folder: Path, *commands: str, undo: tuple[str, ...]) -> Iterator[Path]:
    """A file system at a folder, made by commands; skipped where this process may not."""
    folder.mkdir()
    try:
        for command in commands:
            done = subprocess.run(command.format(at=folder).split(), capture_output=True, text=True, check=False)
            if done.returncode:
                pytest.skip(f"no file system can be mounted here: {done.stderr.strip()}")
        yield folder
    finally:
        for command in undo:
            subprocess.run(command.format(at=folder).split(), capture_output=True, check=False)


def test_no_name_and_no_packing_silences_the_service(tmp_path: Path) -> None:
    """62 MiB to a clutch called `runs`, 200 MiB to a run called `file`, and 1 MiB that unpacks to 1 GiB."""
    numbers = b"1," * (31 << 20)
    with serving(tmp_path / "a.db") as server:
        for name in ("runs", "c1"):
            assert server.http.post("/v1/clutches", json={"clutch_id": name}).status_code == 201
        assert post(server, 0.0) == 201
        before = resident(server.pid)
        with probed(server) as seconds:
            for method, path, body in (
                ("PATCH", "/v1/clutches/runs", b'{"reason":"x","end_of_life":{"a":[' + numbers + b"1]}}"),
                ("PUT", "/v1/rigs/runs", b'{"name":"runs","columns":[' + numbers + b"1]}"),
                ("PATCH", f"{RUNS}/file", b'{"reason":"x","cycles":[' + numbers * 3 + b"1]}"),
            ):
                with suppress(httpx2.TransportError):  # refused and closed while it sends
                    assert server.http.request(method, path, content=body, headers=JSON).status_code == 413
            bomb = gzip.compress(bytes(1000 << 20), 9)
            packed = {"Content-Type": "text/csv", "Content-Encoding": "gzip"}
            arguments = "kind=stationary_stribeck&cycles=0&filename=a.csv"
            for _ in range(4):
                assert server.http.post(f"{RUNS}/file?{arguments}", content=bomb, headers=packed).status_code == 413
            lines = "\n".join(f"{number % 9973:04}" for number in range(8_000_000)).encode()
            refused = server.http.post(f"{RUNS}/file?{arguments}", content=gzip.compress(lines), headers=packed)
            assert refused.status_code == 422
        assert max(seconds) < PATIENCE
        assert resident(server.pid) - before < 64 << 20


def test_slow_readers_of_a_file_leave_room_on_the_disk_and_are_cut_off(tmp_path: Path) -> None:
    """120 filled a disk of 1 GiB, for as long as they liked."""
    made = mounted(tmp_path / "disk", "mount -t tmpfs -o size=1g tmpfs {at}", undo=("umount {at}",))
    with made as folder, serving(folder / "a.db") as server:

        def free() -> int:
            return os.statvfs(folder).f_bavail * os.statvfs(folder).f_frsize

        assert server.http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        arguments = "kind=stationary_stribeck&cycles=0&filename=a.csv&run_id=big"
        assert server.http.post(f"{RUNS}/file?{arguments}", content=long_file()).status_code == 201
        before = free()
        thinned = [f"{RUNS}/big?points={number}" for number in range(MAX_POINTS - 60, MAX_POINTS)]  # each its own copy
        with slow_readers(server, [f"{RUNS}/big/file"] * 60 + thinned):
            begun = time.monotonic()
            least = before
            while time.monotonic() - begun < TAKEN_SECONDS - 10:
                assert post(server, time.monotonic()) == 201
                assert server.http.get("/readyz").status_code == 200
                least = min(least, free())
            assert before / 3 < least < before, "they have taken nothing, or more than their share"
            until(lambda: free() > 0.9 * before, within=10 * TAKEN_SECONDS)
        assert post(server, 1.0) == 201


def test_slow_readers_of_a_photograph_hold_a_piece_each(tmp_path: Path) -> None:
    """120 held 2 GiB."""
    photograph = png(1) + os.urandom((16 << 20) - len(png(1)))
    with serving(tmp_path / "a.db") as server:
        assert server.http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        body = {"cycles": 0, "performed_at": "2026-11-02T16:00:00+01:00", "roughness_um": 1.9}
        inspection = server.http.post("/v1/clutches/c1/inspections", json=body).json()["inspection_id"]
        address = f"/v1/clutches/c1/inspections/{inspection}/photographs"
        made = server.http.post(address, content=photograph, headers={"Content-Type": "image/png"})
        assert made.status_code == 201
        path = f"{address}/{made.json()['photograph_id']}"
        assert server.http.get(path).content == photograph
        before = resident(server.pid)
        with probed(server) as seconds, slow_readers(server, [path] * 120) as lines:
            time.sleep(10)
            assert resident(server.pid) - before < 128 << 20
            assert server.http.get(path).content == photograph, "who reads is answered"
            until(lambda: all(map(cut_off, lines)), within=10 * TAKEN_SECONDS)
        assert max(seconds) < PATIENCE


def cut_off(line: socket.socket) -> bool:
    """Whether the service has ended a connection, of which nothing was read."""
    established = 1
    return line.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] != established


def test_a_disk_that_is_frozen_silences_no_probe(tmp_path: Path) -> None:
    """As a snapshot of a volume or of a virtual machine does."""
    image = tmp_path / "disk.img"
    made = mounted(
        tmp_path / "disk", f"truncate -s 200M {image}", f"mkfs.ext4 -q {image}", f"mount -o loop {image} {{at}}",
        undo=("fsfreeze -u {at}", "umount {at}"),
    )  # fmt: skip
    with made as folder, serving(folder / "a.db") as server:
        assert server.http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        assert post(server, 0.0) == 201
        frozen = subprocess.run(["fsfreeze", "-f", folder], capture_output=True, text=True, check=False)
        if frozen.returncode:
            pytest.skip(f"no file system can be frozen here: {frozen.stderr.strip()}")
        try:
            with probed(server) as seconds:
                posting = threading.Thread(target=lambda: server.http.post(RUNS, json=stationary(1.0)))
                posting.start()
                ready = server.http.get("/readyz")
                assert (ready.status_code, "has not answered" in ready.json()["checks"]["disk"]) == (503, True)
                assert server.http.get(RUNS, timeout=30).status_code in (200, 503)
                time.sleep(5)
                answered = len(seconds)
                until(lambda: len(seconds) > answered + 10)
        finally:
            subprocess.run(["fsfreeze", "-u", folder], check=True)
        posting.join()
        until(lambda: server.http.get("/readyz").status_code == 200)
        assert post(server, 2.0) == 201


FAKETIME = next(Path("/usr/lib").glob("**/libfaketimeMT.so.1"), None)


@contextmanager
def clocked(path: Path, offset: str) -> Iterator[tuple[Server, Path]]:
    """A service whose wall clock is off by what a file says, and that file."""
    if FAKETIME is None:
        pytest.skip("libfaketime is not installed: apt-get install faketime")
    clock = path.with_name("clock")
    clock.write_text(offset)
    environment: Mapping[str, str] = {
        "LD_PRELOAD": str(FAKETIME),
        "FAKETIME_TIMESTAMP_FILE": str(clock),
        "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "DONT_FAKE_MONOTONIC": "1",
        # one process, so that none waits for another's lock of the file: with these settings libfaketime fails each sleep
        "CLUTCHLIFE_WORKERS": "0",
    }
    with serving(path, environment=environment) as server:
        yield server, clock


@pytest.mark.parametrize("offset", ["+1d", "-10d"])
def test_a_clock_that_is_set_right_delays_no_alarm_drops_none_and_makes_none(tmp_path: Path, offset: str) -> None:
    """One that was a day ahead delayed an alarm by a day; one that was ten days behind had it given up, and rigs silent."""
    with receiving() as receiver, clocked(tmp_path / "a.db", offset) as (server, clock):
        receiver.status = 500
        http = server.http
        assert http.post("/v1/webhooks", json={"url": receiver.url, "secret": SECRET}).status_code == 201
        assert http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
        for rule in ({"quantity": "remaining_cycles", "below": 1e9}, {"quantity": "silent_hours", "above": 12}):
            assert http.post("/v1/alarms", json=rule).status_code == 201
        post_tests(http, 0.0, 1000.0, 2000.0, 3000.0, 4000.0)
        receiver.await_requests(2)
        new = clock.with_name("clock-set")
        new.write_text("+0")
        new.replace(clock)
        receiver.await_requests(3)
        receiver.status = 200
        name = http.get("/v1/webhooks").json()["items"][0]["webhook_id"]

        def states() -> set[str]:
            items: list[dict[str, Any]] = http.get(f"/v1/webhooks/{name}/deliveries").json()["items"]
            return {item["state"] for item in items}

        until(lambda: states() == {"delivered"}, within=60)
        assert {json.loads(body)["type"] for _, _, body in receiver.requests} == {"alarm.raised"}
        time.sleep(2 * CLOCK_SECONDS)  # the time in which rigs are judged silent
        assert [event["quantity"] for event in http.get("/v1/alarms/events").json()["items"]] == ["remaining_cycles"]
