"""What the names of files and the cells above their tables suggest of runs: kind, cycles, clutch. A person confirms it.

In: a file's name, those of the files that came with it, the labels above its table. Out: a `Named` and the pattern or the
labels by which a rig profile finds the same in other files. A pattern that all names share says more than a name alone.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import PurePath

from service.api.rig import FileKindName
from service.readers.meanings import label_of
from service.runs.rig_profile import Named, count, pattern_for

_SUFFIXES = re.compile(
    r"(\.(csv|txt|tsv|asc|dat|lvm|tdms|mf4|mdf|parquet|json|gz|xlsx|xls|ods|mat|h5|hdf5|zip))+$", re.IGNORECASE
)
_DATE = re.compile(
    r"(?<!\d)(?:19|20)\d\d[-_.]?(?:0[1-9]|1[0-2])[-_.]?(?:0[1-9]|[12]\d|3[01])(?:[-_ T]*(?:[01]\d|2[0-3])[-_.:h]?[0-5]\d"
    r"(?:[-_.:]?[0-5]\d)?(?!\d))?(?!\d)"
)
_KIND = re.compile(r"(stat|dyn|strib|loop|sweep)", re.IGNORECASE)
_CYCLES = re.compile(r"(cycles?|cyc|zyklen|schaltungen|lastspiele|lw)$", re.IGNORECASE)
#: A number before one of these is a pressure, a speed, a time or the like.
_UNIT = re.compile(r"(bar|rpm|hz|c|degc|nm|kpa|mpa|s|min|h|mm|cst|kj)$", re.IGNORECASE)
#: What may be a clutch's id: letters, then a number. And words before a number that count files, not clutches.
_ID = re.compile(
    r"(?<![A-Za-z0-9])[A-Za-z]{1,8}\d*(?:-[A-Za-z]{0,4}\d+)+(?![A-Za-z0-9])|(?<![A-Za-z0-9])[A-Za-z]{1,4}\d{2,}(?![A-Za-z0-9])"
)
_COUNTER = re.compile(r"(run|test|file|messung|nr|no|record|log|versuch|stat|dyn|cyc|part)", re.IGNORECASE)
_IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9._:@+-]{0,127}")
#: A number of cycles that stands without the word: zero, or from here on; smaller ones count files. Chosen.
_LEAST_UNNAMED = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Suggested:
    """Suggestions for a run's kind, cycles and clutch, and the pattern or labels with which a profile finds them."""

    named: Named
    file_name: str | None = None
    cycles_cell: str | None = None
    clutch_cell: str | None = None


def suggested(filename: str, beside: Sequence[str], cells: Mapping[str, str]) -> Suggested:
    """Suggestions from a file's name, the names `beside` it, and the cells above its table."""
    name = PurePath(filename).name
    clutch_cell, cycles_cell = label_of("clutch", cells), label_of("cycles", cells)
    clutch_id = cells[clutch_cell] if clutch_cell and _IDENTIFIER.fullmatch(cells[clutch_cell]) else None
    cycles = count(cells[cycles_cell]) if cycles_cell else None
    clutch_cell = None if clutch_id is None else clutch_cell
    cycles_cell = None if cycles is None else cycles_cell
    if cycles is None:
        cycles = cycles_of_all(name, beside)
    clutch_id = clutch_id or _clutch(name, cycles)
    if cycles is None and clutch_id is not None:
        cycles = _only_number(_stem(name).replace(clutch_id, ""))
    pattern = pattern_for(name, cycles, None if clutch_cell else clutch_id)
    named = Named(kind=kind_in(name), cycles=cycles, clutch_id=clutch_id)
    return Suggested(named=named, file_name=pattern, cycles_cell=cycles_cell, clutch_cell=clutch_cell)


def kind_in(filename: str) -> FileKindName | None:
    """The kind of run stated by a name; None if it is ambiguous."""
    stem = _stem(filename)
    dynamic = re.search("dyn|loop", stem, re.IGNORECASE) is not None
    stationary = re.search("stat|sweep", stem, re.IGNORECASE) is not None
    stationary = stationary or (not dynamic and re.search("stribeck", stem, re.IGNORECASE) is not None)
    if dynamic == stationary:
        return None
    return "dynamic_stribeck" if dynamic else "stationary_stribeck"


def _stem(filename: str) -> str:
    return _DATE.sub(" ", _SUFFIXES.sub("", filename))


def cycles_of_all(filename: str, beside: Sequence[str]) -> float | None:
    """The cycles stated by words in a name, or the number that differs between the names sent together."""
    alone = cycles_in(filename)
    if alone is not None or not beside:
        return alone
    names = list(dict.fromkeys([filename, *beside]))
    split = [re.split(r"(\d+k?(?![A-Za-z]))", _stem(name), flags=re.IGNORECASE) for name in names]
    if len(names) < 2 or len({tuple(parts[::2]) for parts in split}) != 1:
        return None
    columns = {at: [count(parts[at]) for parts in split] for at in range(1, len(split[0]), 2)}
    changing = {at: values for at, values in columns.items() if len(set(values)) > 1}
    counts = [values for values in changing.values() if _are_cycles(values)]
    return counts[0][0] if len(counts) == 1 else None


def _are_cycles(values: Sequence[float | None]) -> bool:
    """Whether numbers in file names may be cycles: whole, all different, and not consecutive like file numbers."""
    known = sorted(value for value in values if value is not None)
    if len(known) < len(values) or len(set(known)) < len(known):
        return False
    return known[-1] >= _LEAST_UNNAMED and any(b - a != 1 for a, b in pairwise(known))


def cycles_in(filename: str) -> float | None:
    """The cycles stated by a name alone; None if it is ambiguous."""
    found = [
        (match[0], match.start(), match.end()) for match in re.finditer(r"[A-Za-z]+|\d+(?:\.\d+)?", _stem(filename))
    ]
    numbers = [_number_at(found, at) for at, (text, *_) in enumerate(found) if text[0].isdigit()]
    for by in ("cycles", "kind before", "kind after"):
        values = [value for value, said in numbers if said == by and (by == "cycles" or _is_count(value))]
        if values:
            return values[0] if len(values) == 1 else None
    alone = [value for value, said in numbers if said == "nothing"]
    return alone[0] if len(alone) == 1 and _is_count(alone[0]) else None


def _only_number(stem: str) -> float | None:
    """The only number in a name without its clutch's id, if it may be cycles."""
    numbers = re.findall(r"(?<![A-Za-z.])\d+k?(?![A-Za-z.])", stem, flags=re.IGNORECASE)
    value = count(numbers[0]) if len(numbers) == 1 else None
    return value if value is not None and _is_count(value) else None


def _is_count(value: float) -> bool:
    return value == 0 or value >= _LEAST_UNNAMED


def _number_at(found: Sequence[tuple[str, int, int]], at: int) -> tuple[float, str]:
    """A number in a name, and its meaning by the words beside it."""
    text, start, end = found[at]
    before, before_end = (found[at - 1][0], found[at - 1][2]) if at else ("", -1)
    thousands = at + 1 < len(found) and found[at + 1][1] == end and found[at + 1][0].lower() == "k"
    behind = at + 1 + thousands
    after = found[behind][0] if behind < len(found) else ""
    value = round(float(text) * (1000 if thousands else 1), 6)
    if _CYCLES.match(after) or _CYCLES.match(before):
        return value, "cycles"
    if _UNIT.match(after):
        return value, "unit"
    if _KIND.match(before):
        return value, "kind before"
    if before_end == start or (before and not before[0].isdigit()):
        return value, "word"
    if _KIND.match(after):
        return value, "kind after"
    return value, "word" if re.match(r"0\d", text) else "nothing"


def _clutch(name: str, cycles: float | None) -> str | None:
    """The only part of a name that may be a clutch's id; None if there is none or there are several."""
    ids = [match[0] for match in _ID.finditer(_stem(name)) if not _COUNTER.match(match[0])]
    ids = [own for own in ids if cycles is None or count(re.sub(r"^\D+", "", own)) != cycles]
    return ids[0] if len(ids) == 1 else None
