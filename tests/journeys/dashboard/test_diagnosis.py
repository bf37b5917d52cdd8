"""A diagnosis from the page: run, read, adopted after a question, taken back. The engine is a quick stand-in."""

from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.browser.driving import Watched, drawn, turned
from tests.browser.lives import post, worn
from tests.browser.pixels import seen
from tests.support import Server, filled_service, stationary

pytestmark = pytest.mark.browser

ENGINE = "tests.service.changes.stand_in_engine:diagnose"


@filled_service(scope="function", engine=ENGINE)
def server(running: Server) -> None:
    worn(running.http, "bench", last=5000)


def told(server: Server, path: str) -> dict[str, Any]:
    return server.http.get(f"/v1/clutches/bench{path}").json()


def test_a_diagnosis_is_run_adopted_and_taken_back(watched: Watched, server: Server) -> None:
    page = watched.open("/clutches/bench#/diagnosis")
    section = page.locator("#diagnosis")
    section.get_by_text("No diagnosis has been run yet").wait_for()
    section.get_by_role("button", name="Run the diagnosis").click()
    section.get_by_text("Cause named.").wait_for(timeout=60_000)
    report = told(server, f"/diagnoses/{told(server, '/diagnoses')['items'][0]['diagnosis_id']}")
    for part in (report["summary"], "Zero of the torque sensor", "17 % less error", "read the unloaded zero", "98 %"):
        assert part in section.inner_text(), part
    maps_are_drawn(page)
    expect(page.locator("#head .verdict")).to_contain_text("Out of specification")

    adopt(page, agree=False)
    assert told(server, "/remaining-useful-life")["model"]["name"] == "baseline"
    adopt(page, agree=True)
    expect(section).to_contain_text("This diagnosis is adopted")
    assert told(server, "/remaining-useful-life")["model"]["effects"] == report["causes"]
    turned(page, "overview")
    expect(page.locator(".tiles")).to_contain_text("For torque zero shift")
    expect(page.locator("#head .verdict")).not_to_contain_text("Out of specification")
    turned(page, "diagnosis")

    section.get_by_role("button", name="Go back to the baseline").click()
    dialog = page.get_by_role("dialog", name="Go back to the baseline?")
    assert "no longer account for" in dialog.inner_text()
    dialog.get_by_role("button", name="Go back").click()
    section.get_by_role("button", name="Adopt the extended model").wait_for()
    assert told(server, "/remaining-useful-life")["model"]["name"] == "baseline"
    turned(page, "overview")
    expect(page.locator(".tiles")).to_contain_text("no diagnosis is adopted")

    page.goto(f"{server.url}/")
    row = page.locator("tr[data-clutch='bench']")
    expect(row).to_contain_text("Out of specification")
    expect(row.locator(".do")).to_contain_text("it explains where data and model disagree")


def adopt(page: Page, *, agree: bool) -> None:
    page.get_by_role("button", name="Adopt the extended model").click()
    dialog = page.get_by_role("dialog", name="Adopt")
    said = dialog.inner_text()
    for part in ("Torque zero shift", "recomputed", "The runs themselves are not touched", "Now", "Then"):
        assert part in said, part
    if agree:
        dialog.get_by_role("button", name="Adopt it").click()
    else:
        page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)


def maps_are_drawn(page: Page) -> None:
    for name in ("map-speed", "map-cycles", "diagnosis-loops"):
        assert seen(drawn(page, name).locator(".plot")).is_chart, name


@pytest.mark.slow
def test_a_rebuild_ends_what_a_diagnosis_said(watched: Watched, server: Server) -> None:
    server.http.post("/v1/clutches/bench/diagnoses", json={"adopt": False}).raise_for_status()
    page = watched.open("/")
    row = page.locator("tr[data-clutch='bench']")
    expect(row).to_contain_text("Out of specification")
    post(server.http, "bench", {"kind": "maintenance", "cycles": 5000, "event": "rebuild"})
    for cycles in (5100, 6000, 7000):
        post(server.http, "bench", stationary(cycles, wear=(cycles - 5000) / 26_000))
    expect(row).to_contain_text("Normal")
    watched.open("/clutches/bench#/diagnosis")
    page.locator("#diagnosis").get_by_text("which concerns the earlier life").wait_for()
    expect(page.locator("#head .verdict")).to_contain_text("Normal")
    expect(page.get_by_role("button", name="Adopt the extended model")).to_have_count(0)


@pytest.mark.slow
def test_a_failed_diagnosis_says_why(watched: Watched, server: Server) -> None:
    page = watched.page
    answer = told(server, "/diagnoses")
    problem = {"type": "about:blank", "title": "Busy", "status": 503, "detail": "16 diagnoses wait already: ask again"}
    problem |= {"errors": [], "total_errors": 0}

    def refuse(route: Any) -> None:
        if route.request.method == "POST":
            route.fulfill(status=503, json=problem, headers={"Retry-After": "1"})
        else:
            route.continue_()

    page.route("**/diagnoses*", refuse)
    watched.open("/clutches/bench#/diagnosis")
    page.get_by_role("button", name="Run the diagnosis").click()
    page.locator("#diagnosis").get_by_text("16 diagnoses wait already").wait_for()
    assert page.get_by_role("button", name="Run the diagnosis").is_enabled()
    assert told(server, "/diagnoses") == answer
    assert all("503" in line for line in watched.errors())
    watched.said.clear()
