"""What a filter gives, and the steps that all filters have.

A filter follows one quantity ξ (mean COF, or one Stribeck parameter at one pressure) along eq. 6. A step returns a
new state; randomness is an argument; a measurement is the fitted value with the fit's variance, to which the unknown
scatter between runs is added, which the filter estimates.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.degradation.general_order import DegradationLaw
from models.tracking.courses import UNIT_OF_CHANGE, basis, coordinates_of, course_of, form_of
from models.tracking.criteria import UNSEEN_WEAR
from models.tracking.discrepancy import BY_DRAW, CourseDiscrepancy
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior


class SampleStatus(StrEnum):
    """Whether a weighted sample has enough effective draws to represent the posterior."""

    SOUND = "sound"
    FEW_DRAWS = "few_draws"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPosterior:
    """A weighted sample of eq. 6's coefficients, all arrays [n]; weight >= 0 sums to one.

    `scatter` is the deviation from run to run, in the unit of the quantity; where it is `proportional` (None: nowhere), that
    of a value of the prior's size. `discrepancy` is the deviation of each draw from its course, if there is one; `branch`
    which series of measurements a draw was tracked under, where there are several (`mixture`). From these follow, of every
    draw, the `course` (`courses.CourseForm`), and log φ and log ε as the priors know them
    (`courses.coordinates_of`), each [n].
    """

    weight: FloatArray
    initial: FloatArray
    change: FloatArray
    scale: FloatArray
    exponent: FloatArray
    scatter: FloatArray
    proportional: NDArray[np.bool_] | None = None
    discrepancy: CourseDiscrepancy | None = None
    branch: NDArray[np.intp] | None = None
    course: NDArray[np.intp] = field(init=False, repr=False, compare=False)
    log_scale: FloatArray = field(init=False, repr=False, compare=False)
    log_exponent: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        course = course_of(self.scale, self.exponent)
        log_scale, log_exponent = coordinates_of(self.scale, self.exponent, course)
        for name, column in (("course", course), ("log_scale", log_scale), ("log_exponent", log_exponent)):
            object.__setattr__(self, name, column)

    @property
    def effective_draws(self) -> float:
        """Effective sample size 1/Σ w²."""
        return 1.0 / float(np.square(self.weight).sum())

    @property
    def status(self) -> SampleStatus:
        """Whether the sample has enough effective draws to represent the posterior."""
        # a 5 % quantile rests on five draws then
        return SampleStatus.SOUND if self.effective_draws >= 100.0 else SampleStatus.FEW_DRAWS

    @property
    def form(self) -> NDArray[np.intp]:
        """The form of every draw [n] (`courses`)."""
        none = np.zeros(self.weight.size)
        size = none if self.discrepancy is None else self.discrepancy.size
        return form_of(self.course, size, none > 0.0 if self.proportional is None else self.proportional)

    @property
    def degradation(self) -> DegradationLaw:
        """The sample as coefficients of eq. 6's family, each [n]."""
        return DegradationLaw(initial=self.initial, change=self.change, scale=self.scale, exponent=self.exponent)

    @property
    def of_clutch(self) -> "TrackPosterior":
        """The sample for the clutch itself, without the level steps of zeroed sensors, which are in the readings
        only."""
        if self.discrepancy is None or (clutch := self.discrepancy.of_clutch) is self.discrepancy:
            return self
        return replace(self, discrepancy=clutch)

    def values(self, progress: FloatArray) -> FloatArray:
        """ξ [k, n] of every draw at progress ζ >= 0, [k] or [k, n] where it differs between draws, discrepancy
        included."""
        discrepancy, zeta = self.discrepancy, progress if progress.ndim == 2 else progress[:, None]
        values = self._without_knee(progress)
        furthest = float(progress.max(initial=0.0))
        if discrepancy is None or not (discrepancy.knee < furthest).any():
            return values
        knee = np.minimum(discrepancy.knee, furthest)
        at_knee = self._without_knee(knee[None])[0]
        worn = np.maximum(self.initial - at_knee, 0.0) + UNSEEN_WEAR * self.initial
        level = np.where(zeta > knee, np.minimum(values, at_knee), values)
        return np.asarray(level - discrepancy.steepening * (worn / knee) * np.maximum(zeta - knee, 0.0))

    def _without_knee(self, progress: FloatArray) -> FloatArray:
        """ξ [k, n] of every draw at progress [k] or [k, n] as if it had no knee: eq. 6's course with δ, which beyond
        the measured span goes on with the course's own progress."""
        zeta = progress if progress.ndim == 2 else progress[:, None]
        share = self._share(zeta)
        law = self.initial + self.change * share
        if self.discrepancy is None:
            return law
        span = self.discrepancy.span
        if progress.ndim == 1 and progress.max(initial=0.0) <= span:
            return np.asarray(law + self.discrepancy.measured(progress))
        full_share = np.broadcast_to(self._share(np.full((1, 1), span)), share.shape)
        zeta_kept = np.broadcast_to(
            zeta, share.shape
        ).copy()  # where rounding leaves nothing of a course up to the span
        np.divide(span * share, full_share, out=zeta_kept, where=full_share != 0.0)
        zeta_kept = np.maximum(zeta, zeta_kept)
        return np.asarray(law + self.discrepancy(np.where(zeta > span, zeta_kept, zeta), zeta))

    def _share(self, progress: FloatArray) -> FloatArray:
        """Basis b [k, n] of every draw at progress [k, n] or [k, 1]."""
        return np.asarray(basis(progress, self.log_scale, self.log_exponent, self.course) * UNIT_OF_CHANGE[self.course])

    @property
    def course_end(self) -> FloatArray:
        """Progress ζ [n] at which a draw falls without bounds; inf where it does not."""
        cliff = (self.scale < 0.0) & (self.exponent > -1.0) & (self.change < 0.0)
        return np.where(cliff, np.abs(self.scale), np.inf)

    def scatter_variance(self, value: float, prior: TrackPrior) -> FloatArray:
        """Variance of the run-to-run scatter at a value, by draw [n]."""
        if self.proportional is None:
            return np.square(self.scatter)
        return np.asarray(np.square(self.scatter) * np.where(self.proportional, prior.relative_squared(value), 1.0))

    def taken(self, index: NDArray[np.intp], weight: FloatArray) -> "TrackPosterior":
        """The draws at `index`, with new weights."""
        columns = ("initial", "change", "scale", "exponent", "scatter", "proportional", "branch")
        rows = {name: getattr(self, name) for name in columns}
        rows_taken: dict[str, Any] = {name: column[index] for name, column in rows.items() if column is not None}
        discrepancy = None if self.discrepancy is None else self.discrepancy.taken(index)
        return replace(self, weight=weight, discrepancy=discrepancy, **rows_taken)

    def beside(self, offsets: FloatArray) -> FloatArray:
        """Offsets [k, n] of the draws from offsets of the branches [b, k]; [k, 1] if all branches share one row
        [1, k]."""
        if self.branch is None or len(offsets) == 1:
            return offsets[:1].T
        return np.asarray(offsets[self.branch].T)

    def of_branch(self, branch: int) -> "TrackPosterior":
        """The draws of one branch, weights normalised."""
        if self.branch is None:
            return self
        index = np.flatnonzero(self.branch == branch)
        return self.taken(index, self.weight[index] / self.weight[index].sum())

    def moments(self, sample: FloatArray) -> tuple[float, float]:
        """Weighted mean and standard deviation of a function of the coefficients, given its values at the draws [n]."""
        mean = float(self.weight @ sample)
        return mean, math.sqrt(max(0.0, float(self.weight @ np.square(sample - mean))))


def joined(parts: Sequence[TrackPosterior]) -> TrackPosterior:
    """One sample with the draws of all parts, which share one history of progress, weights unchanged."""
    names = [field.name for field in fields(TrackPosterior) if field.init]
    return TrackPosterior(**{name: _joined([getattr(part, name) for part in parts]) for name in names})


def mixture(parts: Sequence[tuple[float, TrackPosterior]]) -> TrackPosterior:
    """A mixture of posteriors under several series of measurements: part i has its weight and becomes branch i."""
    weighted = [
        replace(part, weight=weight * part.weight, branch=np.full(part.weight.size, branch))
        for branch, (weight, part) in enumerate(parts)
    ]
    return joined(weighted)


def _joined(columns: Sequence[Any]) -> Any:
    """Concatenated columns of several samples; for discrepancies, their columns by draw are concatenated and the shared
    fields kept."""
    first = columns[0]
    if isinstance(first, CourseDiscrepancy):
        rows = {name: np.concatenate([getattr(column, name) for column in columns]) for name in BY_DRAW}
        return CourseDiscrepancy(span=first.span, at=first.at, of_readings=first.of_readings, **rows)
    return None if first is None else np.concatenate(columns)


State = TypeVar("State")


class Tracker(Protocol[State]):
    """A filter for the coefficients of eq. 6. Same seeds, same answers; a state is never changed in place."""

    @property
    def name(self) -> str:
        """The filter's name in the public API: `grid`, `particle` or `ukf`."""

    def start(self, prior: TrackPrior) -> State:
        """The state before the first measurement."""

    def update(self, state: State, measurement: Measurement, rng: np.random.Generator) -> State:
        """The state after one more measurement; measurements may come in any order of progress."""

    def posterior(self, state: State, size: int, rng: np.random.Generator) -> TrackPosterior:
        """About `size` weighted draws of the coefficients given all measurements so far."""
