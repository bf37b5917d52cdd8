"""A clutch's record on its page: edited with a reason, undone, and copied for another clutch."""

from typing import Any

import pytest
from playwright.sync_api import expect

from tests.browser.driving import Watched
from tests.journeys.dashboard.test_axe import violations
from tests.support import ONCE, Server, filled_service, post_tests

pytestmark = pytest.mark.browser


@filled_service
def server(running: Server) -> None:
    running.http.post("/v1/clutches", json={"clutch_id": "bench", "friction_material": "paper"}).raise_for_status()
    post_tests(running.http, 0, 1000, 2000, to="bench", pressures=(5.0,))


def record(server: Server, clutch_id: str) -> dict[str, Any]:
    answer = ONCE.get(f"{server.url}/v1/clutches/{clutch_id}")
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_a_record_is_edited_undone_and_copied(watched: Watched, server: Server) -> None:
    before = record(server, "bench")
    page = watched.open("/clutches/bench")
    more = page.locator("#head summary")
    more.click()
    page.get_by_role("button", name="Edit the record …").click()
    form = page.get_by_role("dialog", name="Record of bench")
    form.get_by_label("Friction material").fill("carbon")
    form.get_by_label("Outer diameter").fill("135")
    form.get_by_label("Where the clutch comes from").fill("lot 7, second supplier")
    form.get_by_role("button", name="Add a criterion").click()
    form.get_by_label("Quantity").select_option("Mean COF")
    form.get_by_label("rpm").fill("")
    form.get_by_label("Kind of limit").select_option("share of new")
    form.get_by_label("Limit", exact=True).fill("0.6")
    assert violations(page) == []
    form.get_by_label("Reason").fill("measured again")
    page.keyboard.press("Enter")
    expect(page.locator(".description")).to_contain_text("Carbon on steel")
    expect(page.locator(".description")).to_contain_text("99/135 mm")
    expect(page.locator(".description")).to_contain_text("end of life at the first of Mean COF (60 % of new)")
    expect(page.locator(".description")).to_contain_text("lot 7, second supplier")
    after = record(server, "bench")
    assert after["geometry"]["outer_diameter_mm"] == 135
    assert after["oil"] == before["oil"]
    (entry, *_) = ONCE.get(f"{server.url}/v1/clutches/bench/changes").json()["items"]
    assert entry["reason"] == "measured again"
    assert set(entry["after"]) == {"geometry", "friction_material", "end_of_life", "note"}

    more.click()
    page.get_by_role("button", name="Register another like it …").click()
    form = page.get_by_role("dialog", name="Register a clutch")
    assert form.get_by_label("Friction material").input_value() == "carbon"
    form.get_by_label("Clutch id").fill("bench-2")
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="bench-2").wait_for()
    copied = record(server, "bench-2")
    for field in ("geometry", "oil", "end_of_life", "friction_material", "note", "severity", "torque_filter_ms"):
        assert copied[field] == after[field], field

    page.goto(f"{server.url}/clutches/bench")
    more.click()
    page.get_by_role("button", name="Edit the record …").click()
    form = page.get_by_role("dialog", name="Record of bench")
    form.get_by_label("Friction material").fill("sinter")
    form.get_by_label("Reason").fill("a slip")
    page.keyboard.press("Enter")
    expect(page.locator(".description")).to_contain_text("Sinter on steel")
    page.get_by_role("button", name="Undo").click()
    expect(page.locator(".description")).to_contain_text("Carbon on steel")
    assert record(server, "bench")["friction_material"] == "carbon"
