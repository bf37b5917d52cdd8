"""The channels of a run: names, units, valid ranges, the check of their values, and when two contents are the same.

Channels are converted to SI here and nowhere else; what units a file states are brought to the channels' own before
(`readers.unit_table`). Contents are compared by value: 7000, 7000.0 and 7e3 are one number, an instant is the same in every
time zone, and texts are compared in Unicode's normal form C.
"""

import hashlib
import json
import math
import unicodedata
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from models.arrays import FloatArray
from service.errors import MAX_ERRORS, MAX_QUOTED, FieldError, InvalidError

RADIANS_PER_SECOND_PER_RPM = 2 * math.pi / 60
PASCALS_PER_BAR = 1e5
ZERO_CELSIUS = 273.15


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A channel with its public unit: SI value = factor · value + offset; values outside [least, most] are refused."""

    name: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0
    least: float
    most: float

    def to_si(self, values: FloatArray) -> FloatArray:
        """Values [n] converted from the channel's unit to SI [n]; the same array if the units are equal."""
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
        Channel(name="plate_temperature_front_c", unit="°C", offset=ZERO_CELSIUS, least=-ZERO_CELSIUS, most=1e4),
        Channel(name="plate_temperature_rear_c", unit="°C", offset=ZERO_CELSIUS, least=-ZERO_CELSIUS, most=1e4),
    )
}

#: The plate's thermometers, front and rear: their mean is the plate's temperature.
PLATE_TEMPERATURES = ("plate_temperature_front_c", "plate_temperature_rear_c")

#: The least value in a sampled record, which passes zero with its sensors' noise. Pressure: derived, a gauge cannot read
#: below a vacuum (-1 bar), and a tenth for its zero.
SAMPLED_LEAST = {"pressure_bar": -1.1, "speed_rpm": -1e6}


def whole(value: float) -> float | int:
    """A number for JSON: an integer if it is whole, so that 7000.0 is sent as 7000."""
    return int(value) if value.is_integer() and abs(value) < 2**53 else value


def bar(pressure: float) -> float:
    """A pressure in bar, from Pa, without rounding noise in the last bits."""
    return round(pressure / PASCALS_PER_BAR, 9)


#: Row of a column, from 0 -> its line in the file, from 1.
LineOf = Callable[[int], int]


def place(name: str, row: int, line_of: LineOf | None) -> str:
    """A value's place in a channel, for an error message."""
    return f"{name}[{row}]" + (f" (line {line_of(row)})" if line_of else "")


class _Errors:
    """The first MAX_ERRORS errors, and the total number. Rows of a file are given with their line."""

    def __init__(self, kept: list[FieldError], line_of: LineOf | None) -> None:
        self.kept, self.total, self._line_of = kept, len(kept), line_of

    def add_row(self, name: str, index: int, value: object, code: str, rule: str) -> None:
        """Count an error of one value, and keep it if there is room."""
        self.total += 1
        if len(self.kept) >= MAX_ERRORS:
            return
        shown = repr(value)[:MAX_QUOTED] if isinstance(value, str | list | dict) else str(value)[:MAX_QUOTED]
        message = f"{place(name, index, self._line_of)} {rule}, got {shown}"
        pointer = f"/channels/{name}/{index}"
        self.kept.append(FieldError(pointer=pointer, row=index + 1, value=shown, code=code, message=message))


def check_columns(
    columns: Mapping[str, Sequence[Any] | FloatArray], *, line_of: LineOf | None = None
) -> dict[str, FloatArray]:
    """Columns checked and converted to float64 [n], by public channel name; values keep every bit.

    Raises InvalidError where a column is empty, lengths differ, or a value is not a finite number within its channel's
    range. The error lists at most 50 places and says how many there are in all; with `line_of` it names the lines of the
    file too.
    """
    errors = _Errors(_wrong_lengths(columns), line_of)
    checked = {}
    for name, values in columns.items():
        column = values if isinstance(values, np.ndarray) else _numbers(name, values, errors)
        if column is not None:
            _check_range(name, column, errors, sampled="time_s" in columns)
            checked[name] = column
    if errors.total:
        more = "" if errors.total == 1 else f"; {errors.total} errors in all"
        raise InvalidError(errors.kept[0].message + more, errors=errors.kept, total=errors.total)
    return checked


def _wrong_lengths(columns: Mapping[str, Sequence[Any] | FloatArray]) -> list[FieldError]:
    """An error for each channel that is empty or shorter than the longest one."""
    errors = []
    rows = max((len(values) for values in columns.values()), default=0)
    for name, values in columns.items():
        size, pointer = len(values), f"/channels/{name}"
        if size == 0:
            errors.append(FieldError(pointer=pointer, code="empty", message=f"{name} must not be empty"))
        elif size != rows:
            message = f"{name} must be as long as the longest channel ({rows} rows), got {size} rows"
            errors.append(FieldError(pointer=pointer, row=size + 1, value=str(size), code="ragged", message=message))
    return errors


def _numbers(name: str, values: Sequence[Any], errors: _Errors) -> FloatArray | None:
    """The values as 64-bit floats; None, with each wrong row added to `errors`, if some are not numbers or too large."""
    if not set(map(type, values)) <= {int, float}:
        for index, value in enumerate(values):
            if type(value) not in (int, float):
                errors.add_row(name, index, value, "not_a_number", "must be a number")
        return None
    try:
        return np.asarray(values, dtype=np.float64)
    except OverflowError:
        for index, value in enumerate(values):
            if isinstance(value, int) and abs(value) > 1e300:
                errors.add_row(name, index, value, "out_of_range", "must be smaller than 1e308")
        return None


def _check_range(name: str, column: FloatArray, errors: _Errors, *, sampled: bool) -> None:
    """Add an error for each value of a column outside its channel's valid range."""
    channel = CHANNELS[name]
    least = SAMPLED_LEAST.get(name, channel.least) if sampled else channel.least
    if least <= column.min(initial=least) and column.max(initial=least) <= channel.most:
        return  # what is not a number is neither
    good = (column >= least) & (column <= channel.most)
    wrong = np.flatnonzero(~good)
    errors.total += max(0, wrong.size - MAX_ERRORS)
    for index in wrong[:MAX_ERRORS]:
        value = float(column[index])
        if not math.isfinite(value):
            errors.add_row(name, int(index), value, "not_finite", "must be finite")
        elif value < 0 <= least:
            errors.add_row(name, int(index), value, "negative", "must not be negative")
        else:
            rule = f"must lie between {least:g} and {channel.most:g} {channel.unit}"
            errors.add_row(name, int(index), value, "out_of_range", rule)


#: Values of a column that are hashed at once: bounds the copy that is made of them. Chosen.
_BLOCK = 1 << 16


def canonical(value: Any) -> Any:
    """A JSON value, or a datetime with a time zone, in one fixed notation for comparison."""
    if isinstance(value, Mapping):
        return {name: canonical(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [canonical(item) for item in value]
    if isinstance(value, str):
        return unicodedata.normalize("NFC", value)
    if isinstance(value, float):
        return whole(value)
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat()
    return value


def instant(stated: str | None) -> datetime | None:
    return None if stated is None else datetime.fromisoformat(stated)


def content_of(record: Mapping[str, Any] | Sequence[Any]) -> str:
    """The sha256 of a record; equal values give equal hashes. Raises ValueError if a number is not finite."""
    return _digest(record).hexdigest()


def content_with_columns(record: Sequence[Any], columns: Mapping[str, FloatArray]) -> str:
    """The hash of a record with columns [n] of finite numbers: every bit counts, except the sign of a zero."""
    digest = _digest(record)
    for name in sorted(columns):
        column = columns[name]
        digest.update(f"\n{name}:{column.size}\n".encode())
        for start in range(0, column.size, _BLOCK):
            digest.update(np.asarray(column[start : start + _BLOCK] + 0.0, dtype="<f8").data)
    return digest.hexdigest()


def _digest(record: Mapping[str, Any] | Sequence[Any]) -> "hashlib._Hash":
    return hashlib.sha256(json.dumps(canonical(record), sort_keys=True, allow_nan=False).encode())
