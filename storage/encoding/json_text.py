"""JSON in text columns: compact, and nothing in it that JSON cannot carry."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

Json: TypeAlias = dict[str, Any]

_encode = json.JSONEncoder(allow_nan=False, ensure_ascii=False, separators=(",", ":")).encode


def to_text(value: Mapping[str, Any] | Sequence[Any]) -> str:
    """Compact JSON text. Raises ValueError on NaN or an infinity, TypeError on what is no JSON value."""
    return _encode(value)


def to_object(text: str) -> Json:
    """The object that `to_text` wrote."""
    value: Json = json.loads(text)
    return value


def to_list(text: str) -> list[Any]:
    """The list that `to_text` wrote."""
    value: list[Any] = json.loads(text)
    return value
