"""A life is declared ended: it reads so, takes in nothing later, can be taken back, and teaches its fleet."""

import csv
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest
from fastapi.testclient import TestClient

from service.changes.learn_fleet import refresh
from storage.engine.opening import open_database
from tests.lab.real import loaders
from tests.service.clients import filled_client
from tests.service.jobs.replaying import InThread
from tests.service.jobs.waiting import until
from tests.support import serving, stationary

RUNS, LIFE = "/v1/clutches/c1/runs", "/v1/clutches/c1/remaining-useful-life"
END = {"kind": "maintenance", "event": "end_of_life", "cycles": 3000}
REBUILD = {"kind": "maintenance", "event": "rebuild", "cycles": 3000, "run_id": "rebuilt"}
FEW = {"pressures": (5.0,), "speeds": (20, 120, 320, 520, 1020, 1320, 1620, 1970)}


def post(client: httpx2.Client, body: dict[str, Any], status: int = 201, path: str = RUNS) -> Any:
    """The answer to a run that is sent."""
    answer = client.post(path, json=body)
    assert answer.status_code == status, answer.json()
    return answer.json()


@filled_client
def tested(client: TestClient) -> None:
    """A clutch with four tests up to 3000 cycles, half of the way to its end."""
    for cycles in (0, 1000, 2000, 3000):
        post(client, stationary(cycles, run_id=f"test-{cycles}", **FEW))


def life(client: TestClient, **query: Any) -> Any:
    """What the clutch's remaining life is now."""
    return client.get(LIFE, params=query).json()


@pytest.mark.parametrize("method", ["particle", "ukf", "grid"])
def test_a_worn_clutch_reads_ended_and_nothing_remains(tested: TestClient, method: str) -> None:
    before = life(tested, method=method)
    assert (before["status"] != "ended", before["ended"]) == (True, None)
    receipt = post(tested, END | {"note": "squeals"})
    assert (receipt["event"], receipt["reason"], receipt["note"]) == ("end_of_life", "worn", "squeals")
    now = life(tested, method=method)
    assert now["status"] == "ended"
    assert now["ended"] == {"cycles": 3000, "reason": "worn", "run_id": receipt["run_id"]}
    assert set(now["remaining_cycles"].values()) == {0}
    assert set(now["end_of_life_cycles"].values()) == {3000}
    assert (now["probability_of_reaching"], now["current"]["health"]) == (1, 0)
    assert now["current"]["mean_cof"] == before["current"]["mean_cof"]
    (listed,) = tested.get("/v1/clutches").json()["items"]
    assert (listed["summary"]["status"], listed["summary"]["ended"]["cycles"]) == ("ended", 3000)
    assert listed["state"] == {"name": "failure", "why": "ended at 3,000 cycles"}
    assert life(tested, method=method, at_cycles=2000)["ended"] is None
    assert life(tested, quantity="static_torque_nm", method=method)["status"] == "ended"
    plan = {"programme": [{"cycles": 100, "energy_per_cycle_kj": 10}]}
    planned = tested.post(f"{LIFE}/forecast", json=plan, params={"method": method}).json()
    assert (planned["status"], set(planned["remaining_cycles"].values())) == ("ended", {0})


def test_a_clutch_that_was_taken_out_is_no_failure_and_its_end_lies_ahead(tested: TestClient) -> None:
    before = life(tested)
    post(tested, END | {"reason": "other"})
    now = life(tested)
    assert (now["status"], now["ended"]["reason"]) == ("ended", "other")
    assert set(now["remaining_cycles"].values()) == {None}
    assert now["end_of_life_cycles"] == before["end_of_life_cycles"]
    (listed,) = tested.get("/v1/clutches").json()["items"]
    assert listed["state"] == {"name": "normal", "why": "ended at 3,000 cycles, taken out before it was worn"}


def test_nothing_later_is_taken_in_until_a_rebuild_and_what_is_earlier_still_is(tested: TestClient) -> None:
    assert post(tested, END | {"reason": "broken"}, 422)["errors"][0]["pointer"] == "/reason"
    alone = {"kind": "maintenance", "event": "rest", "cycles": 1, "reason": "worn"}
    assert "end_of_life" in post(tested, alone, 422)["detail"]
    assert "'test-3000' at 3000 cycles" in post(tested, END | {"cycles": 2500}, 409)["detail"]
    assert life(tested)["ended"] is None
    end = post(tested, END)
    late = stationary(4000, run_id="late", **FEW)
    duty = {"kind": "duty_cycles", "cycles": 4000, "duty": {"cycles": 1000}}
    for body in (late, duty, END | {"cycles": 2500}, END | {"reason": "other"}):
        problem = post(tested, body, 409)
        assert problem["type"].endswith("life-ended")
        declared = 2500 if body.get("cycles") == 2500 else 3000
        assert f"declared end at {declared} cycles" in problem["detail"]
        assert (end["run_id"] in problem["detail"]) is (declared == 3000)
        assert ("a second end" in problem["detail"]) is (body["cycles"] == 3000)
    for same in (END, END | {"reason": "worn"}):
        again = post(tested, same, 200)
        assert (again["duplicate"], again["run_id"]) == (True, end["run_id"])
    assert tested.patch(f"{RUNS}/test-3000", json={"cycles": 3500, "reason": "typo"}).status_code == 409
    assert post(tested, stationary(1500, run_id="early", **FEW))["state"] == "accepted"
    assert life(tested)["status"] == "ended"
    post(tested, {"kind": "maintenance", "event": "other", "cycles": 4000})
    assert life(tested)["status"] == "ended"
    post(tested, REBUILD)
    post(tested, late)
    assert life(tested)["status"] == "insufficient_data"
    assert life(tested, life=1)["status"] == "ended"
    problem = post(tested, {"reason": "none was made"}, 409, f"{RUNS}/rebuilt/withdraw")
    assert "late" in problem["detail"]


def test_a_declared_end_is_taken_back_and_all_is_as_it_was(tested: TestClient) -> None:
    before = life(tested)
    end = post(tested, END)
    post(tested, {"reason": "the wrong clutch"}, 200, f"{RUNS}/{end['run_id']}/withdraw")
    after = life(tested)
    assert {**after, "revision": 0} == {**before, "revision": 0}
    later = post(tested, stationary(4000, run_id="later", **FEW))
    assert later["state"] == "accepted"
    assert post(tested, {"reason": "ended after all"}, 409, f"{RUNS}/{end['run_id']}/restore")


@pytest.mark.slow
def test_declared_ends_teach_the_fleet_by_themselves(client: TestClient, database_url: str) -> None:
    """Stopped at 95 % of the way to the threshold; four ends and one clutch that was taken out."""
    for number in range(5):
        path = f"/v1/clutches/w{number}"
        post(client, {"clutch_id": f"w{number}"}, path="/v1/clutches")
        end = 4000 + 200 * number
        for part in range(6):
            body = stationary(end * part / 5, run_id=f"t{part}", wear=0.095 * part, noise=0.001, **FEW)
            assert post(client, body, path=f"{path}/runs")["state"] == "accepted"
        stopped = END | {"cycles": end, "reason": "other" if number == 4 else "worn"}
        assert post(client, stopped, path=f"{path}/runs")["state"] == "accepted"
    jobs = client.get("/v1/jobs").json()["items"]
    assert {item["kind"] for item in jobs} == {"fleet_refresh"}
    # the job has the least priority of all: on a busy machine it is not waited for
    with closing(open_database(database_url)) as database:
        refresh(database, InThread(), now="2026-11-26T00:00:00+00:00")
    (prior,) = client.get("/v1/fleet/priors").json()["items"]
    assert (prior["ended_lives"], prior["censored_lives"]) == (4, 1)
    post(client, {"reason": "it goes on"}, 200, f"/v1/clutches/w0/runs/{_declared(client, 'w0')}/withdraw")
    with closing(open_database(database_url)) as database:
        refresh(database, InThread(), now="2026-11-26T00:00:01+00:00")
    (prior,) = client.get("/v1/fleet/priors").json()["items"]
    assert (prior["ended_lives"], prior["censored_lives"]) == (3, 1)


def _declared(client: TestClient, clutch_id: str) -> str:
    """The run that declares the end of a clutch."""
    return str(client.get(f"/v1/clutches/{clutch_id}").json()["summary"]["ended"]["run_id"])


def _filters(feed: str) -> list[list[tuple[float, float]]]:
    """Filters of one dust feed, each in twelve tests until 98 % of 600 Pa or until its rig stopped it: seconds, and the
    share of the first COF that such a pressure stands for, a half at 600 Pa."""
    with (loaders.FOLDER / "filter_lives" / "filters_odd.csv").open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["dust_feed"] == feed]
    lives = []
    for number in dict.fromkeys(row["life"] for row in rows):
        seconds, pressure = np.array(
            [(float(row["time_s"]), float(row["differential_pressure_pa"])) for row in rows if row["life"] == number]
        ).T
        clogged = np.flatnonzero(pressure >= 0.98 * 600.0)
        at = np.linspace(0.0, seconds[clogged[0] if clogged.size else -1], 12).round()
        smooth = [np.median(pressure[np.abs(seconds - t) <= 3.0]) for t in at]
        lives.append([(float(t), 1.0 - 0.5 * float(p) / 600.0) for t, p in zip(at, smooth, strict=True)])
    return lives


@pytest.mark.slow
@pytest.mark.skipif(not loaders.FOLDER.is_dir(), reason="the measurements are not there")
def test_ten_filters_that_were_stopped_just_short_of_their_threshold_teach_the_eleventh(
    tmp_path: Path,
) -> None:
    """Declared one right after another to a service that runs."""
    lives = _filters("1.0")[:11]
    assert len(lives) == 11
    with serving(tmp_path / "a.db") as server, httpx2.Client(base_url=server.url, timeout=60) as client:
        _send(client, lives)
        for number in range(10):
            post(client, END | {"cycles": lives[number][-1][0]}, path=f"/v1/clutches/filter-{number}/runs")
        eleventh = "/v1/clutches/filter-10/remaining-useful-life"
        until(lambda: client.get(eleventh).json()["ended_lives"] == 10, within=300)
        now = client.get(eleventh).json()
    end = lives[10][-1][0]
    assert now["end_of_life_cycles"]["0.05"] < end < now["end_of_life_cycles"]["0.95"]
    assert now["end_of_life_cycles"]["0.5"] == pytest.approx(end, rel=0.5)


def _send(client: httpx2.Client, lives: list[list[tuple[float, float]]]) -> None:
    """All tests of the filters, of the last the first six."""
    for number, tests in enumerate(lives):
        path = f"/v1/clutches/filter-{number}"
        post(client, {"clutch_id": f"filter-{number}"}, path="/v1/clutches")
        for part, (seconds, share) in enumerate(tests[:6] if number == len(lives) - 1 else tests):
            body = stationary(seconds, run_id=f"t{part}", wear=0.0, noise=0.002, **FEW)
            torque = [share * value for value in body["channels"]["torque_nm"]]
            post(client, body | {"channels": body["channels"] | {"torque_nm": torque}}, path=f"{path}/runs")
        assert client.get(f"{path}/runs?state=held").json()["items"] == []
