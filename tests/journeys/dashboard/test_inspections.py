"""Inspections on a clutch's page: R_a and R_sk over cycles, photographs by state, and a form that sends them."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.driving import Watched
from tests.browser.lives import worn
from tests.journeys.dashboard.test_axe import violations
from tests.service.web.routes.surfaces import FRESH, WORN, png
from tests.support import Server, clutchlife, filled_service, serving

pytestmark = pytest.mark.browser

SMALL = {"width": 360, "height": 740}
PICTURE = {"name": "worn.png", "mimeType": "image/png", "buffer": png(size=64)}


@filled_service
def bench(server: Server) -> None:
    """A clutch that was inspected fresh and worn, two photographs of the latter; a clutch that was never inspected."""
    worn(server.http, "bench", last=2000)
    for clutch_id in ("waiting", "sent"):
        server.http.post("/v1/clutches", json={"clutch_id": clutch_id}).raise_for_status()
    for body in (FRESH, FRESH | {"cycles": 4000, "roughness_um": 4.1, "skewness": -2.2}, WORN):
        answer = server.http.post("/v1/clutches/bench/inspections", json=body).raise_for_status()
    for red in (90, 160):
        address = f"{answer.headers['location']}/photographs"
        headers = {"Content-Type": "image/png"}
        server.http.post(address, content=png(red, size=64), headers=headers).raise_for_status()


def opened(browser: Browser, server: Server, clutch_id: str, **context: object) -> tuple[Watched, Page]:
    watched = Watched(browser, server.url, **context)
    page = watched.open(f"/clutches/{clutch_id}#/history")
    page.locator("#inspections").scroll_into_view_if_needed()
    return watched, page


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "viewport"), [("light", SMALL), ("dark", {"width": 1360, "height": 900})], ids=["phone", "dark"]
)
def test_roughness_and_skewness_are_charts_and_photographs_open_larger(
    browser: Browser, bench: Server, scheme: str, viewport: dict[str, int]
) -> None:
    watched, page = opened(browser, bench, "bench", color_scheme=scheme, viewport=viewport)
    section = page.locator("#inspections")
    for name in ("roughness", "skewness"):
        page.locator(f"#chart-{name}").scroll_into_view_if_needed()
        page.locator(f"#chart-{name}[data-drawn]").wait_for()
    rows = section.get_by_role("table", name="Inspections, by duty cycles").get_by_role("row")
    expect(rows).to_have_count(4)
    for words in ("11,000", "disc 2, side A", "1.94", "−3.4", "smooth and flat"):
        expect(rows.nth(3)).to_contain_text(words)
    thumbnails = section.get_by_role("button", name="show it larger")
    expect(thumbnails).to_have_count(2)
    thumbnails.last.scroll_into_view_if_needed()
    expect(section.locator(".thumbnail canvas")).to_have_count(2)
    assert violations(page) == []
    thumbnails.first.click()
    dialog = page.get_by_role("dialog", name="Photograph 1 of 2 at 11,000 cycles, disc 2, side A")
    expect(dialog.get_by_role("img")).to_have_js_property("width", 64)
    assert violations(page) == []
    dialog.get_by_role("button", name="Close").click()
    expect(thumbnails.first).to_be_focused()
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    watched.close()


def polled(page: Page, times: int) -> None:
    """Wait until the list of inspections was asked for so many times more."""
    for _ in range(times):
        page.wait_for_event("requestfinished", lambda request: "/inspections?" in request.url)


@pytest.mark.slow
def test_photographs_are_kept_small_and_drawn_again_only_where_they_changed(browser: Browser, bench: Server) -> None:
    bench.http.post("/v1/clutches", json={"clutch_id": "large"}).raise_for_status()
    address = bench.http.post("/v1/clutches/large/inspections", json=WORN).headers["location"]
    bench.http.post(f"{address}/photographs", content=png(size=1200), headers={"Content-Type": "image/png"})
    watched = Watched(browser, bench.url)
    page = watched.open("/clutches/large#/history")
    section = page.locator("#inspections")
    section.locator(".thumbnail").scroll_into_view_if_needed()
    drawing = section.locator(".thumbnail canvas").first
    assert drawing.evaluate("(canvas) => [canvas.width, canvas.height]") == [352, 352]
    drawing.evaluate("(canvas) => { canvas.dataset.marked = 'drawing'; }")
    listed = section.get_by_role("table", name="Inspections, by duty cycles")
    listed.evaluate("(table) => { table.dataset.marked = 'table'; }")
    polled(page, 2)
    expect(listed).to_have_attribute("data-marked", "table")
    bench.http.post(address.rsplit("/", 1)[0], json=FRESH).raise_for_status()
    expect(listed.get_by_role("row")).to_have_count(3)
    assert listed.get_attribute("data-marked") is None
    expect(drawing).to_have_attribute("data-marked", "drawing")
    assert len([url for url in watched.asked if "/photographs/" in url]) == 1

    section.get_by_role("button", name="show it larger").click()
    dialog = page.get_by_role("dialog", name="Photograph 1 of 1 at 11,000 cycles")
    image = dialog.get_by_role("img")
    expect(image).to_have_js_property("width", 1200)
    dialog.get_by_role("button", name="Close").click()
    expect(page.locator("canvas")).to_have_count(1)  # the whole photograph is let go
    watched.close()


def test_an_inspection_is_sent_by_the_form_withdrawn_and_restored(browser: Browser, bench: Server) -> None:
    watched, page = opened(browser, bench, "sent")
    section = page.locator("#inspections")
    section.get_by_text("Add an inspection").click()
    section.get_by_label("Duty cycles since new").fill("7000")
    send = section.get_by_role("button", name="Send the inspection")
    send.click()
    section.get_by_text("give roughness_um, skewness or a note").first.wait_for()
    section.get_by_label("Inspected at").fill("2026-11-02T08:00")
    section.get_by_label("Roughness Ra, µm").fill("2.5")
    section.get_by_label("Skewness Rsk", exact=True).fill("-2.75")
    section.get_by_label("Photographs").set_input_files([PICTURE, PICTURE | {"name": "other.png", "buffer": b"none"}])
    assert violations(page) == []
    send.click()
    section.get_by_text("other.png is not stored.").wait_for()
    section.get_by_label("Photographs").set_input_files([PICTURE])
    send.click()
    section.get_by_text("The inspection at 7,000 cycles is stored.").wait_for()
    expect(section.get_by_text("is not stored")).to_have_count(0)
    expect(section.get_by_label("Roughness Ra, µm")).to_have_value("")
    rows = section.get_by_role("table", name="Inspections, by duty cycles").get_by_role("row")
    expect(rows).to_have_count(2)
    expect(rows.nth(1)).to_contain_text("2 Nov 2026")
    expect(section.locator(".thumbnail canvas")).to_have_count(1)
    section.get_by_role("button", name="Withdraw the inspection at 7,000 cycles").click()
    dialog = page.get_by_role("dialog", name="Withdraw this inspection")
    dialog.get_by_label("Reason").fill("the other bench's disc")
    dialog.get_by_role("button", name="Withdraw").click()
    page.locator(".done").get_by_text("The inspection at 7,000 cycles is withdrawn.").wait_for()
    expect(rows.nth(1)).to_contain_text("withdrawn")
    expect(section.locator(".thumbnail")).to_have_count(0)
    page.locator(".done").get_by_role("button", name="Undo").click()
    page.locator(".done").get_by_text("The inspection at 7,000 cycles is restored.").wait_for()
    expect(section.locator(".thumbnail canvas")).to_have_count(1)
    # the browser notes every refusal in its console
    watched.said = [line for line in watched.said if "422" not in line]
    watched.close()


@pytest.mark.slow
def test_with_keys_photographs_are_shown_and_sent_with_the_readers_key(browser: Browser, tmp_path: Path) -> None:
    with serving(tmp_path / "clutchlife.db", loaded=True) as server:
        server.http.post("/v1/clutches", json={"clutch_id": "secret"}).raise_for_status()
        address = server.http.post("/v1/clutches/secret/inspections", json=WORN).headers["location"]
        headers = {"Content-Type": "image/png"}
        server.http.post(f"{address}/photographs", content=png(size=64), headers=headers).raise_for_status()
        text = clutchlife("key", "create", "--scope", "ingest", "--database", server.address).strip()
        watched = Watched(browser, server.url)
        page = watched.open("/clutches/secret#/history")
        page.get_by_role("textbox", name="Key").fill(text)
        page.keyboard.press("Enter")
        section = page.locator("#inspections")
        section.locator(".thumbnail").scroll_into_view_if_needed()
        expect(section.locator(".thumbnail canvas")).to_have_count(1)
        section.get_by_text("Add an inspection").click()
        section.get_by_label("Duty cycles since new").fill("12000")
        section.get_by_label("Photographs").set_input_files([PICTURE])
        section.get_by_role("button", name="Send the inspection").click()
        expect(section.locator(".thumbnail canvas")).to_have_count(2)
        section.get_by_role("button", name="Withdraw the inspection at 12,000 cycles").click()
        dialog = page.get_by_role("dialog", name="Withdraw this inspection")
        dialog.get_by_label("Reason").fill("a slip")
        dialog.get_by_role("button", name="Withdraw").click()
        dialog.get_by_text("this request needs admin").wait_for()
        assert all(text not in url for url in watched.asked)
        watched.said = [line for line in watched.said if "401" not in line and "403" not in line]
        watched.close()
