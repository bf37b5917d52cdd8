"""Where torque is predicted: plateaus of stationary tests, and evenly spaced phases of loops."""

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.records.criteria import UNLOADED

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Columns [n]: run (index into Design.runs), cycles, pressure [Pa], engaged (1, or 0 where the clutch is open; the
    pressure there is the campaign's lowest closed one, for laws are asked for none beyond, and what they say is no friction
    that acts), velocity [m/s] >= 0, sign ±1, acceleration [m/s²] (of the folded velocity), temperature of the oil [K] (NaN
    where not measured), clock [s] since the test began, moment [s] (NaN where unknown), angular_frequency [rad/s] (0 at
    plateaus), phase [rad], loop (index, -1 at plateaus) and previous (the index of the plateau before it in the same run,
    -1 where there is none)."""

    run: IntArray
    cycles: FloatArray
    pressure: FloatArray
    engaged: FloatArray
    velocity: FloatArray
    sign: FloatArray
    acceleration: FloatArray
    temperature: FloatArray
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
        """Those points; `previous` is cut (-1), for its rows may be gone."""
        columns = {each.name: getattr(self, each.name)[index] for each in fields(self)}
        return Points(**{**columns, "previous": np.full(columns["run"].size, -1, dtype=np.intp)})


def opened(points: Points) -> Points:
    """With what is measured below UNLOADED marked as open."""
    closed = points.pressure >= UNLOADED
    lowest = float(points.pressure[closed].min()) if closed.any() else 1.0
    return replace(points, engaged=closed.astype(np.float64), pressure=np.where(closed, points.pressure, lowest))


def joined(blocks: list[Points]) -> Points:
    """All blocks one after the other; none are no points."""

    def column(name: str) -> list[FloatArray]:
        return [getattr(block, name) for block in blocks] or [np.zeros(0)]

    integers = {name: np.concatenate(column(name)).astype(np.intp) for name in ("run", "loop", "previous")}
    rest = {
        each.name: np.concatenate(column(each.name)).astype(np.float64)
        for each in fields(Points)
        if each.name not in integers
    }
    return Points(**integers, **rest)  # type: ignore[arg-type] # names are the fields' own
