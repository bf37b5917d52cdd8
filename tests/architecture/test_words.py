"""Plain words: what an engineer would have to look up or read twice is written nowhere."""

import re
from pathlib import Path

import pytest

from tests.architecture.source import PACKAGES, ROOT, none_of

QUAINT = re.compile(r"foretell|foretold|reckon|\bstrangers?\b|spoiled|swallowed", flags=re.IGNORECASE)
#: What stays, by file: names in databases and answers of earlier releases. An array of stored filter states, which would
#: be unreadable under another name; the former key of a gain, in the step that renames it and where it is still answered.
STORED_NAMES = {
    "models/tracking/filters/particle.py": '{"outlying": "spoiled"}',
}
TEXT = {".py", ".js", ".css", ".html", ".md", ".svg", ".toml"}


def texts(place: str) -> list[Path]:
    """The text files of a folder, or the file itself."""
    path = ROOT / place
    return [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.suffix in TEXT)


def judged(text: str, path: Path) -> str:
    """A file's text without its stored name, which must be there once."""
    stored = STORED_NAMES.get(path.relative_to(ROOT).as_posix())
    if stored is None:
        return text
    assert text.count(stored) == 1, f"{path} must hold {stored} once"
    return text.replace(stored, "")


@pytest.mark.parametrize("place", [*PACKAGES, "docs", "README.md"])
def test_no_quaint_word(place: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)}:{number}: {match[0]}"
        for path in texts(place)
        for number, line in enumerate(judged(path.read_text(encoding="utf-8"), path).splitlines(), start=1)
        for match in QUAINT.finditer(line)
    ]
    none_of(wrong, "quaint words:")


def test_the_words_are_noticed_in_names_and_sentences() -> None:
    for text in (
        "foretold_torque",
        "It is foretelling.",
        "Reckoned by hand",
        "of a stranger.",
        "spoiled_run",
        "swallowed",
    ):
        assert QUAINT.search(text), text
    assert not QUAINT.search("predicted, computed, an outlying run")
