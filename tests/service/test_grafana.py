"""What Grafana is provisioned with asks for what the service really says."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.support import stationary

FOLDER = Path(__file__).parents[2] / "docker" / "grafana"
DASHBOARD: dict[str, Any] = json.loads((FOLDER / "dashboards" / "clutchlife.json").read_text(encoding="utf-8"))
TARGETS = [target for panel in DASHBOARD["panels"] for target in panel["targets"]]


@pytest.fixture
def aged(client: TestClient) -> TestClient:
    """A service that knows a clutch with three tests."""
    client.post("/v1/clutches", json={"clutch_id": "bench"})
    for cycles in (0, 1000, 2000):
        assert client.post("/v1/clutches/bench/runs", json=stationary(cycles)).status_code == 201
    return client


def test_every_series_is_there_with_the_columns_that_are_read(aged: TestClient) -> None:
    asked = [target for target in TARGETS if target["datasource"]["uid"] == "clutchlife"]
    assert asked
    for target in asked:
        path = target["url"].removeprefix("http://clutchlife:8000").replace("${clutch}", "bench")
        params = {each["key"]: each["value"] for each in target["url_options"]["params"]}
        rows = aged.get(path, params=params).json()[target["root_selector"]]
        assert rows, (path, params)
        assert {each["selector"] for each in target["columns"]} <= rows[0].keys()


def test_every_metric_is_there(aged: TestClient) -> None:
    said = aged.get("/metrics").text
    asked = {name for target in TARGETS for name in re.findall(r"clutchlife_\w+", target.get("expr", ""))}
    assert len(asked) >= 5
    for name in asked:
        assert re.search(rf"^{name}\{{", said, re.MULTILINE), name
    assert not re.search(r"^clutchlife_nothing\{", said, re.MULTILINE)


def test_every_source_is_provisioned() -> None:
    said = (FOLDER / "provisioning" / "datasources" / "clutchlife.yaml").read_text(encoding="utf-8")
    provisioned = set(re.findall(r"^\s+uid: (\S+)$", said, re.MULTILINE))
    assert {target["datasource"]["uid"] for target in TARGETS} == provisioned
