"""axe-core's rules on every page and dialog, in light and dark, on a wide screen and on a phone."""

from collections.abc import Iterator
from typing import Any

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from playwright.sync_api import Browser, Page, expect

from tests.browser.driving import Watched, turned
from tests.browser.lives import post, worn
from tests.service.changes import stand_in_engine
from tests.support import serving, stationary

pytestmark = pytest.mark.browser

PHONE = {"width": 390, "height": 844}
WIDE = {"width": 1360, "height": 900}


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    engine = {"CLUTCHLIFE_ENGINE": f"{stand_in_engine.__name__}:diagnose"}
    with serving(tmp_path_factory.mktemp("axe") / "clutchlife.db", loaded=True, environment=engine) as server:
        worn(server.http, "bench", last=4000)
        odd = stationary(5000, run_id="odd")
        odd["channels"]["torque_nm"] = [100 * value for value in odd["channels"]["torque_nm"]]
        assert post(server.http, "bench", odd)["state"] == "held"
        post(server.http, "bench", stationary(4500, run_id="aside"))
        server.http.post("/v1/clutches/bench/runs/aside/withdraw", json={"reason": "to look at"}).raise_for_status()
        server.http.post("/v1/clutches", json={"clutch_id": "waiting"})
        server.http.post("/v1/clutches/bench/diagnoses", json={"adopt": False}).raise_for_status()
        # what the charts show is made before the page asks: this is not about how long that takes beside a browser
        server.http.get("/v1/clutches/bench/degradation", headers={"Prefer": "wait=60"}).raise_for_status()
        yield server.url


def violations(page: Page, within: str = "body") -> list[str]:
    """What axe finds, a line an element; in an open dialog alone, for what is behind it was looked at before.

    `within`: where else all was looked at before."""
    if page.evaluate("window.axe === undefined"):
        page.evaluate(AXE_SCRIPT)
    whole = "document" if within == "body" else f"document.querySelector('{within}')"
    looked_at = f"document.querySelector('dialog[open]') ?? {whole}"
    found: dict[str, Any] = page.evaluate(f"axe.run({looked_at}, {{resultTypes: ['violations']}})")
    assert found["passes"] is not None
    return [
        f"{each['id']}: {node['html'][:160]} {node['failureSummary'][:300]}"
        for each in found["violations"]
        for node in each["nodes"]
    ]


@pytest.mark.parametrize(("scheme", "viewport"), [("light", WIDE), pytest.param("dark", PHONE, marks=pytest.mark.slow)])
def test_the_fleet(browser: Browser, url: str, scheme: str, viewport: dict[str, int]) -> None:
    watched = Watched(browser, url, color_scheme=scheme, viewport=viewport)
    page = watched.open("/")
    page.locator("table.fleet tbody tr").first.wait_for()
    page.get_by_role("link", name="one held run").wait_for()
    assert violations(page) == []
    page.get_by_role("button", name="Register a clutch").click()
    page.get_by_role("dialog", name="Register a clutch").wait_for()
    assert violations(page) == []
    page.keyboard.press("Escape")
    # the rules themselves can fail
    page.evaluate("document.body.append(Object.assign(document.createElement('img'), {src: '/assets/none'}))")
    assert any(line.startswith("image-alt") for line in violations(page))
    watched.context.close()


@pytest.mark.parametrize(("scheme", "viewport"), [("light", PHONE), pytest.param("dark", WIDE, marks=pytest.mark.slow)])
def test_a_clutch_with_a_diagnosis_and_all_that_opens(
    browser: Browser, url: str, scheme: str, viewport: dict[str, int]
) -> None:
    watched = Watched(browser, url, color_scheme=scheme, viewport=viewport)
    page = watched.open("/clutches/bench")
    # neither clicked nor pressed: a chart above it may still grow, and the page may still move its focus
    page.locator("#chart-fan details").evaluate("details => { details.open = true; }")
    page.locator("#chart-fan table").wait_for()
    page.get_by_text("More", exact=True).click()
    page.locator("#units summary").click()
    assert violations(page) == []
    page.keyboard.press("Escape")
    for tab in ("curves", "loops", "engagements"):
        turned(page, tab).locator(f"#tab-{tab} figure.chart").first.wait_for()
        assert violations(page, f"#tab-{tab}") == [], tab
    turned(page, "runs")
    for run_id in ("odd", "aside"):
        page.locator(f"#runs details[data-run='{run_id}'] > summary").click()
    expect(page.locator("#runs .facts")).to_have_count(2)
    expect(page.locator("#runs .run-charts figure")).to_have_count(6)
    assert violations(page, "#tab-runs") == []
    turned(page, "history").locator("#changes tbody tr").first.wait_for()
    assert violations(page, "#tab-history") == []
    turned(page, "diagnosis").locator("#diagnosis .verdict").wait_for()
    assert violations(page, "#tab-diagnosis") == []
    turned(page, "overview").locator("#held").get_by_text("1 run is held").wait_for()
    page.locator("#held").get_by_role("button", name="Correct the cycles").click()  # the form that has all fields
    assert violations(page) == []
    page.keyboard.press("Escape")
    turned(page, "diagnosis").get_by_role("button", name="Adopt the extended model").click()
    assert violations(page) == []
    page.keyboard.press("Escape")
    with page.expect_file_chooser() as chooser:
        page.get_by_role("button", name="Send runs").click()
    broken = {"name": "a.csv", "mimeType": "text/csv", "buffer": b"pressure_bar,speed_rpm,torque_nm\n5,20,x\n"}
    chooser.value.set_files([broken])
    dialog = page.get_by_role("dialog", name="Send a run")
    dialog.get_by_label("Kind of test").select_option("Stationary Stribeck test")
    dialog.get_by_label("Duty cycles since new").fill("9000")
    dialog.get_by_label("Clutch", exact=True).fill("unknown")
    page.keyboard.press("Enter")
    form = page.get_by_role("dialog", name="Register a clutch")
    form.wait_for()
    assert violations(page) == []
    form.get_by_role("button", name="Cancel").click()
    dialog.get_by_label("Clutch", exact=True).fill("bench")
    page.keyboard.press("Enter")
    dialog.get_by_text("Not stored.").wait_for()
    assert violations(page) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    watched.context.close()


_COLOURS = """names => names.map((name) => {
  const probe = document.body.appendChild(document.createElement("span"));
  probe.style.color = `var(--${name})`;
  const found = getComputedStyle(probe).color.match(/[\\d.]+/g).map(Number);
  probe.remove();
  return found;
})"""
#: What lines, points, bars, icons and borders of fields are drawn in.
DRAWN = (
    "ink",
    "quiet",
    "edge",
    "accent",
    "failure",
    "out",
    "maintenance",
    "check",
    "normal",
    "fresh",
    "midlife",
    "worn",
    "low",
    "high",
)


def luminance(rgb: list[float]) -> float:
    """Relative luminance after WCAG 2.2."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (value / 255 for value in rgb[:3])]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: list[float], other: list[float]) -> float:
    """Contrast ratio after WCAG 2.2, 1 to 21."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_all_that_is_drawn_stands_out_three_to_one(browser: Browser, url: str) -> None:
    assert contrast([255, 255, 255], [0, 0, 0]) == pytest.approx(21)
    watched = Watched(browser, url)
    page = watched.open("/")
    page.locator("table.fleet tbody tr").first.wait_for()
    names = ("panel", "page", "line", *DRAWN)
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        found = dict(zip(names, page.evaluate(_COLOURS, names), strict=True))
        assert (luminance(found["page"]) > 0.5) == (scheme == "light")
        for name in DRAWN:
            for ground in ("panel", "page"):
                assert contrast(found[name], found[ground]) >= 3, (scheme, name, ground)
        assert contrast(found["line"], found["panel"]) < 3  # grid lines carry nothing: the check can fail
    watched.close()


def test_an_empty_clutch_an_unknown_one_and_an_archived_one(browser: Browser, url: str) -> None:
    watched = Watched(browser, url, viewport=PHONE)
    for path, title in (("nobody", "No such clutch"), ("waiting", "No run has arrived")):
        page = watched.open(f"/clutches/{path}")
        page.get_by_role("heading", name=title).wait_for()
        assert violations(page) == []
    watched.said.clear()  # the browser notes that nobody is there
    page.get_by_text("More", exact=True).click()
    page.get_by_role("button", name="Archive …").click()
    page.get_by_role("dialog").get_by_role("button", name="Archive").click()
    page.locator(".done").get_by_text("waiting is archived").wait_for()
    page.locator("#archived").get_by_role("button", name="Bring it back").wait_for()
    assert violations(page) == []
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    page.locator(".done").get_by_role("button", name="Undo").click()
    page.locator(".done").get_by_text("back in the list").wait_for()
    watched.close()
