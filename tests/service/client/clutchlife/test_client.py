"""The client as scripts use it, against a running service: values, tables, exceptions with the service's problem."""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from service.client.clutchlife import Client, ClutchlifeError, RefusedError, ServiceAwayError
from service.client.clutchlife.tables import Frames, columns, table
from tests.support import Server, free_port, serving, stationary

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with serving(tmp_path_factory.mktemp("client") / "clutchlife.db", loaded=True) as running:
        yield running


@pytest.fixture(scope="module")
def client(server: Server) -> Iterator[Client]:
    with Client(server.url) as made:
        made.register("e", friction_material="paper")
        for cycles in (0.0, 1000.0, 2000.0, 3000.0):
            made.post_run("e", stationary(cycles, run_id=f"s{cycles:g}"))
        yield made


def test_clutches_and_runs_are_frames_where_pandas_is_there(client: Client) -> None:
    clutches, runs = client.clutches(), client.runs("e")
    assert isinstance(clutches, pd.DataFrame)
    assert clutches.loc[0, "clutch_id"] == "e"
    assert clutches.loc[0, "state.name"] == client.clutch("e")["state"]["name"]
    assert runs["cycles"].tolist() == [0, 1000, 2000, 3000]


def test_remaining_life_is_the_answer_of_the_api(client: Client) -> None:
    answer = client.remaining_useful_life("e", method="grid")
    assert answer["method"] == "grid"
    assert answer["at_least"] > 0
    planned = client.forecast("e", [{"cycles": 1000}], pace_cycles_per_hour=100)
    assert planned["pace_from"] == "request"


def test_held_runs_are_confirmed_together(client: Client) -> None:
    client.register("held")
    for cycles in (0.0, 1000.0, 2000.0):
        client.post_run("held", stationary(cycles, run_id=f"s{cycles:g}"))
    for cycles in (3000.0, 4000.0):
        body = stationary(cycles, run_id=f"odd-{cycles:g}")
        body["channels"]["torque_nm"] = [60 * torque for torque in body["channels"]["torque_nm"]]
        assert client.post_run("held", body)["state"] == "held"
    answer = client.confirm("held", "odd-3000", "odd-4000", reason="a new lining")
    assert {receipt["state"] for receipt in answer["items"]} == {"accepted"}


def test_a_run_may_be_a_content_its_fields_a_frame_or_a_file(client: Client, tmp_path: Path) -> None:
    client.register("forms")
    body = stationary(500.0)
    first = client.post_run("forms", body)
    again = client.post_run("forms", kind=body["kind"], cycles=500.0, channels=pd.DataFrame(body["channels"]))
    arrays = {name: np.array(values) for name, values in body["channels"].items()}
    assert again["duplicate"]
    assert client.post_run("forms", body, channels=arrays)["run_id"] == first["run_id"]
    as_json = tmp_path / "run.json"
    as_json.write_text(json.dumps(body), encoding="utf-8")
    assert client.post_run("forms", as_json)["duplicate"]
    as_csv = tmp_path / "a.csv"
    pd.DataFrame(stationary(900.0)["channels"]).to_csv(as_csv, index=False)
    assert client.post_run("forms", str(as_csv), kind="stationary_stribeck", cycles=900)["cycles"] == 900
    assert client.post_run("forms", kind="maintenance", event="oil_change", cycles=np.int64(950))["duplicate"] is False


def test_a_refusal_carries_the_problem(client: Client) -> None:
    with pytest.raises(RefusedError) as refused:
        client.post_run("e", stationary(-1.0))
    assert refused.value.status == 422
    assert refused.value.problem["errors"][0]["pointer"] == "/cycles"
    with pytest.raises(ClutchlifeError, match="there is no clutch 'nobody'") as unknown:
        client.remaining_useful_life("nobody")
    assert unknown.value.problem["type"] == "urn:clutchlife:problem:not-found"


def test_a_service_that_is_not_there_is_said_so() -> None:
    with pytest.raises(ServiceAwayError), Client(f"http://127.0.0.1:{free_port()}", patience=0.0) as away:
        away.clutches()


def test_a_diagnosis_is_waited_for(client: Client) -> None:
    report = client.diagnose("e")
    assert report["status"] == "finished"
    assert client.diagnoses("e").loc[0, "diagnosis_id"] == report["diagnosis_id"]


ITEMS: list[dict[str, Any]] = [{"a": 1, "b": {"c": None, "d": [1]}}, {"a": 2.5, "b": {"c": "x", "d": []}}]


def test_tables_have_a_column_for_each_part_of_an_item() -> None:
    frame = table(ITEMS, "pandas")
    assert list(frame.columns) == ["a", "b.c", "b.d"]
    assert table(ITEMS, "list") == ITEMS
    polars = pytest.importorskip("polars")
    assert isinstance(table(ITEMS, "polars"), polars.DataFrame)


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_an_object_that_only_some_items_have_is_no_empty_column_beside_its_own(library: Frames) -> None:
    pytest.importorskip(library)
    frame = table([{"a": 1, "b": None}, {"a": 2, "b": {"c": 3}}, {"a": 4, "b": {}}], library)
    assert list(frame.columns) == ["a", "b.c"]


def test_a_frame_has_a_row_for_each_measurement() -> None:
    items = [
        {
            "run_id": "a",
            "fits": [{"pressure_bar": 4, "mean_cof": 0.1}, {"pressure_bar": 5, "mean_cof": 0.2}],
            "doubts": [],
        },
        {"run_id": "b", "fits": [], "doubts": [{"code": "unit", "message": "?"}, {"code": "dead", "message": "?"}]},
    ]
    rows = table(items, "pandas", row_of="fits")
    assert rows["run_id"].tolist() == ["a", "a", "b"]
    assert rows["pressure_bar"].tolist()[:2] == [4, 5]
    assert rows["doubts"].tolist() == ["", "", "unit, dead"]
    assert table(items, "pandas", without=["fits"]).columns.tolist() == ["run_id", "doubts"]
    assert table(items, "list", row_of="fits") == items


def test_channels_of_any_kind_are_lists() -> None:
    assert columns(pd.DataFrame({"torque_nm": [1.0, 2.0]})) == {"torque_nm": [1.0, 2.0]}
    assert columns({"torque_nm": (1, 2)}) == {"torque_nm": [1, 2]}


@pytest.mark.usefixtures("client")
def test_without_pandas_and_polars_tables_are_lists(server: Server) -> None:
    """And the package needs nothing but httpx2: the service's own packages cannot be imported from where it stands."""
    script = (
        "import sys; sys.modules.update(dict.fromkeys(('pandas', 'polars', 'numpy', 'pydantic', 'fastapi')));"
        "import importlib.util as u; real = u.find_spec;"
        "u.find_spec = lambda name, *more: None if name in ('pandas', 'polars') else real(name, *more);"
        f"from clutchlife import Client; print([run['cycles'] for run in Client({server.url!r}).runs('e')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT / "service" / "client", capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "[0, 1000, 2000, 3000]", done.stderr
