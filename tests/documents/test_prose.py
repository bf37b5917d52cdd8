"""Sentences of the pages are short."""

import re
from pathlib import Path

import pytest

from tests.lab.measuring import ROOT

DOCS = ROOT / "docs"
#: Words in a sentence; guides to plain English say 20 on average and 40 at most.
LONGEST, AVERAGE = 40, 20
JUDGED = [
    *(path for path in sorted(DOCS.rglob("*.md")) if not {"reference", "appendix"} & set(path.parts)),
    ROOT / "README.md",
    *(DOCS / "reference" / f"{name}.md" for name in ("api", "dashboard", "operations")),
]
#: What is no prose: fenced blocks, parts that are made from the code, comments, tables, formulas, pictures.
OTHER = (
    r"^(`{3,})[^\n]*\n.*?^\1$",
    r"<!-- [a-z-]+ -->\n.*?<!-- end -->",
    r"<!--.*?-->",
    r"^[ \t]*\|[^\n]*$",
    r"^\$\$.*?\$\$$",
    r"^!\[[^\n]*$",
)
END = re.compile(r"(?<=[.!?:])[\"')*]*\s+(?=[\"'(*]*[A-ZΑ-ω])|\n\s*\n|\n(?=\s*(?:[-*]|\d+\.)\s)")


def prose(page: str) -> str:
    """What a reader reads in order; code and formulas within a sentence count as a word each."""
    for pattern in OTHER:
        page = re.sub(pattern, "\n", page, flags=re.MULTILINE | re.DOTALL)
    page = re.sub(r"^#+ .*$", r"\n\g<0>\n", page, flags=re.MULTILINE)
    page = re.sub(r"`[^`]+`|\$[^$\n]+\$", "CODE", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", page))
    return re.sub(r"^[ \t]*(?:[-*]|\d+\.)[ \t]", r"\n\n\g<0>", page, flags=re.MULTILINE)


def words(text: str) -> int:
    return len(re.findall(r"\w[\w'’.,/-]*", text))


@pytest.mark.parametrize("path", JUDGED, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_sentence_is_short(path: Path) -> None:
    text = prose(path.read_text(encoding="utf-8"))
    found = [" ".join(part.split()) for part in END.split(text) if part and words(part) > 3]
    assert [sentence for sentence in found if words(sentence) > LONGEST] == []
    assert sum(map(words, found)) <= AVERAGE * len(found)
