"""The channels by their public names, with unit and admissible range; conversion to SI happens here and nowhere else."""

import math
from dataclasses import dataclass

from models.arrays import FloatArray

RADIANS_PER_SECOND_PER_RPM = 2 * math.pi / 60
PASCALS_PER_BAR = 1e5
ZERO_CELSIUS = 273.15


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A channel at the edge: SI value = factor · value + offset; values outside [least, most] are refused."""

    name: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0
    least: float
    most: float

    def to_si(self, values: FloatArray) -> FloatArray:
        """Values [n] in the channel's unit to SI [n]; the same array where that is the unit."""
        if self.factor == 1.0 and self.offset == 0.0:
            return values
        converted = values * self.factor
        converted += self.offset
        return converted


#: Ranges are chosen to refuse wrong units and faulty sensors, not unusual clutches. Derived: absolute zero, and no negative
#: pressure, speed or deviation.
CHANNELS = {
    channel.name: channel
    for channel in (
        Channel(name="time_s", unit="s", least=-1e12, most=1e12),
        Channel(name="pressure_bar", unit="bar", factor=PASCALS_PER_BAR, least=0.0, most=1e4),
        Channel(name="speed_rpm", unit="rpm", factor=RADIANS_PER_SECOND_PER_RPM, least=0.0, most=1e6),
        Channel(name="torque_nm", unit="Nm", least=-1e7, most=1e7),
        Channel(name="torque_sd_nm", unit="Nm", least=0.0, most=1e7),
        Channel(name="oil_temperature_c", unit="°C", offset=ZERO_CELSIUS, least=-ZERO_CELSIUS, most=1e4),
    )
}

#: The least value in a sampled record, which passes zero with its sensors' noise. Pressure: derived, a gauge cannot read
#: below a vacuum (-1 bar), and a tenth for its zero.
SAMPLED_LEAST = {"pressure_bar": -1.1, "speed_rpm": -1e6}
