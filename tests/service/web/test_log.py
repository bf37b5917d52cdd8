"""A log that nobody reads: others are answered, and what is lost of it is counted."""

import fcntl
import json
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.support import serving, stationary

RUNS = "/v1/clutches/c1/runs"
#: Bytes of the smallest pipe that Linux makes, which some 16 lines of the log fill.
SMALL = 4096


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, SMALL)
    yield reading, writing
    os.close(reading)


def read_until_closed(number: int, into: list[dict[str, Any]]) -> threading.Thread:
    def read() -> None:
        with os.fdopen(os.dup(number), encoding="utf-8") as lines:
            into.extend(map(json.loads, lines))

    reading = threading.Thread(target=read)
    reading.start()
    return reading


def test_a_log_that_nobody_reads_holds_up_no_request_and_is_whole_once_it_is_read(
    tmp_path: Path, pipe: tuple[int, int]
) -> None:
    """/livez and posts waited until somebody read a line: the event loop wrote it."""
    reading, writing = pipe
    written: list[dict[str, Any]] = []
    with serving(tmp_path / "a.db", log=("debug", writing)) as server:
        with httpx2.Client(base_url=server.url, timeout=20) as http:
            assert http.post("/v1/clutches", json={"clutch_id": "c1"}).status_code == 201
            for number in range(100):
                assert http.get("/livez", headers={"X-Request-ID": f"probe-{number}"}).status_code == 200
            assert http.post(RUNS, json=stationary(0.0)).status_code == 201
        reader = read_until_closed(reading, written)
        assert server.stop() == 0
    os.close(writing)
    reader.join(20)
    asked = [line["request_id"] for line in written if line.get("request_id", "").startswith("probe-")]
    assert asked == [f"probe-{number}" for number in range(100)], "each line is there, in its order"
    assert "POST /v1/clutches/{clutch_id}/runs 201" in [line["message"] for line in written]
    assert written[-1]["message"].startswith("Finished server process"), "nothing is lost at the end"


@pytest.mark.slow
def test_a_service_whose_log_nobody_reads_stops_in_order(tmp_path: Path, pipe: tuple[int, int]) -> None:
    """It waited for ever, and with bytes in Python's own buffer it would end by SIGABRT."""
    with serving(tmp_path / "a.db", log=("debug", pipe[1])) as server:
        with httpx2.Client(base_url=server.url, timeout=20) as http:
            for _ in range(100):
                assert http.get("/livez").status_code == 200
        assert server.stop() == 0
    os.close(pipe[1])
