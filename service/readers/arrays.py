"""Named arrays, in folders of each other as MATLAB and HDF5 have them -> a table.

A vector is a column; a matrix is several, with the names that a list of as many texts beside it gives. Units and a clock are
what stands beside an array under the usual names: attributes of HDF5, fields and variables of MATLAB.
"""

import contextlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.errors import InvalidError, Notice
from service.readers.column_names import column_of, recognised
from service.readers.constants import VALUE_NAMES, in_parts, refuse_several_tests
from service.readers.limits import Limits
from service.readers.meanings import known_channel
from service.readers.numerals import Stamps, is_stamp
from service.readers.stated_clocks import UNITS, stated_clock
from service.readers.table import Clock, FileColumn, Reading, Table, index_of_wanted
from service.readers.unit_table import conversion, is_unit

#: Factors that a file states beside raw counts; whether they were applied already only its program knows.
_GAINS = frozenset(
    ["gain", "scale", "scaling", "factor", "slope", "multiplier", "sensitivity", "calibration", "resolution", "lsb"]
)
_OFFSETS = {"offset", "zero"}
#: What is said of an array stands under such a name beside it (`C1_Data`, `C1_Header`).
_HEADERS = ("header", "info", "meta", "attributes")
_LABELS = ("label", "name", "signalname", "channelname")
_CHARACTERS = "SUO"
#: Folders in folders, at most. Chosen: recorders have three.
_DEEPEST = 8
_MAX_MATRIX_COLUMNS = 200

Tree = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Leaf:
    """An array to be read in slices, with its attributes and, if the file refers to one, the array of its times."""

    data: Any
    attributes: Mapping[str, Any] = field(default_factory=dict)
    times: "Leaf | None" = None


@dataclass(frozen=True, slots=True)
class _Source:
    """A column with the means to read its values."""

    column: FileColumn
    leaf: Leaf
    index: Any


def table_of(tree: Tree, reading: Reading, limits: Limits, unread: tuple[str, ...] = ()) -> Table:
    """The table of a tree of arrays, or of its named folder; `unread`: names of values that only MATLAB can read.

    Raises InvalidError where it holds no array that could be a channel.
    """
    sources = list(_sources(_paired(tree), "", 0, {}, Stamps({}, set())))
    groups = tuple(dict.fromkeys(source.column.group for source in sources))
    left_out = ", ".join(unread[:10])
    notices = (
        (Notice(code="not_read", message=f"left out, because only MATLAB can read it: {left_out}"),) if unread else ()
    )
    of_groups = {name: [source for source in sources if source.column.group == name] for name in groups}

    def table(own: list[_Source], name: str) -> Table:
        limits.require_columns(len(own))
        if len({source.column.group for source in own}) == 1:
            own = [replace(source, column=replace(source.column, group="")) for source in own]

        def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
            return [_values(own[index]) for index in taken]

        columns = tuple(source.column for source in own)
        above = tuple((key, f"{value}") for key, value in _stated_of(tree, name).items())
        return Table(columns=columns, read=read, name=name, others=groups, above=above, notices=notices)

    if not sources:
        hint = (
            f": only MATLAB can read {left_out}. Save the channels as arrays, or as a struct of arrays"
            if unread
            else ""
        )
        message = f"the file holds no array of numbers that could be a channel{hint}"
        raise InvalidError.of(message, code="no_arrays")
    if reading.reads_all():
        return in_parts([table(own, name) for name, own in of_groups.items()])
    if reading.table:
        name = groups[index_of_wanted(groups, reading.table, "group")]
        return table(of_groups[name], name)
    refuse_several_tests([source.column for source in sources])
    return table(sources, "")


def _stated_of(tree: Tree, group: str) -> dict[str, float | str]:
    """The single numbers and texts in a folder, by the folder's path."""
    for name in filter(None, group.split("/")):
        held = tree.get(name)
        tree = held if isinstance(held, Mapping) else {}
    return _scalars(tree)


def _paired(tree: Tree) -> Tree:
    """The tree with each array and its description moved into one folder, if they are stored as `C1_Data` beside
    `C1_Header`."""
    paired = dict(tree)
    headers = {key.lower(): value for key, value in tree.items() if isinstance(value, Mapping)}
    for key, value in tree.items():
        base, _, kind = key.rpartition("_")
        header_values = [headers[name] for end in _HEADERS if (name := f"{base}_{end}".lower()) in headers]
        if isinstance(value, Leaf) and kind.lower() in VALUE_NAMES and header_values:
            paired[base] = {**header_values[0], kind: paired.pop(key)}
    return paired


def _sources(tree: Tree, group: str, depth: int, above: Tree, stamps: Stamps) -> Iterator[_Source]:
    """The columns of a folder and its subfolders; `above`: values stated in the folders above; `stamps`: holds the
    first start."""
    stated = {**above, **_scalars(tree), **{key: node for key, node in tree.items() if key.lower() in UNITS}}
    for name, node in tree.items():
        path = f"{group}/{name}" if group else name
        if isinstance(node, Mapping):
            lowered = {key.lower(): value for key, value in node.items()}
            data = next((lowered[key] for key in VALUE_NAMES if isinstance(lowered.get(key), Leaf)), None)
            leaves = {key: leaf for key, leaf in node.items() if isinstance(leaf, Leaf) and leaf is not data}
            remaining = [key for key, leaf in leaves.items() if _rows(leaf)]
            if data is not None and all(known_channel(key) == "time_s" for key in remaining):
                label = next((_text(lowered[key]) for key in _LABELS if _text(lowered.get(key))), name)
                data = replace(data, attributes={**node, **data.attributes})
                own = path if remaining else group
                unitless = {key: value for key, value in {**stated, **node}.items() if key.lower() not in UNITS}
                for key in remaining:  # the unit is that of the data
                    yield from _columns(key, node[key], own, unitless, stamps)
                yield from _columns(label, data, own, {**stated, **node}, stamps)
            elif depth < _DEEPEST:
                yield from _sources(node, path, depth + 1, stated, stamps)
        elif isinstance(node, Leaf):
            yield from _columns(name, node, group, {**above, **tree}, stamps)


def _columns(name: str, leaf: Leaf, group: str, beside: Tree, stamps: Stamps) -> Iterator[_Source]:
    """The columns of one array: a vector, the fields of a compound one, or those of a matrix; none of any other.

    A list of texts that stands beside it, one for each column, gives their units if most of them are units, else names. A
    column of a matrix without a name has no channel."""
    shape, dtype = tuple(size for size in leaf.data.shape if size > 1), leaf.data.dtype
    parts: list[tuple[str, Any]] = []
    if dtype.names:
        rows, parts = leaf.data.shape[0], [(part, part) for part in dtype.names]
    elif rows := _rows(leaf):
        parts = [(name, Ellipsis)]
    elif len(shape) == 2 and dtype.kind in "iuf" and min(shape) <= _MAX_MATRIX_COLUMNS:
        across = 0 if shape[0] < shape[1] else 1
        rows, every = shape[1 - across], slice(None)
        places = [(at, every) if across == 0 else (every, at) for at in range(shape[across])]
        parts = [(f"{name}[{number}]", place) for number, place in enumerate(places, 1)]
    size = len(parts)
    lists = [texts for texts in map(_texts, {**beside, **leaf.attributes}.values()) if len(texts) == size > 1]
    units = max(lists, key=_count_units, default=[])
    units = units if 2 * _count_units(units) > size else [""] * size
    matrix = size > 1 and not dtype.names
    titles = [texts for texts in lists if matrix and texts is not units]
    names = max(titles, key=lambda own: recognised(own, ()), default=[])
    clock = _referred(leaf, rows, stamps)
    clock = clock or stated_clock({**_scalars(beside), **_scalars(leaf.attributes)}, lambda: rows, stamps)
    for at, (part, place) in enumerate(parts):
        title = names[at] if names else part
        stated_as = [title, f"field_{at}"] if dtype.names else [title]
        unit = units[at] or _unit(stated_as, leaf.attributes, beside, whole=size == 1 and not dtype.names)
        if matrix and not names:
            column = FileColumn(part, None, group, part)
        else:
            column = column_of(title, unit or None, group, moments=dtype.kind in "Mm")
        yield _Source(replace(column, rows=rows, clock=clock), leaf, place)


def _referred(leaf: Leaf, rows: int, stamps: Stamps) -> Clock | None:
    """The clock of an array that refers to an array of times in a unit of time, which may state an origin."""
    times = leaf.times
    unit = "" if times is None else unit_of_array(times.attributes)
    converted = conversion("time_s", unit) if unit else None
    if times is None or converted is None or _rows(times) != rows:
        return None
    _, _, since = unit.partition(" since ")
    start = stamps.since_first([since.strip()]) if is_stamp(since) else None
    shift = 0.0 if start is None else float(start[0] / np.timedelta64(1, "s"))

    def read() -> FloatArray:
        seconds = np.array(times.data[()], dtype=np.float64).reshape(-1)
        converted.apply(seconds)
        return seconds + shift

    return Clock(times.data.name, read, own=True)


def _unit(names: Sequence[str], attributes: Tree, beside: Tree, *, whole: bool) -> str:
    """The unit stated at an array, or beside it under one of its names; `whole`: the array is one column, so a unit
    without a name counts too."""
    at_data = beside if whole and any(key.lower() in VALUE_NAMES for key in beside) else {}
    named = (stated_unit(name, stated) for stated in (attributes, beside) for name in names)
    return next(filter(None, [unit_of_array(attributes if whole else {}), *named, unit_of_array(at_data)]), "")


def unit_of_array(held: Tree) -> str:
    """The unit among the values stated about one array."""
    lowered = {key.lower(): value for key, value in held.items()}
    return next(filter(None, (_text(lowered.get(key)) for key in UNITS)), "")


def _count_units(texts: list[str]) -> int:
    return sum(map(is_unit, texts))


def parsed(value: Any) -> Any:
    """The value of a JSON text; any other value or text unchanged."""
    with contextlib.suppress(ValueError):
        return json.loads(value) if isinstance(value, str) else value
    return value


def stated_unit(name: str, beside: Tree) -> str | None:
    """The unit of a column among values stored beside it: as `torque_unit`, or by the column's name under `units`."""
    lowered = {key.lower(): value for key, value in beside.items()}
    for key in UNITS:
        by_name = parsed(lowered.get(key))
        under = {at.lower(): unit for at, unit in by_name.items()} if isinstance(by_name, Mapping) else {}
        if unit := _text(under.get(name.lower())) or _text(lowered.get(f"{name.lower()}_{key}")):
            return unit
    return None


def _rows(leaf: Leaf) -> int:
    """The length of a vector of numbers, points in time or texts; 0 for a single value and any other array."""
    shape = leaf.data.shape
    vector = len(shape) >= 1 and max(shape) > 1 and int(np.prod(shape)) == max(shape)
    return int(max(shape)) if vector and leaf.data.dtype.kind in "iufMm" else 0


def _scalars(tree: Tree) -> dict[str, float | str]:
    """The single numbers and texts of a folder, and of subfolders with nothing else; a number's unit is stored beside
    it."""
    scalars: dict[str, float | str] = {}
    for key, value in tree.items():
        number = _number(value)
        if isinstance(value, Mapping):
            if not any(isinstance(node, Leaf) and node.data.size > 1 for node in value.values()):
                scalars = _scalars(value) | scalars
        elif number is not None or _text(value):
            scalars[key] = _text(value) if number is None else number
            attributes = value.attributes if isinstance(value, Leaf) else {}
            scalars |= {f"{key}_{name}": _text(attributes[name]) for name in UNITS if _text(attributes.get(name))}
    return scalars


def _number(value: Any) -> float | None:
    """A single number."""
    if isinstance(value, Leaf) and value.data.size == 1:
        value = value.data[()]
    elif not np.isscalar(value):
        return None
    array = np.asarray(value)
    return float(array.reshape(-1)[0]) if array.size == 1 and array.dtype.kind in "iuf" else None


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind in _CHARACTERS:
        return _text(value.reshape(-1)[0])
    return value if isinstance(value, str) else ""


def _texts(value: Any) -> list[str]:
    if isinstance(value, Leaf):
        value = value.data
    array = np.asarray(value if isinstance(value, list | tuple | np.ndarray) else ())
    return [_text(item) for item in array.reshape(-1)] if array.dtype.kind in _CHARACTERS else []


def refuse_counts(shown: str, values: NDArray[Any], stated: Mapping[str, Any]) -> None:
    """Raise InvalidError on integers beside a factor: they may be raw counts, or values to which it is already applied."""
    for name, value in stated.items() if values.dtype.kind in "iu" else ():
        words, number = set(re.split(r"[\W_]+|(?<=[a-z])(?=[A-Z])", name)), _number(value)
        words = {word.lower() for word in words}
        if number is not None and ((words & _GAINS and number != 1) or (words & _OFFSETS and number != 0)):
            attribute = "scale_factor" if words & _GAINS else "add_offset"
            message = (
                f"{shown} holds whole numbers beside {name} = {number:g}: raw counts or physical values? For raw counts, "
                f"rename {name} to {attribute}, and the service applies it; for physical values, delete {name}"
            )
            raise InvalidError.of(message, code="raw_counts")


def _values(source: _Source) -> NDArray[Any]:
    """The values, scaled by NetCDF's conventions; fill values are masked.

    Source: CF Conventions, 8.1, packed data.
    """
    values = np.asarray(source.leaf.data[source.index]).reshape(-1)
    stated = {key.lower(): _number(value) for key, value in source.leaf.attributes.items()}
    attributes = source.leaf.attributes
    unscaled = {key: held for key, held in attributes.items() if key.lower() not in ("scale_factor", "add_offset")}
    refuse_counts(source.column.shown(), values, unscaled)
    factor, offset = (stated.get(name, default) for name, default in (("scale_factor", 1.0), ("add_offset", 0.0)))
    fill_values = [value for name in ("_fillvalue", "missing_value") if (value := stated.get(name)) is not None]
    invalid = np.isin(values, fill_values) if fill_values and values.dtype.kind in "iuf" else None
    if (factor, offset) != (1.0, 0.0):
        values = values * (1.0 if factor is None else factor) + (0.0 if offset is None else offset)
    return values if invalid is None or not invalid.any() else np.ma.MaskedArray(values, mask=invalid)
