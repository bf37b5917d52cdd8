"""A clutch's page on the demo's life: every chart drawn, its table, its files, its report; live."""

import base64
import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path

import openpyxl
import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.browser.driving import Watched, turned
from tests.browser.driving import drawn as drawn_on
from tests.browser.lives import demo, post
from tests.browser.pixels import seen
from tests.support import ONCE, Server, filled_service

pytestmark = pytest.mark.browser

CHARTS = {
    "overview": {
        "fan": "Mean COF against its threshold",
        "cof": "Mean COF by pressure",
        "shudder": "Shudder margin",
    },
    "curves": {
        "stribeck": "Stribeck curves",
        "surface": "Lines of equal torque",
        "static-torque-nm": "Static torque Ms",
        "coulomb-ratio": "Coulomb ratio M̄c",
        "stribeck-velocity-m-s": "Stribeck velocity VS",
        "viscous-coefficient": "Viscous coefficient Cv",
        "landscape": "A parameter over cycles and pressure",
        "pressure-law": "A parameter over pressure",
    },
    "loops": {
        "loop-curves": "Loops: torque over speed",
        "lag-cycles": "Lag over cycles",
        "lag-pressure": "Lag over pressure",
    },
    "engagements": {
        "engagement-indicators": "An indicator over cycles",
        "engagement-trace": "An engagement against the model",
    },
    "history": {
        "predicted": "Remaining cycles, as predicted",
        "roughness": "Roughness Ra",
        "skewness": "Skewness Rsk",
    },
}
TAB_OF = {name: tab for tab, names in CHARTS.items() for name in names}
#: The highest that the overview may be at 1280 x 800, and how soon the top line stands after the answer.
MAX_OVERVIEW_PX, MAX_TOP_LINE_MS = 1700, 1000


@filled_service
def life(server: Server) -> None:
    """The demo's life as sim-1, with an oil change beside what the simulation gives."""
    clutch_id = demo(server.http)
    note = "<img src=x onerror=alert(1)>"
    post(server.http, clutch_id, {"kind": "maintenance", "cycles": 5000, "event": "oil_change", "note": note})


@pytest.fixture(scope="module")
def watched(browser: Browser, life: Server) -> Iterator[Watched]:
    """A page on the demo's life that several tests look at, one after the other."""
    found = Watched(browser, life.url)
    yield found
    found.close()


def opened(watched: Watched) -> Page:
    return watched.page if "/clutches/sim-1" in watched.page.url else watched.open("/clutches/sim-1")


def drawn(page: Page, name: str) -> Locator:
    """The chart, scrolled to and drawn."""
    return drawn_on(turned(page, TAB_OF[name]), name)


@pytest.mark.slow
def test_every_chart_is_drawn(watched: Watched) -> None:
    page = opened(watched)
    for tab, names in CHARTS.items():
        turned(page, tab)
        expect(page.locator("figure.chart:visible h3")).to_have_text(list(names.values()))
        for name in names:
            found = seen(drawn(page, name).locator(".plot"))
            assert found.is_chart, (name, found)
            assert not found.is_dark, name
    turned(page, "overview")
    # the check itself can fail: what is no chart is not taken for one
    assert not seen(page.locator("#chart-fan figcaption .note")).is_chart


@pytest.mark.slow
@pytest.mark.parametrize("size", [(1280, 800), (390, 844)], ids=["wide", "phone"])
def test_the_page_answers_first(browser: Browser, life: Server, size: tuple[int, int]) -> None:
    """State, safe bound and what to do stand in the first screen within a second of the clutch's answer; the overview is
    short."""
    watched = Watched(browser, life.url, viewport={"width": size[0], "height": size[1]})
    page = watched.page
    with page.expect_response("**/v1/clutches/sim-1") as answered:
        watched.open("/clutches/sim-1")
    said = answered.value.json()
    page.locator("#action").wait_for()
    ready, shown = page.evaluate(
        """() => [performance.getEntriesByName(new URL("/v1/clutches/sim-1", location.href).href)[0].responseEnd,
        performance.getEntriesByName("head-shown")[0].startTime]"""
    )
    assert 0 <= shown - ready < MAX_TOP_LINE_MS
    headline = " ".join(page.locator("#headline").inner_text().split())
    assert said["headline"].partition(": ")[2] in headline
    assert page.locator("#action").inner_text() == said["action"]
    box = page.locator("#action").bounding_box()
    assert box["y"] + box["height"] <= size[1]
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    page.locator("#chart-shudder").scroll_into_view_if_needed()  # on a phone it begins below what is drawn ahead
    page.locator("#chart-shudder[data-drawn]").wait_for()
    if size[0] == 1280:
        assert page.evaluate("document.documentElement.scrollHeight") <= MAX_OVERVIEW_PX
    watched.close()


def test_a_tab_has_an_address_and_the_way_back(watched: Watched) -> None:
    page = opened(watched)
    for tab in ("curves", "runs", "history"):
        turned(page, tab)
        assert page.url.endswith(f"#/{tab}")
        expect(page.locator("#tabs [aria-current]")).to_have_attribute("href", f"#/{tab}")
    page.go_back()
    page.locator("#tab-runs").wait_for()
    page.go_back()
    page.locator("#tab-curves").wait_for()
    assert not page.locator("#tab-runs").is_visible()


def test_a_run_opens_to_its_curve_what_the_fit_leaves_and_its_record(watched: Watched) -> None:
    page = opened(watched)
    runs = ONCE.get(f"{watched.url}/v1/clutches/sim-1/runs?kind=stationary_stribeck&limit=1").json()["items"]
    page.goto(f"{watched.url}/clutches/sim-1#/runs/{runs[0]['run_id']}")
    details = page.locator(f"#runs details[data-run='{runs[0]['run_id']}']")
    for title in ("Curve and fit", "Residuals of the fit", "The record as it was sent"):
        chart = details.locator("figure.chart").filter(has=page.get_by_role("heading", name=title))
        chart.scroll_into_view_if_needed()
        expect(chart.locator(".plot svg").first).to_be_visible()
    details.get_by_label("Channel").select_option("Speed, rpm")


@pytest.mark.slow
def test_units_are_chosen_and_kept(browser: Browser, life: Server) -> None:
    watched = Watched(browser, life.url)
    page = watched.open("/clutches/sim-1#/curves")
    note = page.locator("#chart-stribeck .note")
    expect(note).to_contain_text("At 5.0 bar")
    page.locator("#units summary").click()
    page.get_by_role("button", name="US: lbf·ft, psi, ft/s").click()
    expect(note).to_contain_text("At 73 psi")
    page.locator("#units summary").click()
    page.get_by_role("button", name="Friction as µ").click()
    expect(page.locator("#chart-stribeck .plot")).to_contain_text("coefficient of friction µ")
    page.reload()
    expect(note).to_contain_text("At 73 psi")
    with page.expect_download() as sheet:
        page.locator("#chart-stribeck").get_by_role("button", name="XLSX").click()
    rows = list(
        openpyxl.load_workbook(io.BytesIO(Path(sheet.value.path()).read_bytes())).active.iter_rows(values_only=True)
    )
    assert rows[0] == ("kind", "cycles", "pressure, bar", "speed, rpm", "coefficient of friction µ")
    assert 0.05 < rows[1][4] < 0.25
    watched.close()


@pytest.mark.slow
def test_dark_and_light_are_chosen_and_the_charts_follow(watched: Watched) -> None:
    page = opened(watched)
    button = page.locator("#theme")
    assert button.inner_text() == "Theme: system"
    for theme, dark in (("light", False), ("dark", True), ("system", False)):
        button.click()
        assert button.inner_text() == f"Theme: {theme}"
        for name in ("fan", "roughness") if theme == "dark" else ("fan",):
            chart = drawn(page, name)
            page.wait_for_timeout(300)
            found = seen(chart.locator(".plot"))
            assert (found.is_chart, found.is_dark) == (True, dark), (theme, name)
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(300)
    assert seen(drawn(page, "fan").locator(".plot")).is_dark
    page.emulate_media(color_scheme="light")


def test_a_violation_of_the_policy_would_be_noticed(watched: Watched) -> None:
    page = opened(watched)
    page.evaluate(
        "document.head.append(Object.assign(document.createElement('script'), {textContent: 'window.ran = 1'}))"
    )
    assert page.evaluate("window.ran") is None
    assert len(watched.violations()) == 1
    page.evaluate("window.violations = []")
    watched.said.clear()


def test_what_the_page_says_is_what_the_service_says(watched: Watched) -> None:
    page = opened(watched)
    said = ONCE.get(f"{watched.url}/v1/clutches/sim-1/remaining-useful-life").json()
    assert f"{round(100 * said['current']['health'])} %" in page.locator(".tiles").inner_text()
    assert f"{said['as_of_cycles']:,}" in page.locator(".tiles").inner_text()
    assert page.locator("h1 .tag").inner_text() == "simulated"
    # the list is where its last reader left it: the page of the oil change
    changed = ONCE.get(f"{watched.url}/v1/clutches/sim-1/runs?kind=maintenance&limit=1").json()["items"][0]
    page.goto(f"{watched.url}/clutches/sim-1#/runs/{changed['run_id']}")
    page.locator("#runs .runs > details").first.wait_for()
    # a note is text, never markup
    expect(page.locator("#runs").get_by_text("<img src=x onerror=alert(1)>")).to_be_visible()
    warned = page.locator("#runs details").filter(has=page.locator(".warned")).first
    if warned.get_attribute("open") is None:
        warned.locator("summary").first.click()
    warned.locator(".warnings li").first.wait_for()
    tested = page.locator("#runs details").filter(has_text="stationary").first
    if tested.get_attribute("open") is None:
        tested.locator("summary").first.click()
    tested.locator("table").first.wait_for()


def saved(page: Page, chart: Locator, kind: str) -> bytes:
    """The chart's file of that kind."""
    with page.expect_download() as file:
        chart.get_by_role("button", name=kind.upper()).click()
    assert file.value.suggested_filename == f"sim-1-{chart.get_attribute('id').removeprefix('chart-')}.{kind}"
    return Path(file.value.path()).read_bytes()


_DIFFERING = """async ([png, svg]) => {
  const shades = await Promise.all([["png", png], ["svg+xml", svg]].map(async ([type, data]) => {
    const image = new Image();
    image.src = `data:image/${type};base64,${data}`;
    await image.decode();
    const pen = new OffscreenCanvas(2000, 1200).getContext("2d");
    pen.drawImage(image, 0, 0, 2000, 1200);
    return pen.getImageData(0, 0, 2000, 1200).data;
  }));
  let count = 0;
  for (let at = 0; at < shades[0].length; at += 4) {
    if ([0, 1, 2].some((n) => Math.abs(shades[0][at + n] - shades[1][at + n]) > 100)) count += 1;
  }
  return count / (2000 * 1200);
}"""


def differing(page: Page, picture: bytes, drawing: bytes) -> float:
    """Share of the pixels in which the PNG differs much from the SVG, as the browser itself draws that."""
    assert page.context.browser is not None
    blank = page.context.browser.new_page()  # the page's own policy loads no such pictures
    found: float = blank.evaluate(_DIFFERING, [base64.b64encode(each).decode() for each in (picture, drawing)])
    blank.close()
    return found


@pytest.mark.slow
def test_every_chart_has_a_table_a_png_an_svg_and_a_csv(watched: Watched) -> None:
    page = opened(watched)
    for name in ("fan", "landscape"):
        chart = drawn(page, name)
        chart.locator("summary").click()
        chart.locator("table tbody tr").nth(20).wait_for()
        picture, drawing = (saved(page, chart, kind) for kind in ("png", "svg"))
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 20_000
        assert re.match(rb'<svg [^>]*xmlns="http://www.w3.org/2000/svg"', drawing)
        assert b"duty cycles" in drawing
        lacking = re.sub(rb"(</?)(path|text)\b", rb"\1none", drawing)
        assert differing(page, picture, drawing) < 0.1 * differing(page, picture, lacking)
    for chart in turned(page, "overview").locator("figure.chart:visible").all():
        assert chart.get_by_role("button", name="PNG").is_visible()
        assert chart.get_by_role("button", name="CSV").is_visible()
        assert chart.locator("summary").inner_text() == "Table"
    with page.expect_download() as sheet:
        page.locator("#chart-fan").get_by_role("button", name="CSV").click()
    rows = list(csv.DictReader(io.StringIO(Path(sheet.value.path()).read_bytes().decode())))
    pooled = ONCE.get(f"{watched.url}/v1/clutches/sim-1/degradation").json()["items"][0]["measured"]
    measured = [float(row["mean COF"]) for row in rows if row["kind"] == "measured"]
    assert measured == pooled["value"]


def test_pressure_and_view_are_chosen_by_keyboard(watched: Watched) -> None:
    page = turned(opened(watched), "curves")
    chart = page.locator("#chart-stribeck")
    chart.scroll_into_view_if_needed()
    select = chart.get_by_label(re.compile(r"^\s*Pressure"))
    select.focus()
    page.keyboard.press("ArrowDown")
    expect(chart.locator(".note")).to_contain_text("At 5.5 bar")
    assert page.evaluate("document.activeElement.tagName") == "SELECT"
    expect(page.locator("#chart-static-torque-nm .controls select")).to_have_value("5.5")
    surface = page.locator("#chart-surface")
    surface.get_by_label("Torque over speed and").select_option("cycles")
    expect(surface.locator(".note")).to_contain_text("over the life")
    law = page.locator("#chart-pressure-law summary")
    law.focus()
    page.keyboard.press("Enter")
    page.locator("#chart-pressure-law table tbody tr").first.wait_for()


@pytest.mark.slow
def test_the_report_is_one_page_and_light(browser: Browser, life: Server) -> None:
    watched = Watched(browser, life.url, color_scheme="dark")
    page = opened(watched)
    page.locator("#report .drawing").nth(1).wait_for(state="attached")
    pdf = page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page[^s]", pdf)) == 1
    page.emulate_media(media="print", color_scheme="dark")
    assert not page.locator("main").is_visible()
    report = page.locator("#report")
    for part in ("sim-1", "Remaining cycles", "Threshold", "Diagnosis:", "The last tests", "Made of: Clutchlife "):
        assert part in report.inner_text()
    assert not seen(report).is_dark
    watched.close()
