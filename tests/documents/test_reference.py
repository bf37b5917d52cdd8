"""Every setting, command, route, field, code and metric is documented, in pages that are those of the code."""

import re
from pathlib import Path

import pytest

from tests.documents import reference
from tests.documents.reference import FOLDER, ROOT

SOURCES = [path.read_text(encoding="utf-8") for path in (ROOT / "service").rglob("*.py")]


@pytest.fixture(scope="module")
def pages() -> dict[Path, str]:
    return reference.pages()


def test_the_pages_in_git_are_those_of_the_code() -> None:
    stale = [path.name for path, text in reference.kept().items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "make reference"


def test_the_pages_out_of_git_are_ignored_and_listed_by_the_site(pages: dict[Path, str]) -> None:
    ignored = (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8").splitlines()
    for name in reference.OUT_OF_GIT:
        assert FOLDER / name in pages
        assert f"/docs/reference/{name}" in ignored
        assert f"reference/{name.removesuffix('.md')}" in index


def test_every_row_says_something(pages: dict[Path, str]) -> None:
    silent = [
        f"{path.name}: {line}"
        for path, text in pages.items()
        for line in text.splitlines()
        if line.startswith("| `") and re.search(r"\|\s*\|$", line)
    ]
    assert silent == []


def test_every_code_is_documented(pages: dict[Path, str]) -> None:
    """Codes as they stand in the service's source, found without its syntax."""
    found = {code for text in SOURCES for code in re.findall(r'\bcode="([a-z_]+)"', text)}
    assert len(found) > 30
    text = pages[FOLDER / "codes.md"]
    assert [code for code in sorted(found) if f"`{code}`" not in text] == []
    slugs = {slug for text in SOURCES for slug in re.findall(r'\bslug="([a-z-]+)"', text)}
    assert len(slugs) > 10
    assert [slug for slug in sorted(slugs) if f":problem:{slug}`" not in text] == []


def test_no_message_holds_a_place_that_nothing_fills(pages: dict[Path, str]) -> None:
    """A string without its f: `missed_forecasts` showed `{back_cast.widening:.2g}` to its readers."""
    assert "{" not in pages[FOLDER / "codes.md"]


def test_every_metric_is_documented(pages: dict[Path, str]) -> None:
    found = {name for text in SOURCES for name in re.findall(r'"(clutchlife_[a-z_]+)"', text)}
    assert len(found) > 8
    text = pages[FOLDER / "metrics.md"]
    assert [name for name in sorted(found) if f"`{name}" not in text] == []
