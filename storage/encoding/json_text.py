"""JSON in text columns: compact, and without NaN or infinities.

The library's functions under the types that the tables need: nothing of our own runs at every row.
"""

import json
from collections.abc import Callable
from typing import Any, TypeAlias

Json: TypeAlias = dict[str, Any]

#: Compact JSON text. Raises ValueError on NaN or an infinity, TypeError on a value that JSON does not have.
to_text: Callable[[object], str] = json.JSONEncoder(allow_nan=False, ensure_ascii=False, separators=(",", ":")).encode
#: The object that `to_text` wrote.
to_object: Callable[[str], Json] = json.loads
#: The list that `to_text` wrote.
to_list: Callable[[str], list[Any]] = json.loads
