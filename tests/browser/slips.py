"""A clutch with a typo: what is sent, what is compared, and the parts of its page where it is mended."""

from datetime import UTC, datetime, timedelta
from typing import Any

import httpx2
from playwright.sync_api import Locator, Page, expect

from tests.browser.driving import Watched, turned
from tests.browser.lives import loops, post
from tests.support import ONCE, stationary

CLUTCH = "/v1/clutches/bench"
#: What the answers are compared in; all else of `/runs` is the trail of what was sent.
ANSWERS = [
    "/v1/clutches",
    CLUTCH,
    *(f"{CLUTCH}/remaining-useful-life?method={method}" for method in ("particle", "ukf", "grid")),
    f"{CLUTCH}/remaining-useful-life?at_cycles=5000",
    f"{CLUTCH}/degradation",
    *(f"{CLUTCH}/series?limit=1000&quantity={quantity}" for quantity in ("mean_cof", "remaining_cycles")),
    f"{CLUTCH}/stribeck",
    f"{CLUTCH}/loops",
]
#: When something was stored, and how many changes there were.
TIMES = {"revision", "created_at", "received_at"}
#: What says that runs are held, and what follows from it while they are.
OF_HELD_RUNS = {"held_runs", "at_least", "at_least_at", "counted_from", "state", "statement", "warnings", "items"}
LAST = 7000
PRESSURES = (4.0, 5.0, 6.0)
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


def fill(http: httpx2.Client) -> None:
    """A life up to the test before the last."""
    http.post("/v1/clutches", json={"clutch_id": "bench"}).raise_for_status()
    for cycles in range(0, LAST, 1000):
        assert post(http, "bench", right(cycles))["state"] == "accepted"
    post(http, "bench", loops(4000, pressures=(5.0,)) | {"started_at": at(4000)})


def plain(value: Any) -> Any:
    """An answer without times and revisions."""
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items() if key not in TIMES}
    return [plain(part) for part in value] if isinstance(value, list) else value


def answers(url: str) -> dict[str, Any]:
    newest = {"Prefer": "wait=60"}  # a page that reads as well keeps the workers busy
    return {path: plain(ONCE.get(f"{url}{path}", headers=newest).raise_for_status().json()) for path in ANSWERS}


def accepted_part(found: dict[str, Any]) -> dict[str, Any]:
    """Of a clutch's answers, what depends on accepted runs alone."""
    return {
        path: {key: value for key, value in answer.items() if key not in OF_HELD_RUNS}
        for path, answer in found.items()
        if path.startswith(f"{CLUTCH}/")
    }


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
