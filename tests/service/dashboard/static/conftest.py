"""Modules of the pages, loaded into a browser from a running service."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.browser.driving import FLAT, chromium
from tests.browser.modules import Module, load, open_page
from tests.support import Server, serving


@pytest.fixture(scope="package")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A service without clutches, which serves the files."""
    with serving(tmp_path_factory.mktemp("modules") / "clutchlife.db", loaded=True) as running:
        yield running


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    """A headless Chromium."""
    with chromium(more=FLAT) as launched:
        yield launched


@pytest.fixture(scope="module")
def page(browser: Browser, server: Server) -> Iterator[Page]:
    """An empty page of the service."""
    opened = open_page(browser, server)
    yield opened
    opened.context.close()


@pytest.fixture(scope="module")
def loaded(page: Page, server: Server) -> Callable[[str], Module]:
    """A module by its name in the tree."""
    return lambda name: load(page, server, name)
