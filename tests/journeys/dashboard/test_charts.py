"""A chart is read by pointer and by keyboard, zoomed by dragging and by keys, and shown whole again."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.browser.driving import Watched, drawn, turned
from tests.browser.lives import worn
from tests.support import Server, filled_service

pytestmark = pytest.mark.browser


@filled_service
def life(server: Server) -> None:
    worn(server.http, "bench", last=6000)


@pytest.fixture(params=[pytest.param(390, marks=pytest.mark.slow), 1360])
def page(request: pytest.FixtureRequest, browser: Browser, life: Server) -> Iterator[Page]:
    watched = Watched(browser, life.url, viewport={"width": request.param, "height": 900})
    yield watched.open("/clutches/bench")
    watched.close()


def ticks(chart: Locator) -> list[str]:
    """The values at both axes."""
    found = chart.locator(".drawing text").all_text_contents()
    return [text for text in found if re.fullmatch(r"[\d,.]+", text)]


def test_the_point_under_the_pointer_is_read_out(page: Page) -> None:
    chart = drawn(page)
    said = chart.locator(".readout")
    box = chart.locator(".drawing circle").nth(-2).bounding_box()  # the last test; the legend's point is behind it
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    expect(said).to_have_text(re.compile(r"measured.*duty cycles 6,000, mean COF 0\.\d{4} ± 0\.\d+ \(90 %\)"))
    page.mouse.move(1, 1)
    expect(said).to_be_hidden()


def test_values_are_read_and_zoomed_by_keyboard(page: Page) -> None:
    chart = drawn(page)
    whole, plot, said = ticks(chart), chart.locator(".plot"), chart.locator(".readout")
    plot.focus()
    page.keyboard.press("ArrowRight")
    first = said.inner_text()
    page.keyboard.press("ArrowRight")
    expect(said).not_to_have_text(first)
    for _ in range(3):
        page.keyboard.press("ArrowDown")
    page.keyboard.press("End")
    expect(said).to_contain_text("duty cycles 6,000")
    page.keyboard.press("+")
    assert ticks(chart) != whole
    assert chart.get_by_role("button", name="show all of it").is_visible()
    page.keyboard.press("Escape")
    assert ticks(chart) == whole
    expect(chart.get_by_role("button", name="show all of it")).to_be_hidden()
    assert page.evaluate("document.activeElement.className") == "plot"


def test_a_part_is_enlarged_by_dragging_until_the_data_are_shown_whole_again(page: Page) -> None:
    chart = drawn(page)
    whole, box = ticks(chart), chart.locator(".plot").bounding_box()
    page.mouse.move(box["x"] + 0.4 * box["width"], box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.7 * box["width"], box["y"] + 62)
    expect(chart.locator(".rubber")).to_have_count(1)
    page.mouse.up()
    expect(chart.locator(".rubber")).to_have_count(0)
    assert set(ticks(chart)) != set(whole)
    assert [value for value in ticks(chart) if value.startswith("0.")] == [v for v in whole if v.startswith("0.")]
    chart.get_by_role("button", name="show all of it").click()
    assert ticks(chart) == whole


def test_a_cut_through_the_surface_is_chosen_and_read(page: Page) -> None:
    chart = drawn(turned(page, "curves"), "surface")
    cut = chart.get_by_label("Cut at")
    expect(cut.locator("option:checked")).to_have_text("pressure 5 bar")
    cut.select_option("speed 1,000 rpm")
    expect(chart.locator(".drawing")).to_contain_text("speed 1,000 rpm")
    chart.locator(".plot").focus()
    read = chart.locator(".readout")
    page.keyboard.press("ArrowRight")
    expect(read).to_have_text(re.compile(r"^fitspeed 0 rpm, pressure 4\S* bar, friction torque \S+ Nm$"))
    page.keyboard.press("ArrowDown")
    expect(read).to_have_text(re.compile(r"^speed 1,000 rpm, fitpressure 4\S* bar, friction torque \S+ Nm$"))
