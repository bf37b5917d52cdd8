"""A clutch that several criteria end: its shudder margin, its lag over life, its pressure laws, and planned duty."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.driving import Watched, turned
from tests.browser.lives import loops, post
from tests.journeys.dashboard.test_axe import violations
from tests.support import Server, filled_service, post_tests

pytestmark = pytest.mark.browser

PRESSURES = (4.0, 5.0, 6.0)
CRITERIA = [{"quantity": "mean_cof"}, {"quantity": "slope", "pressure_bar": 5, "speed_rpm": 100}]


@filled_service
def server(running: Server) -> None:
    """`bench` with two criteria, three stationary tests and two dynamic ones; `planned`, whose severity is its energy, 18 kJ
    a cycle, tested at four states and one pressure."""
    record = {"clutch_id": "bench", "end_of_life": {"criteria": CRITERIA}}
    running.http.post("/v1/clutches", json=record).raise_for_status()
    post_tests(running.http, 0, 2000, 4000, to="bench", pressures=PRESSURES)
    for cycles in (0, 4000):
        post(running.http, "bench", loops(cycles, pressures=(4.0, 5.0)))
    record = {"clutch_id": "planned", "severity": {"basis": "dissipated_energy"}}
    running.http.post("/v1/clutches", json=record).raise_for_status()
    post_tests(running.http, *range(0, 4000, 1000), to="planned", pressures=(5.0,))
    duty = {"cycles": 3000, "energy_per_cycle_kj": 18}
    post(running.http, "planned", {"kind": "duty_cycles", "cycles": 3000, "duty": duty})


def asked(watched: Watched, text: str) -> int:
    """How often the page has asked for an address with that text."""
    return sum(text in url for url in watched.asked)


@pytest.mark.slow
def test_the_margin_and_the_lag_are_read_when_they_are_looked_at_and_again_when_the_clutch_changes(
    browser: Browser, server: Server
) -> None:
    watched = Watched(browser, server.url, color_scheme="dark")
    page = watched.open("/clutches/bench")
    rows = page.locator(".limits tbody tr")
    expect(rows).to_have_count(2)
    expect(page.locator(".limits")).to_contain_text("Mean COF")
    expect(page.locator(".limits")).to_contain_text("Slope dμ/dv, 100 rpm, 5.0 bar")
    ends = server.http.get("/v1/clutches/bench/remaining-useful-life").json()["criteria"]
    assert [end["quantity"] for end in ends] == ["mean_cof", "slope"]

    page.goto(f"{server.url}/")  # another document, so that the tab of the curves is the first that is opened
    watched.asked.clear()
    watched.open("/clutches/bench#/curves")
    page.locator("#chart-stribeck[data-drawn]").wait_for()
    assert asked(watched, "degradation?quantity") == 0

    margin = turned(page, "overview").locator("#chart-shudder")
    margin.scroll_into_view_if_needed()
    expect(margin.locator(".note")).to_contain_text("At 5.0 bar")
    expect(margin.locator(".note")).to_contain_text("At 100 rpm")
    assert asked(watched, "remaining-useful-life?quantity=slope") == 0  # the record has that criterion
    margin.locator("summary").click()
    items = server.http.get("/v1/clutches/bench/degradation", params={"quantity": "slope"}).json()["items"]
    measured = sum(len(item["measured"]["cycles"]) for item in items if item["pressure_bar"] == 5.0)
    assert measured >= 6
    expect(margin.locator("tbody tr").filter(has_text="measured")).to_have_count(measured)
    margin.get_by_label("Pressure").select_option("4.0 bar")
    expect(margin.locator(".note")).to_contain_text("At 4.0 bar")
    expect(margin.locator(".note")).to_contain_text("At 100 rpm")
    assert asked(watched, "remaining-useful-life?quantity=slope&pressure_bar=4") == 1

    lag = turned(page, "loops").locator("#chart-lag-cycles")
    lag.scroll_into_view_if_needed()
    expect(lag.locator(".note")).to_contain_text("at 0.1 Hz")
    lag.get_by_label("Quantity").select_option("Attractor C")
    expect(page.locator("#chart-lag-pressure .note")).to_contain_text("Attractor C")
    expect(page.locator("#chart-loop-curves .note")).to_contain_text("stationary curve at the same number of cycles")
    assert violations(page) == []

    before = asked(watched, "degradation?quantity=slope")
    post(server.http, "bench", {"kind": "maintenance", "cycles": 4000, "event": "oil_change"})
    expect(turned(page, "runs").locator("#runs .runs > details")).to_have_count(6)
    turned(page, "overview")
    margin.scroll_into_view_if_needed()
    expect(margin.locator(".plot")).to_contain_text("oil change")
    assert asked(watched, "degradation?quantity=slope") == before + 1
    watched.close()


@pytest.mark.slow
def test_curves_of_one_state_and_its_pressure_law(watched: Watched) -> None:
    page = watched.open("/clutches/bench#/curves")
    curves = page.locator("#chart-stribeck")
    curves.scroll_into_view_if_needed()
    curves.get_by_label("Colour by").select_option("pressure")
    expect(curves.locator(".note")).to_contain_text("After 0 cycles, at every pressure")
    curves.locator(".controls select").nth(1).select_option("4,000 cycles")
    expect(curves.locator(".note")).to_contain_text("After 4,000 cycles")
    law = page.locator("#chart-pressure-law")
    law.scroll_into_view_if_needed()
    law.locator(".controls select").first.select_option("Coulomb ratio")
    expect(law.locator(".note")).to_contain_text("falls to an asymptote")
    law.locator("summary").click()
    expect(law.locator("tbody tr").filter(has_text="identified")).to_have_count(len(PRESSURES))


@pytest.mark.slow
def test_remaining_life_by_any_quantity_and_pressure_is_chosen_on_the_page(watched: Watched) -> None:
    page = watched.open("/clutches/bench")
    assert asked(watched, "remaining-useful-life?quantity") == 0  # nothing is computed before it is opened
    page.get_by_text("Remaining life by another quantity").click()
    part = page.locator("details.planned").filter(has_text="Remaining life by another quantity")
    quantity, pressure = (part.get_by_role("combobox", name=name) for name in ("Quantity", "Pressure"))
    table = part.get_by_role("table", name="Remaining life by a quantity")
    expect(table).to_contain_text("Static torque, 5.0 bar")
    pressure.select_option("6.0 bar")
    expect(table).to_contain_text("Static torque, 6.0 bar")
    quantity.select_option("Film time")
    expect(table).to_contain_text("Film time, 0.10 Hz, 5.0 bar")
    quantity.select_option("Mean COF")
    expect(pressure).to_contain_text("all pressures")
    expect(table).to_contain_text("Mean COF")
    assert violations(page) == []
    quantity.select_option("Stop time")
    expect(part.get_by_role("alert")).to_contain_text("stop_time_s is not measured in this life")
    watched.said = [line for line in watched.said if "404" not in line]  # the browser notes the refusal


# --- Planned duty: blocks and a pace are typed; cycles, blocks, dates and errors by field come out.


@pytest.fixture
def plan(watched: Watched) -> Iterator[Page]:
    page = watched.open("/clutches/planned")
    page.get_by_text("Planned duty", exact=True).click()
    yield page
    # the browser notes every refusal in its console, and a plan that is refused is one
    watched.said = [line for line in watched.said if "422" not in line]


def test_a_plan_is_typed_by_keyboard_and_answered_with_cycles_blocks_and_dates(plan: Page, server: Server) -> None:
    plan.get_by_label("Energy per cycle, kJ").fill("25,5")
    plan.keyboard.press("Tab")
    plan.keyboard.type("5000")
    plan.keyboard.press("Tab")
    plan.keyboard.type("2")
    plan.keyboard.press("Tab")
    plan.keyboard.type("120")
    plan.keyboard.press("Enter")
    table = plan.get_by_role("table", name="Remaining life under planned duty, by probability")
    expect(table).to_contain_text("Remaining blocks")
    sent = {"programme": [{"cycles": 5000, "energy_per_cycle_kj": 25.5, "sd": 2}], "pace_cycles_per_hour": 120}
    said = server.http.post("/v1/clutches/planned/remaining-useful-life/forecast", json=sent).json()
    median = said["remaining_cycles"]["0.5"]
    assert median is not None
    for words in (f"{median:,.0f}", f"{said['remaining_blocks']['0.5']:.1f}", said["end_of_life_at"]["0.5"][:10]):
        expect(table).to_contain_text(words)
    assert violations(plan) == []


@pytest.mark.slow
def test_what_is_wrong_is_said_at_its_field_and_can_be_mended(plan: Page) -> None:
    plan.get_by_role("button", name="Add a block").click()
    second = plan.get_by_role("group", name="Block 2")
    expect(second.get_by_label("Energy per cycle, kJ")).to_be_focused()
    second.get_by_label("Duty cycles").fill("-5")
    plan.get_by_role("button", name="Predict", exact=True).click()
    wrong = second.get_by_label("Duty cycles")
    expect(wrong).to_have_attribute("aria-invalid", "true")
    expect(wrong).to_be_focused()
    expect(wrong).to_have_accessible_description(re.compile("^must be greater than"))
    expect(plan.get_by_role("group", name="Block 1").locator("[aria-invalid]")).to_have_count(0)
    assert violations(plan) == []
    for typed in ("1,000", "ten"):
        wrong.fill(typed)
        plan.get_by_role("button", name="Predict", exact=True).click()
        expect(wrong).to_have_accessible_description(re.compile("^Write a number as 25.5 or 25,5"))
    # a standard deviation without an energy is an error of the block
    wrong.fill("1000")
    second.get_by_label("Standard deviation of this energy, kJ").fill("3")
    plan.get_by_role("button", name="Predict", exact=True).click()
    expect(second).to_contain_text("needs energy_per_cycle_kj")
    plan.get_by_role("button", name="Remove block 2").click()
    plan.get_by_role("button", name="Predict", exact=True).click()
    expect(plan.get_by_role("table", name="Remaining life under planned duty, by probability")).to_be_visible()
    expect(plan.locator(".planned [aria-invalid]")).to_have_count(0)
