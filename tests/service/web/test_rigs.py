"""Rig profiles, the files that are kept with their runs, and runs that are read again by another profile."""

import fnmatch
import hashlib
import random
from collections.abc import Mapping
from contextlib import closing
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.answers.verification import check_results, check_runs
from service.api.rig import RigProfile
from service.runs.rig_profile import Named, _regex, named, pattern_for
from storage.engine.opening import open_database
from storage.raw_columns import FILE
from storage.rigs import MAX_AT_ONCE
from storage.tables import channel
from tests.browser.lives import loops
from tests.growth import LINEAR, time_ratio
from tests.support import PRESSURES_BAR, SPEEDS_RPM, stationary

RIG = {
    "name": "bench-3",
    "columns": [
        {"title": "Druck", "channel": "pressure_bar", "unit": "bar"},
        {"title": "Drehzahl", "channel": "speed_rpm", "unit": "rpm"},
        {"title": "M1", "channel": "torque_nm", "unit": "Nm"},
        {"title": "M2"},
    ],
    "kind": "stationary_stribeck",
    "file_name": "test_{cycles}_*.csv",
}
#: The same rig, its torque in the other column.
MENDED = RIG | {
    "columns": [
        *RIG["columns"][:2],  # type: ignore[index]
        {"title": "M1"},
        {"title": "M2", "channel": "torque_nm", "unit": "Nm"},
    ]
}


def table(cycles: float) -> bytes:
    """A stationary test with two torques, of which the first one is 20 % too high."""
    channels = stationary(cycles, pressures=PRESSURES_BAR[:3], speeds=SPEEDS_RPM[::4])["channels"]
    rows = zip(channels["pressure_bar"], channels["speed_rpm"], channels["torque_nm"], strict=True)
    lines = [f"{p},{n},{1.2 * m!r},{m!r}" for p, n, m in rows]
    return "\n".join(["Druck [bar],Drehzahl [rpm],M1 [Nm],M2 [Nm]", *lines]).encode()


def post(client: TestClient, clutch: str, at: int, **query: Any) -> Any:
    """A file sent as `test_CYCLES_x.csv`."""
    given = {"filename": f"test_{at}_x.csv"} | query
    return client.post(f"/v1/clutches/{clutch}/runs/file", params=given, content=table(at))


def answers(client: TestClient, clutch: str) -> dict[str, Any]:
    """What is computed of a clutch, without what names it and what only tells the way of its runs."""
    dropped = {"clutch_id", "time", "revision", "received_at", "content_sha256", "file", "next"}

    def bare(part: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in part.items() if name not in dropped}

    names = ("stribeck", "loops", "runs")
    return {name: client.get(f"/v1/clutches/{clutch}/{name}").json(object_hook=bare) for name in names}


def test_a_profile_is_saved_once_and_replaced_by_put_alone(client: TestClient) -> None:
    first = client.post("/v1/rigs", json=RIG)
    assert (first.status_code, first.headers["Location"]) == (201, "/v1/rigs/bench-3")
    assert client.post("/v1/rigs", json=RIG).status_code == 200
    refused = client.post("/v1/rigs", json=MENDED)
    assert (refused.status_code, refused.json()["type"]) == (409, "urn:clutchlife:problem:conflict")
    tag = client.get("/v1/rigs/bench-3").headers["ETag"]
    assert client.get("/v1/rigs/bench-3", headers={"If-None-Match": tag}).status_code == 304
    replaced = client.put("/v1/rigs/bench-3", json=MENDED)
    assert (replaced.status_code, replaced.json()["version"]) == (200, 2)
    assert client.put("/v1/rigs/bench-3", json=MENDED).json()["version"] == 2
    assert client.get("/v1/rigs/bench-3", headers={"If-None-Match": tag}).status_code == 200
    assert client.put("/v1/rigs/bench-4", json=RIG | {"name": "bench-4"}).status_code == 201
    page = client.get("/v1/rigs?limit=1").json()
    assert [item["name"] for item in page["items"]] == ["bench-3"]
    following = client.get("/v1/rigs", params={"limit": 1, "cursor": page["next"]}).json()
    assert ([item["name"] for item in following["items"]], following["next"]) == (["bench-4"], None)
    assert client.get("/v1/rigs/none").status_code == 404


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"columns": []}, "columns"),
        ({"columns": [{"title": "a", "channel": "torque_nm"}, {"title": "b", "channel": "torque_nm"}]}, "stands twice"),
        ({"columns": [{"title": "a", "channel": "torque_nm", "scale": 0}]}, "scale must not be 0"),
        ({"columns": [{"title": "a"}]}, "at least one column"),
        ({"columns": [{"title": "a", "channel": "torque_nm", "unit": "bar"}]}, "bar"),
        ({"file_name": "*" * 9}, "file_name may hold at most"),
        ({"file_name": "{cycles}{cycles}"}, "once"),
        ({"file_name": "{kind}_{cycles}"}, "so `kinds` must list"),
        ({"colour": "red"}, "colour"),
        ({"name": "a b"}, "name"),
    ],
)
def test_a_profile_that_cannot_be_used_is_refused(
    shared_client: TestClient, change: Mapping[str, Any], words: str
) -> None:
    answer = shared_client.post("/v1/rigs", json=RIG | change)
    assert answer.status_code == 422, answer.text
    assert words in answer.json()["detail"]
    assert shared_client.get("/v1/rigs").json()["items"] == []


def test_no_name_of_a_file_takes_long_by_any_pattern_and_one_with_the_cycles_twice_is_none() -> None:
    """Each of three `*` may stand for anything: 10 s where all of it was tried. What is found is the same."""
    columns = [{"title": "a", "channel": "torque_nm"}]
    slow = RigProfile.model_validate({"columns": columns, "file_name": "*a*a*a*b"})
    assert time_ratio(lambda size: named(slow, "a" * size, {}), 16, repeats=50) < LINEAR
    assert named(slow, "a" * 255, {}) == Named()
    rng = random.Random(5)  # noqa: S311 - patterns, not secrets
    for _ in range(500):
        pattern, name = ("".join(rng.choices(of, k=rng.randint(1, 7))) for of in ("*ab", "ab"))
        assert bool(_regex(pattern).fullmatch(name)) == fnmatch.fnmatchcase(name, pattern), (pattern, name)
    assert pattern_for("test_7000_3.csv", 7000.0) == "test_{cycles}_*.csv"
    assert pattern_for("test_7000_7000.csv", 7000.0) is None
    assert pattern_for("test_7000_7k.csv", 7000.0) is None


@pytest.mark.parametrize(
    ("filename", "rig"),
    [("test_7000_x.csv", "bench-3"), ("probe_7000_y.csv", "bench-4"), ("test_7000_y.csv", None), ("other.csv", None)],
)
def test_of_several_profiles_that_fit_the_name_of_the_file_says_which(
    client: TestClient, filename: str, rig: str | None
) -> None:
    for profile in (RIG, RIG | {"name": "bench-4", "file_name": "*_{cycles}_y.csv"}):
        client.post("/v1/rigs", json=profile)
    shown = client.post("/v1/import/preview", params={"filename": filename}, content=table(7000)).json()
    assert (shown["rig"], shown["cycles"]) == (rig, None if rig is None else 7000)


def test_many_large_profiles_come_in_small_pages(client: TestClient) -> None:
    """A page of the thousand that may be asked for would be a gigabyte."""
    for number in range(MAX_AT_ONCE + 1):
        assert client.post("/v1/rigs", json=RIG | {"name": f"bench-{number:03}"}).status_code == 201
    first = client.get("/v1/rigs", params={"limit": 1000}).json()
    rest = client.get("/v1/rigs", params={"limit": 1000, "cursor": first["next"]}).json()
    assert (len(first["items"]), len(rest["items"]), rest["next"]) == (MAX_AT_ONCE, 1, None)


def test_a_file_is_read_by_its_rig_arguments_win_and_it_is_given_out_as_it_was_sent(client: TestClient) -> None:
    client.post("/v1/rigs", json=RIG)
    receipt = post(client, "c1", 7000, rig="bench-3").json()
    assert (receipt["kind"], receipt["cycles"]) == ("stationary_stribeck", 7000)
    assert receipt["file"] == {
        "filename": "test_7000_x.csv",
        "sha256": hashlib.sha256(table(7000)).hexdigest(),
        "bytes": len(table(7000)),
        "rig": "bench-3",
    }
    assert post(client, "c1", 7000, rig="bench-3").json()["duplicate"]
    assert post(client, "c1", 8000, rig="bench-3", cycles=9000, map="torque_nm:M2").json()["cycles"] == 9000
    unnamed = post(client, "c1", 8000, rig="bench-3", filename="other.csv")
    assert (unnamed.status_code, unnamed.json()["errors"][0]["pointer"]) == (422, "/query/cycles")
    assert post(client, "c1", 8000, rig="none").status_code == 404
    address = f"/v1/clutches/c1/runs/{receipt['run_id']}/file"
    sent = client.get(address)
    assert sent.content == table(7000)
    assert sent.headers["Content-Disposition"].startswith("attachment")
    assert client.get(address, headers={"If-None-Match": sent.headers["ETag"]}).status_code == 304
    posted = client.post("/v1/clutches/c1/runs", json=stationary(500)).json()
    assert posted["file"] is None
    assert client.get(f"/v1/clutches/c1/runs/{posted['run_id']}/file").status_code == 404


def test_runs_that_are_read_again_answer_as_if_they_had_been_read_so_at_first(
    client: TestClient, database_url: str
) -> None:
    """A wrong torque column, mended for the reference test and for the last; the others come in by the right one."""
    client.post("/v1/clutches", json={"clutch_id": "c2"})
    client.post("/v1/rigs", json=RIG)
    client.put("/v1/rigs/mended", json=MENDED | {"name": "mended"})
    for clutch, rig in (("c1", "bench-3"), ("c2", "mended")):
        for cycles in (0, 1000, 2000, 3000):
            own = "mended" if cycles in (1000, 2000) else rig
            answer = post(client, clutch, cycles, rig=own, run_id=f"r{cycles}")
            assert answer.status_code == 201, answer.text
        assert client.post(f"/v1/clutches/{clutch}/runs", json=loops(2500, pressures=(5.0,))).status_code == 201
    assert answers(client, "c1") != answers(client, "c2")
    for run in ("r0", "r3000"):
        body = {"rig": "mended", "reason": "the torque was in M2"}
        changed = client.patch(f"/v1/clutches/c1/runs/{run}", json=body)
        assert changed.status_code == 200, changed.text
        assert changed.json()["file"]["rig"] == "mended"
    mended, right = answers(client, "c1"), answers(client, "c2")
    for name, wanted in right.items():
        assert mended[name] == wanted, name
    entry = client.get("/v1/clutches/c1/changes").json()["items"][0]
    assert (entry["action"], entry["run_id"], entry["reason"]) == ("reread", "r3000", "the torque was in M2")
    assert (entry["before"]["rig"], entry["after"]["rig"]) == ("bench-3", "mended")
    channels = [client.get(f"/v1/clutches/{clutch}/runs/r0").json()["channels"] for clutch in ("c1", "c2")]
    assert channels[0] == channels[1]
    client.__exit__(None, None, None)
    with closing(open_database(database_url)) as database:
        for clutch in ("c1", "c2"):  # predictions and tracks too are as if all had been computed at once
            assert check_results(database, clutch).findings == check_runs(database, clutch).findings == ()


def test_a_file_that_was_read_again_is_stored_once_and_verified(client: TestClient, database_url: str) -> None:
    client.post("/v1/rigs", json=RIG)
    first = post(client, "c1", 0, rig="bench-3").json()
    client.put("/v1/rigs/bench-3", json=MENDED)
    client.patch(f"/v1/clutches/c1/runs/{first['run_id']}", json={"rig": "bench-3", "reason": "the other torque"})
    again = post(client, "c1", 0, rig="bench-3")
    assert (again.status_code, again.json()["run_id"]) == (200, first["run_id"])
    before = post(client, "c1", 0, map="torque_nm:M1", kind="stationary_stribeck", cycles=0)
    assert (before.status_code, before.json()["duplicate"]) == (200, True)
    assert len(client.get("/v1/clutches/c1/runs").json()["items"]) == 1
    client.__exit__(None, None, None)
    with closing(open_database(database_url)) as database:
        assert check_runs(database, "c1").findings == check_results(database, "c1").findings == ()
        with database.writing() as connection:
            data = table(0).replace(b"Druck", b"Drvck")
            connection.execute(channel.update().where(channel.c.name == FILE).values(codec="as-sent", data=data))
        assert "differs from what was sent" in check_runs(database, "c1").findings[0]


def test_what_cannot_be_read_again_changes_nothing(client: TestClient) -> None:
    client.post("/v1/rigs", json=RIG)
    sent = client.post("/v1/clutches/c1/runs", json=stationary(0)).json()["run_id"]
    file = post(client, "c1", 1000, rig="bench-3").json()["run_id"]
    other = RIG | {"name": "other", "columns": [{"title": "no such", "channel": "torque_nm"}]}
    client.post("/v1/rigs", json=other)
    before = client.get("/v1/clutches/c1").headers["ETag"]
    address = "/v1/clutches/c1/runs/"
    assert client.patch(address + sent, json={"rig": "bench-3", "reason": "no file"}).status_code == 409
    assert client.patch(address + file, json={"rig": "none", "reason": "no rig"}).status_code == 404
    assert client.patch(address + file, json={"rig": "other", "reason": "no column"}).status_code == 422
    assert client.patch(address + file, json={"rig": "bench-3", "reason": "as it is"}).status_code == 200
    assert client.patch(address + file, json={"rig": "bench-3", "cycles": 1, "reason": "both"}).status_code == 422
    assert client.patch(address + file, json={"reason": "neither"}).status_code == 422
    assert client.get("/v1/clutches/c1").headers["ETag"] == before
