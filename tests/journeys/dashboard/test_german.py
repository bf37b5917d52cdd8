"""German labels where the browser speaks German: page, chart and report; and no entry of the table that no page has."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from service.clutch.condition import STATE_WORDS
from service.dashboard.assets import STATIC
from tests.browser.driving import Watched, drawn, turned
from tests.browser.lives import worn
from tests.support import Server, filled_service

pytestmark = pytest.mark.browser

WORDS = STATIC / "shared" / "words.js"


@filled_service
def life(server: Server) -> None:
    worn(server.http, "bench", last=4000)


def test_labels_are_german_in_a_german_browser_and_english_in_others(browser: Browser, life: Server) -> None:
    tabs = {"de-AT": "Übersicht", "en-GB": "Overview", "fr-FR": "Overview"}
    axes = {"de-AT": "Schaltspiele", "en-GB": "duty cycles", "fr-FR": "duty cycles"}
    for locale, tab in tabs.items():
        watched = Watched(browser, life.url, locale=locale)
        page = watched.open("/clutches/bench")
        expect(page.locator("#tabs a").first).to_have_text(tab)
        expect(drawn(page).locator(".drawing")).to_contain_text(axes[locale])
        report = page.locator("#report")
        report.locator(".drawing").first.wait_for(state="attached")
        expect(report.locator("caption")).to_have_text(
            "Die letzten Versuche" if locale == "de-AT" else "The last tests"
        )
        assert page.evaluate("document.documentElement.scrollWidth") <= 1360
        if locale == "de-AT":
            expect(turned(page, "curves").locator("#tab-curves").get_by_label("Druck").first).to_be_visible()
            page.goto(f"{life.url}/")
            expect(page.get_by_role("columnheader", name="Was zu tun ist")).to_be_visible()
        watched.close()


def test_every_entry_of_the_table_is_a_label_of_the_pages() -> None:
    table = re.search(r"`\n(.*?)`", WORDS.read_text(encoding="utf-8"), re.DOTALL)
    assert table is not None
    pairs = [pair.strip().split(" = ") for pair in re.split(r";\s", table[1])]
    assert all(len(pair) == 2 for pair in pairs), [pair for pair in pairs if len(pair) != 2]
    labels = [english for english, _ in pairs]
    assert len(set(labels)) == len(labels) > 80
    sources = [path for path in STATIC.rglob("*") if path.suffix in {".js", ".html"} and path != WORDS]
    text = "\n".join(map(Path.read_text, sources)) + " ".join(STATE_WORDS.values())
    assert [label for label in labels if not re.search(rf"[\">`]{re.escape(label)}[\"<` ]", text)] == []
