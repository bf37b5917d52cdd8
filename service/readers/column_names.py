"""A file's column titles -> channels and their units: by public name, by synonym, or by an explicit map."""

import re
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from service.columns import CHANNELS
from service.errors import MAX_QUOTED, FieldError, InvalidError
from service.readers.limits import LONGEST_MAP, LONGEST_NAME, LONGEST_TITLE, LONGEST_UNIT
from service.readers.table import NO_TIME, Choice, Column, Reading
from service.readers.unit_table import Conversion, conversion, is_unit, spellings

#: Single letters have their meaning in mechanics: capitals count (M is a torque, n a speed, p a pressure, t a time).
_LETTERS = {"M": "torque_nm", "n": "speed_rpm", "p": "pressure_bar", "t": "time_s"}

_WORDS = {
    "time_s": "time zeit timestamp timestamps zeitstempel elapsed_time elapsed messzeit time_stamp x_value datetime "
    "date_time uhrzeit datum_zeit datum_uhrzeit datum/uhrzeit date/time temps tiempo tempo tout czas čas tijd tid zaman "
    "时间 時間 時刻 время 시간",
    "pressure_bar": "pressure druck line_pressure leitungsdruck anpressdruck kolbendruck "
    "clutch_pressure kupplungsdruck piston_pressure druck_ist pressure_actual p_ist p_line pression presión presion "
    "pressione pressão ciśnienie tlak tryck basınç druk 压力 油压 壓力 油壓 圧力 油圧 давление 압력",
    "speed_rpm": "speed drehzahl rotational_speed rotation_speed shaft_speed differential_speed slip_speed motor_speed "
    "relative_speed drehgeschwindigkeit winkelgeschwindigkeit angular_velocity angular_speed differenzdrehzahl "
    "schlupfdrehzahl motordrehzahl drehzahl_ist n_ist n_motor n_rel n_diff omega speed_actual rpm vitesse "
    "vitesse_de_rotation velocidad velocidad_de_giro velocità velocidade rotação prędkość prędkość_obrotowa otáčky "
    "toerental varvtal devir hız 회전수 转速 轉速 回転数 回転速度 частота_вращения обороты",
    "torque_nm": "torque drehmoment moment friction_torque reibmoment clutch_torque kupplungsmoment "
    "drehmoment_ist torque_actual m_ist m_d md m_r couple couple_de_frottement par par_motor par_de_fricción coppia "
    "binário koppel vridmoment kroutící_moment moment_obrotowy tork 扭矩 转矩 轉矩 トルク 摩擦トルク момент 토크",
    "torque_sd_nm": "torque_sd torque_std torque_deviation standard_deviation_of_torque "
    "drehmoment_standardabweichung standardabweichung_drehmoment",
    "oil_temperature_c": "oil_temperature oil_temp oiltemperature oiltemp öltemperatur öltemp t_oil t_öl toil töl "
    "temperature_oil temperatur_öl theta_oil theta_öl sump_temperature sumpftemperatur oil_sump_temperature "
    "température_d'huile température_huile temperatura_del_aceite temperatura_aceite temperatura_olio 油温 油溫",
    "plate_temperature_front_c": "plate_temperature_front front_plate_temperature plate_temp_front t_plate_front "
    "temperature_plate_front theta_plate_front plattentemperatur_vorn plattentemperatur_vorne lamellentemperatur_vorn "
    "lamellentemperatur_vorne t_platte_vorn t_lamelle_vorn plate_temperature plate_temp t_plate plattentemperatur "
    "lamellentemperatur t_lamelle",
    "plate_temperature_rear_c": "plate_temperature_rear rear_plate_temperature plate_temp_rear t_plate_rear "
    "temperature_plate_rear theta_plate_rear plattentemperatur_hinten lamellentemperatur_hinten t_platte_hinten "
    "t_lamelle_hinten",
}
#: Words of time, within any name.
_TIMES = (
    "time", "zeit", "temps", "tiempo", "tempo", "stamp", "date", "datum", "index", "时间", "時間", "時刻", "日時", "время",
)  # fmt: skip
#: Times whose program writes seconds and no unit: LabVIEW's text files, asammdf's exports, Simulink's.
_SECONDS = frozenset({"x_value", "timestamps", "tout"})

#: Columns that one message names.
_MAX_NAMED = 10


@dataclass(frozen=True, slots=True)
class Taken:
    """A column that is taken: the file's `index`-th as `channel`, with its conversion to the channel's unit.

    `assumed`: neither file nor caller states a unit, and the channel's own was taken. `guessed`: a time by its unit and a
    word in its name, which its values must bear out.
    """

    channel: str
    index: int
    conversion: Conversion
    assumed: bool = False
    guessed: bool = False


def _key(name: str) -> str:
    """Names that differ in case, blanks, dashes, width or in ö for oe are one name.

    Composing letters takes time with the square of the length where accents are piled up: only short names are composed.
    """
    plain = (unicodedata.normalize("NFKC", name) if len(name) <= LONGEST_NAME else name).strip().casefold()
    plain = plain.replace("oel", "öl").replace("ϑ", "theta").replace("ω", "omega")
    return re.sub(r"[\s._\-]+", "_", plain).strip("_")


_BY_KEY = {_key(word): channel for channel, words in _WORDS.items() for word in words.split()}
_BY_KEY |= {name: name for name in CHANNELS}
#: What in a name may say that its values are multiples.
_SCALED = re.compile(r"(?P<sign>[x×*·/]) ?(?P<number>10+|0[.,]0*1)(?![\d^])")
#: Words at either end of a name that say that its values are means.
_MEAN = re.compile(
    r"(?:^(?:mean|average|avg|ave)|[\s_./(-]+(?:mean|average|avg|ave|mittel(?:wert)?|moyenne|moy|media)\)?$)[\s_.-]*",
    re.I,
)
_WIDE = str.maketrans("（）［］｛｝，／：【】", "()[]{},/:[]")
_BRACKETED = re.compile(
    r"(?P<name>.*?)\s*/?\s*(?:\[(?P<square>[^\[\]]*)\]|[({<](?P<unit>[^\[\](){}<>]*)[)}>])[\s:.]*", re.DOTALL
)
#: Where a word of a title may begin: after what is no letter or digit, and at a capital after a small
#: letter that is no prefix of a unit (kNm).
_WORD_STARTS = re.compile(r"(?<![^\W_])(?=[^\W_°])|(?<=[a-jln-zäöüß])(?=[A-Z])|(?<!°)(?=°)")
#: What may stand between a name and its unit: a comma, a slash, "in", blanks or underscores.
_BETWEEN = re.compile(r"\s*[,;:|]\s*|\s*/\s*|\s+in\s+|[\s_]+")


def known_channel(name: str) -> str | None:
    """The public channel that a name stands for, or None; what follows a backslash names a device (`torque\\CAN:1`), and a
    mean may be said to be one (`Torque/AVE`)."""
    bare = name.partition("\\")[0].strip()
    if not 1 < len(bare) <= LONGEST_NAME:
        return _LETTERS.get(bare)
    return _BY_KEY.get(_key(bare)) or _BY_KEY.get(_key(_MEAN.sub("", bare)))


def is_time(column: Column) -> bool:
    """Whether a column is a time by its name, or may be one by its unit."""
    return known_channel(column.name) == "time_s" or _may_be_time(column)


def is_counter(column: Column) -> bool:
    """Whether a time column's title is LabVIEW's, which may count samples."""
    return _key(column.name) == "x_value"


def column_of(text: str, unit: str | None = None, group: str = "") -> Column:
    """A column's title -> name and unit: `torque [Nm]`, `torque (Nm)`, `M / Nm`, `Druck in bar`, `Time, ms`, `speed_rad_s`.

    `unit` is what the file states beside the title. Raises InvalidError on a text that is too long for a title, and where
    the title states another unit.
    """
    title = text.strip()
    if len(title) > LONGEST_TITLE:
        shown = title[:MAX_QUOTED]
        message = (
            f"a column's title must not be longer than {LONGEST_TITLE} characters, got {len(title)}: {shown!r} ..."
        )
        raise InvalidError.of(message, code="title_too_long", value=shown)
    name, own = _taken_apart(" ".join(title.translate(_WIDE).split()))
    column = Column(name, own, group, title)
    return column if unit is None else with_unit(column, unit)


def _taken_apart(title: str) -> tuple[str, str | None]:
    if known_channel(title):
        return title, None
    if match := _BRACKETED.fullmatch(title):
        return match["name"].strip(), bare_unit(match["square"] if match["unit"] is None else match["unit"])
    for name, unit in _endings(title):
        if is_unit(unit) and (known_channel(name) or _stands_apart(title, name, unit)):
            return name, unit
    return title, None


def _stands_apart(title: str, name: str, unit: str) -> bool:
    """Whether what parts a name that is not known from its unit is a sign, which a mere word does not have before it."""
    between = title[len(name) : len(title) - len(unit)].strip()
    return between not in ("", "_") or between == "in"


def _endings(title: str) -> Iterator[tuple[str, str]]:
    """Where a title may be parted into a name and a unit, the longest unit first."""
    for mark in _BETWEEN.finditer(title, max(0, len(title) - LONGEST_UNIT - 4)):
        name, unit = title[: mark.start()].strip(), title[mark.end() :]
        if name and unit:
            yield name, unit


def bare_unit(text: str) -> str | None:
    """A unit without its brackets; None where nothing is stated."""
    unit = text.translate(_WIDE).strip()
    unit = (unit[1:-1] if unit[:1] + unit[-1:] in ("[]", "()", "{}", "<>") else unit).strip().removeprefix("in ")
    return unit if re.search(r"[^-_=?.*/|\s]", unit) else None


def with_unit(column: Column, unit: str | None) -> Column:
    """A column with the unit that the file states beside the name; raises InvalidError where the name states another."""
    stated = bare_unit(unit or "")
    if stated and column.unit and stated != column.unit:
        channel = known_channel(column.name)
        if channel is None or conversion(channel, stated) != conversion(channel, column.unit):
            both = f"{column.unit[:MAX_QUOTED]!r} and {stated[:MAX_QUOTED]!r}"
            message = f"column {column.shown()!r} must be in one unit, got {both}"
            raise InvalidError.of(message, code="mixed_units", value=both)
    return replace(column, unit=stated or column.unit)


def parse_map(mapping: str | None) -> dict[str, Choice]:
    """`torque_nm:Mz,pressure_bar:p1` -> {channel: its column}. Names may hold commas and colons themselves.

    Raises InvalidError where the text is no such list, or a channel in it is unknown or named twice.
    """
    if mapping is None or not mapping.strip():
        return {}
    if len(mapping) > LONGEST_MAP:
        raise _wrong_map(mapping, f"must not be longer than {LONGEST_MAP} characters")
    choices: dict[str, Choice] = {}
    for part in re.split(rf",(?=\s*(?:{'|'.join(CHANNELS)})\s*:)", mapping):
        channel, colon, name = part.partition(":")
        channel, name = channel.strip(), name.strip()
        if not colon or not name:
            raise _wrong_map(part, "must be a list such as torque_nm:Mz,pressure_bar:p1")
        if channel not in CHANNELS:
            raise _wrong_map(channel, f"must name channels from {', '.join(CHANNELS)}")
        if channel in choices:
            raise _wrong_map(channel, "must name each channel once")
        choices[channel] = Choice(column=name)
    return choices


def _wrong_map(value: str, rule: str) -> InvalidError:
    message = f"map {rule}, got {value[:MAX_QUOTED]!r}"
    return InvalidError.of(message, code="invalid_map", pointer="/map", value=value)


def choices_of(reading: Reading) -> dict[str, Choice]:
    """The columns that a caller names, the time column among them."""
    named = dict(reading.mapping)
    if reading.time and reading.time != NO_TIME:
        named.setdefault("time_s", Choice(column=reading.time))
    return named


def recognised(titles: Sequence[str], named: Sequence[str]) -> int:
    """How many titles are those of channels or are `named`: by it the row of titles is found."""
    wanted = {_key(name) for name in named} | {_key(column_of(name).name) for name in named}
    channels: set[str] = set()
    for title in titles:
        if 0 < len(title) <= LONGEST_TITLE:
            column = column_of(title)
            channel = known_channel(column.name) or ("time_s" if is_time(column) else None)
            keys = {_key(title), _key(column.name)} & wanted
            channels |= keys or ({channel} if channel else set())
    return len(channels)


def choose(columns: Sequence[Column], reading: Reading) -> list[Taken]:
    """Which columns are taken, in the order of the file; all others are left out. The time may be taken several times.

    Raises InvalidError where two columns are the same channel, or a unit is unknown or not stated.
    """
    named = choices_of(reading)
    if reading.time == NO_TIME:
        named.pop("time_s", None)
    by_map = {_find(columns, channel, choice.column): channel for channel, choice in named.items()}
    if len(by_map) < len(named):
        shown = ",".join(f"{name}:{choice.column}" for name, choice in named.items())
        raise _wrong_map(shown, "must not name one column for two channels")
    indices: dict[str, list[int]] = {}
    for index, column in enumerate(columns):
        channel = by_map.get(index) or (None if reading.only_named else known_channel(column.name))
        if channel is None or (channel in named and index not in by_map):
            continue
        if channel == "time_s" and reading.time == NO_TIME:
            continue
        indices.setdefault(channel, []).append(index)
    for channel, positions in indices.items():
        plain = [index for index in positions if not _MEAN.search(columns[index].name)]
        if len(positions) > len(plain) > 0:
            positions = indices[channel] = plain  # a mean beside the signal itself
        if len(positions) > 1 and channel != "time_s":
            raise _twice(channel, *(columns[index] for index in positions))
    guessed = {
        index
        for index, column in enumerate(columns)
        if not ({"time_s"} & {*indices, *named})
        and reading.time != NO_TIME
        and not reading.only_named
        and index not in by_map
        and _may_be_time(column)
    }
    if not indices:
        raise InvalidError(f"the file holds no known channel: it has {_list(columns)}; {remedy(columns)}")
    if guessed:
        indices["time_s"] = sorted(guessed)
    taken, without_unit = [], []
    for channel, positions in indices.items():
        for index in positions:
            choice = named.get(channel) if index in by_map else None
            unit = _unit(channel, columns[index], choice)
            public = _key(columns[index].name) == channel
            if unit is None and choice is None and not public:
                without_unit.append((channel, columns[index]))
                continue
            converted = _conversion(channel, columns[index], choice, unit)
            assumed = unit is None and not public
            taken.append(Taken(channel, index, converted, assumed, channel == "time_s" and index in guessed))
    if without_unit:
        raise _no_unit(without_unit, reading)
    return sorted(taken, key=lambda column: column.index)


def _may_be_time(column: Column) -> bool:
    """Whether a column in a unit of time has a word of time in its name, or no name."""
    name = column.name.casefold()
    timed = name in ("", "t") or any(word in name for word in _TIMES)
    return (
        timed
        and known_channel(column.name) is None
        and column.unit is not None
        and conversion("time_s", column.unit) is not None
    )


def _no_unit(columns: Sequence[tuple[str, Column]], reading: Reading) -> InvalidError:
    """The error of columns whose units nobody states, with the one map that takes all of them for the channels' own."""
    errors = []
    for channel, column in columns:
        message = f"{channel} (column {column.shown()!r}): the unit must be stated ({spellings(channel)})"
        errors.append(FieldError(pointer=f"/channels/{channel}", code="missing_unit", message=message))
    named = {channel: choice.column for channel, choice in reading.mapping.items()}
    titles = {channel: column.title or column.shown() for channel, column in columns}
    way = ",".join(f"{channel}:{title}" for channel, title in {**named, **titles}.items())
    own = ", ".join(CHANNELS[channel].unit for channel in titles)
    message = "; ".join(error.message for error in errors)
    return InvalidError(f"{message}, in brackets or in a unit row; map={way} takes it for {own}", errors=errors)


def remedy(columns: Sequence[Column]) -> str:
    """How to name the columns of channels."""
    example = columns[0].shown() if columns else "NAME"
    return f"map=torque_nm:{example},... names the columns of the channels, which are {', '.join(CHANNELS)}"


def _find(columns: Sequence[Column], channel: str, name: str) -> int:
    """The index of the column that a map names: by its exact title or name, else whatever its case, blanks and unit."""
    wanted = column_of(name)
    exact = [
        i for i, column in enumerate(columns) if name in (column.title, column.name, f"{column.group}/{column.name}")
    ]
    alike = [i for i, column in enumerate(columns) if _key(wanted.name) == _key(column.name)]
    for matches in (exact, alike):
        if len(matches) == 1:
            return matches[0]
        if matches:
            raise _twice(channel, *(columns[index] for index in matches))
    message = (
        f"map names for {channel} the column {name[:MAX_QUOTED]!r}, which is not there; there are {_list(columns)}"
    )
    raise InvalidError.of(message, code="no_such_column", pointer="/map", value=name)


def _twice(channel: str, *columns: Column) -> InvalidError:
    names = [column.shown() for column in columns]
    if len(set(names)) < len(names):
        names = [column.title[:MAX_QUOTED] or column.shown() for column in columns]
    shown = " and ".join(names[:_MAX_NAMED])
    distinct = len(set(names)) == len(names)
    way = f"map={channel}:NAME chooses one" if distinct else "their names must differ"
    message = f"{channel} must be one column, got {shown}; {way}"
    return InvalidError.of(message, code="ambiguous", pointer=f"/channels/{channel}", value=shown)


def _list(columns: Sequence[Column]) -> str:
    shown = ", ".join(repr(column.shown()) for column in columns[:_MAX_NAMED])
    return shown if len(columns) <= _MAX_NAMED else f"{shown} and {len(columns) - _MAX_NAMED} more"


def unit_in_title(channel: str, title: str) -> str | None:
    """The unit of the channel that a title ends in, whatever parts them: `Time, ms`, `Mz_kNm`, `timeMs`, `Time..ms.`."""
    if len(title) > LONGEST_NAME:
        return None
    words = [title[start.start() :].strip(" .:,;_-()[]") for start in _WORD_STARTS.finditer(title)]
    return next((word for word in words if is_unit(word) and conversion(channel, word)), None)


def _may_state(channel: str, title: str) -> str | None:
    """A word within a title that is another unit than the channel's own (`Mz [kNm] filtered`), or the unit of a title that
    may say that its values are scaled (`Mz x10`, `Mz/10`); None where there is none."""
    if scaled := _SCALED.search(title[:LONGEST_NAME]):
        factor = float(scaled["number"].replace(",", "."))
        return f"x{factor if scaled['sign'] == '/' else 1 / factor:g} {CHANNELS[channel].unit}"
    for word in re.finditer(r"[^\W\d_]{2,}(?:/[^\W\d_]+)?", title[:LONGEST_NAME]):
        for part in (word[0], word[0][-3:]):
            converted = conversion(channel, part)
            if converted is not None and not converted.is_identity():
                return part
    return None


def _unit(channel: str, column: Column, choice: Choice | None) -> str | None:
    """The unit that the file, the map or the profile states; None where none does.

    A column that a map names may end in its unit, whatever parts them.
    """
    if choice is None:
        return "s" if column.unit is None and _key(column.name) in _SECONDS else column.unit
    public = _key(column.name) == channel
    scaled = _SCALED.search(column.name) is not None
    stated = column.unit or (None if public or scaled else unit_in_title(channel, column.name))
    wanted = choice.unit or (None if choice.column == column.title else column_of(choice.column).unit)
    if wanted and stated not in (None, choice.stated) and conversion(channel, stated) != conversion(channel, wanted):
        rule = f"must be {wanted}, as its profile or map says"
        raise _wrong_unit(channel, column, "mixed_units", rule, repr(stated[:MAX_QUOTED]))
    unit = wanted or stated
    if unit is None and not public and (word := _may_state(channel, column.name)):
        rule = f"may be {word}: map={channel}:{column.name} [{word}], or [{CHANNELS[channel].unit}], says which"
        raise _wrong_unit(channel, column, "missing_unit", rule, "no clear one")
    return unit


def _conversion(channel: str, column: Column, choice: Choice | None, unit: str | None) -> Conversion:
    """The conversion to the channel's unit. A public name states its unit: another unit beside it is a contradiction.

    A column that a map names without a unit is in the channel's unit.
    """
    own, public = CHANNELS[channel].unit, _key(column.name) == channel
    if unit is None:
        converted: Conversion | None = Conversion()
    else:
        converted = conversion(channel, unit)
    if converted is None:
        rule = f"must be a known one ({spellings(channel)})"
        raise _wrong_unit(channel, column, "unknown_unit", rule, repr((unit or "")[:MAX_QUOTED]))
    if public and not converted.is_identity() and choice is None:
        rule = f"is in {own} by its name"
        raise _wrong_unit(channel, column, "mixed_units", rule, repr((unit or "")[:MAX_QUOTED]))
    if choice is not None:
        converted = Conversion(converted.factor * choice.factor, converted.offset * choice.factor + choice.offset)
    return converted


def _wrong_unit(channel: str, column: Column, code: str, rule: str, got: str) -> InvalidError:
    shown = channel if _key(column.name) == channel else f"{channel} (column {column.shown()!r})"
    message = f"{shown}: the unit {rule}, got {got}"
    return InvalidError.of(message, code=code, pointer=f"/channels/{channel}", value=(column.unit or ""))
