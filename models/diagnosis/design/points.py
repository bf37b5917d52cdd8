"""Where torque is predicted: plateaus of stationary tests, and evenly spaced phases of loops."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records.criteria import UNLOADED

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Columns [n].

    run                index into Design.runs
    cycles
    pressure           [Pa]; where the clutch is open the campaign's lowest closed pressure, for the laws hold for no other
                       (no friction acts there, see `engaged`)
    engaged            1, or 0 where the clutch is open
    velocity           [m/s] >= 0, folded; sign ±1 says which way the clutch turned
    acceleration       [m/s²] of the folded velocity
    temperature        of the oil [K], NaN where not measured
    plate_rise         of the plate above the oil [K], NaN where not measured
    clock              [s] since the test began
    moment             [s] since 1970, NaN where unknown
    angular_frequency  [rad/s], 0 at plateaus
    phase              [rad]
    loop               index, -1 at plateaus
    previous           index of the plateau before it in the same run, -1 where there is none
    """

    run: IntArray
    cycles: FloatArray
    pressure: FloatArray
    engaged: FloatArray
    velocity: FloatArray
    sign: FloatArray
    acceleration: FloatArray
    temperature: FloatArray
    plate_rise: FloatArray
    clock: FloatArray
    moment: FloatArray
    angular_frequency: FloatArray
    phase: FloatArray
    loop: IntArray
    previous: IntArray

    @property
    def steady(self) -> NDArray[np.bool_]:
        """[n] whether it is a plateau."""
        return self.loop < 0

    def take(self, index: IntArray | NDArray[np.bool_]) -> "Points":
        """The points at `index`; `previous` is set to -1, for the plateau that it means may be gone."""
        columns = {field.name: getattr(self, field.name)[index] for field in fields(self)}
        return Points(**{**columns, "previous": np.full(columns["run"].size, -1, dtype=np.intp)})


def mark_open(points: Points) -> Points:
    """With what was measured below UNLOADED marked as an open clutch."""
    closed = points.pressure >= UNLOADED
    lowest = float(points.pressure[closed].min()) if closed.any() else 1.0
    return replace(points, engaged=closed.astype(np.float64), pressure=np.where(closed, points.pressure, lowest))


def concatenate(blocks: list[Points]) -> Points:
    """All blocks one after the other; no blocks give no points."""

    def column(name: str) -> list[FloatArray]:
        return [getattr(block, name) for block in blocks] or [np.zeros(0)]

    integers = {name: np.concatenate(column(name)).astype(np.intp) for name in ("run", "loop", "previous")}
    floats = {
        field.name: np.concatenate(column(field.name)).astype(np.float64)
        for field in fields(Points)
        if field.name not in integers
    }
    return Points(**integers, **floats)  # type: ignore[arg-type] # names are the fields' own
