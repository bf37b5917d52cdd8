"""The pages are short, and a sentence is read once. `pytest -s` prints the count of each page."""

import re
from pathlib import Path

import pytest

from tests.documents.prose import prose, sentences, words
from tests.documents.reference import ROOT

DOCS = ROOT / "docs"
#: Demanded of docs/ without docs/reference and docs/appendix: prose, tables not counted.
ALLOWED_WORDS = 22_000
#: Rules of thumb of plain English guides are 20 on average and 40 at most.
LONGEST, AVERAGE = 40, 20
READ = [
    path
    for path in sorted([ROOT / "README.md", *DOCS.rglob("*.md")])
    if not {"reference", "appendix"} & set(path.relative_to(ROOT).parts)
]
#: What a reader would have to look up or read twice, and what to write instead.
HARD = {
    r"\banew\b": "again",
    r"\bwhose like\b": "earlier ones",
    r"\bforetold|foretells?\b": "predicted",
    r"\breckon(ed|s)?\b": "computed",
    r"\bat a glance\b": "quickly",
    r"\butili[sz]e": "use",
    r"\bin order to\b": "to",
    r"\bleverag": "use",
    r"\bwhatever of\b": "any of",
    r"\bheretofore|hitherto|thereof|wherein|whereby\b": "plain words",
    r"(?:^|[.;:] )Who(?:ever)? (?!is |are )\w+": "a subject that has a name",
}


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def test_the_pages_are_short() -> None:
    counted = {name(path): words(prose(path.read_text(encoding="utf-8"))) for path in READ if path.name != "README.md"}
    for page, count in counted.items():
        print(f"{count:6d} {page}")
    print(f"{sum(counted.values()):6d} of {ALLOWED_WORDS}")
    assert sum(counted.values()) <= ALLOWED_WORDS


@pytest.mark.parametrize("path", READ, ids=name)
def test_a_sentence_is_short_and_plain(path: Path) -> None:
    text = prose(path.read_text(encoding="utf-8"))
    found = sentences(text)
    long = [f"{words(sentence)} words: {sentence}" for sentence in found if words(sentence) > LONGEST]
    assert long == []
    whole = [words(sentence) for sentence in found if words(sentence) > 3]
    assert not whole or sum(whole) / len(whole) <= AVERAGE
    hard = [
        f"{match[0]!r}: {better}" for wrong, better in HARD.items() for match in re.finditer(wrong, text, re.MULTILINE)
    ]
    assert hard == []


def test_what_is_counted() -> None:
    page = (
        "# A title\n\nOne `x y` two.\nThree [four](a.md).\n\n| a |\n|---|\n\n```sh\nfive six\n```\n- seven\n- eight\n"
    )
    assert words(prose(page)) == 9
    assert [words(sentence) for sentence in sentences(prose(page))] == [2, 3, 2, 1, 1]
    assert any(re.search(wrong, "It is made anew.") for wrong in HARD)
