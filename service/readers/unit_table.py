"""Units that a file may state and their conversion to the channels' own units (`columns.CHANNELS`); no other is read."""

import unicodedata
from dataclasses import dataclass

from models.arrays import FloatArray
from service.columns import CHANNELS, PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.readers.limits import LONGEST_UNIT


@dataclass(frozen=True, slots=True)
class Conversion:
    """Value in the channel's unit = factor · value + offset."""

    factor: float = 1.0
    offset: float = 0.0

    def is_identity(self) -> bool:
        """Whether values stay as they are, bit for bit."""
        return self.factor == 1.0 and self.offset == 0.0

    def apply(self, values: FloatArray) -> None:
        """Convert values [n] in place."""
        if self.factor != 1.0:
            values *= self.factor
        if self.offset != 0.0:
            values += self.offset


_PASCALS_PER_PSI = 6894.757293168361
_NEWTON_METRES_PER_POUND_FOOT = 1.3558179483314004
_SAME = Conversion()


def _spelled(conversion: Conversion, *spellings: str) -> dict[str, Conversion]:
    return dict.fromkeys(spellings, conversion)


_TIME = (
    _spelled(_SAME, "s", "S", "sec", "Sec", "secs", "second", "seconds", "Sekunde", "Sekunden")
    | _spelled(Conversion(1e-3), "ms", "msec", "milliseconds")
    | _spelled(Conversion(1e-6), "us", "µs")
    | _spelled(Conversion(1e-9), "ns")
    | _spelled(Conversion(60.0), "min", "minutes", "Minuten")
    | _spelled(Conversion(3600.0), "h", "hours", "Stunden")
)
_PRESSURE = (
    _spelled(_SAME, "bar", "Bar", "BAR")
    | _spelled(Conversion(1e-3), "mbar", "hPa")
    | _spelled(Conversion(1 / PASCALS_PER_BAR), "Pa", "N/m2", "N/m^2", "pascal")
    | _spelled(Conversion(1e3 / PASCALS_PER_BAR), "kPa", "KPa", "kpa")
    | _spelled(Conversion(1e6 / PASCALS_PER_BAR), "MPa", "N/mm2", "N/mm^2")
    | _spelled(Conversion(_PASCALS_PER_PSI / PASCALS_PER_BAR), "psi", "PSI", "Psi", "lbf/in2", "lbf/in^2")
)
_SPEED = _spelled(
    _SAME, "rpm", "RPM", "Rpm", "1/min", "min-1", "min^-1", "/min", "U/min", "u/min", "r/min", "rev/min", "Upm"
) | _spelled(Conversion(1 / RADIANS_PER_SECOND_PER_RPM), "rad/s", "rad/sec", "rad_s", "rad.s-1", "rad*s^-1", "rad*s-1")
_TORQUE = (
    _spelled(_SAME, "Nm", "N.m", "N*m", "N-m", "NM", "nm", "newtonmeter")
    | _spelled(Conversion(1e3), "kNm", "kN.m", "kN*m", "knm")
    | _spelled(Conversion(1e-3), "mNm", "mN.m", "mN*m")
    | _spelled(Conversion(_NEWTON_METRES_PER_POUND_FOOT), "lbf.ft", "lbf*ft", "ft.lbf", "ft*lbf", "lbfft", "ftlbf")
)
_TEMPERATURE = (
    _spelled(_SAME, "°C", "degC", "DegC", "deg C", "degreeC", "C", "°c", "Celsius", "celsius")
    | _spelled(Conversion(1.0, -ZERO_CELSIUS), "K", "kelvin", "Kelvin")
    | _spelled(Conversion(5 / 9, -160 / 9), "°F", "degF", "DegF", "deg F", "F", "Fahrenheit", "fahrenheit")
)

#: By the channel's unit: the spellings that may be stated; capitals count (mPa is not MPa).
UNITS = {"s": _TIME, "bar": _PRESSURE, "rpm": _SPEED, "Nm": _TORQUE, "°C": _TEMPERATURE}

_AS_WRITTEN = str.maketrans(
    {
        "·": "*",
        "⋅": "*",
        "•": "*",
        "∙": "*",
        "×": "*",
        "⁻": "-",
        "−": "-",
        "¹": "1",
        "²": "2",
        "º": "°",
        "μ": "µ",
        "℃": "°C",
    }
)


def conversion(channel: str, unit: str) -> Conversion | None:
    """From a stated unit to the channel's own; None where the unit is not in the table."""
    if len(unit) > LONGEST_UNIT:
        return None
    table = UNITS[CHANNELS[channel].unit]
    written = unicodedata.normalize("NFC", unit).translate(_AS_WRITTEN).strip()
    return table.get(written) or table.get(written.replace(" ", ""))


def is_unit(text: str) -> bool:
    """Whether a text is the spelling of any unit of any channel."""
    return any(conversion(name, text) is not None for name in CHANNELS)


def spellings(channel: str) -> str:
    """Examples of the units that a channel may be in, for a message."""
    examples = {
        "s": "s, ms, min",
        "bar": "bar, mbar, MPa, kPa, Pa, psi",
        "rpm": "rpm, 1/min, rad/s",
        "Nm": "Nm, N·m, kNm",
        "°C": "°C, degC, K, °F",
    }
    return examples[CHANNELS[channel].unit]
