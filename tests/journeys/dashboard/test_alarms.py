"""Alarms on the pages: a rule is made in a form, a posted run raises an alarm, which is in sight everywhere until somebody
acknowledges it, and it stays so."""

import re

import pytest
from playwright.sync_api import expect

from tests.browser.driving import Watched
from tests.browser.lives import post
from tests.journeys.dashboard.test_axe import violations
from tests.service.alarms.receiving import receiving
from tests.support import Server, filled_service, post_tests, stationary

pytestmark = pytest.mark.browser


@filled_service
def server(running: Server) -> None:
    running.http.post("/v1/clutches", json={"clutch_id": "bench"}).raise_for_status()
    post_tests(running.http, 0, 1000, 2000, to="bench", pressures=(5.0,))


def test_a_rule_is_made_an_alarm_raised_and_acknowledged(watched: Watched, server: Server) -> None:
    page = watched.open("/clutches/bench#/alarms")
    page.get_by_text("No alarm has been raised.").wait_for()
    page.get_by_role("button", name="New rule …").click()
    form = page.get_by_role("dialog", name="New rule")
    assert violations(page) == []
    form.get_by_label("An alarm when").select_option("Remaining cycles, safe bound")
    form.get_by_label("Below, cycles").fill("900000,5")
    form.get_by_label("Name").fill("soon")
    page.keyboard.press("Enter")
    expect(page.get_by_role("table", name="Rules")).to_contain_text("below 900,001 cycles, median below 2 times that")
    post(server.http, "bench", stationary(3000, pressures=(5.0,)))
    events = page.get_by_role("table", name="Alarms, the newest first")
    expect(events).to_contain_text("Not acknowledged")
    assert violations(page) == []
    for path, places in (("/", ("#raised", "tr .raised")), ("/clutches/bench", ("#raised", ".title .notice"))):
        page.goto(f"{server.url}{path}")
        for place in places:
            expect(page.locator(place)).to_be_visible()
    assert violations(page) == []
    expect(page.locator("#action")).to_have_text("Look at the alarm and acknowledge it.")
    page.locator(".title").get_by_role("button", name="Acknowledge").click()
    asked = page.get_by_role("dialog", name="Acknowledge the alarm")
    asked.get_by_label("Note").fill("a new one is ordered")
    assert violations(page) == []
    page.keyboard.press("Enter")
    for place in ("#raised", ".title .notice"):
        expect(page.locator(place)).to_be_hidden()
    expect(page.locator("#action")).to_have_text("Nothing to do: carry on testing.")
    page.goto(f"{server.url}/clutches/bench#/alarms")
    expect(events).to_contain_text("a new one is ordered")
    post(server.http, "bench", stationary(4000, pressures=(5.0,)))
    page.goto(f"{server.url}/#/alarms")
    events.wait_for()
    expect(events.get_by_role("row")).to_have_count(2)
    expect(events).to_contain_text("Acknowledged by")
    page.get_by_role("button", name="Delete: Remaining cycles").click()
    page.get_by_text("No rule yet: nothing raises an alarm.").wait_for()


def test_a_receiver_is_tried_and_what_is_typed_wrong_stays(watched: Watched) -> None:
    page = watched.open("/#/alarms")
    page.get_by_role("button", name="New receiver …").click()
    form = page.get_by_role("dialog", name="New receiver")
    form.get_by_label("Name").fill("shop floor")
    form.get_by_label("Address").fill("ftp://example.org/hook")
    page.keyboard.press("Enter")
    expect(form.get_by_role("alert")).to_have_count(1)
    expect(form.get_by_label("Address")).to_be_focused()
    assert "url" in form.get_by_role("alert").inner_text()
    expect(form.locator(".answer")).to_be_empty()
    assert form.get_by_label("Address").input_value() == "ftp://example.org/hook"
    assert form.get_by_label("Name").input_value() == "shop floor"
    assert violations(page) == []
    with receiving() as receiver:
        form.get_by_label("Address").fill(receiver.url)
        page.keyboard.press("Enter")
        table = page.get_by_role("table", name="Receivers", exact=True)
        expect(table).to_contain_text("nothing sent yet")
        table.get_by_role("button", name="Test").click()
        expect(table).to_contain_text("Delivered")
        page.locator("[aria-label=Receivers]").get_by_text("receiver").first.wait_for()
    table.get_by_role("button", name="Test").click()
    expect(table.locator("summary")).to_contain_text("Failed: ")
    table.locator("summary").click()
    expect(page.get_by_role("table", name="Deliveries to")).to_contain_text("Delivered")
    assert violations(page) == []
    assert any("status of 422" in line for line in watched.said)
    watched.said.clear()  # the browser notes the refusal


def test_a_number_that_cannot_be_read_is_marked_once_at_its_field(watched: Watched) -> None:
    page = watched.open("/#/alarms")
    page.get_by_role("button", name="New rule …").click()
    form = page.get_by_role("dialog", name="New rule")
    form.get_by_label("Below, cycles").fill("7,000")
    page.keyboard.press("Enter")
    expect(form.get_by_role("alert")).to_have_text(re.compile("A comma before exactly three digits is not clear"))
    assert form.get_by_label("Below, cycles").input_value() == "7,000"
    form.get_by_label("Below, cycles").fill("7000")
    form.get_by_label("and the median below").fill("0.5")
    page.keyboard.press("Enter")
    expect(form.get_by_role("alert")).to_have_count(1)
    expect(form.get_by_label("and the median below")).to_be_focused()
    watched.said.clear()
