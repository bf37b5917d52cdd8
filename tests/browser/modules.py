"""A module of the pages in the browser: its functions called from Python, as they are served and under the same policy."""

import json
import re
from typing import Any

from playwright.sync_api import Browser, Page

from tests.support import ONCE, Server

_CALL = """async ([address, name, values]) => {
  const module = await import(address);
  const result = module[name](...values);
  return result instanceof Element ? { html: result.outerHTML, text: result.textContent } : result;
}"""


class Module:
    """A module that a page of the service has loaded."""

    def __init__(self, page: Page, address: str) -> None:
        self.page = page
        self.address = address

    def __call__(self, name: str, *values: Any) -> Any:
        """The function's result; an element as its `html` and `text`."""
        return self.page.evaluate(_CALL, [self.address, name, list(values)])

    def evaluate(self, code: str) -> Any:
        """What a function of the module `m` gives: `m => ...`, where Python has no word for the values, as undefined."""
        return self.page.evaluate(f"async () => ({code})(await import({json.dumps(self.address)}))")


def open_page(browser: Browser, server: Server) -> Page:
    """An empty page of the service, British and in its own time zone so that dates are the same on every machine."""
    context = browser.new_context(locale="en-GB", timezone_id="Europe/Brussels")
    page = context.new_page()
    page.goto(f"{server.url}/livez")
    return page


def load(page: Page, server: Server, name: str) -> Module:
    """A module by its name in the tree."""
    match = re.search(r"/assets/[0-9a-f]+", ONCE.get(f"{server.url}/").text)
    assert match is not None
    return Module(page, f"{server.url}{match.group()}/{name}")
