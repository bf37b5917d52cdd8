"""What Grafana is provisioned with asks for what the service really says."""

import json
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from models.rig.campaign import simulate
from models.rig.programme import RigProgramme
from models.rig.sampled import DynamicTest
from service.runs.simulated import simulated_body
from tests.service.clients import client_on

FOLDER = Path(__file__).parents[3] / "docker" / "grafana"
DASHBOARD: dict[str, Any] = json.loads((FOLDER / "dashboards" / "clutchlife.json").read_text(encoding="utf-8"))
TARGETS = [target for panel in DASHBOARD["panels"] for target in panel["targets"]]


@pytest.fixture(scope="module")
def aged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A service that knows a clutch with three tests of each kind, and has metrics of every clutch."""
    database = f"sqlite:///{tmp_path_factory.mktemp('aged') / 'clutchlife.db'}"
    with client_on(database, clutch_metrics=True) as client:
        client.post("/v1/clutches", json={"clutch_id": "bench"})
        for run in simulate(
            7, most_tests=3, programme=RigProgramme(dynamic=DynamicTest(rate=25.0, pressures=(4e5, 6e5)))
        ):
            assert client.post("/v1/clutches/bench/runs", json=simulated_body(run)).status_code == 201
        yield client


def rows_of(client: TestClient, target: dict[str, Any]) -> list[dict[str, Any]]:
    """What a target of the service's own asks for."""
    path = target["url"].removeprefix("http://clutchlife:8000").replace("${clutch}", "bench")
    params = {each["key"]: each["value"] for each in target["url_options"]["params"]}
    return client.get(path, params=params).json()[target["root_selector"]]


def test_every_panel_finds_its_rows(aged: TestClient) -> None:
    """What a panel reads and filters for is there, and what it maps, sorts or renames is one of its columns."""
    panels = [panel for panel in DASHBOARD["panels"] if panel["datasource"]["uid"] == "clutchlife"]
    assert panels
    for panel in panels:
        (target,) = panel["targets"]
        rows = rows_of(aged, target)
        assert rows, target["url"]
        assert {each["selector"] for each in target["columns"]} <= rows[0].keys()
        columns = {each["text"] for each in target["columns"]}
        for step in panel["transformations"]:
            for each in step["options"].get("filters", []):
                absent = each["config"]["id"] == "isNull"
                assert each["config"]["id"] in ("isNull", "isNotNull")
                rows = [row for row in rows if (row[each["fieldName"]] is None) == absent]
            assert set(step["options"].get("fields", [])) <= columns, panel["title"]
        assert len({row["cycles"] for row in rows}) == 3, panel["title"]
        assert all(row["value"] is not None for row in rows[2:]), panel["title"]
        for series in panel["options"]["series"]:
            assert {series[axis]["matcher"]["options"] for axis in "xy"} <= columns, panel["title"]


def test_lags_make_a_group_for_each_pressure_and_frequency_whatever_the_recorder_s_clock(client: TestClient) -> None:
    """Three tests at two pressures and two frequencies, by a recorder whose clock is off by some tenths of a percent."""
    assert client.post("/v1/clutches", json={"clutch_id": "bench"}).status_code == 201
    swings = [DynamicTest(rate=25.0, frequency=f, duration=1.5 / f, pressures=(4e5, 6e5)) for f in (0.1, 0.25)]
    clock = iter([1.0, 1.0, 1.003, 1.004, 0.998, 0.997])
    for run in simulate(7, most_tests=3, programme=RigProgramme(dynamic=swings[0], further=(swings[1],))):
        sent = simulated_body(run)
        if sent["kind"] == "dynamic_stribeck":
            rate = next(clock)
            sent["channels"]["time_s"] = [rate * time for time in sent["channels"]["time_s"]]
        assert client.post("/v1/clutches/bench/runs", json=sent).status_code == 201
    runs = client.get("/v1/clutches/bench/runs").json()["items"]
    assert len({loop["frequency_hz"] for run in runs for loop in run["loops"]}) > 4, "the clock is not off"
    parted = [
        (panel, step["options"]["fields"])
        for panel in DASHBOARD["panels"]
        for step in panel.get("transformations", [])
        if step["id"] == "partitionByValues" and "frequency_hz" in step["options"]["fields"]
    ]
    assert len(parted) == 2
    for panel, fields in parted:
        (target,) = panel["targets"]
        assert fields == ["pressure_bar", "frequency_hz"]
        groups = Counter((row["pressure_bar"], row["frequency_hz"]) for row in rows_of(client, target))
        assert groups.keys() == {(pressure, frequency) for pressure in (4.0, 6.0) for frequency in (0.1, 0.25)}
        # a film time that the noise leaves open has no row
        assert set(groups.values()) == {3} or target["url_options"]["params"][0]["value"] == "film_time"


def test_every_expression_selects_by_labels_that_are_there(aged: TestClient) -> None:
    said = [line for line in aged.get("/metrics").text.splitlines() if not line.startswith("#")]
    known = {name: re.findall(r'(\w+)="([^"]*)"', line) for line in said for name in [line.partition("{")[0]]}
    for target in TARGETS:
        expression = target.get("expr", "").replace("$clutch", "bench")
        for name, labels in re.findall(r"(clutchlife_\w+)(?:\{([^}]*)\})?", expression):
            lines = [line for line in said if line.startswith(f"{name}{{")]
            for label in labels.split(",") if labels else []:
                lines = [line for line in lines if label in line]
            assert lines, expression
            grouped = re.search(r"by \(([^)]*)\)", expression)
            names = set() if grouped is None else {each.strip() for each in grouped[1].split(",")}
            assert names <= {label for label, _ in known[name]}, expression
