"""A new run: the checked request with its unchanged channels, and its conversion to the models' units."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.records.cleaning import stands
from models.records.criteria import UNLOADED
from models.records.pressure_levels import levels_of
from models.records.runs import Plateaus, Record
from service.api.base import Origin
from service.channels import CHANNELS, PLATE_TEMPERATURES, content_with_columns, instant
from service.clutch.criteria import MAX_LEVELS, MIN_TORQUE_SD
from service.errors import InvalidError


@dataclass(frozen=True, slots=True, kw_only=True)
class IncomingRun:
    """A run as the rig sent it. `channels` are in the units of their names, `details` is what else was said.

    `file` describes the file that it was read from (None: it was sent otherwise): `filename`, `sha256`, `bytes`, the `rig`
    whose profile was applied, `reading` (all by which it was read) and the `warnings` of reading. It is no part of the
    content: the same channels sent another way are the same run.
    """

    kind: str
    cycles: float
    run_id: str
    content_sha256: str = ""
    started_at: str | None = None
    origin: Origin = "measured"
    channels: Mapping[str, FloatArray] = field(default_factory=dict)
    details: Mapping[str, Any] = field(default_factory=dict)
    file: Mapping[str, Any] | None = None


def name_run(run: IncomingRun) -> IncomingRun:
    """The run with its content's hash and, if none was given, a name derived from it.

    Raises InvalidError where a stationary test holds neither a curve that could be fitted nor an open clutch, and where the
    time of a dynamic test steps back or stands still.
    """
    content = content_hash(run)
    if run.kind == "dynamic_stribeck":
        _require_forward(run.channels["time_s"])
    if run.kind == "stationary_stribeck" and "time_s" not in run.channels:
        _require_readings(run.channels)
    return replace(run, run_id=run.run_id or f"{run.kind}-{content[:16]}", content_sha256=content)


def content_hash(run: IncomingRun) -> str:
    """The sha256 of a run's content without its name: kind, cycles, instant, origin, details and every value of every
    channel."""
    return content_with_columns(
        [run.kind, run.cycles, instant(run.started_at), run.origin, dict(run.details)], run.channels
    )


def sampled_record(channels: Mapping[str, FloatArray]) -> Record:
    """A sampled record in SI units."""
    si = {name: CHANNELS[name].to_si(values) for name, values in channels.items()}
    return Record(
        time=si["time_s"],
        pressure=si["pressure_bar"],
        speed=si["speed_rpm"],
        torque=si["torque_nm"],
        oil_temperature=si.get("oil_temperature_c"),
        plate_temperature=_plate_temperature(si),
    )


def _plate_temperature(si: Mapping[str, FloatArray]) -> FloatArray | None:
    """The mean of the plate's thermometers [n] K; None if there is none."""
    measured = [si[name] for name in PLATE_TEMPERATURES if name in si]
    return np.asarray(sum(measured) / len(measured), dtype=np.float64) if measured else None


@dataclass(frozen=True, slots=True)
class SampledChannels:
    """A sampled record with channels converted to SI units on access: converting all at once would need two thirds more
    memory."""

    channels: Mapping[str, FloatArray]

    def _si(self, name: str) -> FloatArray:
        return CHANNELS[name].to_si(self.channels[name])

    @property
    def time(self) -> FloatArray:
        """[n] s."""
        return self._si("time_s")

    @property
    def pressure(self) -> FloatArray:
        """[n] Pa."""
        return self._si("pressure_bar")

    @property
    def speed(self) -> FloatArray:
        """[n] rad/s."""
        return self._si("speed_rpm")

    @property
    def torque(self) -> FloatArray:
        """[n] Nm."""
        return self._si("torque_nm")

    @property
    def oil_temperature(self) -> FloatArray | None:
        """[n] K."""
        return self._si("oil_temperature_c") if "oil_temperature_c" in self.channels else None

    @property
    def plate_temperature(self) -> FloatArray | None:
        """[n] K."""
        return _plate_temperature({name: self._si(name) for name in PLATE_TEMPERATURES if name in self.channels})


def stationary_plateaus(channels: Mapping[str, FloatArray]) -> Plateaus:
    """The plateaus of a stationary test in SI units, rows as sent. Standard deviations of torque have a lower limit;
    all are ignored if one is 0, because then noise was not measured."""
    si = {name: CHANNELS[name].to_si(values) for name, values in channels.items()}
    deviation = si.get("torque_sd_nm")
    if deviation is not None:
        under_load = si["pressure_bar"] >= UNLOADED
        torque = si["torque_nm"][under_load] if under_load.any() else si["torque_nm"]
        deviation = np.maximum(deviation, MIN_TORQUE_SD * float(np.sqrt(np.mean(torque**2))))
    return Plateaus(
        pressure=si["pressure_bar"],
        speed=si["speed_rpm"],
        torque=si["torque_nm"],
        torque_sd=deviation if deviation is not None and bool((channels["torque_sd_nm"] > 0).all()) else None,
        oil_temperature=si.get("oil_temperature_c"),
        plate_temperature=_plate_temperature(si),
    )


def _require_forward(time: FloatArray) -> None:
    """Raise InvalidError if a record's time steps back or stands still between rows."""
    if stands(time):
        still = np.count_nonzero(np.diff(time) == 0)
        message = f"time_s does not advance in {still} of {time.size - 1} steps: send finer times"
        raise InvalidError.of(message, code="time_stands", pointer="/channels/time_s")
    back = np.flatnonzero(np.diff(time) < 0)
    if back.size:
        row = int(back[0]) + 1
        value = f"{time[row]:.9g}"
        message = (
            f"time_s[{row}] must not step back, got {value} s after {time[row - 1]:.9g} s: the recorder's clock "
            "restarted or wrapped around, or two records stand in one; send each by itself"
        )
        pointer = f"/channels/time_s/{row}"
        raise InvalidError.of(message, code="time_backwards", pointer=pointer, value=value, row=row + 1)


def _require_readings(channels: Mapping[str, FloatArray]) -> None:
    """Raise InvalidError if a test has no information: zero torque, an open clutch at rest, or pressed rows that form
    no curve."""
    torque, speed, pressure = channels["torque_nm"], channels["speed_rpm"], channels["pressure_bar"]
    if (pressure * CHANNELS["pressure_bar"].factor >= UNLOADED).any():
        _require_curve(torque, speed, pressure)
    elif not speed.any():
        open_ = f"the clutch is open (all pressures below {UNLOADED / 1e5:g} bar)"
        _refuse_all("speed_rpm", speed, "open_at_rest", f"{open_}, so at least one speed must differ from zero")
    if not torque.any():
        _refuse_all("torque_nm", torque, "torque_all_zero", "at least one torque must differ from zero")


def _require_curve(torque: FloatArray, speed: FloatArray, pressure: FloatArray) -> None:
    """Raise InvalidError if pressed rows form no Stribeck curve, or more than a test may have."""
    if torque.size == 1:
        _refuse("torque_nm", torque, "too_few_points", "a Stribeck curve needs more than one point, got 1")
    levels = np.unique(levels_of(pressure * CHANNELS["pressure_bar"].factor)).size
    if levels > MAX_LEVELS:
        rule = f"a test may have at most {MAX_LEVELS} pressure levels, got {levels}. Send it as several tests"
        _refuse("pressure_bar", pressure, "too_many_levels", rule)
    if (speed == speed[0]).all():
        _refuse_all("speed_rpm", speed, "speeds_all_equal", "a Stribeck curve needs more than one speed")


def _refuse_all(name: str, column: FloatArray, code: str, rule: str) -> None:
    """Raise InvalidError for a column because of the value of all its rows."""
    rows = "" if column.size == 1 else f" in all {column.size} rows"
    _refuse(name, column, code, f"{rule}, got {column[0]:g}{rows}")


def _refuse(name: str, column: FloatArray, code: str, rule: str) -> None:
    raise InvalidError.of(f"{name}: {rule}", code=code, pointer=f"/channels/{name}/0", value=f"{column[0]:g}", row=1)
