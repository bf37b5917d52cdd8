"""What a rig profile says of a file besides its columns: kind, cycles and name of its run, from the file's name or a cell.

A pattern of names has `{cycles}` (a whole number, `7k` for 7,000), `{kind}` (a word that the profile explains), `{run_id}`,
`{clutch_id}` and `*`; everything else stands for itself, whatever its case.
"""

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from service.api.base import MAX_CYCLES
from service.api.rig import FileKindName, RigProfile
from service.errors import InvalidError
from service.readers.unit_table import conversion, spellings

#: Places of a pattern that stand for something. Chosen: names of rigs have the cycles, a kind, a number, and a rest.
_MAX_WILD = 4
_WILD = re.compile(r"\{cycles\}|\{kind\}|\{run_id\}|\{clutch_id\}|\*")
_MEANING = {
    "{cycles}": r"(?P<cycles>\d{1,12}k?)(?!\d)",
    "{kind}": r"(?P<kind>[^\d\W_]+)",
    "{run_id}": r"(?P<run_id>[A-Za-z0-9][A-Za-z0-9._:@+-]{0,127}?)",
    "{clutch_id}": r"(?P<clutch_id>[A-Za-z0-9][A-Za-z0-9._:@+-]{0,127}?)",
    "*": r".*?",
}
_NUMBER = re.compile(r"\d+(?:[.,' ]\d{3})*")


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """The facts that a file states about its run outside of the table; None if not stated."""

    kind: FileKindName | None = None
    cycles: float | None = None
    run_id: str | None = None
    clutch_id: str | None = None


def require_usable(profile: RigProfile) -> None:
    """Raise InvalidError if a unit does not fit its channel or the pattern of names cannot be used."""
    for number, column in enumerate(profile.columns):
        if column.channel and column.unit and conversion(column.channel, column.unit) is None:
            allowed = spellings(column.channel)
            message = f"columns.{number}.unit must be one of {allowed} for {column.channel}, got {column.unit!r}"
            raise InvalidError.of(message, code="unknown_unit", pointer=f"/columns/{number}/unit", value=column.unit)
    pattern = profile.file_name
    if pattern is None:
        return
    places = _WILD.findall(pattern)
    rule = None
    if len(places) > _MAX_WILD:
        rule = f"may hold at most {_MAX_WILD} of {', '.join(_MEANING)}"
    elif any(places.count(name) > 1 for name in _MEANING if name != "*"):
        rule = "may hold each of {cycles}, {kind}, {run_id} and {clutch_id} once"
    elif "{kind}" in places and not profile.kinds:
        rule = "has {kind}, so `kinds` must list the words for each kind of run"
    if rule is not None:
        message = f"file_name {rule}, got {pattern!r}"
        raise InvalidError.of(message, code="pattern", pointer="/file_name", value=pattern)


def named(profile: RigProfile, filename: str, cells: Mapping[str, str]) -> Named:
    """The facts that the profile finds in the file's name and in the cells above its table (label -> text beside it)."""
    groups: Mapping[str, str | None] = {}
    if profile.file_name is not None:
        match = _regex(profile.file_name).fullmatch(PurePath(filename).name)
        groups = {} if match is None else match.groupdict()
    words = {word.casefold(): kind for word, kind in profile.kinds.items()}
    cycles, clutch_id = count(groups.get("cycles")), groups.get("clutch_id")
    if cycles is None and profile.cycles_cell is not None:
        cycles = count(_beside(profile.cycles_cell, cells))
    if clutch_id is None and profile.clutch_cell is not None:
        clutch_id = _beside(profile.clutch_cell, cells)
    return Named(
        kind=words.get((groups.get("kind") or "").casefold(), profile.kind),
        cycles=cycles,
        run_id=groups.get("run_id"),
        clutch_id=clutch_id,
    )


def _beside(label: str, cells: Mapping[str, str]) -> str | None:
    """The text beside a label above the table."""
    texts = {_bare(own): text for own, text in cells.items()}
    return texts.get(_bare(label))


def _bare(label: str) -> str:
    return label.strip().rstrip(":=").strip().casefold()


def pattern_for(filename: str, cycles: float | None, clutch_id: str | None = None) -> str | None:
    """A pattern that matches names like this one: the cycles and the clutch as fields, if each occurs once, and `*` for
    every other number.

    None if the cycles are not in the name.
    """
    if cycles is None or not cycles.is_integer():
        return None
    digits, thousands = str(int(cycles)), f"{int(cycles) // 1000}k" if cycles and cycles % 1000 == 0 else None
    name = PurePath(filename).name
    if clutch_id and name.count(clutch_id) == 1:
        before, _, after = name.partition(clutch_id)
        name = f"{before}{{clutch_id}}{after}"
    parts = re.split(r"(\d+k?(?![^\W\d_]))", name, flags=re.IGNORECASE)
    numbers = range(1, len(parts), 2)
    as_digits = [place for place in numbers if parts[place].lstrip("0") == digits.lstrip("0")]
    places = as_digits + [place for place in numbers if parts[place].casefold() == thousands]
    if len(places) != 1:
        return None
    for place in numbers:
        parts[place] = "{cycles}" if place == places[0] else "*"
    pattern = re.sub(r"\*[-_.: ]*(?=\*)", "", "".join(parts))
    return pattern if len(_WILD.findall(pattern)) <= _MAX_WILD else None


def _regex(pattern: str) -> re.Pattern[str]:
    """The pattern as a regular expression. Between two `*` only the first occurrence of a text is tried, because the
    second `*` matches the rest; otherwise matching would take exponential time."""
    pattern = re.sub(r"\*+", "*", pattern)
    texts, wilds = _WILD.split(pattern), _WILD.findall(pattern)
    parts = [re.escape(texts[0])]
    for wild, text, following in zip(wilds, texts[1:], [*wilds[1:], ""], strict=False):
        part = _MEANING[wild] + re.escape(text)
        parts.append(f"(?>{part})" if wild == following == "*" else part)
    return re.compile("".join(parts), re.IGNORECASE)


def count(text: str | None) -> float | None:
    """A whole number of cycles, with grouped thousands or as `7k`; None if the text is no such number."""
    plain = (text or "").strip()
    times = 1000.0 if plain[-1:].casefold() == "k" else 1.0
    plain = plain[:-1] if times > 1 else plain
    if not _NUMBER.fullmatch(plain):
        return None
    value = times * float(re.sub(r"\D", "", plain))
    return value if value <= MAX_CYCLES else None


def fits(profile: Mapping[str, Any], titles: Collection[str]) -> bool:
    """Whether a file has exactly the columns of a stored profile, ignoring case and blanks."""
    own = [column["title"] for column in profile["columns"] if not column["title"].startswith("=")]
    return {_plain(title) for title in own} == {_plain(title) for title in titles}


def _plain(title: str) -> str:
    return " ".join(title.split()).casefold()
