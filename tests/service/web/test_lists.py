"""Lists and tables are whole where no limit is given, and say where they go on where one is."""

import csv
import io
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from tests.service.clients import client_on
from tests.support import stationary

BASE = "/v1/clutches/c1"


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A clutch with five tests, one of them corrected twice, and a second clutch."""
    with client_on(f"sqlite:///{tmp_path_factory.mktemp('lists')}/clutchlife.db") as found:
        for clutch_id in ("c1", "c2"):
            assert found.post("/v1/clutches", json={"clutch_id": clutch_id}).status_code == 201
        for cycles in range(0, 5000, 1000):
            body = stationary(cycles, run_id=f"s{cycles}", pressures=(4.0, 5.0))
            assert found.post(f"{BASE}/runs", json=body).status_code == 201
        for cycles in (4500, 4000):
            body = {"cycles": cycles, "reason": "mistyped"}
            assert found.patch(f"{BASE}/runs/s4000", json=body).status_code == 200
        yield found


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.parametrize(
    "name", ["runs", "changes", "stribeck", "series", "series?quantity=health", "degradation", "remaining-useful-life"]
)
def test_a_table_is_whole_without_a_limit_and_the_same_page_by_page(client: TestClient, name: str) -> None:
    path, _, query = name.partition("?")
    address = f"{BASE}/{path}.csv?{query}"
    answer = client.get(address)
    whole = rows(answer.text)
    assert len(whole) > 1
    assert "link" not in answer.headers
    collected, pages, following = [], 0, f"{address}&limit=1"
    while following:
        page = client.get(following)
        assert page.status_code == 200
        assert len(rows(page.text)) in ((1, 2) if path == "stribeck" else (1,))  # two pressures a test
        assert client.get(following, headers={"If-None-Match": page.headers["etag"]}).status_code == 304
        collected += rows(page.text)
        pages += 1
        following = page.links["next"]["url"] if "next" in page.links else ""
    assert collected == whole
    assert pages == (len(whole) // 2 if path == "stribeck" else len(whole))


@pytest.mark.parametrize("name", ["/v1/clutches", *(f"{BASE}/{n}" for n in ("runs", "changes", "stribeck", "series"))])
def test_a_list_names_its_next_page_in_a_header_too(client: TestClient, name: str) -> None:
    items, following = [], f"{name}?limit=1"
    for _ in range(2):  # the second time from what is kept
        page = client.get(following)
        assert page.links["next"]["url"].endswith(f"cursor={page.json()['next']}")
    while following:
        page = client.get(following)
        items += page.json()["items"]
        assert ("next" in page.links) is (page.json()["next"] is not None)
        following = page.links["next"]["url"] if "next" in page.links else ""
    assert items == client.get(name).json()["items"]


def test_a_limit_is_refused_where_nothing_is_listed(client: TestClient) -> None:
    assert client.get(f"{BASE}/model?limit=1").status_code == 422
