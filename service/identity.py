"""What makes two contents the same: their values, whatever notation they were sent in.

7000, 7000.0 and 7e3 are one number; an instant is the same in every time zone; texts are compared in Unicode's normal
form C.
"""

import hashlib
import json
import unicodedata
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

import numpy as np

from models.arrays import FloatArray
from service.columns import whole

#: Values of a column that are hashed at once: bounds the copy that is made of them. Chosen.
_BLOCK = 1 << 16


def canonical(value: Any) -> Any:
    """A value of JSON, or a datetime with a time zone, in the one notation by which it is compared."""
    if isinstance(value, Mapping):
        return {name: canonical(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [canonical(item) for item in value]
    if isinstance(value, str):
        return unicodedata.normalize("NFC", value)
    if isinstance(value, float):
        return whole(value)
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat()
    return value


def instant(stated: str | None) -> datetime | None:
    """A stored time as what is compared, None where none was stated."""
    return None if stated is None else datetime.fromisoformat(stated)


def content_of(record: Mapping[str, Any] | Sequence[Any]) -> str:
    """The sha256 of a record: equal for equal values. Raises ValueError where a number is not finite."""
    return _digest(record).hexdigest()


def content_with_columns(record: Sequence[Any], columns: Mapping[str, FloatArray]) -> str:
    """The same of a record and columns [n] of finite numbers, of which each bit counts but the sign of a zero."""
    digest = _digest(record)
    for name in sorted(columns):
        column = columns[name]
        digest.update(f"\n{name}:{column.size}\n".encode())
        for start in range(0, column.size, _BLOCK):
            digest.update(np.asarray(column[start : start + _BLOCK] + 0.0, dtype="<f8").data)
    return digest.hexdigest()


def _digest(record: Mapping[str, Any] | Sequence[Any]) -> "hashlib._Hash":
    return hashlib.sha256(json.dumps(canonical(record), sort_keys=True, allow_nan=False).encode())
