"""The shape-checked values that flow through everything: the steady plateaus of a stationary test and its curves.

A stationary Stribeck test holds pressure and speed on a plateau and measures torque; one row is one plateau. A curve is
the rows of one pressure level. Measured pressures scatter about their level, so levels are found, not assumed.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.clutch import Geometry

#: Pressures further apart than this belong to different levels: 0.12 bar, or 2.5 % of the pressure where that is more.
LEVEL_GAP = 0.12e5
LEVEL_GAP_SHARE = 0.025
#: Below this [Pa] the clutch is open: what is read says nothing of the lining's friction.
UNLOADED = 0.05e5
#: A level within 0.02 bar of a multiple of 0.05 bar is called by that multiple.
LEVEL_STEP = 0.05e5
LEVEL_SNAP = 0.02e5


@dataclass(frozen=True, slots=True, kw_only=True)
class Plateaus:
    """Steady plateaus, one row each: pressure [n] Pa, speed [n] rad/s, torque [n] Nm.

    `torque_sd` [n] Nm is the deviation of each torque where it is known, `oil_temperature` [n] K where it is measured.
    Raises ValueError on unequal lengths, no rows or values that are not finite.
    """

    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray
    torque_sd: FloatArray | None = None
    oil_temperature: FloatArray | None = None

    def __post_init__(self) -> None:
        _require_columns(self, ("pressure", "speed", "torque", "torque_sd", "oil_temperature"))

    def take(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> "Plateaus":
        """Those rows, at least one."""
        columns = {each.name: getattr(self, each.name) for each in fields(self)}
        return replace(self, **{name: column[rows] for name, column in columns.items() if column is not None})


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """A sampled record: time [n] s, pressure [n] Pa, speed [n] rad/s, torque [n] Nm, perhaps oil_temperature [n] K.

    Times are as the recorder gave them: they may jitter, lack samples or repeat; speeds and pressures may swing through
    zero with their sensors' noise. Raises ValueError on unequal lengths, no rows or values that are not finite.
    """

    time: FloatArray
    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray
    oil_temperature: FloatArray | None = None

    def __post_init__(self) -> None:
        _require_columns(self, ("time", "pressure", "speed", "torque", "oil_temperature"))


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


def _require_columns(columns: Plateaus | Record, names: tuple[str, ...]) -> None:
    rows = columns.torque.shape
    if len(rows) != 1 or rows[0] == 0:
        raise ValueError(f"torque must be a column with at least one row, got shape {rows}")
    for name in names:
        column = getattr(columns, name)
        if column is None:
            continue
        if column.shape != rows:
            raise ValueError(f"{name} must have the shape of torque {rows}, got {column.shape}")
        if not np.isfinite(column).all():
            raise ValueError(f"{name} must be finite")


def loaded(plateaus: Plateaus) -> Plateaus | None:
    """The plateaus through which curves go, those of UNLOADED or more; None where the clutch was open on all."""
    rows = plateaus.pressure >= UNLOADED
    if not rows.any():
        return None
    return plateaus.take(rows)


def pressure_levels(pressure: FloatArray) -> FloatArray:
    """Name the level of each measured pressure [n] Pa: equal names, same level. Returns [n] Pa.

    Sorted pressures are cut where neighbours lie further apart than LEVEL_GAP (or LEVEL_GAP_SHARE); where every distinct
    value stands in three rows or more they are nominal values already, and each is a level.
    """
    distinct, inverse, counts = np.unique(pressure, return_inverse=True, return_counts=True)
    gaps = np.diff(distinct)
    if counts.min() >= 3:
        group = np.arange(distinct.size)
    else:
        group = np.concatenate([[0], np.cumsum(gaps > np.maximum(LEVEL_GAP, LEVEL_GAP_SHARE * distinct[1:]))])
    member = group[inverse]
    names = np.array([_level_name(float(np.median(pressure[member == g]))) for g in range(group[-1] + 1)])
    return np.asarray(names[member], dtype=np.float64)


def _level_name(median: float) -> float:
    snapped = round(median / LEVEL_STEP) * LEVEL_STEP
    return snapped if snapped > 0 and abs(median - snapped) <= LEVEL_SNAP else round(median, 1)


def curves_by_pressure(plateaus: Plateaus, geometry: Geometry) -> tuple[Curve, ...]:
    """The curves of a stationary test, one a pressure level, pressures ascending, rows in the order they were sent."""
    levels = pressure_levels(plateaus.pressure)
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
