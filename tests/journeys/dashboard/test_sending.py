"""Runs sent from the pages: several files at once, each with its outcome; a form registers a clutch, no slip does."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Locator, Page, Route, expect

from tests.browser.driving import Watched, drop
from tests.browser.lives import post
from tests.browser.pixels import seen
from tests.service.clients import csv_text
from tests.support import Server, filled_service, stationary

pytestmark = pytest.mark.browser

WRONG = "pressure_bar,speed_rpm,torque_nm\n5,20,21\n5,120,abc\n5,520,21.5\n5,1020,\n5,1970,20\n"
#: What a browser notes of an answer that is no success.
REFUSED = ("404 (Not Found)", "422 (Unprocessable Entity)", "503 (Service Unavailable)")


@filled_service
def server(running: Server) -> None:
    """A service with a clutch of one run, and another without."""
    for name in ("bench3-017", "other"):
        running.http.post("/v1/clutches", json={"clutch_id": name}).raise_for_status()
    post(running.http, "bench3-017", stationary(0, run_id="first"))


@pytest.fixture
def watched(browser: Browser, server: Server) -> Iterator[Watched]:
    found = Watched(browser, server.url)
    yield found
    assert [line for line in found.errors() if not line.endswith(REFUSED)] == []
    found.said.clear()
    found.close()


def sheet(cycles: float) -> str:
    return csv_text(stationary(cycles)["channels"])


def asked(server: Server, path: str) -> Any:
    return server.http.get(f"/v1/clutches{path}").json()


def names(server: Server) -> set[str]:
    return {item["clutch_id"] for item in asked(server, "")["items"]}


def opened(watched: Watched, path: str = "/") -> Page:
    page = watched.open(path)
    page.get_by_text("Live, as of").wait_for()
    return page


def file_in(dialog: Locator, name: str) -> Locator:
    return dialog.get_by_role("group", name=name, exact=True)


@pytest.mark.slow
def test_no_clutch_is_chosen_for_the_reader(watched: Watched) -> None:
    page = opened(watched)
    drop(page, {"a.csv": sheet(0)})
    dialog = page.get_by_role("dialog", name="Send a run")
    expect(dialog.get_by_label("Clutch", exact=True)).to_have_value("")
    expect(dialog.get_by_label("Clutch", exact=True)).to_be_focused()
    expect(dialog.get_by_label("Kind of test")).to_have_value("")
    before = len(watched.asked)
    dialog.get_by_role("button", name="Send").click()  # the browser asks for what is empty
    assert [url for url in watched.asked[before:] if "/runs" in url] == []
    page = opened(watched, "/clutches/other")
    drop(page, {"a.csv": sheet(0)})
    expect(page.get_by_label("Clutch", exact=True)).to_have_value("other")


def test_several_files_each_have_their_outcome(watched: Watched, server: Server) -> None:
    page = opened(watched)
    drop(
        page,
        {
            "2026-11-02-stationary-2000.csv": sheet(2000),
            "sweep_9k.csv": WRONG,
            "first.json": json.dumps(stationary(0, run_id="first") | {"clutch_id": "another"}),
            "measured.csv": sheet(1000),
            "notes.json": '{"text": "not a run"}',
        },
    )
    dialog = page.get_by_role("dialog", name="Send 4 runs")
    assert "notes.json: not a run" in dialog.inner_text()
    guessed = file_in(dialog, "2026-11-02-stationary-2000.csv")
    expect(guessed.get_by_label("Duty cycles since new")).to_have_value("2000")
    expect(guessed.get_by_label("Kind of test")).to_have_value("stationary_stribeck")
    expect(file_in(dialog, "sweep_9k.csv").get_by_label("Duty cycles since new")).to_have_value("9000")
    unnamed = file_in(dialog, "measured.csv")
    expect(unnamed.get_by_label("Duty cycles since new")).to_have_value("")
    unnamed.get_by_label("Duty cycles since new").fill("1000")
    expect(unnamed.get_by_label("Kind of test")).to_have_value("stationary_stribeck")  # only it has these channels
    dialog.get_by_label("Clutch", exact=True).fill("bench3-017")
    file_in(dialog, "first.json").get_by_text("not bench3-017.").wait_for()

    dialog.get_by_role("button", name="Send 4 runs").click()
    dialog.get_by_text("3 stored, 1 not stored").wait_for()
    for name, outcome in (
        ("2026-11-02-stationary-2000.csv", "at 2,000 cycles"),
        ("measured.csv", "at 1,000 cycles"),
        ("first.json", "Stored before"),
        ("sweep_9k.csv", "Not stored."),
    ):
        expect(file_in(dialog, name).locator(".outcome")).to_contain_text(outcome)
    stored = asked(server, "/bench3-017/runs")["items"]
    assert [run["cycles"] for run in stored] == [0, 1000, 2000]

    broken = file_in(dialog, "sweep_9k.csv")
    (row,) = [row.split("\t") for row in broken.locator(".outcome table tbody tr").all_inner_texts()]
    assert row[:3] == ["2", "/channels/torque_nm/1", "abc"], "the first; the empty cell comes when this is mended"
    assert "must be a number" in row[3]
    # what is left can be mended and sent again, and nothing else is
    broken.get_by_label("Duty cycles since new").fill("3000")
    posted = [url for url in watched.asked if "/runs" in url and "?limit" not in url]
    dialog.get_by_role("button", name="Send the 1 that is left").click()
    dialog.get_by_text("0 stored, 1 not stored").wait_for()
    more = [url for url in watched.asked if "/runs" in url and "?limit" not in url][len(posted) :]
    assert ["cycles=3000" in url for url in more] == [True]
    file_in(dialog, "measured.csv").get_by_text("Receipt").click()
    file_in(dialog, "measured.csv").locator(".receipt svg.curve").wait_for()
    page.keyboard.press("Escape")
    expect(dialog).to_have_count(0)


def test_a_slip_of_typing_makes_no_clutch(watched: Watched, server: Server) -> None:
    page = opened(watched)
    known = names(server)
    drop(page, {"stationary-4000.csv": sheet(4000)})
    dialog = page.get_by_role("dialog", name="Send a run")
    dialog.get_by_label("Clutch", exact=True).fill("bench3-17")
    dialog.get_by_text("Ready to send.").wait_for()  # kind and cycles are suggested by then
    dialog.get_by_role("button", name="Send").click()
    form = page.get_by_role("dialog", name="Register a clutch")
    form.get_by_text("No clutch is registered as “bench3-17”").wait_for()
    form.get_by_role("button", name="Cancel").click()
    dialog.get_by_text("Nothing was sent.").wait_for()
    dialog.get_by_role("button", name="Send").click()
    form.get_by_role("button", name="Send to bench3-017 instead").click()
    dialog.get_by_text("at 4,000 cycles").last.wait_for()
    expect(dialog.get_by_label("Clutch", exact=True)).to_have_value("bench3-017")
    assert 4000 in [run["cycles"] for run in asked(server, "/bench3-017/runs")["items"]]
    assert names(server) == known


def test_a_clutch_is_registered_by_the_form(watched: Watched, server: Server) -> None:
    page = opened(watched)
    drop(page, {"run-0.json": json.dumps(stationary(0))})
    dialog = page.get_by_role("dialog", name="Send a run")
    assert "Stationary Stribeck test at 0 cycles" in dialog.inner_text()
    dialog.get_by_label("Clutch", exact=True).fill("dropped")
    dialog.get_by_role("button", name="Send").click()
    form = page.get_by_role("dialog", name="Register a clutch")
    expect(form.get_by_label("Inner diameter, mm")).to_have_value("99")
    expect(form.get_by_label("Clutch id")).to_have_value("dropped")
    form.get_by_label("Outer diameter, mm").fill("90")
    form.get_by_role("button", name="Register this clutch").click()
    form.get_by_text("Not registered.").wait_for()
    assert "dropped" not in names(server)
    form.get_by_label("Outer diameter, mm").fill("140")
    form.get_by_label("Mean COF as a share of its value when new").fill("0.4")
    form.get_by_label("Friction material").fill("carbon")
    page.keyboard.press("Enter")
    dialog.locator("svg.curve").wait_for()
    assert dialog.locator("svg.curve circle").count() == 160
    assert dialog.locator("svg.curve path[stroke-width='2']").count() == 4
    assert seen(dialog.locator("svg.curve")).is_chart
    assert dialog.locator("table tbody tr").count() == 4
    record = asked(server, "/dropped")
    assert record["geometry"]["outer_diameter_mm"] == 140
    assert (record["end_of_life"]["cof_fraction"], record["friction_material"]) == (0.4, "carbon")
    page.keyboard.press("Escape")
    page.get_by_role("link", name="dropped").wait_for()

    page.get_by_role("button", name="Register a clutch").click()
    form.get_by_label("Clutch id").fill("by-button")
    form.get_by_role("button", name="Register this clutch").click()
    page.get_by_role("heading", name="No run has arrived").wait_for()
    assert asked(server, "/by-button")["geometry"] == asked(server, "/other")["geometry"]


@pytest.mark.slow
def test_a_busy_service_is_asked_again(watched: Watched, server: Server) -> None:
    busy = ["1", "1"]

    def answer(route: Route) -> None:
        if busy:
            problem = {"title": "Busy", "status": 503, "detail": "try again"}
            route.fulfill(status=503, headers={"Retry-After": busy.pop()}, json=problem)
        else:
            route.continue_()

    watched.page.route("**/runs/file?*", answer)  # before the page is loaded, else a request may pass by it
    page = opened(watched, "/clutches/other")
    drop(page, {"stationary-100.csv": sheet(100)})
    page.get_by_role("dialog").get_by_role("button", name="Send").click()
    page.get_by_text("at 100 cycles").last.wait_for()
    assert busy == []
    assert [run["cycles"] for run in asked(server, "/other/runs")["items"]] == [100]


@pytest.mark.slow
def test_a_campaign_s_folder_says_itself_what_its_files_are(watched: Watched, server: Server) -> None:
    page = opened(watched)
    listed = [
        {"file": "b.csv", "kind": "stationary_stribeck", "cycles": 70, "run_id": "b", "origin": "simulated"},
        {"file": "a.csv", "kind": "stationary_stribeck", "cycles": 90, "run_id": "a"},
    ]
    record = {"clutch_id": "whole", "origin": "simulated", "geometry": {"inner_diameter_mm": 100}}
    texts = {"runs.json": json.dumps(listed), "clutch.json": json.dumps(record)}
    drop(page, texts | {"a.csv": sheet(90), "b.csv": sheet(70)})
    dialog = page.get_by_role("dialog", name="Send 2 runs")
    expect(dialog.get_by_label("Clutch", exact=True)).to_have_value("whole")
    dialog.get_by_role("button", name="Send 2 runs").click()
    form = page.get_by_role("dialog", name="Register a clutch")
    expect(form.get_by_label("Inner diameter, mm")).to_have_value("100")
    form.get_by_role("button", name="Register this clutch").click()
    dialog.get_by_text("All 2 stored.").wait_for()
    stored = asked(server, "/whole/runs")["items"]
    sent = [(run["run_id"], run["cycles"], run["origin"]) for run in stored]
    assert sent == [("b", 70, "simulated"), ("a", 90, "measured")]
    assert asked(server, "/whole")["origin"] == "simulated"
