"""The plate's temperature, front and rear: sent as JSON or as a file, checked, kept, given back, and read as one mean."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.lives.incoming_run import SampledChannels, sampled_record, stationary_plateaus
from tests.service.run_files.test_upload import dynamic_record, raw_record
from tests.support import stationary

RUNS = "/v1/clutches/c1/runs"
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
    answer = client.post(RUNS, json=run | {"run_id": "r", "cycles": 10, "channels": channels})
    assert answer.status_code == 201, answer.text
    assert client.get(f"{RUNS}/r").json()["channels"] == channels


def test_a_file_brings_it_by_its_titles(client: TestClient) -> None:
    channels = with_plate(stationary(0)["channels"], FRONT, REAR)
    titles = {FRONT: "T_plate front [K]", REAR: "Lamellentemperatur hinten [°C]"}
    columns = channels | {FRONT: [value + 273.15 for value in channels[FRONT]]}
    lines = [",".join(titles.get(name, name) for name in columns)]
    lines += [",".join(map(repr, row)) for row in zip(*columns.values(), strict=True)]
    for kind in ("stationary_stribeck", "dynamic_stribeck"):
        if kind == "dynamic_stribeck":
            lines = [f"time_s,{lines[0]}", *(f"{0.01 * row},{line}" for row, line in enumerate(lines[1:]))]
        sent = client.post(f"{RUNS}/file?kind={kind}&cycles=0&run_id={kind}", content="\n".join(lines).encode())
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
        if mean is None:
            assert read.plate_temperature is None
        else:
            assert read.plate_temperature is not None
            assert read.plate_temperature[0] == pytest.approx(mean)
