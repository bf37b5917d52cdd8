"""The start page of a laboratory with 15 clutches: what needs somebody is in sight without scrolling, with what to do."""

from typing import Any

import pytest
from playwright.sync_api import Browser, expect

from tests.browser.driving import Watched
from tests.browser.lives import post
from tests.journeys.dashboard.test_axe import violations
from tests.support import ONCE, Server, filled_service, stationary

pytestmark = pytest.mark.browser

#: Cycles of the last test, and the cycles at which all friction would be gone: one reached its end, one is near it, one has
#: two tests and one has one; the others age as they should.
LIVES = [
    (2000, 70_000), (3000, 60_000), (2000, 90_000), (19_000, 26_000), (2000, 50_000), (3000, 50_000), (1000, 60_000),
    (2000, 60_000), (3000, 70_000), (0, 50_000), (2000, 80_000), (12_000, 30_000), (2000, 40_000), (3000, 80_000),
]  # fmt: skip
#: Whether an element begins in sight, with nothing in front of it, and is not cut off above or below; its end may be elided.
_IN_SIGHT = """(element) => {
  const box = element.getBoundingClientRect();
  const front = document.elementFromPoint(box.left + 4, (box.top + box.bottom) / 2);
  return box.top >= 0 && box.bottom <= innerHeight && box.left + 30 < innerWidth && element.contains(front);
}"""


@filled_service
def server(running: Server) -> None:
    """14 clutches by their tests, and one whose run waits for somebody."""
    for number, (last, gone) in enumerate(LIVES):
        clutch_id = f"bench-{number:02}"
        running.http.post("/v1/clutches", json={"clutch_id": clutch_id}).raise_for_status()
        for cycles in range(0, last + 1, 1900 if last > 10_000 else 1000):
            post(running.http, clutch_id, stationary(cycles, wear=cycles / gone, pressures=(5.0,)))
    running.http.post("/v1/clutches", json={"clutch_id": "bench-14"}).raise_for_status()
    for cycles in (0, 1000, 2000):
        post(running.http, "bench-14", stationary(cycles, wear=cycles / 60_000, pressures=(5.0,)))
    post(running.http, "bench-14", stationary(40_000, wear=0.05, pressures=(5.0,)))
    rule = {"clutch_id": "bench-08", "quantity": "health", "below": 0.99, "name": "watched"}
    running.http.post("/v1/alarms", json=rule).raise_for_status()


@pytest.mark.parametrize("viewport", [(1280, 800), (390, 844)], ids=["desk", "phone"])
def test_what_needs_somebody_is_in_sight(browser: Browser, server: Server, viewport: tuple[int, int]) -> None:
    width, height = viewport
    watched = Watched(browser, server.url, viewport={"width": width, "height": height})
    page = watched.open("/")
    expect(page.locator("table.fleet tbody tr")).to_have_count(len(LIVES) + 1)
    listed: list[dict[str, Any]] = ONCE.get(f"{server.url}/v1/clutches").json()["items"]
    needing = [item for item in listed if not item["action"].startswith("Nothing to do")]
    assert {item["clutch_id"] for item in needing} >= {"bench-03", "bench-06", "bench-08", "bench-09", "bench-14"}
    assert needing == listed[: len(needing)], "what needs somebody comes first"
    for item in needing:
        row = page.locator(f"tr[data-clutch='{item['clutch_id']}']")
        for part in (".state svg", "th a", ".do .line > :last-child", ".safe"):
            assert row.locator(part).last.evaluate(_IN_SIGHT), (item["clutch_id"], part)
        assert item["action"] in row.locator(".do").inner_text()
    raised = page.locator("tr[data-clutch='bench-08'] .raised")
    assert raised.evaluate(_IN_SIGHT)
    assert page.locator("#raised").evaluate(_IN_SIGHT)
    assert (page.locator("#raised").inner_text(), raised.inner_text()) == ("1 alarm", "1 alarm")
    assert page.evaluate("scrollY") == 0
    assert violations(page) == []
    watched.close()


def test_a_desk_shows_every_clutch_and_a_phone_two_lines_of_each(browser: Browser, server: Server) -> None:
    watched = Watched(browser, server.url, viewport={"width": 1280, "height": 800})
    page = watched.open("/")
    rows = page.locator("table.fleet tbody tr")
    expect(rows).to_have_count(len(LIVES) + 1)
    assert all(row.locator("th a").evaluate(_IN_SIGHT) for row in rows.all())
    page.set_viewport_size({"width": 390, "height": 844})
    for row in rows.all():
        (name, safe, what), tall = (
            (row.locator(part).bounding_box() for part in ("th", ".safe", ".do")),
            row.bounding_box(),
        )
        assert name["y"] == pytest.approx(safe["y"], abs=6)
        assert what["y"] > name["y"] + 10
        assert tall["height"] < 56
    watched.close()
