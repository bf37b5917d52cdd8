"""Tables in HTML and XML, which spreadsheets open under the name `.xls`: their rows as a text with tabs between cells.

In: a text in which rows and cells are elements, of HTML (`tr`, `td`) or of Excel 2003's XML (`Row`, `Cell`). Out: the same
cells as lines, with an empty line before each table but the first.
"""

import html
import re

#: The beginning of such a text.
_BEGINNING = re.compile(r"\s*<(?:\?xml|!doctype|html|table|meta|head|body|style)", re.IGNORECASE)
_ROW = re.compile(r"<(?:\w+:)?(?:tr|row)[\s>]", re.IGNORECASE)
#: An element's beginning or end, or the text between two.
_PART = re.compile(r"<(?P<end>/?)(?:\w+:)?(?P<name>\w+)(?P<held>[^<>]*)>|(?P<text>[^<]+)|<")
#: The column at which a cell stands, from 1; how many it goes over, and how many more.
_INDEX, _OVER, _MORE = (
    re.compile(rf"\b{name}=\W?(\d{{1,3}})\b", re.IGNORECASE) for name in ("index", "colspan", "mergeacross")
)


def as_lines(text: str) -> str | None:
    """The tables of an HTML or XML text as lines; None for any other text."""
    if not _BEGINNING.match(text) or not _ROW.search(text):
        return None
    rows: list[list[str]] = []
    within, at = False, 0
    for part in _PART.finditer(text):
        name, held = (part["name"] or "").lower(), part["held"] or ""
        if part["text"] and within:
            rows[-1][at] = " ".join(f"{rows[-1][at]} {html.unescape(part['text'])}".split())
        elif name in ("td", "th", "cell", "tr", "row") and part["end"]:
            within = False
        elif name in ("tr", "row") or (name in ("table", "worksheet") and rows and not part["end"]):
            rows.append([])
        elif name in ("td", "th", "cell") and rows:
            index, over, more = (int(found[1]) if (found := own.search(held)) else 0 for own in (_INDEX, _OVER, _MORE))
            at = max(len(rows[-1]), index - 1)
            rows[-1] += [""] * (at + max(over, 1 + more) - len(rows[-1]))
            within = not held.endswith("/")
    return "".join("\t".join(row) + "\n" for row in rows)
