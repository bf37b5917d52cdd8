"""Ready is who can work: database, disk, memory and workers, found out without a lock; alive is who answers."""

import os
import shutil
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient

from service.web import readiness
from service.web.readiness import available_memory
from tests.lab.benchmarks.memory import family
from tests.service.clients import client_on
from tests.service.jobs.waiting import until
from tests.service.web.routes.granting import context_of
from tests.support import ONCE, serving

WHOLE = dict.fromkeys(("database", "disk", "memory", "workers"), "ok")


def test_a_service_that_can_work_says_so(client: TestClient) -> None:
    answer = client.get("/readyz")
    assert answer.status_code == 200
    assert answer.json() == {"status": "ready", "journal_mode": "wal", "checks": WHOLE, "oldest_call": None}


@pytest.mark.parametrize(
    ("setting", "part", "says"),
    [("least_free_mb", "disk", "MiB are free on"), ("least_memory_mb", "memory", "MiB of memory are left")],
)
def test_too_little_room_is_not_ready_and_says_how_little(
    database_url: str, setting: str, part: str, says: str
) -> None:
    with client_on(database_url, **{setting: 2**40}) as client:
        answer = client.get("/readyz")
        assert (answer.status_code, answer.json()["status"]) == (503, "not ready")
        checks = answer.json()["checks"]
        assert says in checks[part]
        assert f"{2**40} are needed" in checks[part]
        assert checks | {part: "ok"} == WHOLE
        assert client.get("/livez").status_code == 200


def test_ready_at_once_while_all_threads_wait_for_the_write_lock(client: TestClient) -> None:
    """Forty is as many as the server has for requests."""
    database = context_of(client).database
    with ThreadPoolExecutor(45) as pool:
        with database.writing():
            posts = [pool.submit(client.post, "/v1/clutches", json={"clutch_id": f"w{number}"}) for number in range(45)]
            time.sleep(1.0)
            assert not any(post.done() for post in posts), "they do not wait"
            answer = client.get("/readyz")
            assert not any(post.done() for post in posts), "it waited as long as they may"
        assert {post.result().status_code for post in posts} == {201}
    assert answer.status_code == 200


def test_a_disk_that_hangs_is_not_ready_in_time(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    hangs = threading.Event()
    monkeypatch.setattr(readiness, "LONGEST_LOOK_SECONDS", 0.2)
    usage = shutil.disk_usage
    monkeypatch.setattr("storage.engine.sqlite.database.shutil.disk_usage", lambda path: hangs.wait(30) and usage(path))
    for _ in range(2):
        answer = client.get("/readyz")
        assert answer.status_code == 503
        assert "has not answered for" in answer.json()["checks"]["disk"]
    hangs.set()


@pytest.mark.slow
def test_a_worker_that_died_is_not_ready_until_another_is_up(tmp_path: Path) -> None:
    with serving(tmp_path / "a.db", environment={"CLUTCHLIFE_WORKERS": "2"}) as server:
        with httpx2.Client(base_url=server.url, timeout=30) as http:

            def checks(status: int) -> Any:
                answer = http.get("/readyz")
                return answer.json()["checks"] if answer.status_code == status else None

            until(lambda: 'clutchlife_worker_calls{lane="runs"} 0.0' in http.get("/metrics").text)
            found = workers_of(server.pid)
            assert len(found) == 2
            assert checks(200) == WHOLE
            os.kill(found[0], signal.SIGKILL)
            ended = "a worker process has ended and is being started again: runs"
            assert until(lambda: checks(503)) == WHOLE | {"workers": ended}
            assert until(lambda: checks(200)) == WHOLE
        assert set(workers_of(server.pid)).isdisjoint(found[:1])
        assert ONCE.post(f"{server.url}/v1/clutches", json={"clutch_id": "c1"}).status_code == 201


def workers_of(service: int) -> list[int]:
    """What was forked off what the service forks its workers off."""
    return [pid for pid in family(service) if parent(parent(pid)) == service]


def parent(pid: int) -> int:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    except FileNotFoundError:
        return 0


def test_memory_is_that_of_the_machine_and_of_the_own_group(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        return path

    monkeypatch.setattr(readiness, "_MEMORY", write("meminfo", "MemTotal: 900 kB\nMemAvailable:    700 kB\n"))
    monkeypatch.setattr(readiness, "_GROUP", write("cgroup", "0::/own\n"))
    monkeypatch.setattr(readiness, "_GROUPS", tmp_path)
    assert available_memory() == 700 << 10, "without a group of its own"
    write("own/memory.current", "300000\n")
    write("own/memory.stat", "anon 1\ninactive_file 20000\nactive_file 25000\nslab_reclaimable 5000\n")
    write("own/memory.max", "max\n")
    assert available_memory() == 700 << 10, "in a group without a bound"
    write("own/memory.max", "400000\n")
    assert available_memory() == 150_000
    monkeypatch.setattr(readiness, "_MEMORY", tmp_path / "nothing")
    write("own/memory.max", "max\n")
    assert available_memory() is None
