"""While runs are held, every answer that says what remains or how a clutch ages says so too.

Answers are found in the API's description, so that new ones are asked as well.
"""

import csv
import io
import re

from fastapi.testclient import TestClient

from tests.service.clients import filled_client
from tests.support import stationary

CLUTCH = "/v1/clutches/c1"
FEW = {"pressures": (4.0, 6.0), "speeds": (20, 120, 320, 520, 1020, 1320, 1620, 1970)}
#: What an answer concludes from the runs that count.
CONCLUSIONS = (
    "remaining_cycles",
    "end_of_life_cycles",
    "at_least",
    "trajectory",
    "coefficients",
    "scale_cycles_sd",
    "parameters",
    "headline",
    "fits",
    "mean_cof",
    "simulated",
)
#: The runs themselves; rules, which conclude nothing; how right the predictions of an ended life were.
OF_EACH_RUN = ("/runs", "/runs.csv", "/v1/alarms", "/scores", "/scores.csv")
#: Answers that conclude something, whatever else there is.
ANSWERS = (
    "",
    "/remaining-useful-life",
    "/degradation",
    "/surfaces",
    "/stribeck",
    "/stribeck.csv",
    "/engagement",
)
#: How an answer says that two runs are held.
SAID = re.compile(r'"held(_runs)?":(2\b|2\.0\b|\{"count":2\b)|"(code|quantity)":"held_runs"|2 (runs are|held runs)')


@filled_client
def held(client: TestClient) -> None:
    """A clutch with four tests that count and two that are held."""
    for cycles in (0.0, 1000.0, 2000.0, 3000.0):
        _sent(client, cycles, 1.0, "accepted")
    for cycles in (4000.0, 5000.0):
        _sent(client, cycles, 60.0, "held")


def _sent(client: TestClient, cycles: float, gain: float, state: str) -> None:
    body = stationary(cycles, run_id=f"r{cycles:g}", **FEW)  # type: ignore[arg-type]
    body["channels"]["torque_nm"] = [gain * torque for torque in body["channels"]["torque_nm"]]
    answer = client.post(f"{CLUTCH}/runs", json=body)
    assert (answer.status_code, answer.json()["state"]) == (201, state), answer.json()


def test_no_answer_of_the_api_stands_without_a_word_while_two_runs_are_held(held: TestClient) -> None:
    rule = {"quantity": "remaining_cycles", "probability": 0.05, "below": 1e9, "clutch_id": "c1"}
    assert held.post("/v1/alarms", json=rule).status_code == 201
    described = held.get("/openapi.json").json()["paths"]
    addresses = [
        path.replace("{clutch_id}", "c1")
        for path, methods in described.items()
        if "get" in methods and path.startswith("/v1/") and re.findall(r"\{\w+\}", path) in ([], ["{clutch_id}"])
    ]
    asked = []
    for address in addresses:
        answer = held.get(address)
        assert answer.status_code in (200, 404, 422), address
        text = answer.text
        if answer.status_code != 200 or address.endswith(OF_EACH_RUN) or not any(name in text for name in CONCLUSIONS):
            continue
        asked.append(address)
        if address.endswith(".csv"):
            rows = list(csv.DictReader(io.StringIO(text)))
            values = [
                row.get("held_runs") or (row["value"] if row.get("quantity") == "held_runs" else "") for row in rows
            ]
            assert {value for value in values if value} in ({"2"}, {"2.0"}), address
        else:
            assert SAID.search(text), f"{address} says nothing of held runs: {text[:400]}"
    forecast = held.post(f"{CLUTCH}/remaining-useful-life/forecast", json={"programme": [{"cycles": 5000}]})
    assert SAID.search(forecast.text)
    assert {f"{CLUTCH}{end}" for end in ANSWERS} <= set(asked)
    assert {"/v1/clutches", f"{CLUTCH}/remaining-useful-life.csv", f"{CLUTCH}/degradation.csv"} <= set(asked)
    (raised,) = held.get("/v1/alarms/events").json()["items"]
    assert raised["message"].endswith("2 runs are held and do not count")

    for answer in ("degradation", "surfaces", "stribeck", "engagement", "loops"):
        said = held.get(f"{CLUTCH}/{answer}").json()
        warnings = [warning["message"] for warning in said["warnings"] if warning["code"] == "held_runs"]
        assert (said["held_runs"], warnings) == (2, ["2 runs are held and do not count: this is without them"]), answer


def test_an_earlier_life_and_an_earlier_time_say_what_was_held_of_them(held: TestClient) -> None:
    rebuild = {"kind": "maintenance", "event": "rebuild", "cycles": 6000.0, "run_id": "rebuilt"}
    assert held.post(f"{CLUTCH}/runs", json=rebuild).status_code == 201
    _sent(held, 6000.0, 1.0, "accepted")
    for query, count in (({"life": 1}, 2), ({"life": 1, "at_cycles": 4500}, 1), ({"at_cycles": 3500}, 0)):
        life = held.get(f"{CLUTCH}/remaining-useful-life", params=query).json()
        assert (life["held_runs"] or {"count": 0})["count"] == count, query
        assert ("held_runs" in {warning["code"] for warning in life["warnings"]}) is (count > 0)
        assert held.get(f"{CLUTCH}/degradation", params=query).json()["held_runs"] == count, query
