"""Lists of the service as tables: frames of pandas, else of polars, else lists, by what is installed or asked for."""

import importlib
import importlib.util
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal

from .answers import JsonObject

#: What a table is: a frame of this library, a list of dictionaries, or (`auto`) the first that is installed, in this order.
Frames = Literal["auto", "pandas", "polars", "list"]
#: Lists of what is odd, each with its code.
_NOTICES = ("warnings", "doubts")


def table(
    items: Iterable[Mapping[str, Any]],
    frames: Frames = "auto",
    *,
    row_of: str | None = None,
    without: Sequence[str] = (),
) -> Any:
    """Items as rows of a table; in frames an object within an item becomes columns of its own, `state.name`, and lists
    are cells.

    In frames an item with a list named `row_of` is a row for every member of it, an item without one a row, and the fields
    `without` are left out: methods of the client have them as tables of their own. Of warnings and doubts the codes stand
    in a cell. Raises ImportError where the library that is asked for is not installed.
    """
    library = _chosen(frames)
    if library == "list":
        return [dict(item) for item in items]
    left_out = {row_of, *without}
    rows: list[JsonObject] = []
    for item in items:
        shared = {name: value for name, value in item.items() if name not in left_out}
        parts: Sequence[Mapping[str, Any]] = (item.get(row_of) if row_of else None) or ({},)
        rows += [dict(_cells(shared | dict(part))) for part in parts]
    names = {name for row in rows for name in row}
    objects = {name for name in names if any(other.startswith(f"{name}.") for other in names)}
    # of an object that only some items have the others say null, or nothing in braces
    rows = [
        {name: value for name, value in row.items() if name not in objects or value not in (None, {})} for row in rows
    ]
    if library == "pandas":
        return importlib.import_module("pandas").DataFrame(rows)
    # of all rows: the first ones may have nulls where later ones have numbers
    return importlib.import_module("polars").DataFrame(rows, infer_schema_length=None, strict=False)


def columns(channels: Any) -> dict[str, list[Any]]:
    """A run's channels in the service's form, from a frame of pandas or polars, or from arrays or lists by name."""
    if not isinstance(channels, Mapping):
        channels = {str(name): channels[name] for name in channels.columns}
    return {name: _column(values) for name, values in channels.items()}


def _column(values: Any) -> list[Any]:
    for convert in ("tolist", "to_list"):
        if hasattr(values, convert):
            return list(getattr(values, convert)())
    return list(values)


def _chosen(frames: Frames) -> str:
    if frames != "auto":
        return frames
    libraries: Sequence[str] = ("pandas", "polars")
    return next((name for name in libraries if importlib.util.find_spec(name) is not None), "list")


def _cells(item: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The fields of an item as columns; nested fields have dotted names, notices show their codes."""
    for name, value in item.items():
        if isinstance(value, Mapping) and value:
            yield from _cells(value, f"{prefix}{name}.")
        elif name in _NOTICES:
            yield f"{prefix}{name}", ", ".join(notice["code"] for notice in value)
        else:
            yield f"{prefix}{name}", value
