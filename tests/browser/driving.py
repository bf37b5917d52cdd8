"""Driving a browser: launched the same way everywhere, and pages that note whatever they must not do."""

import base64
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from playwright.sync_api import Browser, Locator, Page, expect, sync_playwright

#: [ms] How long a page may take to show what is waited for: on a busy machine a diagnosis took more than 20 s.
_PATIENCE = 60_000
expect.set_options(timeout=_PATIENCE)

ARGUMENTS = (
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-gpu",
    "--disable-3d-apis",
)

_LISTEN = """
window.violations = [];
document.addEventListener("securitypolicyviolation", (event) => {
  window.violations.push(`${event.effectiveDirective} ${event.blockedURI} ${event.sourceFile}`);
});
"""


def system() -> str | None:
    """$CHROMIUM or one on the path; where there is none, Playwright launches its own."""
    names = ("chromium", "chromium-browser", "google-chrome-stable", "google-chrome")
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, names)), None)


@contextmanager
def chromium() -> Iterator[Browser]:
    """A headless Chromium, closed at the end."""
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=system(), args=list(ARGUMENTS))
        yield found
        found.close()


def drawn(page: Page, chart: str = "fan") -> Locator:
    """A chart, scrolled to and drawn."""
    found = page.locator(f"#chart-{chart}")
    found.scroll_into_view_if_needed()
    page.locator(f"#chart-{chart}[data-drawn]").wait_for()
    return found


def turned(page: Page, tab: str) -> Page:
    """A clutch's page with that tab in sight, as by its link."""
    page.locator("#tabs").wait_for()
    if not page.locator(f"#tab-{tab}").is_visible():
        page.locator(f"#tabs a[href='#/{tab}']").click()
    page.locator(f"#tab-{tab}").wait_for()
    return page


_DROP = """(files) => {
  const transfer = new DataTransfer();
  for (const [name, data] of files)
    transfer.items.add(new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], name));
  for (const type of ["dragenter", "dragover", "drop"])
    document.body.dispatchEvent(new DragEvent(type, {bubbles: true, cancelable: true, dataTransfer: transfer}));
}"""


def drop(page: Page, files: Mapping[str, str | bytes]) -> None:
    """Drop files on a page as a person would: text or bytes, by their names, all at once."""
    contents = {name: content.encode() if isinstance(content, str) else content for name, content in files.items()}
    page.evaluate(_DROP, [[name, base64.b64encode(content).decode()] for name, content in contents.items()])


class Watched:
    """A page of the service, and what it asked for, said and violated."""

    def __init__(self, browser: Browser, url: str, **context: Any) -> None:
        self.url = url
        self.context = browser.new_context(viewport=context.pop("viewport", {"width": 1360, "height": 900}), **context)
        self.page = self.context.new_page()
        self.asked: list[str] = []
        self.said: list[str] = []
        self.page.set_default_timeout(_PATIENCE)
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("console", lambda message: self.said.append(f"{message.type}: {message.text}"))
        self.page.on("pageerror", lambda error: self.said.append(f"error: {error}"))
        self.page.add_init_script(_LISTEN)

    def open(self, path: str) -> Page:
        """Go to a path of the service."""
        self.page.goto(f"{self.url}{path}")
        return self.page

    def errors(self) -> list[str]:
        """Console errors and uncaught exceptions."""
        return [line for line in self.said if line.startswith("error")]

    def abroad(self) -> list[str]:
        """Requests that left the service's host."""
        return [url for url in self.asked if not url.startswith((self.url, "data:", f"blob:{self.url}"))]

    def violations(self) -> list[str]:
        """Violations of the Content-Security-Policy since the page was loaded."""
        found: list[str] = self.page.evaluate("window.violations")
        return found

    def close(self) -> None:
        """Close the page; it must have behaved."""
        found = (self.violations(), self.abroad(), self.errors())
        self.context.close()
        assert found == ([], [], []), found


class Wire:
    """What a page receives, headers included: addresses and bytes, an entry a request that has ended."""

    def __init__(self, page: Page) -> None:
        self.loaded: list[tuple[str, int]] = []
        addresses: dict[str, str] = {}
        session = page.context.new_cdp_session(page)
        session.send("Network.enable")
        session.on(
            "Network.requestWillBeSent", lambda event: addresses.update({event["requestId"]: event["request"]["url"]})
        )
        session.on(
            "Network.loadingFinished",
            lambda event: self.loaded.append((addresses[event["requestId"]], int(event["encodedDataLength"]))),
        )

    def of(self, part: str) -> list[int]:
        """Bytes of all whose address holds a part."""
        return [size for url, size in self.loaded if part in url]
