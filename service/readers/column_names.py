"""A file's column titles -> channels and their units: by public name, by synonym, or by an explicit map.

Nothing else is taken: what a column may be besides is a suggestion (`suggest`).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from service.channels import CHANNELS
from service.errors import MAX_QUOTED, FieldError, InvalidError
from service.readers.limits import LONGEST_MAP, LONGEST_NAME, LONGEST_TITLE, LONGEST_UNIT
from service.readers.meanings import (
    MEANS,
    SYMBOLS,
    UNITS_AS_TITLES,
    Sense,
    is_another,
    key,
    known_channel,
    meaning,
    measures,
    of_time,
    words,
)
from service.readers.table import CELLS, COLUMNS, NO_TIME, SHEETS, ColumnChoice, FileColumn, Reading, is_per_column
from service.readers.unit_table import Conversion, conversion, is_unit, spellings

#: Times whose program writes seconds and no unit: LabVIEW's text files, asammdf's exports, Simulink's.
_SECONDS = frozenset({"x_value", "timestamps", "tout"})
#: A column that holds what of a time is less than a second.
_PART_OF_SECOND = re.compile(r"fraction|bruchteil|sub_?second", re.IGNORECASE)
#: Columns that one message names.
_MAX_NAMED = 10


@dataclass(frozen=True, slots=True)
class Taken:
    """A column taken as a channel: the file's `index`-th as `channel`, with its conversion to the channel's unit.

    `unit`: as stated by file or caller; None: not stated, so the channel's own is assumed. `clock_of`: the only columns
    of which it is the time, by the names it gives them (`t_M`).
    """

    channel: str
    index: int
    conversion: Conversion
    unit: str | None
    clock_of: frozenset[int] = frozenset()


#: What in a name may say that its values are multiples: `x10`, `/100`, `(10^-3)`, `gain 10`, `10*M`.
_SCALED = re.compile(
    r"/ ?(?:10+|0[.,]0*1)(?![\d^.,])|(?<![\w.,])(?:10+|0[.,]0*1) ?(?:[x×](?![^\W_])|[*·])"
    r"|(?:(?:(?<![^\W_])(?-i:x)|[×*·]) ?|(?:fa[ck]tor|gain|s[ck]al|mult|times|verstärk)\D{0,15})"
    r"(?:10\^[+-]?\d|(?!1(?!\d))\d+(?:[.,]\d+)?)"
    r"|(?<![^\W_])X(?:10+|0[.,]0*1)(?!\d)|\((?:10\^[+-]?\d|1/10+|10+|0[.,]0*1)\)",
    re.IGNORECASE,
)
_WIDE = str.maketrans("（）［］｛｝，／：【】", "()[]{},/:[]")
_BRACKETED = re.compile(
    r"(?P<name>.*?)\s*/?\s*(?:\[(?P<square>[^\[\]]*)\]|[({<](?P<unit>[^\[\](){}<>]*)[)}>])[\s:.]*", re.DOTALL
)
_RANGE = re.compile(
    r"(?:(?P<least>[+-]?\d+)(?:[.,]\d+)? ?(?:\.{2,3}|…|-|–|to|bis) ?|±|\+/-)(?P<most>[+-]?\d+)(?:[.,]\d+)? ?(?=1/|[^\W\d])"
)
#: Where a word of a title may begin: after what is no letter or digit, and at a capital after a small
#: letter that is no prefix of a unit (kNm).
_WORD_STARTS = re.compile(r"(?<![^\W_])(?=[^\W_°])|(?<=[a-jln-zäöüß])(?=[A-Z])|(?<!°)(?=°)")
_BRACKET = re.compile(r"[\[({<]([^\[\](){}<>]*(?:\([^()]*\))?)[\])}>]")
#: What may stand between a name and its unit: a comma, a slash, "in", blanks or underscores, and dots as R writes for them
#: (`Pressure..bar.`).
_BETWEEN = re.compile(r"\s*[,;:|]\s*|\s*/\s*|\s+in\s+|[\s_]+|\.+(?!\d)")


def is_time(column: FileColumn) -> bool:
    """Whether a column is a time by its name, or may be one by its unit."""
    return meaning(column.name, column.unit)[0] == "time_s" or may_be_time(column)


def part_of_second(column: FileColumn) -> float | None:
    """The factor to s of a column beside the time that may hold the fraction of the second, by its title."""
    unit = conversion("time_s", column.unit or column.name)
    return unit.factor if unit and unit.factor < 1 else 1.0 if _PART_OF_SECOND.search(column.name) else None


def is_counter(column: FileColumn) -> bool:
    """Whether a time column's title is LabVIEW's, which may count samples."""
    return key(column.name) == "x_value"


def column_of(text: str, unit: str | None = None, group: str = "", *, moments: bool = False) -> FileColumn:
    """The name and unit in a column's title: `torque [Nm]`, `torque (Nm)`, `M / Nm`, `Druck in bar`, `Time, ms`,
    `speed_rad_s`.

    `unit` is the unit stated beside the title; points in time (`moments`) need none. Raises InvalidError on a text too
    long for a title, and if the title states another unit.
    """
    title = text.strip()
    if len(title) > LONGEST_TITLE:
        shown = title[:MAX_QUOTED]
        message = (
            f"a column's title must not be longer than {LONGEST_TITLE} characters, got {len(title)}: {shown!r} ..."
        )
        raise InvalidError.of(message, code="title_too_long", value=shown)
    name, title_unit = _taken_apart(" ".join(title.translate(_WIDE).split()))
    title_unit = name if title_unit is None and key(name[:LONGEST_NAME]) in UNITS_AS_TITLES else title_unit
    column = FileColumn(name, "s" if moments else title_unit, group, title)
    return column if unit is None or moments else with_unit(column, unit)


def _taken_apart(title: str) -> tuple[str, str | None]:
    within = [bracket for bracket in _BRACKET.finditer(title) if bracket.start()]
    units = [bracket for bracket in within if is_unit(bare_unit(bracket[1]) or "")]
    if len(units) == 1:
        name = f"{title[: units[0].start()].rstrip(' /')} {title[units[0].end() :].strip(' :.')}".strip()
        return name, bare_unit(units[0][1])
    if units:
        return title, None  # which one it is in, it does not say
    if match := _BRACKETED.fullmatch(title):
        return match["name"].strip(), bare_unit(match["square"] if match["unit"] is None else match["unit"])
    if known_channel(title):
        return title, None
    for mark in _BETWEEN.finditer(title, max(0, len(title) - LONGEST_UNIT - 4)):  # the longest unit first
        name, unit = title[: mark.start()].strip(), title[mark.end() :].rstrip(".")
        if name and is_unit(unit):
            channel = meaning(name, unit)[0]
            # a sign parts any name from its unit, a blank only one that is known
            if (channel and conversion(channel, unit)) or mark[0].strip(" _."):
                return name, unit
    return title, None


def bare_unit(text: str) -> str | None:
    """A unit without its brackets and the range of its sensor (`0..10 bar`, `±200 Nm`); None if none is stated."""
    unit = text.translate(_WIDE).strip()
    unit = (unit[1:-1] if unit[:1] + unit[-1:] in ("[]", "()", "{}", "<>") else unit).strip().removeprefix("in ")
    within = _RANGE.match(unit)
    if within and (not within["least"] or float(within["least"]) < float(within["most"])):
        unit = unit[within.end() :]
    return unit if re.search(r"[^-_=?.*/|\s]", unit) else None


def with_unit(column: FileColumn, unit: str | None) -> FileColumn:
    """A column with the unit stated beside its name; raises InvalidError if the name states another."""
    stated = bare_unit(unit or "")
    if stated and column.unit and is_unit(stated) and not is_unit(column.unit):
        return replace(column, name=column.title, unit=stated)  # `Torque (filtered)` is no unit
    if stated and column.unit and stated != column.unit:
        channel = known_channel(column.name)
        if channel is None or conversion(channel, stated) != conversion(channel, column.unit):
            both = f"{column.unit[:MAX_QUOTED]!r} and {stated[:MAX_QUOTED]!r}"
            message = f"column {column.shown()!r} must be in one unit, got {both}"
            raise InvalidError.of(message, code="mixed_units", value=both)
    return replace(column, unit=stated or column.unit)


def parse_map(mapping: str | None) -> dict[str, ColumnChoice]:
    """The dictionary channel -> column of a map given as text (`torque_nm:Mz,pressure_bar:p1`). Names may hold commas
    and colons themselves.

    Raises InvalidError if the text is no such list, or a channel in it is unknown or named twice.
    """
    if mapping is None or not mapping.strip():
        return {}
    if len(mapping) > LONGEST_MAP:
        raise _wrong_map(mapping, f"must not be longer than {LONGEST_MAP} characters")
    choices: dict[str, ColumnChoice] = {}
    for part in re.split(rf",(?=\s*(?:{'|'.join(CHANNELS)})\s*:)", mapping):
        channel, colon, name = part.partition(":")
        channel, name = channel.strip(), name.strip()
        if not colon or not name:
            raise _wrong_map(part, "must be a list such as torque_nm:Mz,pressure_bar:p1")
        if channel not in CHANNELS:
            raise _wrong_map(channel, f"must name channels from {', '.join(CHANNELS)}")
        if is_per_column(name) and channel in choices and is_per_column(choices[channel].column):
            name = f"{choices[channel].column},{name}"
        elif channel in choices:
            raise _wrong_map(channel, "must name each channel once")
        pseudo = next((own for own in (COLUMNS, SHEETS, CELLS) if name.partition(" ")[0] == own), None)
        choices[channel] = (
            ColumnChoice(column=pseudo, unit=column_of(name).unit) if pseudo else ColumnChoice(column=name)
        )
    return choices


def _wrong_map(value: str, rule: str) -> InvalidError:
    message = f"map {rule}, got {value[:MAX_QUOTED]!r}"
    return InvalidError.of(message, code="invalid_map", pointer="/map", value=value)


def choices_of(reading: Reading) -> dict[str, ColumnChoice]:
    """The columns named by the caller, including the time column."""
    named = dict(reading.mapping)
    if reading.time and reading.time != NO_TIME:
        named.setdefault("time_s", ColumnChoice(column=reading.time))
    return named


def named_columns(reading: Reading) -> list[str]:
    """The titles named by the caller."""
    return [choice.column for choice in choices_of(reading).values()]


def recognised(titles: Sequence[str], named: Sequence[str]) -> int:
    """The number of titles that name channels or are in `named`, by which the row of titles is found."""
    wanted_keys = {key(name) for name in named} | {key(column_of(name).name) for name in named}
    channels: set[str] = set()
    for title in titles:
        if 0 < len(title) <= LONGEST_TITLE:
            column = column_of(title)
            if is_unit(title) and meaning(title)[0] is None:
                continue  # a unit, of which a part may look like a title (`giri/min`)
            channel = "time_s" if is_time(column) else meaning(column.name, column.unit)[0]
            keys = {key(title), key(column.name)} & wanted_keys
            channels |= keys or ({channel} if channel else set())
    return len(channels)


def choose(columns: Sequence[FileColumn], reading: Reading) -> list[Taken]:
    """The columns to read as channels, in the order of the file; all others are left out. The time may be taken several
    times.

    Raises InvalidError where two columns are the same channel, or a unit is unknown or not stated.
    """
    chosen, errors = understood(columns, reading)
    if errors:
        raise errors[0]
    if not chosen:
        example = columns[0].shown() if columns else "NAME"
        way = f"name the columns of channels, as in map=torque_nm:{example}; the channels are {', '.join(CHANNELS)}"
        raise InvalidError(f"the file holds no known channel: it has {_list(columns)}; {way}")
    return chosen


def understood(columns: Sequence[FileColumn], reading: Reading) -> tuple[list[Taken], list[InvalidError]]:
    """The columns that are channels, in the order of the file, and the errors that prevent reading them."""
    named, errors = choices_of(reading), []
    if reading.time == NO_TIME:
        named.pop("time_s", None)
    by_map: dict[int, str] = {}
    titles = {column.title for column in columns}
    for channel, choice in named.items():
        if choice.is_constant() and choice.column not in titles:
            continue
        try:
            if (index := _find(columns, channel, choice.column)) in by_map:
                raise _wrong_map(choice.column, f"must not name one column for {by_map[index]} and {channel}")
            by_map[index] = channel
        except InvalidError as error:
            errors.append(error)
    free = [] if reading.only_named else [index for index in range(len(columns)) if index not in by_map]
    senses = {index: meaning(columns[index].name, columns[index].unit) for index in free}
    chosen = dict(by_map)
    clocks_of = {} if reading.time == NO_TIME else _clocks_by_name(columns)
    for channel in CHANNELS:
        if channel in named or (channel == "time_s" and reading.time == NO_TIME):
            continue
        whole = [at for at in free if senses[at] == (channel, Sense.WHOLE)]
        # neither a mean beside the signal itself nor what stands in a group of set points
        plain = [at for at in whole if not (MEANS & {*words(columns[at].name)} or is_another(columns[at].group))]
        candidates = plain or whole
        if channel != "time_s" and len(candidates) == 1 and key(columns[candidates[0]].name) != channel:
            # one more of the same quantity, but for a word that is not known: `Torque corrected` beside `Torque`
            candidates += [at for at in free if senses[at] == (channel, Sense.PART)]
        if channel == "time_s" or len(candidates) == 1:
            chosen |= dict.fromkeys(candidates, channel)
        elif candidates:
            errors.append(_twice(channel, *(columns[index] for index in candidates)))
    for at, of in clocks_of.items():
        if at not in chosen and of & chosen.keys():
            chosen[at] = "time_s"
    columns_taken: list[Taken] = []
    unstated: list[tuple[str, FileColumn]] = []
    for index, channel in sorted(chosen.items()):
        asked_column = named.get(channel) if index in by_map else None
        public = key(columns[index].name) == channel
        unit, converted = None, Conversion()
        try:
            unit = _unit(channel, columns[index], asked_column)
            converted = _conversion(channel, columns[index], asked_column, unit)
        except InvalidError as error:
            unit = None
            errors.append(error)
        else:
            unstated += [(channel, columns[index])] if unit is None and asked_column is None and not public else []
        unit = CHANNELS[channel].unit if unit is None and public else unit
        clock_of = frozenset() if index in by_map or channel != "time_s" else clocks_of.get(index, frozenset())
        columns_taken.append(Taken(channel, index, converted, unit, clock_of))
    if any(channel != "time_s" for channel, _ in unstated):
        errors.append(no_unit(unstated, reading))
    return columns_taken, errors


def _clocks_by_name(columns: Sequence[FileColumn]) -> dict[int, frozenset[int]]:
    """Columns of times that name other columns, with the names: `t_M` names M, `Zeit Moment` the torque."""
    found: dict[int, frozenset[int]] = {}
    for at, column in enumerate(columns):
        all_words = words(column.name[:LONGEST_NAME], digits=True)
        rest = [word for word in all_words if not of_time(word)]
        if not 0 < len(rest) < len(all_words) or (column.unit is not None and not measures("time_s", column.unit)):
            continue
        named, channel = "_".join(rest), meaning(" ".join(rest))
        if channel[0] is None and named in SYMBOLS and len(SYMBOLS[named]) == 1:
            channel = SYMBOLS[named][0], Sense.WHOLE
        of = {
            other
            for other, own in enumerate(columns)
            if other != at
            and own.group == column.group
            and (
                "_".join(words(own.name[:LONGEST_NAME], digits=True)) == named
                or meaning(own.name, own.unit) == channel != (None, Sense.UNKNOWN)
            )
        }
        if of:
            found[at] = frozenset(of)
    return found


def may_be_time(column: FileColumn) -> bool:
    """Whether a column in a unit of time may be the clock, provided that its values run on."""
    return meaning(column.name, column.unit)[1] is Sense.UNKNOWN and measures("time_s", column.unit)


def like_a_time(column: FileColumn) -> bool:
    """Whether a column may be the clock by its unit, by a word of another language, by a part of its name, or because it
    has no title."""
    channel, sense = meaning(column.name, column.unit)
    if column.unit is None and channel is None:
        channel, sense = meaning(column.name, "s")
    untitled = bool(column.name) and not column.title
    return untitled or may_be_time(column) or (channel == "time_s" and sense is not Sense.WHOLE)


def no_unit(columns: Sequence[tuple[str, FileColumn]], reading: Reading) -> InvalidError:
    """The error for columns without a unit. It ends with the `map=` to add if all of them are in their channels' own
    units."""
    errors = []
    for channel, column in columns:
        message = f"{channel} (column {column.shown()!r}): the unit must be stated ({spellings(channel)})"
        errors.append(FieldError(pointer=f"/channels/{channel}", code="missing_unit", message=message))
    named = {channel: choice.column for channel, choice in reading.mapping.items()}
    titles = {channel: column.title or column.shown() for channel, column in columns}
    map_argument = ",".join(f"{channel}:{title}" for channel, title in {**named, **titles}.items())
    own_units = ", ".join(CHANNELS[channel].unit for channel in titles)
    message = "; ".join(error.message for error in errors)
    return InvalidError(
        f"{message}, in brackets or in a unit row. If the unit is {own_units}, add map={map_argument}", errors=errors
    )


def _find(columns: Sequence[FileColumn], channel: str, name: str) -> int:
    """The index of the column named in a map: by its exact title or name, by name and unit, or by its number among
    equal ones (`M#2`); failing that, ignoring case, blanks and unit."""
    wanted = key(column_of(name).name)
    forms = [(own.title, own.name, f"{own.group}/{own.name}", f"{own.name} [{own.unit}]") for own in columns]
    exact = [index for index, names in enumerate(forms) if name in names]
    bare, _, number = name.rpartition("#")
    if not exact and number.isdecimal():
        equal = [index for index, names in enumerate(forms) if bare in names]
        exact = equal[int(number) - 1 : int(number)] if int(number) else []
    alike = [at for at, own in enumerate(columns) if wanted in (key(own.name), key(f"{own.group}/{own.name}"))]
    for matches in (exact, alike):
        if len(matches) == 1:
            return matches[0]
        if matches:
            raise _twice(channel, *(columns[index] for index in matches))
    message = f"map gives {channel} the column {name[:MAX_QUOTED]!r}, but the file has only {_list(columns)}"
    raise InvalidError.of(message, code="no_such_column", pointer="/map", value=name)


def _twice(channel: str, *columns: FileColumn) -> InvalidError:
    names = [column.shown() for column in columns]
    if len(set(names)) < len(names):
        names = [column.title[:MAX_QUOTED] or column.shown() for column in columns]
    shown = " and ".join(names[:_MAX_NAMED])
    distinct = len(set(names)) == len(names)
    way = f"choose one with map={channel}:{'NAME' if distinct else names[0] + '#1'}"
    message = f"{channel} must be one column, got {shown}; {way}"
    if channel == "speed_rpm":
        message += ". It is the sliding speed: if the columns hold the speeds of both sides, send the difference"
    return InvalidError.of(message, code="ambiguous", pointer=f"/channels/{channel}", value=shown)


def several_times(shown: str) -> InvalidError:
    """The error for times in several columns."""
    message = f"time_s must be one column, got {shown}; choose one with time=NAME"
    return InvalidError.of(message, code="ambiguous", pointer="/time")


def perhaps_the_time(column: FileColumn) -> InvalidError:
    """The error for a column that may be the time, if no other is."""
    title = column.title or column.shown()
    message = f"{title} may be the time: add time={title} if it is; if each row is a plateau, add time={NO_TIME}"
    return InvalidError.of(message, code="perhaps_the_time", pointer="/time", value=title)


def _list(columns: Sequence[FileColumn]) -> str:
    shown = ", ".join(repr(column.shown()) for column in columns[:_MAX_NAMED])
    return shown if len(columns) <= _MAX_NAMED else f"{shown} and {len(columns) - _MAX_NAMED} more"


def unit_in_title(channel: str, title: str) -> str | None:
    """The channel's unit at the end of a title, after any separator: `Time, ms`, `Mz_kNm`, `timeMs`, `Time..ms.`."""
    if len(title) > LONGEST_NAME:
        return None
    words = [title[start.start() :].strip(" .:,;_-()[]") for start in _WORD_STARTS.finditer(title)]
    return next((word for word in words if is_unit(word) and conversion(channel, word)), None)


def _may_state(channel: str, title: str) -> str | None:
    """A word in a title that may be another unit of the channel than its own (`Mz [kNm] filtered`); None if there is
    none."""
    for word in re.finditer(r"[^\W\d_]{2,}(?:/[^\W\d_]+)?", title[:LONGEST_NAME]):
        for part in (word[0], word[0][-3:]):
            converted = conversion(channel, part)
            if converted is not None and not converted.is_identity():
                return part
    return None


def _unit(channel: str, column: FileColumn, choice: ColumnChoice | None) -> str | None:
    """The unit stated by the file, the map or the profile; None if none states it.

    A column that a map names may end in its unit, whatever parts them. Where a title says that its values are scaled, only
    the map says how.
    """
    if column.title.startswith("=") and column.title != CELLS:
        return column.unit  # what it stands for was converted
    public = key(column.name) == channel
    scaled = None if public else _SCALED.search(column.name[:LONGEST_NAME])
    asked_unit = None if choice is None else choice.unit
    if choice is not None and choice.column != column.title:
        asked_unit = asked_unit or column_of(choice.column).unit
    if scaled and asked_unit is None and (choice is None or choice.factor == 1):
        number = float(re.findall(r"-?\d+(?:[.,]\d+)?", scaled[0])[-1].replace(",", "."))
        number = 10**number if "^" in scaled[0] else number
        assumed = column.unit or CHANNELS[channel].unit
        factor = number if "/" in scaled[0] else 1 / number
        ways = f"[x{factor:g} {assumed}], [x{1 / factor:g} {assumed}] or [x1 {assumed}]"
        rule = f"may contain a factor: state it with map={channel}:{column.name} {ways}"
        raise _wrong_unit(channel, column, "missing_unit", rule, "no clear one")
    if choice is None:
        return "s" if column.unit is None and key(column.name) in _SECONDS else column.unit
    stated = column.unit or (None if public or scaled else unit_in_title(channel, column.name))
    differ = stated not in (None, choice.stated) and asked_unit and not scaled and is_unit(stated or "")
    if differ and conversion(channel, stated or "") != conversion(channel, asked_unit or ""):
        rule = f"must be {asked_unit}, as the rig profile or map says"
        raise _wrong_unit(channel, column, "mixed_units", rule, repr((stated or "")[:MAX_QUOTED]))
    unit = asked_unit or stated
    if unit is None and not public and (word := _may_state(channel, column.name)):
        rule = f"may be {word}: state it with map={channel}:{column.name} [{word}], or [{CHANNELS[channel].unit}]"
        raise _wrong_unit(channel, column, "missing_unit", rule, "no clear one")
    return unit


def _conversion(channel: str, column: FileColumn, choice: ColumnChoice | None, unit: str | None) -> Conversion:
    """The conversion to the channel's unit. A public name states its unit: another unit beside it is a contradiction.

    A column that a map names without a unit is in the channel's unit.
    """
    channel_unit, public = CHANNELS[channel].unit, key(column.name) == channel
    converted = Conversion() if unit is None else conversion(channel, unit)
    if converted is None:
        rule = f"must be one of {spellings(channel)}"
        way = "" if is_unit(unit or "") else f"; state it with map={channel}:{column.shown()} [UNIT]"
        raise _wrong_unit(channel, column, "unknown_unit", rule, repr((unit or "")[:MAX_QUOTED]) + way)
    if public and not converted.is_identity() and choice is None:
        rule = f"must be {channel_unit}, as the title says"
        raise _wrong_unit(channel, column, "mixed_units", rule, repr((unit or "")[:MAX_QUOTED]))
    if choice is not None:
        converted = Conversion(converted.factor * choice.factor, converted.offset * choice.factor + choice.offset)
    return converted


def _wrong_unit(channel: str, column: FileColumn, code: str, rule: str, got: str) -> InvalidError:
    shown = channel if key(column.name) == channel else f"{channel} (column {column.shown()!r})"
    message = f"{shown}: the unit {rule}, got {got}"
    return InvalidError.of(message, code=code, pointer=f"/channels/{channel}", value=(column.unit or ""))
