"""The prose of a page: what a reader reads in order, without tables, code and addresses; words and sentences."""

import re

#: What is no prose, in the order in which it is taken off.
_OTHER = (
    r"^(`{3,})[^\n]*\n.*?^\1$",  # fenced blocks
    r"<!-- [a-z-]+ -->\n.*?<!-- end -->",  # made from the code
    r"<!--.*?-->",
    r"^[ \t]*\|[^\n]*$",  # tables
    r"^\$\$.*?\$\$$",
    r"^!\[[^\n]*$",  # pictures
)
_FORMULA = re.compile(r"\$[^$\n]+\$")
_CODE = re.compile(r"`[^`\n]+`")
_LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
_END = re.compile(r"(?<=[.!?:])[\"')*]*\s+(?=[\"'(*]*[A-ZΑ-ω])|\n\s*\n|\n(?=\s*(?:[-*]|\d+\.)\s)")


def prose(page: str) -> str:
    """The page's prose; code, formulas and names within a sentence count as a word each."""
    for pattern in _OTHER:
        page = re.sub(pattern, "\n", page, flags=re.MULTILINE | re.DOTALL)
    page = re.sub(r"^#+ .*$", r"\n\g<0>\n", page, flags=re.MULTILINE)
    page = _CODE.sub("CODE", _FORMULA.sub("FORMULA", _LINK.sub(r"\1", page)))
    return re.sub(r"^[ \t]*(?:[-*]|\d+\.)[ \t]", r"\n\n\g<0>", page, flags=re.MULTILINE)


def words(text: str) -> int:
    """Words, numbers and names of a text."""
    return len(re.findall(r"\w[\w'’.,/-]*", text))


def sentences(text: str) -> list[str]:
    """Sentences, headings and entries of lists, on one line each."""
    return [" ".join(part.split()) for part in _END.split(text) if part and words(part)]
