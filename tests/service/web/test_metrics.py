"""Metrics count what happened, by route and not by name; of every clutch they speak only where that is asked for."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import event

from storage import clutches
from tests.service.clients import client_on
from tests.service.web.routes.granting import context_of
from tests.support import post_tests


def test_requests_are_counted_by_route_and_not_by_name(client: TestClient) -> None:
    post_tests(client, 0, 1000, 2000)
    client.get("/v1/clutches/nobody")
    client.get("/no/such/place")
    answer = client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    lines = answer.text.splitlines()
    posted = 'clutchlife_requests_total{method="POST",route="/v1/clutches/{clutch_id}/runs",status="201"} 3.0'
    assert posted in lines
    assert 'clutchlife_requests_total{method="GET",route="/v1/clutches/{clutch_id}",status="404"} 1.0' in lines
    assert 'clutchlife_requests_total{method="any",route="unmatched",status="404"} 1.0' in lines
    assert "nobody" not in answer.text


def test_clutches_runs_and_what_waits_are_counted_together(client: TestClient) -> None:
    post_tests(client, 0, 1000, 2000)
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    database = context_of(client).database
    with database.writing() as connection:
        row = clutches.get(connection, "c2")
        clutches.set_summary(connection, "c2", 0.0, row.summary, life="", state="failure", if_disputed="failure")
    lines = client.get("/metrics").text.splitlines()
    for line in (
        "clutchlife_clutches 2.0",
        'clutchlife_clutches_within{cycles="0"} 1.0',
        'clutchlife_clutches_within{cycles="1000"} 1.0',
        "clutchlife_runs 3.0",
        "clutchlife_runs_held 0.0",
        "clutchlife_ended_lives 0.0",
        'clutchlife_worker_calls{lane="runs"} 0.0',
        "clutchlife_diagnoses_waiting 0.0",
    ):
        assert line in lines, line
    client.patch("/v1/clutches/c2", json={"archived": True, "reason": "worn out"})
    assert 'clutchlife_clutches_within{cycles="0"} 0.0' in client.get("/metrics").text.splitlines()
    assert any(line.startswith("process_resident_memory_bytes ") for line in lines)


def cost(client: TestClient) -> tuple[int, set[str]]:
    """Statements that a question for the metrics makes, and the series that it gives but for those of requests.

    The fewest of three: what a service does by itself meanwhile (alarms, jobs) counts statements too."""
    tried = [_cost(client) for _ in range(3)]
    return min(number for number, _ in tried), tried[-1][1]


def _cost(client: TestClient) -> tuple[int, set[str]]:
    statements: list[str] = []
    engine = context_of(client).database._engine

    def noted(*arguments: object) -> None:
        statements.append(str(arguments[2]))

    event.listen(engine, "before_cursor_execute", noted)
    text = client.get("/metrics").text
    event.remove(engine, "before_cursor_execute", noted)
    series = {line.rpartition(" ")[0] for line in text.splitlines() if not line.startswith(("#", "clutchlife_request"))}
    return len(statements), series


@pytest.mark.parametrize("clutch_metrics", [False, True])
def test_more_clutches_cost_no_more_unless_each_is_asked_for(database_url: str, clutch_metrics: bool) -> None:
    with client_on(database_url, clutch_metrics=clutch_metrics) as client:
        client.post("/v1/clutches", json={"clutch_id": "c1"})
        post_tests(client, 0, 1000, 2000)
        few, few_series = cost(client)
        for number in range(2, 40):
            assert client.post("/v1/clutches", json={"clutch_id": f"c{number}"}).status_code == 201
        post_tests(client, 0, 1000, 2000, to="c2")
        many, many_series = cost(client)
        assert few == many
        assert 0 < few < 13
        assert (many_series == few_series) is not clutch_metrics
        named = {line for line in many_series if re.search(r'clutch="|quantile="', line)}
        assert bool(named) is clutch_metrics
        if not clutch_metrics:
            return
        lines = client.get("/metrics").text.splitlines()
    assert 'clutchlife_clutch_runs{clutch="c1"} 3.0' in lines
    health = next(line for line in lines if line.startswith('clutchlife_clutch_health{clutch="c1"}'))
    assert 0 < float(health.split()[-1]) <= 1
    assert any(line.startswith('clutchlife_clutch_remaining_cycles{clutch="c1",quantile="0.5"}') for line in lines)


#: One of several processes at a port: it counts two requests and a call, then says all metrics.
ONE_OF_SEVERAL = """
import sys
from service.jobs.workers import Lane
from service.web.metrics import Metrics
from storage.engine.opening import open_database
metrics = Metrics()
metrics.requests.labels("GET", "/a", "200").inc(2)
metrics.calls[Lane.RUNS].set(3)
print(metrics.exposition(open_database(sys.argv[1])).decode() + "\\n", flush=True)
sys.stdin.read()
"""


@pytest.mark.slow
def test_of_several_processes_at_a_port_all_are_counted(database_url: str, tmp_path: Path) -> None:
    """Calls that wait are those of processes that are there; what one has answered that ended stays counted."""
    folder = tmp_path / "metrics"
    folder.mkdir()
    environment = os.environ | {"PROMETHEUS_MULTIPROC_DIR": str(folder)}

    def started() -> "subprocess.Popen[str]":
        command = [sys.executable, "-c", ONE_OF_SEVERAL, database_url]
        return subprocess.Popen(command, env=environment, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def said(process: "subprocess.Popen[str]") -> dict[str, float]:
        values = {}
        for line in iter(process.stdout.readline, "\n"):
            if not line.startswith("#"):
                name, _, value = line.rpartition(" ")
                values[name] = float(value)
        return values

    processes = [started()]
    alone = said(processes[0])
    processes.append(started())
    both = said(processes[1])
    processes[0].communicate()
    processes.append(started())
    after = said(processes[2])
    for process in processes[1:]:
        process.communicate()
    for name, values in (
        ('clutchlife_requests_total{method="GET",route="/a",status="200"}', [2, 4, 6]),
        ('clutchlife_worker_calls{lane="runs"}', [3, 6, 6]),
    ):
        assert [seen[name] for seen in (alone, both, after)] == values
    memory = "process_resident_memory_bytes"
    assert 1.5 < both[memory] / alone[memory] < 2.5
    assert 1.5 < after[memory] / alone[memory] < 2.5
