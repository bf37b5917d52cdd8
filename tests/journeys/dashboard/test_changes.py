"""A typo is seen, corrected and undone on the page; a held run is confirmed, one is withdrawn and restored.

That every answer is then that of a clutch which was sent the right things from the start: test_change_run.py.
"""

import json
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.browser.driving import Watched, drop, turned
from tests.browser.lives import loops, post
from tests.service.changes.benches import without_held
from tests.support import Server, filled_service, stationary

pytestmark = pytest.mark.browser

CLUTCH = "/v1/clutches/bench"
LAST = 7000
PRESSURES = (4.0, 5.0, 6.0)
LIFE = "remaining-useful-life"
ANSWERS = (
    *(
        LIFE,
        f"{LIFE}?method=ukf",
        f"{LIFE}?method=grid",
        f"{LIFE}?at_cycles=2500",
        f"{LIFE}?pressure_bar=5",
        "degradation",
    ),
    *("degradation?quantity=slope", "stribeck", "series", "surfaces", "engagement", "scores"),
)
#: Of the first test; the others follow as their cycles do, 1,000 an hour.
FIRST = datetime(2026, 11, 2, 8, tzinfo=UTC)


def right(cycles: int) -> dict[str, Any]:
    """A test as it ought to be sent; its name says nothing of its cycles."""
    return stationary(cycles, run_id=f"test-{cycles // 1000}", pressures=PRESSURES) | {"started_at": at(cycles)}


def at(cycles: int) -> str:
    return (FIRST + timedelta(hours=cycles / 1000)).isoformat()


def typed() -> dict[str, Any]:
    """The last test with a zero too many."""
    return right(LAST) | {"cycles": 10 * LAST}


def bare(part: dict[str, Any]) -> dict[str, Any]:
    """A part of an answer without what names the clutch, its revision or the moment."""
    return {name: value for name, value in part.items() if name not in ("clutch_id", "revision", "time", "received_at")}


def life(server: Server, clutch: str = "bench") -> dict[str, Any]:
    """What is answered of a clutch, which accepted runs alone decide; not what is said of held ones."""
    found = {}
    for name in ANSWERS:  # of the newest revision, however busy the page keeps the service
        answer = server.http.get(f"/v1/clutches/{clutch}/{name}", headers={"Prefer": "wait=60"}).raise_for_status()
        found[name] = without_held(answer.json(object_hook=bare))
    return found


def opened(watched: Watched) -> Page:
    page = watched.open("/clutches/bench#/runs")
    page.locator("#runs .runs details").first.wait_for()
    return page


def run_in(page: Page, run_id: str) -> Locator:
    """A run in the list, opened."""
    turned(page, "runs")
    details = page.locator(f"#runs details[data-run='{run_id}']")
    details.wait_for()
    if details.get_attribute("open") is None:
        details.locator("summary").first.click()
    return details


def ask(place: Locator, button: str, reason: str, *, cycles: int | None = None) -> None:
    """Press a run's button and answer its question."""
    place.get_by_role("button", name=button).click()
    dialog = place.page.get_by_role("dialog")
    if cycles is not None:
        dialog.get_by_label("Duty cycles since new").fill(str(cycles))
    dialog.get_by_label("Reason").fill(reason)
    place.page.keyboard.press("Enter")
    expect(dialog).to_have_count(0)


def done(page: Page, text: str) -> None:
    """The page says what was done, and holds the focus there for the next key."""
    place = page.locator(".done")
    expect(place).to_contain_text(text)
    expect(place).to_be_focused()


def settled(page: Page, held: int) -> None:
    """The page shows so many held runs at its top."""
    turned(page, "overview")
    if held == 0:
        expect(page.locator("#held")).to_have_count(0)
        expect(page.locator("#head .mark-held")).to_have_count(0)
    else:
        expect(page.locator("#held")).to_contain_text(f"{held} run is held")
        expect(page.locator("#head .mark-held")).to_have_text(f"{held} run held")


def trail(page: Page) -> list[list[str]]:
    """What, who and why in the audit trail."""
    turned(page, "history")
    rows = page.locator("#changes tbody tr")
    expect(page.locator("#changes tbody")).to_be_visible()
    return [[row.locator("td").nth(cell).inner_text() for cell in (1, 3, 4)] for row in rows.all()]


@filled_service(scope="function")
def server(running: Server) -> None:
    """A life up to the test before the last."""
    running.http.post("/v1/clutches", json={"clutch_id": "bench"}).raise_for_status()
    for cycles in range(0, LAST, 1000):
        assert post(running.http, "bench", right(cycles))["state"] == "accepted"
    post(running.http, "bench", loops(4000, pressures=(5.0,)) | {"started_at": at(4000)})


@pytest.mark.slow
def test_a_typo_is_seen_corrected_and_undone(watched: Watched, server: Server) -> None:
    page = opened(watched)
    before = life(server)
    drop(page, {"last.json": json.dumps(typed())})
    sending = page.get_by_role("dialog", name="Send a run")
    sending.get_by_role("button", name="Send").click()
    sending.get_by_text("Stored and held").wait_for()
    sending.get_by_role("link", name="Confirm, correct or withdraw it").click()
    expect(sending).to_have_count(0)

    settled(page, 1)
    held = page.locator("#held .held > li")
    assert "70,000 cycles" in held.inner_text()
    assert "70000" in held.locator(".doubts").inner_text()
    listed = turned(page, "runs").locator("#runs details[data-run='test-7'] summary")
    expect(listed).to_contain_text("Held")
    assert life(server) == before
    page.goto(server.url)
    page.locator("tr[data-clutch='bench']").get_by_role("link", name="one held run").click()
    settled(page, 1)

    warned = page.locator("#warnings li").filter(has_text="Runs are held")
    expect(warned).to_contain_text("1 run is held and does not count: ")
    expect(warned).not_to_contain_text("this is without")  # which the first sentence has said
    ask(held, "Correct the cycles", "a zero too many", cycles=LAST)
    done(page, "Corrected from 70,000 to 7,000 cycles.")
    settled(page, 0)
    after = life(server)
    assert (after[LIFE]["as_of_cycles"], after[LIFE]["runs_used"]) == (LAST, before[LIFE]["runs_used"] + 1)
    server.http.post("/v1/clutches", json={"clutch_id": "right"}).raise_for_status()
    for cycles in range(0, LAST + 1, 1000):
        post(server.http, "right", right(cycles))
    post(server.http, "right", loops(4000, pressures=(5.0,)) | {"started_at": at(4000)})
    assert after == life(server, "right"), "as of one that was sent without the slip"
    turned(page, "runs")
    expect(page.locator("#runs details[data-run='test-7'] summary")).to_contain_text("Sent as 70,000")

    page.locator(".done").get_by_role("button", name="Undo").click()
    done(page, "Corrected from 7,000 to 70,000 cycles. It is held")
    settled(page, 1)
    assert life(server) == before

    ask(held, "Correct the cycles", "it was a zero too many after all", cycles=LAST)
    settled(page, 0)
    assert life(server) == after
    ask(run_in(page, "test-7"), "Undo the correction", "only to see it")
    settled(page, 1)

    turned(page, "history")
    expect(page.locator("#changes tbody tr")).to_have_count(5)
    assert trail(page) == [
        ["Cycles corrected: 7,000 to 70,000", "this machine", "only to see it"],
        ["Cycles corrected: 70,000 to 7,000", "this machine", "it was a zero too many after all"],
        ["Cycles corrected: 7,000 to 70,000", "this machine", "the correction is undone"],
        ["Cycles corrected: 70,000 to 7,000", "this machine", "a zero too many"],
        ["Held on arrival", "this machine", "–"],
    ]
    with page.expect_download() as sheet:
        page.locator("#changes").get_by_role("link", name="CSV").click()
    assert Path(sheet.value.path()).read_text(encoding="utf-8").count("a zero too many") == 2
    # the same file once more is the run that is there already, as it is now
    drop(page, {"last.json": json.dumps(typed())})
    sending.get_by_role("button", name="Send").click()
    sending.get_by_text("Stored before").wait_for()
    page.keyboard.press("Escape")
    assert life(server) == before


@pytest.mark.slow
def test_a_doubt_is_answered_with_one_click(watched: Watched, server: Server) -> None:
    page = opened(watched)
    post(server.http, "bench", typed())
    page.reload()
    settled(page, 1)
    held = page.locator("#held .held > li")
    held.get_by_role("button", name="It is another clutch").click()
    done(page, "is withdrawn")
    page.locator(".done").get_by_role("button", name="Undo").click()
    done(page, "is restored")
    held.get_by_role("button", name="Correct the cycles").click()
    expect(page.get_by_role("dialog").get_by_label("Duty cycles since new")).to_have_value(str(LAST))
    page.keyboard.press("Escape")
    held.get_by_role("button", name="It is 7,000").click()
    done(page, "Corrected from 70,000 to 7,000 cycles.")
    settled(page, 0)
    assert life(server)[LIFE]["as_of_cycles"] == LAST


@pytest.mark.slow
def test_a_reason_is_asked_for_and_a_refusal_is_shown(watched: Watched, server: Server) -> None:
    # before the page is loaded: a request that follows at once may pass by what is put before it later
    watched.page.route(
        "**/withdraw", lambda route: route.fulfill(status=409, json={"title": "Not possible now", "status": 409})
    )
    page = opened(watched)
    last = run_in(page, "test-6")
    last.get_by_role("button", name="Withdraw").click()
    dialog = page.get_by_role("dialog", name="Withdraw this run")
    dialog.get_by_role("button", name="Withdraw").click()
    assert dialog.is_visible()
    dialog.get_by_label("Reason").fill("to see a refusal")
    page.keyboard.press("Enter")
    dialog.get_by_text("Nothing was changed. Not possible now").wait_for()
    page.keyboard.press("Escape")
    assert server.http.get(f"{CLUTCH}/changes").json()["items"] == []
    assert all("409" in line for line in watched.errors())
    watched.said.clear()


@pytest.mark.slow
def test_a_clutch_is_archived_and_brought_back(watched: Watched) -> None:
    page = opened(watched)
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="Archive …").click()
    dialog = page.get_by_role("dialog", name="Archive bench")
    dialog.get_by_label("Reason").fill("worn out")
    dialog.get_by_role("button", name="Archive").click()
    done(page, "bench is archived.")
    expect(page.locator("#archived")).to_contain_text("accepts no new runs")
    drop(page, {"last.json": json.dumps(right(LAST))})
    sending = page.get_by_role("dialog", name="Send a run")
    sending.get_by_role("button", name="Send").click()
    sending.get_by_text("Not stored.").wait_for()
    page.keyboard.press("Escape")
    page.get_by_role("link", name="All clutches").click()
    page.get_by_role("heading", name="No clutch is registered yet").wait_for()
    page.get_by_role("switch", name="Archived").check()
    page.get_by_role("link", name="bench").click()
    page.locator("#archived").get_by_role("button", name="Bring it back").click()
    page.get_by_role("dialog").get_by_role("button", name="Bring back").click()
    done(page, "back in the list")
    expect(page.locator("#archived")).to_be_empty()
    turned(page, "history")
    expect(page.locator("#changes tbody tr")).to_have_count(2)
    page.get_by_role("link", name="All clutches").click()
    page.get_by_role("link", name="bench").wait_for()
    page.get_by_role("switch", name="Archived").check()
    page.get_by_text("No clutch is archived.").wait_for()
    assert all("409" in line for line in watched.errors())
    watched.said.clear()


@pytest.mark.slow
def test_warnings_of_a_life_stand_on_its_page(watched: Watched, server: Server) -> None:
    page = turned(opened(watched), "overview")
    page.locator("#chart-fan[data-drawn]").wait_for()
    expect(page.locator("#tab-overview")).not_to_contain_text("The last test does not fit")
    odd = right(LAST)
    odd["channels"]["torque_nm"] = [0.93 * value for value in odd["channels"]["torque_nm"]]
    assert [warning["code"] for warning in post(server.http, "bench", odd)["warnings"]] == ["off_track"]
    warning = page.locator("#warnings li").filter(has_text="The last test does not fit")
    warning.get_by_text(re.compile("its mean COF of .* is .* standard deviations below")).wait_for()
    link = warning.get_by_role("link", name="Stationary Stribeck test at 7,000 cycles")
    link.focus()
    page.keyboard.press("Enter")
    opened_run = page.locator("#runs details[data-run='test-7'][open]")
    opened_run.get_by_text("Off track").wait_for()
    expect(opened_run.locator("summary").first).to_be_focused()


def test_a_menu_that_is_open_when_a_run_arrives_stays_open(watched: Watched, server: Server) -> None:
    page = opened(watched)
    page.get_by_text("More", exact=True).click()
    archive = page.get_by_role("button", name="Archive …")
    archive.focus()
    before = archive.element_handle()
    post(server.http, "bench", right(LAST))
    before.wait_for_element_state("hidden", timeout=60_000)  # it is drawn again
    expect(archive).to_be_focused()


@pytest.mark.slow
def test_runs_are_listed_page_by_page_the_latest_first(watched: Watched, server: Server) -> None:
    for cycles in range(6010, 6330, 10):
        post(server.http, "bench", {"kind": "maintenance", "cycles": cycles, "event": "other", "note": f"n{cycles}"})
    page = opened(watched)
    listed = page.locator("#runs .runs summary .number")
    pager = page.get_by_role("navigation", name="Pages of runs")
    expect(listed).to_have_count(25)
    assert listed.first.inner_text() == "6,320 cycles"
    assert pager.get_by_role("button", name="Later runs").is_disabled()
    pager.get_by_role("button", name="Earlier runs").click()
    expect(pager).to_contain_text("26 to 40 of 40")
    assert listed.last.inner_text() == "0 cycles"
    assert page.evaluate("document.activeElement.tagName") == "SUMMARY"
    pager.get_by_role("button", name="Later runs").click()
    expect(listed).to_have_count(25)


def test_an_end_is_declared_and_taken_back(watched: Watched, server: Server) -> None:
    page = opened(watched)
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="End of life …").click()
    dialog = page.get_by_role("dialog", name="End of life of bench")
    dialog.get_by_label("Why it has ended").select_option(label="It is worn")
    dialog.get_by_label("Note").fill("squeals")
    at = float(dialog.get_by_label("Duty cycles since new").input_value())
    dialog.get_by_role("button", name="Declare the end").click()
    done(page, f"bench is declared ended at {at:,.0f} cycles.")
    expect(page.locator("#head .verdict")).to_contain_text(f"ended at {at:,.0f} cycles")
    page.goto(server.url)
    row = page.locator("tr[data-clutch='bench']")
    expect(row).to_contain_text(f"ended at {at:,.0f} cycles")
    assert row.inner_text().count("ended at") == 1
    page = opened(watched)
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="Take the end back …").click()
    back = page.get_by_role("dialog", name="Take the end back")
    back.get_by_label("Reason").fill("it was the oil")
    back.get_by_role("button", name="Take it back").click()
    done(page, "The declared end is taken back.")
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="End of life …").wait_for()
