"""The charts are drawn light until someone points at one, and nothing moves when the plotting library takes their place."""

from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.driving import Watched, turned
from tests.browser.lives import worn
from tests.browser.pixels import seen
from tests.support import Server, filled_service

pytestmark = pytest.mark.browser

LIBRARY = "**/plotly.min.js"
_SHIFTS = """
window.shifted = 0;
window.shifts = new PerformanceObserver((list) => {
  for (const entry of list.getEntries()) window.shifted += entry.value;
});
window.shifts.observe({type: "layout-shift", buffered: true});
"""
#: What has moved so far (a table opened and closed) is told a frame or two later: it is waited for, and forgotten.
_FORGET = """
async () => {
  for (let frame = 0; frame < 3; frame++) await new Promise(requestAnimationFrame);
  await new Promise((done) => setTimeout(done, 100));
  window.shifts.takeRecords();
  window.shifted = 0;
}
"""
#: Where the measurements stand, px on the page.
_LIGHT = "circles => circles.map((c) => c.getBoundingClientRect()).map((r) => [r.x + r.width / 2, r.y + r.height / 2])"


@filled_service
def life(server: Server) -> None:
    worn(server.http, "bench", last=6000)


def texts(page: Page, chart: str) -> list[str]:
    """What is written in a chart, whoever drew it."""
    found = page.locator(f"{chart} svg text").all_text_contents()
    return sorted({text.replace("\u2212", "-").strip() for text in found if text.strip()})


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1360])
def test_the_library_takes_the_place_of_the_light_drawing(
    browser: Browser, life: Server, scheme: str, width: int
) -> None:
    watched = Watched(browser, life.url, viewport={"width": width, "height": 900}, color_scheme=scheme)
    page, held = watched.page, list[Any]()
    page.add_init_script(_SHIFTS)
    page.route(LIBRARY, lambda route: held.append(route))
    watched.open("/clutches/bench")
    page.locator("#chart-fan[data-sketched]").wait_for()
    chart = page.locator("#chart-fan .plot")
    chart.scroll_into_view_if_needed()
    found = seen(chart)
    assert (found.is_chart, found.is_dark) == (True, scheme == "dark")
    page.locator("#chart-fan summary").click()
    page.locator("#chart-fan table tbody tr").nth(20).wait_for()
    page.locator("#chart-fan summary").click()
    chart.scroll_into_view_if_needed()
    points = page.locator("#chart-fan .sketch circle").evaluate_all(_LIGHT)
    said, box = texts(page, "#chart-fan .plot"), chart.bounding_box()
    assert len(points) >= 8
    page.evaluate(_FORGET)

    assert not held  # nothing asks for the library by itself
    with page.expect_request(LIBRARY):
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.move(0, 0)
    for route in held:
        route.continue_()
    page.locator("#chart-fan[data-drawn]").wait_for()
    expect(page.locator("#chart-fan .sketch")).to_have_count(0)
    again = page.locator("#chart-fan .scatterlayer .points path").evaluate_all(_LIGHT)
    for x, y in points[:-1]:
        assert min(abs(x - u) + abs(y - v) for u, v in again) < 2.5, ((x, y), again)
    assert texts(page, "#chart-fan .plot") == said
    for axis in ("xlines-above", "ylines-above"):
        assert page.locator(f"#chart-fan .{axis}").get_attribute("d").startswith("M"), axis
    assert chart.bounding_box() == box
    assert page.evaluate("window.shifted") < 0.01
    watched.close()


@pytest.mark.slow
def test_without_the_library_the_light_charts_stay(browser_3d: Browser, life: Server) -> None:
    watched = Watched(browser_3d, life.url)
    page = watched.page
    page.route(LIBRARY, lambda route: route.abort())
    watched.open("/clutches/bench")
    drawn = {
        "overview": ("fan", "cof"),
        "history": ("predicted",),
        "loops": ("loop-curves", "lag-cycles"),
        "curves": ("stribeck", "static-torque-nm", "pressure-law"),
    }
    for tab, names in drawn.items():
        turned(page, tab)
        for name in names:
            page.locator(f"#chart-{name}").scroll_into_view_if_needed()
            page.locator(f"#chart-{name}[data-sketched]").wait_for()
            assert seen(page.locator(f"#chart-{name} .plot")).is_chart, name
    page.locator("#chart-surface").get_by_role("button", name="Draw it").click()
    page.locator("#chart-surface").get_by_text("The plotting library did not load").wait_for()
    page.get_by_text("Live, as of").wait_for()
    assert (watched.violations(), watched.abroad()) == ([], [])
    watched.context.close()  # a chart may ask for the library once more meanwhile
    assert all("ERR_FAILED" in line for line in watched.errors())
