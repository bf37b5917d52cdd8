"""What a filter gives, and the steps that all filters have.

A filter follows one quantity ξ (mean COF, or one Stribeck parameter at one pressure) along eq. 6. A step returns a
new state; randomness is an argument; a measurement is the fitted value with the fit's variance, to which the unknown
scatter between runs is added, which the filter estimates.
"""

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.degradation.general_order import Degradation
from models.tracking.discrepancy import Discrepancy
from models.tracking.linear_model import basis
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """A weighted sample of eq. 6's coefficients, all arrays [n]; weight >= 0 sums to one.

    `scatter` is the deviation from run to run, in the unit of the quantity; `discrepancy` the deviation of
    each draw from eq. 6, if there is one.
    """

    weight: FloatArray
    initial: FloatArray
    change: FloatArray
    scale: FloatArray
    exponent: FloatArray
    scatter: FloatArray
    discrepancy: Discrepancy | None = None

    @property
    def degradation(self) -> Degradation:
        """The sample as coefficients of eq. 6, each [n]."""
        return Degradation(initial=self.initial, change=self.change, scale=self.scale, exponent=self.exponent)

    def values(self, progress: FloatArray) -> FloatArray:
        """ξ at progress ζ >= 0 [k], or [k, n] where draws differ, discrepancy and all; [k, n]."""
        share = basis(progress if progress.ndim == 2 else progress[:, None], np.log(self.scale), np.log(self.exponent))
        law = self.initial + self.change * share
        return law if self.discrepancy is None else np.asarray(law + self.discrepancy(progress))

    def taken(self, index: NDArray[np.intp], weight: FloatArray) -> "Posterior":
        """The draws at `index`, with new weights."""
        return Posterior(
            weight=weight,
            initial=self.initial[index],
            change=self.change[index],
            scale=self.scale[index],
            exponent=self.exponent[index],
            scatter=self.scatter[index],
            discrepancy=None if self.discrepancy is None else self.discrepancy.taken(index),
        )

    def moments(self, sample: FloatArray) -> tuple[float, float]:
        """Weighted mean and deviation of a function of the coefficients, evaluated at the sample [n]."""
        mean = float(self.weight @ sample)
        return mean, math.sqrt(max(0.0, float(self.weight @ np.square(sample - mean))))


State = TypeVar("State")


class Tracker(Protocol[State]):
    """A filter for the coefficients of eq. 6. Same seeds, same answers; a state is never changed in place."""

    @property
    def name(self) -> str:
        """What the public contract calls it: `grid`, `particle` or `ukf`."""

    def start(self, prior: Prior) -> State:
        """The state before the first measurement."""

    def update(self, state: State, measurement: Measurement, rng: np.random.Generator) -> State:
        """The state after one more measurement; measurements may come in any order of progress."""

    def posterior(self, state: State, size: int, rng: np.random.Generator) -> Posterior:
        """About `size` weighted draws of the coefficients given all measurements so far."""
