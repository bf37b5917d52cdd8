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
_NEWTONS_PER_KILOPOND = 9.80665
_NEWTON_METRES_PER_POUND_FOOT = 1.3558179483314004
_NEWTON_METRES_PER_POUND_INCH = _NEWTON_METRES_PER_POUND_FOOT / 12
_SAME = Conversion()


def _spelled(factor: float, spellings: str, offset: float = 0.0) -> dict[str, Conversion]:
    """Spellings apart by blanks, all of one conversion."""
    return dict.fromkeys(spellings.split(), Conversion(factor, offset))


_TIME = (
    _spelled(1.0, "s S sec Sec secs second seconds Sekunde Sekunden 秒")
    | _spelled(1e-3, "ms msec millisecond milliseconds Millisekunden 毫秒")
    | _spelled(1e-6, "us µs usec µsec microseconds")
    | _spelled(1e-9, "ns nsec nanoseconds")
    | _spelled(60.0, "min mins minutes Minuten 分")
    | _spelled(3600.0, "h hr hrs hours Stunden")
    | _spelled(86400.0, "d days")
)
_PRESSURE = (
    _spelled(1.0, "bar Bar BAR barg bar_g")
    | _spelled(1e-3, "mbar hPa")
    | _spelled(1 / PASCALS_PER_BAR, "Pa N/m2 N/m^2 pascal")
    | _spelled(1e3 / PASCALS_PER_BAR, "kPa KPa kpa")
    | _spelled(1e6 / PASCALS_PER_BAR, "MPa N/mm2 N/mm^2")
    | _spelled(_PASCALS_PER_PSI / PASCALS_PER_BAR, "psi PSI Psi psig lbf/in2 lbf/in^2")
    | _spelled(_NEWTONS_PER_KILOPOND * 1e4 / PASCALS_PER_BAR, "kgf/cm2 kgf/cm^2 kg/cm2 kg/cm^2 kp/cm2 kp/cm^2")
)
_SPEED = (
    _spelled(1.0, "rpm RPM Rpm 1/min min-1 min^-1 /min U/min u/min r/min R/min rev/min Upm revolutions/min tr/min")
    | _spelled(1e3, "krpm")
    | _spelled(60.0, "U/s r/s rev/s rps")
    | _spelled(1 / RADIANS_PER_SECOND_PER_RPM, "rad/s rad/sec rad_s rad.s-1 rad*s^-1 rad*s-1")
    | _spelled(1 / 6, "deg/s °/s")
)
_TORQUE = (
    _spelled(1.0, "Nm N.m N*m N-m NM nm newtonmeter")
    | _spelled(1e3, "kNm kN.m kN*m kN-m knm")
    | _spelled(1e-3, "mNm mN.m mN*m mN-m Nmm N*mm N.mm N-mm")
    | _spelled(1e-2, "Ncm N*cm N.cm N-cm")
    | _spelled(_NEWTONS_PER_KILOPOND, "kgfm kgf.m kgf*m kgf-m kpm kp*m")
    | _spelled(
        _NEWTON_METRES_PER_POUND_FOOT,
        "lbf.ft lbf*ft lbf-ft lb.ft lb*ft lb-ft lbft lbfft ft.lbf ft*lbf ft-lbf ftlbf ft.lb ft*lb ft-lb ft-lbs ftlb",
    )
    | _spelled(
        _NEWTON_METRES_PER_POUND_INCH,
        "lbf.in lbf*in lbf-in lb.in lb*in lb-in lbin lbfin in.lbf in*lbf in-lbf in.lb in*lb in-lb in-lbs inlb",
    )
)
_TEMPERATURE = (
    _spelled(1.0, "°C degC DegC degreeC C °c Celsius celsius Cel")
    | _spelled(1.0, "K kelvin Kelvin", -ZERO_CELSIUS)
    | _spelled(5 / 9, "°F degF DegF F Fahrenheit fahrenheit", -160 / 9)
)
#: Units of no channel, and 1/s, which may be turns or radians: a title that ends in one is not taken for another.
_FOREIGN = frozenset(
    "V mV A mA N kN lbf W kW J kJ % ‰ m mm µm cm inch kg g deg ° rad l/min L/min l/h m/s mm/s m/s2 m/s^2 bara psia atm Hz "  # noqa: SIM905
    "kHz 1/s s-1 s^-1".split()
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
        "℉": "°F",
        "／": "/",
    }
)


def conversion(channel: str, unit: str) -> Conversion | None:
    """From a stated unit to the channel's own; None where the unit is not in the table."""
    table = UNITS[CHANNELS[channel].unit]
    written = _written(unit)
    return table.get(written) or table.get(written.replace(" ", "")) if written else None


def is_unit(text: str) -> bool:
    """Whether a text is the spelling of a unit, of any channel or of another quantity."""
    return _written(text) in _FOREIGN or any(conversion(name, text) is not None for name in CHANNELS)


def _written(unit: str) -> str:
    """One spelling of what is written in several ways; empty for what is too long for a unit."""
    return unicodedata.normalize("NFC", unit).translate(_AS_WRITTEN).strip() if len(unit) <= LONGEST_UNIT else ""


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
