"""A run over HTTP: negotiated, packed, not sent again where it is known, sent piece by piece; lists hold no channels."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.queries import raw_run
from storage import channels
from tests.support import stationary

RUNS = "/v1/clutches/c1/runs"
PARQUET = "application/vnd.apache.parquet"
SAMPLES = 6000


@pytest.fixture
def raw(client: TestClient) -> dict[str, Any]:
    """A sampled record that is there already."""
    time = np.arange(SAMPLES) / 100
    speed = 1000 - 990 * np.cos(2 * np.pi * 0.1 * time)
    body = {
        "kind": "dynamic_stribeck",
        "cycles": 0,
        "run_id": "raw",
        "channels": {
            "time_s": time.tolist(),
            "pressure_bar": [5.0] * SAMPLES,
            "speed_rpm": speed.round(3).tolist(),
            "torque_nm": (20 + np.sin(time)).round(4).tolist(),
        },
    }
    assert client.post(RUNS, json=body).status_code == 201
    return body


def test_points_thin_the_channels(client: TestClient, raw: dict[str, Any]) -> None:
    whole, plot = client.get(f"{RUNS}/raw").json(), client.get(f"{RUNS}/raw?points=200").json()
    assert whole["channels"] == raw["channels"]
    assert {len(column) for column in plot["channels"].values()} == {len(plot["channels"]["time_s"])}
    assert len(plot["channels"]["time_s"]) <= 200
    assert plot | {"channels": whole["channels"]} == whole
    assert client.get(f"{RUNS}/raw?points={SAMPLES}").json() == whole
    for wrong in ("0", "-1", "a", "1.5", "1000001"):
        assert client.get(f"{RUNS}/raw?points={wrong}").status_code == 422
    assert client.get(f"{RUNS}/nobody?points=2").status_code == 404


@pytest.mark.parametrize(
    ("accepted", "given"),
    [
        ("", "application/json"),
        ("*/*", "application/json"),
        ("text/html,application/xhtml+xml,*/*;q=0.8", "application/json"),
        (PARQUET, PARQUET),
        (f"application/json;q=0.5, {PARQUET.upper()}; q=0.9", PARQUET),
        (f"application/json, {PARQUET};q=0.9", "application/json"),
        (f"application/json;q=0.1, {PARQUET};q=0", "application/json"),
        (f"application/json;q=0.1, {PARQUET};q=inf", "application/json"),
    ],
)
def test_accept_chooses_the_format(client: TestClient, raw: dict[str, Any], accepted: str, given: str) -> None:
    assert raw
    found = client.get(f"{RUNS}/raw?points=100", headers={"Accept": accepted})
    assert (found.status_code, found.headers["content-type"]) == (200, given)
    assert set(found.headers["vary"].split(", ")) == {"Accept", "Accept-Encoding"}


@pytest.mark.parametrize("question", ["", "?points=100"])
@pytest.mark.parametrize("accept", ["application/json", PARQUET])
def test_what_is_known_is_not_decoded_nor_sent(
    client: TestClient, raw: dict[str, Any], monkeypatch: pytest.MonkeyPatch, question: str, accept: str
) -> None:
    assert raw
    headers = {"Accept": accept}
    first = client.get(f"{RUNS}/raw{question}", headers=headers)
    tag = first.headers["etag"]
    assert tag.startswith('"')
    assert client.get(f"{RUNS}/raw{question}", headers=headers).content == first.content
    monkeypatch.setattr(channels, "stored", None)
    monkeypatch.setattr(raw_run, "write_run", None)
    held = client.get(f"{RUNS}/raw{question}", headers=headers | {"If-None-Match": f'"other", W/{tag}'})
    assert (held.status_code, held.content, held.headers["etag"]) == (304, b"", tag)


def test_a_packed_plot_has_a_tag_of_its_own(client: TestClient, raw: dict[str, Any]) -> None:
    assert raw
    packed, plain = (
        client.get(f"{RUNS}/raw?points=100", headers={"Accept-Encoding": coding}) for coding in ("gzip", "identity")
    )
    assert packed.json() == plain.json()
    assert (packed.headers["content-encoding"], plain.headers.get("content-encoding")) == ("gzip", None)
    assert packed.headers["etag"] != plain.headers["etag"]
    assert int(packed.headers["content-length"]) < int(plain.headers["content-length"]) == len(plain.content)


def test_nothing_is_left_on_disk(
    client: TestClient, raw: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert raw
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    assert client.get(f"{RUNS}/raw").status_code == 200
    assert client.get(f"{RUNS}/nobody").status_code == 404
    assert list(folder.iterdir()) == []


def test_lists_hold_no_channels(client: TestClient, raw: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither in what is answered nor in what is read for it."""
    assert raw
    client.post(RUNS, json=stationary(1000)).raise_for_status()
    for name in ("stored", "stored_of_run", "lengths"):
        monkeypatch.setattr(channels, name, None)
    names = ("runs", "runs.csv", "loops", "stribeck", "series", "degradation", "remaining-useful-life", "diagnoses")
    for address in ("/v1/clutches", *(f"/v1/clutches/c1/{name}" for name in names)):
        found = client.get(address)
        assert (found.status_code, '"channels"' in found.text) == (200, False), address
    assert client.get(RUNS).json()["items"][0]["run_id"] == "raw"
