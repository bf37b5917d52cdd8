"""Lists and tables are whole where no limit is given, and say where they go on where one is; clutches are listed by state,
by what is searched for and by name, and counted, as far as a key sees them."""

import csv
import io
from typing import Any

import pytest
from fastapi.testclient import TestClient

from service.paging import to_cursor
from tests.service.clients import filled_client, post_run
from tests.service.web.routes.granting import granted
from tests.support import stationary

BASE = "/v1/clutches/c1"


@filled_client(scope="module")
def listed(client: TestClient) -> None:
    """A clutch with five tests, one of them corrected twice, and a second clutch."""
    assert client.post("/v1/clutches", json={"clutch_id": "c2"}).status_code == 201
    for cycles in range(0, 5000, 1000):
        post_run(client, stationary(cycles, run_id=f"s{cycles}", pressures=(4.0, 5.0)))
    for cycles in (4500, 4000):
        body = {"cycles": cycles, "reason": "mistyped"}
        assert client.patch(f"{BASE}/runs/s4000", json=body).status_code == 200
    for cycles in (0, 3000):
        assert client.post(f"{BASE}/inspections", json={"cycles": cycles, "note": "worn"}).status_code == 201


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


LISTS = ("runs", "changes", "stribeck", "series", "inspections")
TABLES = (*LISTS, "series?quantity=health", "degradation", "remaining-useful-life")


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_whole_without_a_limit_and_the_same_page_by_page(listed: TestClient, name: str) -> None:
    path, _, query = name.partition("?")
    address = f"{BASE}/{path}.csv?{query}"
    answer = listed.get(address)
    whole = rows(answer.text)
    assert len(whole) > 1
    assert "link" not in answer.headers
    collected, pages, following = [], 0, f"{address}&limit=1"
    while following:
        page = listed.get(following)
        assert page.status_code == 200
        assert len(rows(page.text)) in ((1, 2) if path == "stribeck" else (1,))  # two pressures a test
        assert listed.get(following, headers={"If-None-Match": page.headers["etag"]}).status_code == 304
        collected += rows(page.text)
        pages += 1
        following = page.links["next"]["url"] if "next" in page.links else ""
    assert collected == whole
    assert pages == (len(whole) // 2 if path == "stribeck" else len(whole))


@pytest.mark.parametrize("name", ["/v1/clutches", *(f"{BASE}/{name}" for name in LISTS)])
def test_a_list_names_its_next_page_in_a_header_too(listed: TestClient, name: str) -> None:
    items, following = [], f"{name}?limit=1"
    for _ in range(2):  # the second time from what is kept
        page = listed.get(following)
        assert page.links["next"]["url"].endswith(f"cursor={page.json()['next']}")
    while following:
        page = listed.get(following)
        items += page.json()["items"]
        assert ("next" in page.links) is (page.json()["next"] is not None)
        following = page.links["next"]["url"] if "next" in page.links else ""
    assert items == listed.get(name).json()["items"]


def test_a_limit_is_refused_where_nothing_is_listed_and_a_cursor_that_is_none_everywhere(listed: TestClient) -> None:
    assert listed.get(f"{BASE}/model?limit=1").status_code == 422
    for name in TABLES:
        assert listed.get(f"{BASE}/{name.partition('?')[0]}.csv?cursor=bad").status_code == 422, name


@pytest.mark.parametrize("number", [1e300, 2.0**63, 2.0**53 + 2, 2.0**53, -5.0, -1e300])
def test_no_number_of_a_cursor_is_too_great_for_the_database(listed: TestClient, number: float) -> None:
    """A list of clutches at 2^63 was answered 500."""
    cursor = to_cursor((number, "c1"))
    expected = 200 if abs(number) <= 2.0**53 else 422
    of_clutch = [f"{BASE}/{name}?" for name in LISTS]
    of_all = [f"/v1/clutches?sort={sort}&" for sort in ("worst", "name", "kind")]
    for address in (*of_clutch, *of_all, "/v1/alarms/events?", "/v1/jobs?", "/v1/rigs?", "/v1/webhooks?"):
        assert listed.get(f"{address}cursor={cursor}").status_code == expected, address


# --- Lists of clutches.


@filled_client
def fleet(client: TestClient) -> None:
    """c1, without a run; two that wear, one of them to its end and with a held run; one that is archived."""
    for clutch_id, material in (("ageing", "Carbon"), ("ended", "carbon_2"), ("gone", "paper")):
        record = {"clutch_id": clutch_id, "friction_material": material}
        assert client.post("/v1/clutches", json=record).status_code == 201
    for clutch_id, last in (("ageing", 6000), ("ended", 19_000)):
        for cycles in range(0, last + 1, 1900):
            post_run(client, stationary(cycles, wear=cycles / 26_000), clutch_id)
    odd = stationary(20_000, run_id="odd")
    odd["channels"]["torque_nm"] = [100 * value for value in odd["channels"]["torque_nm"]]
    assert client.post("/v1/clutches/ended/runs", json=odd).json()["state"] == "held"
    assert client.patch("/v1/clutches/gone", json={"archived": True}).status_code == 200


def ids(client: TestClient, question: str, **asked: Any) -> list[str]:
    answer = client.get(f"/v1/clutches?{question}", **asked)
    assert answer.status_code == 200, answer.text
    return [item["clutch_id"] for item in answer.json()["items"]]


def test_a_list_is_of_what_was_asked_for_and_says_states_and_why(fleet: TestClient) -> None:
    for question, expected in (
        ("", ["ended", "c1", "ageing"]),
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
        ("offset=1&limit=1", ["c1"]),
        ("offset=7", []),
    ):
        assert ids(fleet, question) == expected, question
    for wrong in ("state=broken", "sort=age", "offset=-1", "find=%00"):
        assert fleet.get(f"/v1/clutches?{wrong}").status_code == 422, wrong
    for sort, last in (("name", "ended"), ("kind", "c1")):
        following = fleet.get(f"/v1/clutches?sort={sort}&limit=2").json()["next"]
        assert ids(fleet, f"sort={sort}&limit=2&cursor={following}") == [last]

    states = {item["clutch_id"]: item["state"] for item in fleet.get("/v1/clutches").json()["items"]}
    assert states == {
        "ended": {"name": "failure", "why": "the end of life is reached: its limit is mean COF at 50 % of new"},
        "ageing": {"name": "normal", "why": "safe for 2,200 more cycles (95 %)"},
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
    assert total == {"all": 3, "archived": 1, "held": 1, "alarms": 0, "states": states}
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
