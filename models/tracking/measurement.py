"""The input of a filter: the fitted value of a quantity, with the variance of its fit."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One fitted value of the quantity at progress ζ >= 0 (cycles), with the variance >= 0 of its fit.

    `epoch` >= 0 counts the events so far that may have shifted the level (an oil change, a zeroed sensor): measurements
    of one epoch share a level. `new_levels` >= 0 of these epochs begin with a level that the tests show to be new,
    whether or not an event declares it; `sensor` >= 0 of the events zeroed a sensor, which shifts readings alone. Raises
    ValueError where a number is not finite or negative where it must not be.
    """

    progress: float
    value: float
    variance: float
    epoch: int = 0
    new_levels: int = 0
    sensor: int = 0

    def __post_init__(self) -> None:
        if (  # as it is nearly always: there are many of them
            0.0 <= self.progress < math.inf
            and 0.0 <= self.variance < math.inf
            and -math.inf < self.value < math.inf
            and 0 <= self.epoch < math.inf
            and 0 <= self.new_levels < math.inf
            and 0 <= self.sensor < math.inf
        ):
            return
        for name in ("progress", "value", "variance", "epoch", "new_levels", "sensor"):
            number = getattr(self, name)
            if not math.isfinite(number):
                raise ValueError(f"{name} must be finite, got {number}")
            if name != "value" and number < 0:
                raise ValueError(f"{name} must not be negative, got {number}")
