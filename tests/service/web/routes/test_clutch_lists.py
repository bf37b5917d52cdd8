"""Lists of clutches by state, by what is searched for and by name; how many there are; what a bound key sees of it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from tests.service.clients import client_of, client_on_copy
from tests.service.web.routes.granting import granted
from tests.support import stationary


@pytest.fixture(scope="module")
def laid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """c1, without a run; two that wear, one of them to its end and with a held run; one that is archived."""
    path = tmp_path_factory.mktemp("fleet") / "clutchlife.db"
    with client_of(path) as client:
        fill(client)
    return path


@pytest.fixture
def fleet(laid: Path, tmp_path: Path) -> Iterator[TestClient]:
    """A client of a service on a copy of it."""
    with client_on_copy(laid, tmp_path) as client:
        yield client


def fill(client: TestClient) -> None:
    for clutch_id, material in (("ageing", "Carbon"), ("ended", "carbon_2"), ("gone", "paper")):
        record = {"clutch_id": clutch_id, "friction_material": material}
        assert client.post("/v1/clutches", json=record).status_code == 201
    for clutch_id, last in (("ageing", 6000), ("ended", 19_000)):
        for cycles in range(0, last + 1, 1900):
            posted = client.post(f"/v1/clutches/{clutch_id}/runs", json=stationary(cycles, wear=cycles / 26_000))
            assert posted.status_code == 201
    odd = stationary(20_000, run_id="odd")
    odd["channels"]["torque_nm"] = [100 * value for value in odd["channels"]["torque_nm"]]
    assert client.post("/v1/clutches/ended/runs", json=odd).json()["state"] == "held"
    assert client.patch("/v1/clutches/gone", json={"archived": True}).status_code == 200


def ids(client: TestClient, question: str, **asked: Any) -> list[str]:
    answer = client.get(f"/v1/clutches?{question}", **asked)
    assert answer.status_code == 200, answer.text
    return [item["clutch_id"] for item in answer.json()["items"]]


def test_a_list_is_of_what_was_asked_for(fleet: TestClient) -> None:
    for question, expected in (
        ("", ["ended", "ageing", "c1"]),
        ("sort=name", ["ageing", "c1", "ended"]),
        ("sort=kind", ["ageing", "ended", "c1"]),
        ("sort=kind&offset=1&limit=1", ["ended"]),
        ("state=failure", ["ended"]),
        ("state=check", ["c1"]),
        ("state=normal", ["ageing"]),
        ("state=out_of_specification", []),
        ("held=true", ["ended"]),
        ("find=CARBON", ["ended", "ageing"]),
        ("find=n_2", ["ended"]),
        ("find=%25", []),
        ("find=carbon&state=normal&sort=name", ["ageing"]),
        ("archived=true", ["gone"]),
        ("offset=1&limit=1", ["ageing"]),
        ("offset=7", []),
    ):
        assert ids(fleet, question) == expected, question
    for wrong in ("state=broken", "sort=age", "offset=-1", "find=%00"):
        assert fleet.get(f"/v1/clutches?{wrong}").status_code == 422, wrong


@pytest.mark.parametrize(("sort", "order"), [("name", ["ageing", "c1", "ended"]), ("kind", ["ageing", "ended", "c1"])])
def test_a_walk_follows_its_cursor(fleet: TestClient, sort: str, order: list[str]) -> None:
    first = fleet.get(f"/v1/clutches?sort={sort}&limit=2").json()
    second = fleet.get(f"/v1/clutches?sort={sort}&limit=2&cursor={first['next']}").json()
    assert [[item["clutch_id"] for item in page["items"]] for page in (first, second)] == [order[:2], order[2:]]
    assert second["next"] is None


def test_a_clutch_says_its_state_and_why(fleet: TestClient) -> None:
    states = {item["clutch_id"]: item["state"] for item in fleet.get("/v1/clutches").json()["items"]}
    assert states == {
        "ended": {"name": "failure", "why": "the end of life is reached: its limit is mean COF at 50 % of new"},
        "ageing": {"name": "normal", "why": "safe for 2,400 more cycles (95 %)"},
        "c1": {"name": "check", "why": "no run counts yet"},
    }
    assert fleet.get("/v1/clutches/ended").json()["state"] == states["ended"]


def test_totals_are_those_of_the_list_and_change_with_it(fleet: TestClient) -> None:
    answer = fleet.get("/v1/fleet/totals")
    total = answer.json()
    quantiles = fleet.get("/v1/clutches/ageing").json()["summary"]["remaining_cycles"]
    upper = quantiles["0.95"] or quantiles["0.5"]
    assert upper <= total.pop("scale_cycles") <= 2.5 * upper
    states = {"failure": 1, "out_of_specification": 0, "maintenance": 0, "check": 1, "normal": 1}
    assert total == {"all": 3, "archived": 1, "held": 1, "states": states}
    assert fleet.get("/v1/fleet/totals?find=2").json()["all"] == 1
    assert fleet.get("/v1/fleet/totals?archived=true").json()["all"] == 1
    unchanged = fleet.get("/v1/fleet/totals", headers={"If-None-Match": answer.headers["ETag"]})
    assert unchanged.status_code == 304
    fleet.post("/v1/clutches", json={"clutch_id": "new"})
    changed = fleet.get("/v1/fleet/totals", headers={"If-None-Match": answer.headers["ETag"]})
    assert (changed.status_code, changed.json()["all"]) == (200, 4)


def test_a_bound_key_finds_and_counts_its_own_alone(fleet: TestClient) -> None:
    bound = granted(fleet, "read", clutches=["c1", "ageing", "gone"])
    assert ids(fleet, "sort=name", headers=bound) == ["ageing", "c1"]
    assert ids(fleet, "find=carbon", headers=bound) == ["ageing"]
    assert ids(fleet, "held=true", headers=bound) == ids(fleet, "state=failure", headers=bound) == []
    whole = granted(fleet, "read")
    for _ in range(2):  # what was polled with the other key is not given to this one
        assert fleet.get("/v1/fleet/totals", headers=whole).json()["all"] == 3
    total = fleet.get("/v1/fleet/totals", headers=bound).json()
    assert (total["all"], total["archived"], total["held"], total["states"]["failure"]) == (2, 1, 0, 0)
