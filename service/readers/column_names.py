"""A file's column titles -> channels and their units: by public name, by synonym, or by an explicit map."""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from service.columns import CHANNELS
from service.errors import MOST_QUOTED, FieldError, InvalidError
from service.readers.limits import LONGEST_MAP, LONGEST_NAME, LONGEST_TITLE, LONGEST_UNIT
from service.readers.unit_table import Conversion, conversion, is_unit, spellings

#: Single letters have their meaning in mechanics: capitals count (M is a torque, n a speed, p a pressure, t a time).
_LETTERS = {"M": "torque_nm", "n": "speed_rpm", "p": "pressure_bar", "t": "time_s"}

_WORDS = {
    "time_s": "time zeit timestamp zeitstempel elapsed_time elapsed messzeit time_stamp",
    "pressure_bar": "pressure druck line_pressure leitungsdruck anpressdruck kolbendruck "
    "clutch_pressure kupplungsdruck piston_pressure druck_ist pressure_actual p_ist p_line",
    "speed_rpm": "speed drehzahl rotational_speed rotation_speed shaft_speed differential_speed slip_speed motor_speed "
    "relative_speed drehgeschwindigkeit winkelgeschwindigkeit angular_velocity angular_speed differenzdrehzahl "
    "schlupfdrehzahl motordrehzahl drehzahl_ist n_ist n_motor n_rel n_diff omega speed_actual rpm",
    "torque_nm": "torque drehmoment moment friction_torque reibmoment clutch_torque kupplungsmoment "
    "drehmoment_ist torque_actual m_ist m_d md m_r",
    "torque_sd_nm": "torque_sd torque_std torque_deviation standard_deviation_of_torque "
    "drehmoment_standardabweichung standardabweichung_drehmoment",
    "oil_temperature_c": "oil_temperature oil_temp oiltemperature oiltemp öltemperatur öltemp t_oil t_öl toil töl "
    "temperature_oil temperatur_öl theta_oil theta_öl sump_temperature sumpftemperatur oil_sump_temperature",
    "plate_temperature_front_c": "plate_temperature_front front_plate_temperature plate_temp_front t_plate_front "
    "temperature_plate_front theta_plate_front plattentemperatur_vorn plattentemperatur_vorne lamellentemperatur_vorn "
    "lamellentemperatur_vorne t_platte_vorn t_lamelle_vorn plate_temperature plate_temp t_plate plattentemperatur "
    "lamellentemperatur t_lamelle",
    "plate_temperature_rear_c": "plate_temperature_rear rear_plate_temperature plate_temp_rear t_plate_rear "
    "temperature_plate_rear theta_plate_rear plattentemperatur_hinten lamellentemperatur_hinten t_platte_hinten "
    "t_lamelle_hinten",
}

#: Columns that one message names.
_MOST_NAMED = 10


@dataclass(frozen=True, slots=True)
class Header:
    """One column of a file: its name without a unit, and the unit that the file states (None: it states none).

    `group` distinguishes equal names in files that have groups; a map may use `group/name`.
    """

    name: str
    unit: str | None = None
    group: str = ""

    def shown(self) -> str:
        """The name for a message."""
        return f"{self.group}/{self.name}"[:MOST_QUOTED] if self.group else self.name[:MOST_QUOTED]


@dataclass(frozen=True, slots=True)
class Taken:
    """A column that is taken: the file's `index`-th as `channel`, with its conversion to the channel's unit."""

    channel: str
    index: int
    conversion: Conversion


def _key(name: str) -> str:
    """Names that differ in case, blanks, dashes or in ö for oe are one name.

    Composing letters takes time with the square of the length where accents are piled up: only short names are composed.
    """
    plain = (unicodedata.normalize("NFC", name) if len(name) <= LONGEST_NAME else name).strip().casefold()
    plain = plain.replace("oel", "öl").replace("ϑ", "theta").replace("ω", "omega")
    return re.sub(r"[\s._\-]+", "_", plain).strip("_")


_BY_KEY = {_key(word): channel for channel, words in _WORDS.items() for word in words.split()}
_BY_KEY |= {name: name for name in CHANNELS}
_BRACKETED = re.compile(r"(?P<name>[^\[\](){}<>]*)[\[({<](?P<unit>[^\[\](){}<>]*)[\])}>]\s*")
_PER = re.compile(r"(?P<name>[^/]+)/\s*(?P<unit>.+)")
_IN = re.compile(r"(?P<name>.*\S)\s+in\s+(?P<unit>\S.*)")
_MARK = re.compile(r"[\s_]+")


def known_channel(name: str) -> str | None:
    """The public channel that a name stands for, or None."""
    bare = name.strip()
    return _LETTERS.get(bare) or (_BY_KEY.get(_key(bare)) if 1 < len(bare) <= LONGEST_NAME else None)


def header_of(text: str) -> Header:
    """A column's title -> name and unit: `torque [Nm]`, `torque (Nm)`, `M / Nm`, `Druck in bar`, `speed_rad_s`.

    Raises InvalidError on a text that is too long for a title.
    """
    title = text.strip()
    if len(title) > LONGEST_TITLE:
        raise _long_title(title)
    if known_channel(title):
        return Header(title)
    if match := _BRACKETED.fullmatch(title):
        return Header(match["name"].strip(), bare_unit(match["unit"]))
    for pattern in (_PER, _IN):
        match = pattern.fullmatch(title)
        if match and (known_channel(match["name"]) or is_unit(match["unit"])):
            return Header(match["name"].strip(), bare_unit(match["unit"]))
    for mark in _MARK.finditer(title, max(0, len(title) - LONGEST_UNIT - 1)):
        name, unit = title[: mark.start()], title[mark.end() :]
        if known_channel(name) and is_unit(unit):
            return Header(name, unit)
    return Header(title)


def _long_title(title: str) -> InvalidError:
    shown = title[:MOST_QUOTED]
    message = f"a column's title must not be longer than {LONGEST_TITLE} characters, got {len(title)}: {shown!r} ..."
    return InvalidError(message, errors=[FieldError(pointer="", code="title_too_long", message=message, value=shown)])


def bare_unit(text: str) -> str | None:
    """A unit without its brackets; None where nothing is stated."""
    unit = text.strip().strip("[](){}<>").strip()
    return None if unit in ("", "-", "--", "_", "?") else unit


def with_unit(header: Header, unit: str | None) -> Header:
    """A header with the unit that the file states beside the name; raises InvalidError where the name states another."""
    stated = bare_unit(unit or "")
    if stated and header.unit and stated != header.unit:
        channel = known_channel(header.name)
        if channel is None or conversion(channel, stated) != conversion(channel, header.unit):
            both = f"{header.unit[:MOST_QUOTED]!r} and {stated[:MOST_QUOTED]!r}"
            message = f"column {header.shown()!r} must be in one unit, got {both}"
            raise InvalidError(
                message, errors=[FieldError(pointer="", code="mixed_units", message=message, value=both)]
            )
    return Header(header.name, stated or header.unit, header.group)


def parse_map(mapping: str | None) -> dict[str, str]:
    """`torque_nm:Mz,pressure_bar:p1` -> {channel: column's name}. Names may hold commas and colons themselves.

    Raises InvalidError where the text is no such list, or a channel in it is unknown or named twice.
    """
    if mapping is None or not mapping.strip():
        return {}
    if len(mapping) > LONGEST_MAP:
        raise _wrong_map(mapping, f"must not be longer than {LONGEST_MAP} characters")
    names: dict[str, str] = {}
    for part in re.split(rf",(?=\s*(?:{'|'.join(CHANNELS)})\s*:)", mapping):
        channel, colon, name = part.partition(":")
        channel, name = channel.strip(), name.strip()
        if not colon or not name:
            raise _wrong_map(part, "must be a list such as torque_nm:Mz,pressure_bar:p1")
        if channel not in CHANNELS:
            raise _wrong_map(channel, f"must name channels from {', '.join(CHANNELS)}")
        if channel in names:
            raise _wrong_map(channel, "must name each channel once")
        names[channel] = name
    return names


def _wrong_map(value: str, rule: str) -> InvalidError:
    message = f"map {rule}, got {value[:MOST_QUOTED]!r}"
    return InvalidError(
        message, errors=[FieldError(pointer="/map", code="invalid_map", message=message, value=value[:MOST_QUOTED])]
    )


def choose(headers: Sequence[Header], mapping: str | None) -> list[Taken]:
    """Which columns are taken, in the order of the file.

    Without a map every column must be a known channel. With a map, columns that are neither in it nor known are left out.
    Raises InvalidError where a column is unknown, two are the same channel, or a unit is unknown or not stated.
    """
    mapped_names = parse_map(mapping)
    by_map = {_find(headers, channel, name): channel for channel, name in mapped_names.items()}
    if len(by_map) < len(mapped_names):
        raise _wrong_map(str(mapping), "must not name one column for two channels")
    indices: dict[str, int] = {}
    unknown = []
    for index, header in enumerate(headers):
        channel = by_map.get(index) or known_channel(header.name)
        if channel is None:
            unknown.append(header)
        elif index in by_map or channel not in mapped_names:
            if channel in indices:
                raise _twice(channel, headers[indices[channel]], header)
            indices[channel] = index
    if unknown and not mapped_names:
        raise _unknown(headers, unknown)
    if not indices:
        raise InvalidError(f"the file holds no known channel: it has {_list(headers)}")
    taken = [
        Taken(name, index, _conversion(name, headers[index], mapped=index in by_map)) for name, index in indices.items()
    ]
    return sorted(taken, key=lambda column: column.index)


def _find(headers: Sequence[Header], channel: str, name: str) -> int:
    """The index of the column that a map names: by its exact name, else whatever its case, blanks and unit."""
    wanted = header_of(name).name
    exact = [index for index, header in enumerate(headers) if name in (header.name, f"{header.group}/{header.name}")]
    alike = [index for index, header in enumerate(headers) if _key(wanted) == _key(header.name)]
    for matches in (exact, alike):
        if len(matches) == 1:
            return matches[0]
        if matches:
            raise _twice(channel, *(headers[index] for index in matches))
    message = (
        f"map names for {channel} the column {name[:MOST_QUOTED]!r}, which is not there; there are {_list(headers)}"
    )
    raise InvalidError(
        message, errors=[FieldError(pointer="/map", code="no_such_column", message=message, value=name[:MOST_QUOTED])]
    )


def _twice(channel: str, *headers: Header) -> InvalidError:
    shown = " and ".join(header.shown() for header in headers[:_MOST_NAMED])
    message = f"{channel} must be one column, got {shown}; map={channel}:NAME chooses one"
    return InvalidError(
        message, errors=[FieldError(pointer=f"/channels/{channel}", code="ambiguous", message=message, value=shown)]
    )


def _unknown(headers: Sequence[Header], unknown: Sequence[Header]) -> InvalidError:
    """The error that lists every unknown column, and equal names: a map cannot distinguish those either."""
    repeated = [name for name, times in Counter(header.shown() for header in headers).items() if times > 1]
    more = f"; {', '.join(repeated[:_MOST_NAMED])} is there more than once" if repeated else ""
    errors = [
        FieldError(
            pointer=f"/channels/{header.shown().replace('~', '~0').replace('/', '~1')}",
            code="unknown_channel",
            message=f"{header.shown()!r} is not a known channel",
            value=header.shown(),
        )
        for header in unknown
    ]
    detail = (
        f"{_list(unknown)}: not known as a channel; the channels are {', '.join(CHANNELS)}{more}; "
        "map=CHANNEL:NAME,... names the columns to take; unknown columns that it does not name are left out"
    )
    return InvalidError(detail, errors=errors)


def _list(headers: Sequence[Header]) -> str:
    shown = ", ".join(repr(header.shown()) for header in headers[:_MOST_NAMED])
    return shown if len(headers) <= _MOST_NAMED else f"{shown} and {len(headers) - _MOST_NAMED} more"


def _conversion(channel: str, header: Header, *, mapped: bool) -> Conversion:
    """The conversion to the channel's unit. A public name states its unit: another unit beside it is a contradiction.

    A column without a unit that a map names is taken to be in the channel's unit.
    """
    own, public = CHANNELS[channel].unit, _key(header.name) == channel
    if header.unit is None:
        if public or mapped:
            return Conversion()
        rule = f"must be stated ({spellings(channel)}), in brackets or in a unit row; or map={channel}:{header.name}"
        raise _wrong_unit(channel, header, "missing_unit", rule, "none")
    converted = conversion(channel, header.unit)
    if converted is None:
        rule = f"must be a known one ({spellings(channel)})"
        raise _wrong_unit(channel, header, "unknown_unit", rule, repr(header.unit[:MOST_QUOTED]))
    if public and not mapped and not converted.is_identity():
        rule = f"is in {own} by its name"
        raise _wrong_unit(channel, header, "mixed_units", rule, repr(header.unit[:MOST_QUOTED]))
    return converted


def _wrong_unit(channel: str, header: Header, code: str, rule: str, got: str) -> InvalidError:
    column = channel if _key(header.name) == channel else f"{channel} (column {header.shown()!r})"
    message = f"{column}: the unit {rule}, got {got}"
    error = FieldError(
        pointer=f"/channels/{channel}", code=code, message=message, value=(header.unit or "")[:MOST_QUOTED]
    )
    return InvalidError(message, errors=[error])
