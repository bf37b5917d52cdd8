"""Hidden effects go in over HTTP as the contract's runs, and the service has to name them."""

from typing import Any

import httpx2
import pytest

from tests.lab.blind.rig.hide import Hidden, hide
from tests.lab.blind.rig.sent import runs

VERDICTS = {"model_adequate", "cause_named", "cause_ambiguous", "unexplained_structure", "insufficient_data"}
BASE = "/v1/clutches/blind"


def diagnosed(http: httpx2.Client, hidden: Hidden) -> dict[str, Any]:
    """The finished report on a hidden campaign that was posted run by run."""
    assert http.post("/v1/clutches", json={"clutch_id": "blind"}).status_code == 201
    for run in runs(hidden):
        answer = http.post(f"{BASE}/runs", json=run | {"origin": "simulated"})
        assert answer.status_code == 201, answer.text
    request = {"json": {"adopt": False}, "headers": {"Prefer": "wait=400"}}  # a busy machine takes its time
    answer = http.post(f"{BASE}/diagnoses", **request)
    assert answer.status_code == 201, answer.text
    report: dict[str, Any] = answer.json()
    assert report["status"] == "finished"
    assert report["verdict"] in VERDICTS
    assert http.get(f"{BASE}/diagnoses/{report['diagnosis_id']}").json() == report
    return report


@pytest.mark.slow
def test_a_hidden_effect_is_found(http: httpx2.Client) -> None:
    """λ = 100: an oracle sees it beyond any doubt. Whatever else stands in the set, the truth leads it."""
    slug = "squeeze_film"
    report = diagnosed(http, hide((31, 1), (slug,), 100.0))
    assert report["verdict"] in {"cause_named", "cause_ambiguous"}
    assert slug in report["causes"]
    assert report["candidates"][0]["effect"] == slug
    assert report["candidates"][0]["probability"] > 0.5
    assert report["extended"]["rmse_nm"] <= report["baseline"]["rmse_nm"]
    assert len(report["summary"]) > 40


@pytest.mark.slow
def test_where_nothing_is_hidden_the_model_is_adequate(http: httpx2.Client) -> None:
    report = diagnosed(http, hide((31, 2)))
    assert report["verdict"] == "model_adequate"
    assert report["causes"] == []


@pytest.mark.slow
def test_what_no_catalogue_has_is_not_named(http: httpx2.Client) -> None:
    report = diagnosed(http, hide((31, 3), ("speed_bump",), 100.0))
    assert report["verdict"] == "unexplained_structure"
    assert report["causes"] == []
    assert report["baseline"]["where"][0]["axis"] == "speed_rpm"
