"""How a notebook shows an answer: what it says first, then its fields as a table."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

#: Sentences that stand first where an answer has them.
_SENTENCES = ("headline", "action", "statement")
#: Values of a field that are written out; of more their number is.
_FEW = 8


def as_html(answer: Mapping[str, Any]) -> str:
    """An answer as HTML; everything in it is escaped."""
    first = "".join(f"<p>{escape(str(answer[name]))}</p>" for name in _SENTENCES if answer.get(name))
    rows = "".join(
        f"<tr><th>{escape(name.replace('_', ' '))}</th><td>{escape(_text(value))}</td></tr>"
        for name, value in answer.items()
        if name not in _SENTENCES
    )
    return f"{first}<table>{rows}</table>"


def _text(value: Any) -> str:
    """A value of an answer in a few words, for a table cell."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return f"{value:,.6g}"
    if isinstance(value, Mapping):
        named = [f"{name.replace('_', ' ')}: {_text(one)}" for name, one in value.items()]
        return "; ".join(named) if len(named) <= _FEW else f"{len(named)} fields"
    if isinstance(value, Sequence) and not isinstance(value, str):
        plain = len(value) <= _FEW and not any(isinstance(one, (Mapping, list)) for one in value)
        return ", ".join(map(_text, value)) if plain and value else f"{len(value)} items"
    return str(value)
