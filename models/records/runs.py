"""The shape-checked values of all that is measured: the steady plateaus of a stationary test, a sampled record, a curve.

A stationary Stribeck test holds pressure and speed on a plateau and measures torque; one row is one plateau. A curve is
the rows of one pressure level. Measured pressures scatter about their level, so levels are estimated, not assumed.
"""

from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.clutch import Geometry
from models.records.criteria import UNLOADED
from models.records.pressure_levels import levels_of


@dataclass(frozen=True, slots=True, kw_only=True)
class _Columns:
    """Columns of one length, of finite numbers, with one row at least; other input raises ValueError."""

    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray

    def __post_init__(self) -> None:
        rows = self.torque.shape
        if len(rows) != 1 or rows[0] == 0:
            raise ValueError(f"torque must be a column with at least one row, got shape {rows}")
        for name, column in self._measured().items():
            if column.shape != rows:
                raise ValueError(f"{name} must have the shape of torque {rows}, got {column.shape}")
            if not np.isfinite(column).all():
                raise ValueError(f"{name} must be finite")

    def _measured(self) -> dict[str, FloatArray]:
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: column for name, column in columns.items() if column is not None}

    def take(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Self:
        """The record at `rows`, at least one."""
        return replace(self, **{name: column[rows] for name, column in self._measured().items()})


@dataclass(frozen=True, slots=True, kw_only=True)
class Plateaus(_Columns):
    """Steady plateaus, one row each: pressure [n] Pa, speed [n] rad/s, torque [n] Nm.

    `torque_sd` [n] Nm is the deviation of each torque where it is known, `oil_temperature` and `plate_temperature` [n] K
    where they are measured. Raises ValueError on unequal lengths, no rows or values that are not finite.
    """

    torque_sd: FloatArray | None = None
    oil_temperature: FloatArray | None = None
    plate_temperature: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Record(_Columns):
    """A sampled record: time [n] s, pressure [n] Pa, speed [n] rad/s, torque [n] Nm, perhaps oil_temperature and
    plate_temperature [n] K.

    Times are as the recorder gave them: they may jitter, lack samples or repeat; speeds and pressures may swing through
    zero with their sensors' noise. Raises ValueError on unequal lengths, no rows or values that are not finite.
    """

    time: FloatArray
    oil_temperature: FloatArray | None = None
    plate_temperature: FloatArray | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One pressure level of a stationary test: velocity [n] m/s, torque [n] Nm, torque_sd [n] Nm or None.

    `pressure` [Pa] names the level; `mean_pressure` [Pa] is what was measured on average and what a COF is taken with.
    """

    pressure: float
    mean_pressure: float
    velocity: FloatArray
    torque: FloatArray
    torque_sd: FloatArray | None = None


def plate_rise(measured: Plateaus | Record) -> FloatArray | None:
    """Temperature rise [n] K of the plate above the oil; above its own lowest temperature where the oil's was not
    measured, for then only its changes mean something. None where the plate's was not measured."""
    plate, oil = measured.plate_temperature, measured.oil_temperature
    if plate is None:
        return None
    return np.asarray(plate - (plate.min() if oil is None else oil), dtype=np.float64)


def loaded(plateaus: Plateaus) -> Plateaus | None:
    """The plateaus at a pressure of UNLOADED or more, through which curves are fitted; None where the clutch was open
    on all."""
    rows = plateaus.pressure >= UNLOADED
    if not rows.any():
        return None
    return plateaus.take(rows)


def curves_by_pressure(plateaus: Plateaus, geometry: Geometry) -> tuple[Curve, ...]:
    """The curves of a stationary test, one a pressure level, pressures ascending, rows in the order they were sent."""
    levels = levels_of(plateaus.pressure)
    velocity = geometry.sliding_velocity(plateaus.speed)
    curves = []
    for level in np.unique(levels):
        rows = levels == level
        curves.append(
            Curve(
                pressure=float(level),
                mean_pressure=float(plateaus.pressure[rows].mean()),
                velocity=velocity[rows],
                torque=plateaus.torque[rows],
                torque_sd=None if plateaus.torque_sd is None else plateaus.torque_sd[rows],
            )
        )
    return tuple(curves)
