"""Planned duty on a clutch's page: blocks and a pace are typed; cycles, blocks, dates and errors by field come out."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.driving import Watched
from tests.browser.lives import post
from tests.journeys.dashboard.test_axe import violations
from tests.support import Server, serving, stationary

pytestmark = pytest.mark.browser

BASE = "/v1/clutches/bench"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A clutch whose severity is its energy, 18 kJ a cycle, tested at four states and one pressure."""
    with serving(tmp_path_factory.mktemp("planned") / "clutchlife.db", loaded=True) as running:
        record = {"clutch_id": "bench", "severity": {"basis": "dissipated_energy"}}
        running.http.post("/v1/clutches", json=record).raise_for_status()
        for cycles in range(0, 4000, 1000):
            post(running.http, "bench", stationary(cycles, pressures=(5.0,)))
        duty = {"cycles": 3000, "energy_per_cycle_kj": 18}
        post(running.http, "bench", {"kind": "duty_cycles", "cycles": 3000, "duty": duty})
        yield running


@pytest.fixture
def page(watched: Watched) -> Iterator[Page]:
    page = watched.open("/clutches/bench")
    page.get_by_text("Planned duty", exact=True).click()
    yield page
    # the browser notes every refusal in its console, and a plan that is refused is one
    watched.said = [line for line in watched.said if "422" not in line]


def test_a_plan_is_typed_by_keyboard_and_answered_with_cycles_blocks_and_dates(page: Page, server: Server) -> None:
    page.get_by_label("Energy per cycle, kJ").fill("25,5")
    page.keyboard.press("Tab")
    page.keyboard.type("5000")
    page.keyboard.press("Tab")
    page.keyboard.type("2")
    page.keyboard.press("Tab")
    page.keyboard.type("120")
    page.keyboard.press("Enter")
    table = page.get_by_role("table", name="Remaining life under planned duty, by probability")
    expect(table).to_contain_text("Remaining blocks")
    plan = {"programme": [{"cycles": 5000, "energy_per_cycle_kj": 25.5, "sd": 2}], "pace_cycles_per_hour": 120}
    said = server.http.post(f"{BASE}/remaining-useful-life/forecast", json=plan).json()
    median = said["remaining_cycles"]["0.5"]
    assert median is not None
    for words in (f"{median:,.0f}", f"{said['remaining_blocks']['0.5']:.1f}", said["end_of_life_at"]["0.5"][:10]):
        expect(table).to_contain_text(words)
    assert violations(page) == []


@pytest.mark.slow
def test_what_is_wrong_is_said_at_its_field_and_can_be_mended(page: Page) -> None:
    page.get_by_role("button", name="Add a block").click()
    second = page.get_by_role("group", name="Block 2")
    expect(second.get_by_label("Energy per cycle, kJ")).to_be_focused()
    second.get_by_label("Duty cycles").fill("-5")
    page.get_by_role("button", name="Predict", exact=True).click()
    wrong = second.get_by_label("Duty cycles")
    expect(wrong).to_have_attribute("aria-invalid", "true")
    expect(wrong).to_be_focused()
    expect(wrong).to_have_accessible_description(re.compile("^must be greater than"))
    expect(page.get_by_role("group", name="Block 1").locator("[aria-invalid]")).to_have_count(0)
    assert violations(page) == []
    for typed in ("1,000", "ten"):
        wrong.fill(typed)
        page.get_by_role("button", name="Predict", exact=True).click()
        expect(wrong).to_have_accessible_description(re.compile("^Write a number as 25.5 or 25,5"))
    # a standard deviation without an energy is an error of the block
    wrong.fill("1000")
    second.get_by_label("Standard deviation of this energy, kJ").fill("3")
    page.get_by_role("button", name="Predict", exact=True).click()
    expect(second).to_contain_text("needs energy_per_cycle_kj")
    page.get_by_role("button", name="Remove block 2").click()
    page.get_by_role("button", name="Predict", exact=True).click()
    expect(page.get_by_role("table", name="Remaining life under planned duty, by probability")).to_be_visible()
    expect(page.locator(".planned [aria-invalid]")).to_have_count(0)
