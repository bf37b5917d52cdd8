"""All measurements of a quantity so far, as columns."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.criteria import LEVEL_SIZE
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior

#: Values are resolved to this share of the prior's deviations. Where a series is free of noise its likelihood grows
#: without bound as the scatter vanishes, and differences of sums weighted by 1/s² would be rounding alone.
_RESOLUTION = 1e-6
#: Progress below this counts as none, so that ratios to it are finite. Chosen: a millionth of a duty cycle; no table.
LEAST_SPAN = 1e-6
#: What a measurement and a history hold of each test.
COLUMNS = ("progress", "value", "variance", "epoch", "new_levels", "sensor")
_row = attrgetter(*COLUMNS)


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """The measurements so far, in order of arrival: progress, value, variance, epoch, new levels and zeroed sensors,
    each [t]."""

    progress: FloatArray
    value: FloatArray
    variance: FloatArray
    epoch: FloatArray
    new_levels: FloatArray
    sensor: FloatArray

    @classmethod
    def of(cls, measurements: Sequence[Measurement], prior: TrackPrior) -> "History":
        """The columns of a sequence of measurements, possibly empty, with the variance of their resolution added."""
        rows = np.array(list(map(_row, measurements)), dtype=np.float64).reshape(-1, len(COLUMNS))
        columns = dict(zip(COLUMNS, rows.T.copy(), strict=True))
        columns["variance"] += resolution(prior) ** 2
        return cls(**columns)

    def append(self, measurement: Measurement, prior: TrackPrior) -> "History":
        """A history with one more measurement."""
        more = History.of([measurement], prior)
        return History(**{name: np.append(getattr(self, name), getattr(more, name)) for name in COLUMNS})

    @property
    def span(self) -> float:
        """The largest progress measured, 1 where nothing has been beyond LEAST_SPAN."""
        return span_of(self.progress)

    @property
    def steps(self) -> FloatArray:
        """Progress [e] at which each epoch after the first begins, as far as it was measured."""
        begun = [self.progress[self.epoch >= epoch].min() for epoch in later_epochs(self.epoch)]
        return np.array(begun, dtype=np.float64)

    def step_sizes(self, prior: TrackPrior) -> FloatArray:
        """Prior standard deviations [e] of the steps between epochs, as shares of the size of the quantity."""
        sizes = step_sizes(self.epoch, self.new_levels, prior.step_size)
        return np.where(self.reading_steps, LEVEL_SIZE, sizes)

    @property
    def reading_steps(self) -> NDArray[np.bool_]:
        """Whether only a zeroed sensor explains the step at the beginning of each epoch after the first [e]: it was
        zeroed there, and no other event lies there."""
        first = np.unique(self.epoch, return_index=True)[1]
        epochs, levels, zeroed = (np.diff(each[first]) for each in (self.epoch, self.new_levels, self.sensor))
        return np.asarray((zeroed > 0) & (epochs <= zeroed + levels))

    def to_arrays(self) -> dict[str, FloatArray]:
        """The columns by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, FloatArray]) -> "History":
        """The inverse of `to_arrays`."""
        return cls(**{field.name: arrays[field.name] for field in fields(cls)})


def span_of(progress: FloatArray) -> float:
    """The largest progress [t], 1 where nothing has been beyond LEAST_SPAN."""
    span = float(progress.max(initial=0.0))
    return span if span > LEAST_SPAN else 1.0


def later_epochs(epoch: FloatArray) -> list[float]:
    """The epochs after the first, ascending."""
    return sorted(set(epoch.tolist()))[1:]


def step_sizes(epoch: FloatArray, new_levels: FloatArray, step_size: float) -> FloatArray:
    """Prior standard deviations [e] of the level's step at each epoch [t] after the first, as shares of the quantity's
    size: as by an event, or to a new level."""
    known = np.array([new_levels[epoch == each].max() for each in sorted(set(epoch.tolist()))])
    return np.where(np.diff(known) > 0, LEVEL_SIZE, step_size)


def resolution(prior: TrackPrior) -> float:
    """The deviation to which a series of values is resolved."""
    return _RESOLUTION * math.hypot(prior.initial_sd, prior.change_sd)
