"""The client as scripts use it: values, tables, problems as exceptions; it waits while the service is away."""

import json
import subprocess
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pandas as pd
import pytest

from service.client.clutchlife import Client, ClutchlifeError, transport
from service.client.clutchlife.answers import RefusedError, ServiceAwayError, retry_after
from service.client.clutchlife.tables import Frames, table
from service.client.clutchlife.transport import Service
from tests.service.cli.sending.stand_in_service import URL
from tests.service.web.test_import_preview import foreign
from tests.support import Server, serving, stationary

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


def test_tables_are_frames_where_pandas_is_there_and_other_answers_those_of_the_api(client: Client) -> None:
    clutches, runs = client.clutches(), client.runs("e")
    assert isinstance(clutches, pd.DataFrame)
    assert clutches.loc[0, "clutch_id"] == "e"
    assert clutches.loc[0, "state.name"] == client.clutch("e")["state"]["name"]
    assert runs["cycles"].tolist() == [0, 1000, 2000, 3000]
    answer = client.remaining_useful_life("e", method="grid")
    assert answer["method"] == "grid"
    assert answer["at_least"] > 0
    planned = client.forecast("e", [{"cycles": 1000}], pace_cycles_per_hour=100)
    assert planned["pace_from"] == "request"


def test_a_suggestion_is_confirmed_and_kept_for_the_rig(client: Client, tmp_path: Path) -> None:
    client.register("KL-4712")
    first, second = tmp_path / "KL-4712_01500.csv", tmp_path / "KL-4712_03000.csv"
    for path in (first, second):
        path.write_bytes(foreign())
    with pytest.raises(RefusedError) as caught:
        client.post_run("KL-4712", first)
    assert caught.value.suggestion is not None
    assert caught.value.suggestion["map"]["torque_nm"] == "Couple FZG"
    assert client.confirm_suggestion("KL-4712", first, caught.value, rig="bench-fr")["cycles"] == 1500
    assert client.post_run("KL-4712", second, rig="bench-fr")["cycles"] == 3000
    with pytest.raises(ValueError, match="no suggestion"):
        client.confirm_suggestion("KL-4712", first, RefusedError(422, {}))


def test_held_runs_are_confirmed_together(client: Client) -> None:
    client.register("held")
    for cycles in (0.0, 1000.0, 2000.0):
        client.post_run("held", stationary(cycles))
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


def test_a_diagnosis_is_waited_for(client: Client) -> None:
    report = client.diagnose("e")
    assert report["status"] == "finished"
    assert client.diagnoses("e").loc[0, "diagnosis_id"] == report["diagnosis_id"]


@pytest.mark.parametrize("library", ["pandas", "polars"])
@pytest.mark.parametrize(
    ("items", "columns"),
    [
        ([{"a": 1, "b": {"c": None, "d": [1]}}, {"a": 2.5, "b": {"c": "x", "d": []}}], ["a", "b.c", "b.d"]),
        # an object that only some items have is no empty column beside its own
        ([{"a": 1, "b": None}, {"a": 2, "b": {"c": 3}}, {"a": 4, "b": {}}], ["a", "b.c"]),
    ],
)
def test_tables_have_a_column_for_each_part(library: Frames, items: list[dict[str, Any]], columns: list[str]) -> None:
    frames = pytest.importorskip(library)
    frame = table(items, library)
    assert isinstance(frame, frames.DataFrame)
    assert list(frame.columns) == columns
    assert table(items, "list") == items


def test_a_frame_has_a_row_for_each_measurement() -> None:
    fits = [{"pressure_bar": 4, "mean_cof": 0.1}, {"pressure_bar": 5, "mean_cof": 0.2}]
    doubts = [{"code": "unit", "message": "?"}, {"code": "dead", "message": "?"}]
    items = [{"run_id": "a", "fits": fits, "doubts": []}, {"run_id": "b", "fits": [], "doubts": doubts}]
    rows = table(items, "pandas", row_of="fits")
    assert rows["run_id"].tolist() == ["a", "a", "b"]
    assert rows["pressure_bar"].tolist()[:2] == [4, 5]
    assert rows["doubts"].tolist() == ["", "", "unit, dead"]
    assert table(items, "pandas", without=["fits"]).columns.tolist() == ["run_id", "doubts"]
    assert table(items, "list", row_of="fits") == items


@pytest.mark.usefixtures("client")
def test_without_pandas_and_polars_tables_are_lists(server: Server) -> None:
    """And the package needs nothing but httpx2: the service's own packages cannot be imported from where it stands."""
    script = (
        "import sys; sys.modules.update(dict.fromkeys(('pandas', 'polars', 'numpy', 'pydantic', 'fastapi')));"
        "import importlib.util as u; real = u.find_spec;"
        "u.find_spec = lambda name, *more: None if name in ('pandas', 'polars') else real(name, *more);"
        f"from clutchlife import Client; print([run['cycles'] for run in Client({server.url!r}).runs('e')])"
    )
    here, command = ROOT / "service" / "client", [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=here, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "[0, 1000, 2000, 3000]", done.stderr


# --- It waits while the service is away, on a clock of the test's.


RECEIPT = httpx2.Response(200, json={"run_id": "r1"})


class Clock:
    """Time that passes in `sleep` alone."""

    def __init__(self) -> None:
        self.now = 0.0
        self.waits: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.waits.append(seconds)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    fake = Clock()
    monkeypatch.setattr(transport, "time", fake)
    return fake


Served = httpx2.Response | Exception


def service(*answers: Served, patience: float = 60.0) -> Service:
    """A service that gives these answers in turn, the last one for ever."""
    left = list(answers)

    def handle(_request: httpx2.Request) -> httpx2.Response:
        answer = left.pop(0) if len(left) > 1 else left[0]
        if isinstance(answer, Exception):
            raise answer
        return answer

    return Service(http=httpx2.Client(base_url=URL, transport=httpx2.MockTransport(handle)), patience=patience)


def test_it_waits_for_a_service_that_comes_back(clock: Clock) -> None:
    away: list[Served] = [
        httpx2.ConnectError("refused"),
        httpx2.Response(502),
        httpx2.Response(429),
        httpx2.Response(308, headers={"Location": "https://login.test"}),
        httpx2.Response(200, html="<p>log in</p>"),
    ]
    assert service(*away, RECEIPT).get("/x") == {"run_id": "r1"}
    assert clock.waits == [0.25, 0.5, 1.0, 2.0, 4.0]


def test_it_waits_as_long_as_it_is_told(clock: Clock) -> None:
    later = {"Date": "Sun, 01 Mar 2026 12:00:00 GMT", "Retry-After": "Sun, 01 Mar 2026 12:00:20 GMT"}
    assert service(httpx2.Response(503, headers=later), RECEIPT).get("/x")
    assert service(httpx2.Response(429, headers={"Retry-After": "9"}), RECEIPT).get("/x")
    assert clock.waits == [20.0, 9.0]


@pytest.mark.parametrize(
    ("answer", "patience", "words"),
    [
        (httpx2.Response(503, headers={"Retry-After": "86400"}), 60.0, "503"),
        (httpx2.Response(200, html="<html>Please log in</html>"), 0.0, "login page"),
        (httpx2.Response(308, headers={"Location": "https://new.test/"}), 0.0, "https://new.test/"),
    ],
)
def test_no_wait_goes_beyond_its_patience(clock: Clock, answer: httpx2.Response, patience: float, words: str) -> None:
    with pytest.raises(ServiceAwayError, match=words):
        service(answer, patience=patience).get("/x")
    assert clock.waits == []


@pytest.mark.parametrize(
    ("answer", "perhaps"),
    [
        (httpx2.ConnectError("refused"), False),
        (httpx2.Response(503), False),
        (httpx2.Response(429), False),
        (httpx2.Response(302), False),
        (httpx2.ReadTimeout("slow"), True),
        (httpx2.RemoteProtocolError("cut"), True),
        (httpx2.Response(504), True),
        (httpx2.DecodingError("not gzip"), True),
    ],
    ids=str,
)
@pytest.mark.usefixtures("clock")
def test_it_tells_whether_a_lost_request_may_have_been_carried_out(answer: Served, perhaps: bool) -> None:
    with pytest.raises(ServiceAwayError) as raised:
        service(answer, patience=5).post("/x", {})
    assert raised.value.perhaps_stored is perhaps


def test_what_is_refused_is_not_tried_again(clock: Clock) -> None:
    for status in (400, 401, 404, 409, 413, 422, 500):
        with pytest.raises(RefusedError, match=str(status)):
            service(httpx2.Response(status, text="no")).get("/x")
    with pytest.raises(RefusedError):
        Service(http=httpx2.Client(base_url="nowhere")).get("/x")
    assert clock.waits == []


@pytest.mark.parametrize(
    ("headers", "seconds"),
    [
        ({}, 0),
        ({"Retry-After": "7"}, 7),
        ({"Retry-After": "Sun, 01 Mar 2026 12:01:30 GMT"}, 90),
        ({"Retry-After": "Sat, 28 Feb 2026 12:00:00 GMT"}, 0),
        ({"Retry-After": "Sun, 01 Mar 2026 12:00:20 -0000"}, 20),
        ({"Retry-After": "Sunday, 01-Mar-26 12:00:30 GMT"}, 30),
        *(({"Retry-After": text}, 0) for text in ("-3", "nan", "inf", "1e9", "soon", "", "Mon, 99 Foo 2026")),
        # this machine's clock is a year behind: the service's own says how long it is
        ({"Date": "Mon, 01 Mar 2027 12:00:00 GMT", "Retry-After": "Mon, 01 Mar 2027 12:00:05 GMT"}, 5),
    ],
    ids=str,
)
def test_retry_after_is_a_number_or_a_date(headers: dict[str, str], seconds: float) -> None:
    assert retry_after(httpx2.Headers(headers), now=datetime(2026, 3, 1, 12, tzinfo=UTC)) == seconds
