"""Raw records, dynamic tests and files through the service; the plate's temperature among their channels."""

import json
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.clutch.incoming_run import SampledChannels, sampled_record, stationary_plateaus
from tests.service.clients import csv_text, post_run
from tests.support import stationary, torque_nm

RUNS = "/v1/clutches/c1/runs"
PRESSURES, SPEEDS = (4.0, 5.0, 6.0), (20, 270, 520, 770, 1020, 1320, 1620, 1970)


def raw_record(rate: float = 50.0, dwell: float = 5.0, tau: float = 0.1) -> dict[str, list[float]]:
    """A stationary test as its recorder saw it: three pressures, eight speeds, an exponential approach to each torque."""
    rng = np.random.default_rng(3)
    steps = [(p, n) for p in PRESSURES for n in SPEEDS]
    per = int(rate * dwell)
    clock = np.arange(per) / rate
    torque, before = [], 0.0
    for pressure, speed in steps:
        level = torque_nm(pressure, speed, 0.0)
        torque.append(level + (before - level) * np.exp(-clock / tau))
        before = level
    rows = per * len(steps)
    return {
        "time_s": (np.arange(rows) / rate).tolist(),
        "pressure_bar": (np.repeat([p for p, _ in steps], per) + 0.01 * rng.standard_normal(rows)).tolist(),
        "speed_rpm": (np.repeat([n for _, n in steps], per) + rng.standard_normal(rows)).tolist(),
        "torque_nm": (np.concatenate(torque) + 0.2 * rng.standard_normal(rows)).tolist(),
    }


def plateaus() -> dict[str, Any]:
    """The same test as exact plateaus."""
    return stationary(0, noise=0.0, pressures=PRESSURES, speeds=SPEEDS)


def dynamic_record(rate: float = 100.0) -> dict[str, list[float]]:
    """15 s of a sine at 5 bar whose torque is 2 Nm higher in acceleration than in deceleration at the middle."""
    rng = np.random.default_rng(4)
    time = np.arange(0, 15, 1 / rate)
    phase = 2 * np.pi * 0.1 * time
    speed = 1000 - 1000 * np.cos(phase)
    torque = np.array([torque_nm(5.0, max(n, 1e-9), 0.0) for n in speed]) + np.sin(phase)
    return {
        "time_s": time.tolist(),
        "pressure_bar": (5 + 0.005 * rng.standard_normal(time.size)).tolist(),
        "speed_rpm": speed.tolist(),
        "torque_nm": (torque + 0.05 * rng.standard_normal(time.size)).tolist(),
    }


def test_a_raw_record_gives_the_fits_of_its_plateaus(client: TestClient) -> None:
    raw = post_run(client, {"kind": "stationary_stribeck", "cycles": 0, "channels": raw_record()})
    client.post("/v1/clutches", json={"clutch_id": "exact"})
    exact = post_run(client, plateaus(), "exact")
    assert [fit["pressure_bar"] for fit in raw["fits"]] == [4.0, 5.0, 6.0]
    for fitted, true in zip(raw["fits"], exact["fits"], strict=True):
        assert fitted["points"] == 8
        assert abs(fitted["mean_cof"] - true["mean_cof"]) < 4 * fitted["mean_cof_sd"]
    assert client.get(f"{RUNS}/{raw['run_id']}").json()["channels"] == raw_record()


def test_a_sweep_without_a_plateau_and_a_clock_in_whole_seconds_are_refused(client: TestClient) -> None:
    raw, dynamic = raw_record(), dynamic_record()
    ramp = np.linspace(0, 20, len(raw["time_s"]))
    steady = {"torque_nm": ramp.tolist(), "speed_rpm": (100 * ramp).tolist()}
    coarse = {"time_s": np.floor(dynamic["time_s"]).tolist()}
    for kind, channels, code in (
        ("stationary", raw | steady, "no_plateau"),
        ("dynamic", dynamic | coarse, "time_stands"),
    ):
        answer = client.post(RUNS, json={"kind": f"{kind}_stribeck", "cycles": 0, "channels": channels})
        assert (answer.status_code, answer.json()["errors"][0]["code"]) == (422, code)
    assert client.get(RUNS).json()["items"] == []


def test_a_dynamic_test_gets_its_loop(client: TestClient) -> None:
    """Whole periods only: 15 s at 0.1 Hz are one; the area is that of the ellipse, π · 1 Nm · the velocity's amplitude."""
    client.post(RUNS, json=plateaus())
    (loop,) = post_run(client, {"kind": "dynamic_stribeck", "cycles": 0, "channels": dynamic_record()})["loops"]
    amplitude = 1000 * 2 * np.pi / 60 * 0.058
    assert loop["periods"] == 1
    assert loop["pressure_bar"] == 5.0
    assert loop["loop_area_nm_m_s"] == pytest.approx(np.pi * amplitude, rel=0.02)
    items = client.get("/v1/clutches/c1/loops").json()["items"]
    assert [(item["cycles"], item["loop_area_nm_m_s"]) for item in items] == [(0, loop["loop_area_nm_m_s"])]
    assert len(client.get("/v1/clutches/c1/loops.csv").text.splitlines()) == 2
    post_run(client, {"kind": "dynamic_stribeck", "cycles": 500, "channels": dynamic_record()})
    first = client.get("/v1/clutches/c1/loops?limit=1").json()
    assert (first["items"], first["next"] is None) == (items, False)


def test_a_stationary_test_that_comes_later_gives_the_loops_their_curve(client: TestClient) -> None:
    """Whatever the order of arrival, a dynamic test's lag is estimated against its state's stationary curve."""
    dynamic = {"kind": "dynamic_stribeck", "cycles": 0, "run_id": "d", "channels": dynamic_record()}
    client.post(RUNS, json=dynamic)
    assert client.get(f"{RUNS}/d").json()["loops"][0]["status"] == "no_curve"
    client.post(RUNS, json=plateaus())
    later = client.get(f"{RUNS}/d").json()["loops"]
    client.post("/v1/clutches", json={"clutch_id": "other"})
    client.post("/v1/clutches/other/runs", json=plateaus())
    assert client.post("/v1/clutches/other/runs", json=dynamic).json()["loops"] == later
    assert later[0]["status"] != "no_curve"


def csv_of(columns: dict[str, list[float]]) -> bytes:
    """The columns as a German recorder would write them."""
    rows = zip(*columns.values(), strict=True)
    lines = [";".join(columns), *(";".join(f"{x:.9g}".replace(".", ",") for x in row) for row in rows)]
    return ("# Prüfstand 3\r\n" + "\r\n".join(lines) + "\r\n").encode("utf-16")


@pytest.mark.parametrize("form", [False, True], ids=["body", "form"])
def test_a_file_is_the_run_that_it_holds(client: TestClient, form: bool) -> None:
    columns = plateaus()["channels"]
    address = f"{RUNS}/file?kind=stationary_stribeck&cycles=0&run_id=from-file&filename=test.csv"
    if form:
        answer = client.post(address, files={"file": ("test.csv", csv_of(columns), "text/csv")})
    else:
        answer = client.post(address, content=csv_of(columns), headers={"Content-Type": "text/csv"})
    assert answer.status_code == 201, answer.text
    sent = client.get(f"{RUNS}/from-file").json()["channels"]
    assert sent["speed_rpm"] == columns["speed_rpm"]
    assert sent["torque_nm"] == pytest.approx(columns["torque_nm"], rel=1e-8)
    assert client.post(address, content=csv_of(columns)).json()["duplicate"] is True


def test_a_wrong_file_is_refused_and_nothing_is_stored(client: TestClient) -> None:
    address = f"{RUNS}/file?kind=stationary_stribeck&cycles=0"
    columns = plateaus()["channels"]
    bad = csv_of({**columns, "torque_nm": [*columns["torque_nm"][:-1], float("nan")]})
    short = csv_of({"speed_rpm": [1.0, 2.0], "torque_nm": [1.0, 2.0]})
    for content in (b"", b"\x89PNG\r\n\x1a\n" + bytes(100), b"a,b\n1,2\n", short, bad):
        answer = client.post(address, content=content)
        assert (answer.status_code, answer.headers["content-type"]) == (422, "application/problem+json"), content[:20]
    assert client.post(f"{RUNS}/file?kind=maintenance&cycles=0", content=b"x").status_code == 422
    assert client.post(f"{RUNS}/file?kind=stationary_stribeck&cycles=-1", content=b"x").status_code == 422
    assert client.get(RUNS).json()["items"] == []


def test_a_page_of_another_site_may_not_post(client: TestClient) -> None:
    body = json.dumps({"clutch_id": "c2"})
    headers = {"Content-Type": "application/json", "Origin": "http://evil.example"}
    assert client.post("/v1/clutches", content=body, headers=headers).status_code == 403
    headers["Origin"] = "http://127.0.0.1"
    assert client.post("/v1/clutches", content=body, headers=headers).status_code == 201


# --- The plate's temperature, front and rear: sent as JSON or as a file, checked, kept, given back, and read as one mean.


FRONT, REAR = "plate_temperature_front_c", "plate_temperature_rear_c"


def with_plate(channels: dict[str, list[float]], *names: str) -> dict[str, list[float]]:
    """The channels, and each of the plate's thermometers a little warmer than the one before."""
    rows = np.arange(len(channels["torque_nm"]))
    return channels | {name: (90.0 + 2.0 * place + 0.01 * rows).tolist() for place, name in enumerate(names)}


@pytest.mark.parametrize(
    "run",
    [
        {"kind": "stationary_stribeck", "channels": stationary(0)["channels"]},
        {"kind": "stationary_stribeck", "channels": raw_record()},
        {"kind": "dynamic_stribeck", "channels": dynamic_record()},
        {"kind": "duty_cycles", "duty": {"cycles": 10}, "channels": dynamic_record()},
    ],
    ids=["plateaus", "raw", "dynamic", "engagement"],
)
def test_what_was_sent_is_given_back(client: TestClient, run: dict[str, Any]) -> None:
    channels = with_plate(run["channels"], FRONT, REAR)
    post_run(client, run | {"run_id": "r", "cycles": 10, "channels": channels})
    assert client.get(f"{RUNS}/r").json()["channels"] == channels


def test_a_file_brings_it_by_its_titles(client: TestClient) -> None:
    channels = with_plate(stationary(0)["channels"], FRONT, REAR)
    titles = {FRONT: "T_plate front [K]", REAR: "Lamellentemperatur hinten [°C]"}
    columns = channels | {FRONT: [value + 273.15 for value in channels[FRONT]]}
    titled = {titles.get(name, name): values for name, values in columns.items()}
    clock = {"time_s": [0.01 * row for row in range(len(channels[FRONT]))]}
    for kind, content in (("stationary_stribeck", titled), ("dynamic_stribeck", clock | titled)):
        sent = client.post(f"{RUNS}/file?kind={kind}&cycles=0&run_id={kind}", content=csv_text(content))
        assert sent.status_code == 201, sent.text
        kept = client.get(f"{RUNS}/{kind}").json()["channels"]
        np.testing.assert_allclose(kept[FRONT], channels[FRONT])
        assert kept[REAR] == channels[REAR]


def test_it_is_refused_below_absolute_zero(client: TestClient) -> None:
    body = stationary(0)
    body["channels"] = with_plate(body["channels"], FRONT, REAR)
    body["channels"][REAR][3] = -300.0
    answer = client.post(RUNS, json=body)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == f"/channels/{REAR}/3"


@pytest.mark.parametrize(
    ("names", "mean"), [((FRONT,), 363.15), ((REAR,), 363.15), ((FRONT, REAR), 364.15), ((), None)]
)
def test_the_plate_is_as_warm_as_the_mean_of_its_thermometers(names: tuple[str, ...], mean: float | None) -> None:
    channels = {name: np.array(values) for name, values in with_plate(dynamic_record(), *names).items()}
    rows = {name: values for name, values in channels.items() if name != "time_s"}
    for read in (sampled_record(channels), SampledChannels(channels), stationary_plateaus(rows)):
        plate = read.plate_temperature
        assert plate is None if mean is None else plate[0] == pytest.approx(mean)
