"""Units that a file may state and their conversion to the channels' own units (`columns.CHANNELS`); no other is read."""

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass

from models.arrays import FloatArray
from service.channels import CHANNELS, PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.readers.limits import LONGEST_UNIT


@dataclass(frozen=True, slots=True)
class Conversion:
    """Value in the channel's unit = factor · value + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def is_identity(self) -> bool:
        """Whether values are unchanged, bit for bit."""
        return self.factor == 1.0 and self.offset == 0.0

    def apply(self, values: FloatArray) -> None:
        """Convert values [n] in place."""
        if self.factor != 1.0:
            values *= self.factor
        if self.offset != 0.0:
            values += self.offset


_PASCALS_PER_PSI = 6894.757293168361
_NEWTONS_PER_KILOPOND = 9.80665
_NEWTON_METRES_PER_POUND_FOOT = 1.3558179483314004


def _spelled(by_factor: Mapping[float, str], offset: float = 0.0) -> dict[str, Conversion]:
    """The conversions by unit spelling; `by_factor` holds texts of spellings separated by blanks. Capitals, dots and
    dashes need no spelling of their own."""
    return {unit: Conversion(factor, offset) for factor, units in by_factor.items() for unit in units.split()}


_TIME = {
    1.0: "s S sec secs second seconds sek sekunde sekunden seconde secondes segundo segundos secondi с сек 秒 초",
    1e-3: "ms msec millisecond milliseconds millisekunden millisecondes milisegundos millisecondi мс 毫秒 ミリ秒",
    1e-6: "us µs usec µsec microsecond microseconds mikrosekunden microsecondes мкс 微秒 マイクロ秒",
    1e-9: "ns nsec nanosecond nanoseconds nanosekunden",
    60.0: "min mins minute minutes minuten minutos minuti мин 分 分钟 分鐘",
    3600.0: "h hr hrs hour hours std stunde stunden heures horas ore ч 小时 小時 時間",
    86400.0: "d day days tag tage jours días giorni 天",
}
_PRESSURE = {
    1.0: "bar barg barrel barü daN/cm2 бар 巴",
    1e-3: "mbar hPa",
    1 / PASCALS_PER_BAR: "Pa N/m2 pascal",
    1e3 / PASCALS_PER_BAR: "kPa кПа 千帕 kN/m2",
    1e4 / PASCALS_PER_BAR: "N/cm2",
    1e6 / PASCALS_PER_BAR: "MPa N/mm2 Nmm2 MN/m2 МПа 兆帕",
    _PASCALS_PER_PSI / PASCALS_PER_BAR: "psi psig lbf/in2 lb/in2",
    1e3 * _PASCALS_PER_PSI / PASCALS_PER_BAR: "ksi",
    101_325 / 760 / PASCALS_PER_BAR: "Torr mmHg",
    _NEWTONS_PER_KILOPOND * 1e4 / PASCALS_PER_BAR: "kgf/cm2 kg/cm2 kp/cm2 кгс/см2",
}
_SPEED = {
    1.0: "rpm 1/min 1min Umin min-1 /min U/min r/min rmin-1 rev/min revmin-1 Upm Umdr/min revolutions/min tr/min trs/min "
    "tr/mn giri/min obr/min ot/min varv/min omw/min dev/dak dev/dk d/dak d/dk об/мин мин-1 转/分 转/分钟 轉/分 "
    "回転/分 回/分",
    1e3: "krpm 1000/min",
    60.0: "U/s r/s rev/s revs/sec rps tr/s об/с 转/秒 Hz",
    1 / RADIANS_PER_SECOND_PER_RPM: "rad/s rad/sec rads rads-1 radps рад/с 弧度/秒",
    1 / 6: "deg/s °/s",
}
_TORQUE = {
    1.0: "Nm newtonmeter newtonmeters newtonmetre newtonmetres Нм 牛米",
    1e3: "kNm кНм 千牛米",
    1e-3: "mNm Nmm",
    1e-2: "Ncm cNm",
    10.0: "daNm",
    _NEWTONS_PER_KILOPOND: "kgfm kpm кгсм",
    _NEWTONS_PER_KILOPOND / 100: "kgfcm kpcm",
    _NEWTON_METRES_PER_POUND_FOOT: "lbfft lbft ftlbf ftlb ftlbs",
    _NEWTON_METRES_PER_POUND_FOOT / 12: "lbfin lbin inlbf inlb inlbs",
    _NEWTON_METRES_PER_POUND_FOOT / 192: "ozfin ozin inoz inozf",
}
_TEMPERATURE = (
    _spelled({1.0: "°C degC degreeC degreesC gradC C celsius cel 摄氏度"})
    | _spelled({1.0: "K degK kelvin"}, -ZERO_CELSIUS)
    | _spelled({5 / 9: "°F degF F fahrenheit"}, -160 / 9)
)
#: By the channel's unit: the spellings that may be stated.
UNITS = {
    "s": _spelled(_TIME), "bar": _spelled(_PRESSURE), "rpm": _spelled(_SPEED), "Nm": _spelled(_TORQUE), "°C": _TEMPERATURE,
}  # fmt: skip
_OF_EACH = ("time_s", "pressure_bar", "speed_rpm", "torque_nm")
#: Units of no channel, and 1/s, which may be turns or radians: a title that ends in one is not taken for another.
_FOREIGN = (
    "V mV A mA N kN lbf W kW J kJ % ‰ m mm µm cm inch kg g deg ° rad l/min l/h m/s mm/s m/s2 bara psia atm kHz 1/s s-1"
)


def _key(unit: str) -> str:
    """The common form of a unit's spellings: plain characters for wide or raised ones, lower case, without blanks,
    dots, multiplication signs, dashes, carets, underscores and brackets. Empty for an empty unit or one too long to be
    a unit.

    A capital is kept where it tells units apart: K and k; MPa and mPa, MNm and mNm.
    """
    if len(unit) > LONGEST_UNIT:  # a sentence
        return ""
    plain = unicodedata.normalize("NFKC", unit.replace("º", "°")).replace("−", "-").strip()
    key = re.sub(r"[\s·⋅•∙×*・.^_()-]+", "", plain)
    if len(key) == 1:
        return key
    prefix, rest = key[:1], key[1:].casefold()
    return prefix + rest if rest in ("pa", "nm") and prefix in ("m", "M") else key.casefold()


_BY_KEY = {
    name: {_key(spelling): conversion for spelling, conversion in table.items()} for name, table in UNITS.items()
} | {"": dict.fromkeys(map(_key, _FOREIGN.split()), Conversion())}


#: A unit of which a value counts several: `10 ms`, `0.1 Nm`, `1/10 Nm`, `x1000 rpm`, `10^-3 Nm`, `rpm x1000`.
_MULTIPLE = re.compile(
    r"(?P<sign>[x×]?) *(?:(?P<over>1/)?(?P<number>\d+(?:[.,]\d+)?)|10\^(?P<power>[+-]?\d)) *[x×*·]? *(?P<unit>[^\W\d].*)"
)
_AFTER = re.compile(r"(?P<unit>[^\W\d].*?) *[x×*·] *(?P<number>1000|10\^3)")
_RAISED = re.compile(r"(?<=10)[⁺⁻]?[⁰¹²³⁴-⁹]")


def conversion(channel: str, unit: str) -> Conversion | None:
    """The conversion from a stated unit to the channel's own unit; None if the unit is not in the table.

    A unit may be a multiple of one in the table; but `10 bar`, and any other whole number without a sign, may be a sensor's
    range, where it is no time's and no thousand turns. NetCDF's times end in the moment from which they count.
    """
    table = _BY_KEY[CHANNELS[channel].unit]
    unit = re.sub(r" since .*", "", unit) if channel == "time_s" else unit
    if (known := table.get(_key(unit))) is not None:
        return known
    short = _AFTER.sub(r"\g<number> \g<unit>", unit[:LONGEST_UNIT])
    short = _RAISED.sub(lambda power: "^" + unicodedata.normalize("NFKC", power[0]).replace("−", "-"), short)
    multiple = _MULTIPLE.fullmatch(short)
    of = None if multiple is None else table.get(_key(multiple["unit"]))
    if multiple is None or of is None or of.offset != 0:
        return None
    factor = float((multiple["number"] or f"1e{multiple['power']}").replace(",", "."))
    factor = 1 / factor if multiple["over"] and factor else factor
    clear = multiple["sign"] or multiple["power"] or factor < 1 or (channel == "speed_rpm" and factor == 1000)
    return Conversion(of.factor * factor) if channel == "time_s" or clear else None


def is_unit(text: str) -> bool:
    """Whether a text is the spelling of a unit, of any channel or of another quantity."""
    key = _key(text)
    return any(key in table for table in _BY_KEY.values()) or any(conversion(name, text) for name in _OF_EACH)


def spellings(channel: str) -> str:
    """Examples of a channel's units, for a message."""
    examples = ["s, ms, min", "bar, mbar, MPa, kPa, Pa, psi", "rpm, 1/min, rad/s", "Nm, N·m, kNm", "°C, degC, K, °F"]
    return dict(zip(UNITS, examples, strict=True))[CHANNELS[channel].unit]
