"""Remaining useful life: when a quantity first passes the threshold, with the uncertainty of everything it depends on.

The criterion is ξ(ζ) <= fraction · ξ0, with ξ0 the value at ζ = 0. Each draw of the coefficients has its own ξ0,
hence its own threshold. Eq. 6 alone passes it in closed form, and saturates: a draw whose ξ0 + Δ stays above its
threshold never gets there. With a discrepancy beside eq. 6, or a known further course of the quantity, the first
passage is computed along the draw's path. The probability of getting there is part of the result; a quantile that lies
beyond the horizon is None, never an infinity.

A life may have several limits, each a share of a quantity's value at ζ = 0, or a value that it falls below or rises above:
the first to be reached counts.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.degradation import general_order
from models.prognosis.criteria import BAND, HORIZON, QUANTILES
from models.tracking.discrepancy import CourseDiscrepancy
from models.tracking.posterior import TrackPosterior
from models.tracking.sampling import systematic

#: Of these every so many'th is looked at first. A dip below the threshold and back between two of them is not seen: the
#: course beside eq. 6 bends some twenty times, and steps are looked at by themselves.
_STRIDE = 6
#: Parts of these places, one after the other: of a part only the draws are looked at that have not passed before it.
_PARTS = 3

#: A given course over ζ [k] that is added to eq. 6, in the quantity's unit; [b, k] for each branch of the sample
#: (`TrackPosterior.branch`), or [1, k] for all.
Offset: TypeAlias = Callable[[FloatArray], FloatArray]


class PassageStatus(StrEnum):
    """Whether the threshold is ahead, more likely than not behind, or may never be reached within the horizon."""

    PREDICTED = "predicted"
    REACHED = "reached"
    MAY_NEVER_REACH = "may_never_reach"


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstPassage:
    """End of life [cycles since new] by quantile, None beyond the horizon.

    `probability_of_reaching` is that of reaching the threshold within the horizon. `initial` is the mean of the value
    at ζ = 0, `threshold` fraction · initial, `current` the mean and deviation of the value now, where friction is
    not negative.
    """

    end_of_life: dict[float, float | None]
    probability_of_reaching: float
    status: PassageStatus
    initial: float
    threshold: float
    current: tuple[float, float]


def horizon_at(age: float) -> float:
    """Horizon [cycles since new] of the search for an end of life at this age: ten times the age, and HORIZON at least.
    A life counts engagements, or kilometres, and an end that is nine ages ahead is no nearer than never."""
    return max(HORIZON, 10.0 * age)


def predict_first_passage(
    posterior: TrackPosterior,
    *,
    fraction: float,
    as_of: float,
    horizon: float = HORIZON,
    quantiles: Sequence[float] = QUANTILES,
    offset: Offset | None = None,
    stated: tuple[FloatArray, FloatArray] | None = None,
    initial: float | None = None,
) -> FirstPassage:
    """The end of life of a weighted sample of coefficients; 0 < fraction < 1, as_of >= 0 and horizon > 0 in cycles.

    With an `offset` the criterion is ξ(ζ) + offset(ζ) <= fraction · (ξ0 + offset(0)). A sample of the end of life with its
    weights that is `stated` counts in place of the coefficients' own, as does an `initial` value. A
    horizon before `as_of` is taken to be `as_of`. Raises ValueError where an argument is out of its range.
    """
    if not 0.0 < fraction < 1.0:
        raise ValueError(f"fraction must lie between 0 and 1, got {fraction}")
    if not (np.isfinite(as_of) and as_of >= 0.0):
        raise ValueError(f"as_of must be finite and not negative, got {as_of}")
    if not (np.isfinite(horizon) and horizon > 0.0):
        raise ValueError(f"horizon must be finite and positive, got {horizon}")
    horizon = max(horizon, as_of)
    if stated is None:
        stated = ends_of_life(posterior, fraction, offset=offset, horizon=horizon), posterior.weight
    passages, weight = stated
    values = weighted_quantiles(np.minimum(passages, 10.0 * horizon), weight, quantiles)
    end = {q: float(x) if x <= horizon else None for q, x in zip(quantiles, values, strict=True)}
    fresh, now = paths(posterior, np.array([0.0, as_of]), offset)
    initial = float(posterior.weight @ fresh) if initial is None else initial
    return FirstPassage(
        end_of_life=end,
        probability_of_reaching=_probability(passages <= horizon, weight),
        status=_status(end, _probability(passages <= as_of, weight)),
        initial=initial,
        threshold=fraction * initial,
        current=posterior.moments(np.maximum(now, 0.0)),
    )


def ends_of_life(
    posterior: TrackPosterior, fraction: float, *, offset: Offset | None = None, horizon: float = HORIZON
) -> FloatArray:
    """First ζ [n] at which each draw has ξ(ζ) <= fraction · ξ0; inf where it never has. A draw whose rate grows without
    bounds has passed every threshold there.

    Of a draw that has a discrepancy, or with an offset, only passages up to the horizon are computed.
    """
    posterior = posterior.of_clutch
    threshold = fraction * posterior.initial
    crossing = general_order.first_passage(threshold, posterior.degradation)
    passages = np.where(posterior.initial <= threshold, 0.0, crossing)
    discrepancy = posterior.discrepancy
    if offset is None and discrepancy is None:
        return np.minimum(passages, posterior.course_end)
    walked = np.ones(passages.size, dtype=bool) if offset is not None or discrepancy is None else discrepancy.present
    index = np.flatnonzero(walked)
    if index.size:
        walked_draws = posterior.taken(index, posterior.weight[index])
        passages[index] = _along_paths(walked_draws, fraction, offset, horizon)
    return np.minimum(passages, posterior.course_end)


def widened(
    passages: FloatArray, weight: FloatArray, *, as_of: float, horizon: float, powers: tuple[float, float]
) -> FloatArray:
    """Passages [n] with remaining life raised, as a multiple of its median (or of the horizon where the median lies
    beyond it), to the first of two powers >= 1 before the median and the second after it. A life that has ended, more
    likely than not, is unchanged."""
    remaining = passages - as_of
    middle = float(weighted_quantiles(np.minimum(remaining, horizon - as_of), weight, (0.5,))[0])
    if powers == (1.0, 1.0) or middle <= 0.0:
        return passages
    power = np.where(remaining < middle, *powers)
    with np.errstate(over="ignore"):
        raised = middle * (np.maximum(remaining, 0.0) / middle) ** power
    return np.where(remaining > 0.0, as_of + raised, passages)


def paths(posterior: TrackPosterior, progress: FloatArray, offset: Offset | None = None) -> FloatArray:
    """Paths ξ(ζ) + offset(ζ) [k, n] of the clutch at progress [k] of every draw."""
    values = posterior.of_clutch.values(progress)
    return values if offset is None else np.asarray(values + posterior.beside(offset(progress)))


def bands(posterior: TrackPosterior, progress: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean [k] of ξ at progress [k], and its quantiles BAND [k, 3], for a plot of the course."""
    values = posterior.values(progress)
    return values @ posterior.weight, np.array([weighted_quantiles(row, posterior.weight, BAND) for row in values])


def _along_paths(posterior: TrackPosterior, fraction: float, offset: Offset | None, horizon: float) -> FloatArray:
    """First passages [n], by linear interpolation between places; a step of the level or of the offset is a crossing
    where it is.

    The draws' paths are taken at every `_STRIDE`-th place and about the steps, and then at the places between the two of
    these that a draw's passage lies between. An offset may dip anywhere: beside one all places are taken.
    """
    places, steps = _places(posterior.discrepancy, horizon)
    course = np.zeros((places.size, 1)) if offset is None else posterior.beside(offset(places))
    stride = _STRIDE if offset is None else 1
    sparse = np.unique(np.concatenate([np.arange(0, places.size, stride), steps, steps - 1, [places.size - 1]]))
    count = posterior.weight.size
    # of every draw the place at which it first lies below, and the one before; its level
    first, before, level = np.full(count, -1), np.zeros(count, dtype=np.intp), np.zeros(count)
    left = np.arange(count)
    for rows in np.array_split(np.arange(sparse.size), _PARTS):
        draws = posterior.taken(left, posterior.weight[left]) if left.size < count else posterior
        above = draws.values(places[sparse[rows]]) + _of_draws(course[sparse[rows]], left)
        if rows[0] == 0:
            level = fraction * above[0]
        below = above <= level[left]
        found, row = below.any(axis=0), rows[below.argmax(axis=0)]
        first[left[found]], before[left[found]] = sparse[row[found]], sparse[np.maximum(row[found] - 1, 0)]
        left = left[~found]
        if left.size == 0:
            break
    passed = np.flatnonzero(first >= 0)
    index = np.minimum(before[passed] + np.arange(_STRIDE + 1)[:, None], first[passed])
    path_rows = np.zeros(1, dtype=np.intp) if course.shape[1] == 1 else passed
    near = posterior.taken(passed, posterior.weight[passed]).values(places[index]) + course[index, path_rows]
    passages = np.full(count, np.inf)
    passages[passed] = first_below(near, places[index], level[passed])
    return passages


def _of_draws(course: FloatArray, draws: NDArray[np.intp]) -> FloatArray:
    """The rows [k, m] of some draws of a course [k, n], or [k, 1] where it is one for all."""
    return course if course.shape[1] == 1 else course[:, draws]


def _places(beside: CourseDiscrepancy | None, horizon: float) -> tuple[FloatArray, NDArray[np.intp]]:
    """Ascending progress at which paths are evaluated, and the indices in it of the steps after the first place."""
    span = 1.0 if beside is None else beside.span
    at = np.zeros(0) if beside is None else beside.at[(beside.at > 0.0) & (beside.at <= horizon)]
    end = min(span, horizon)
    places = np.union1d(path_places(end, horizon, 40, 240), at)
    return places, np.searchsorted(places, at)


def path_places(now: float, horizon: float, behind: int, ahead: int) -> FloatArray:
    """Progress ζ [behind + ahead - 1] at which paths are evaluated: evenly from 0 to `now` > 0, and in equal ratios to
    `horizon`."""
    return np.concatenate([np.linspace(0.0, now, behind), np.geomspace(now, horizon, ahead)[1:]])


def first_below(paths: FloatArray, progress: FloatArray, level: FloatArray) -> FloatArray:
    """First ζ [n] at which each path [k, n] over ascending progress [k] or [k, n] falls to its level [n], by linear
    interpolation between places; inf where it never does."""
    below = paths <= level
    first = below.argmax(axis=0)
    before = np.maximum(first - 1, 0)
    draws = np.arange(paths.shape[1])
    high, low = paths[before, draws], paths[first, draws]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where(first > 0, (high - level) / (high - low), 0.0)
    places = np.broadcast_to(progress if progress.ndim == 2 else progress[:, None], paths.shape)
    crossed = places[before, draws] + share * (places[first, draws] - places[before, draws])
    return np.where(below.any(axis=0), crossed, np.inf)


def weighted_quantiles(sample: FloatArray, weight: FloatArray, quantiles: Sequence[float]) -> FloatArray:
    """Quantiles of a finite sample [n] with weights [n] >= 0, by linear interpolation between the middles of the draws'
    shares."""
    order = np.argsort(sample, kind="stable")
    share = weight[order] / weight.sum()
    return np.asarray(np.interp(quantiles, np.cumsum(share) - 0.5 * share, sample[order]))


def _probability(event: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], weight: FloatArray) -> float:
    """The share of the weight at which an event is true."""
    return float(min(1.0, weight[event].sum() / weight.sum()))


def _status(end_of_life: dict[float, float | None], passed: float) -> PassageStatus:
    """The status of a prediction, by the probability that the end has passed and by the quantiles that are open."""
    if passed >= 0.5:
        return PassageStatus.REACHED
    return PassageStatus.MAY_NEVER_REACH if None in end_of_life.values() else PassageStatus.PREDICTED


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A limit of a quantity, exactly one of: `fraction` of the initial value, a value `below` or `above` which the
    quantity may not get.

    Raises ValueError where none or several are given, or one is not finite, or fraction lies outside (0, 1).
    """

    fraction: float | None = None
    below: float | None = None
    above: float | None = None

    def __post_init__(self) -> None:
        given = [number for number in (self.fraction, self.below, self.above) if number is not None]
        if len(given) != 1 or not math.isfinite(given[0]):
            raise ValueError("exactly one of fraction, below and above must be given, and be finite")
        if self.fraction is not None and not 0.0 < self.fraction < 1.0:
            raise ValueError(f"fraction must lie between 0 and 1, got {self.fraction}")

    def level(self, initial: FloatArray | float) -> FloatArray:
        """The value at which the limit is reached, for an initial value of any shape."""
        if self.fraction is not None:
            return np.asarray(self.fraction * np.asarray(initial))
        fixed = self.below if self.below is not None else self.above
        return np.full(np.shape(initial), fixed)

    def passages(self, paths: FloatArray, progress: FloatArray) -> FloatArray:
        """First ζ [n] at which each path [k, n] over ascending progress [k] reaches the limit; inf where it never does.

        A path that begins past its limit counts only after it has come back to the good side. One that never comes back is
        at the limit from the first ζ.
        """
        sign = -1.0 if self.above is not None else 1.0
        from_above, level = sign * paths, sign * self.level(paths[0])
        was_good = np.logical_or.accumulate(from_above > level, axis=0)
        return first_below(np.where(was_good | ~was_good[-1], from_above, np.inf), progress, level)


def places(now: float, horizon: float) -> FloatArray:
    """Progress ζ [k] at which paths are evaluated: evenly up to `now` >= 0, the present age, and in equal ratios to
    `horizon`."""
    start = max(now, 1.0)
    return path_places(start, max(horizon, 2.0 * start), 40, 200)


def first_reached(
    ends: Sequence[tuple[FloatArray, FloatArray]], size: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """The earliest of several ends, `size` draws of equal weight, and the probability [c] of each to be the earliest.

    `ends` are weighted samples, each of ends [n] (inf: never) with weights [n] that sum to one. A draw in which none is
    ever reached counts for none. At least one is needed. Given its own tests the error of one quantity's end is taken to be
    independent of the others', for each limit looks at another quantity or another pressure.
    """
    drawn = np.stack([rng.permutation(sample[systematic(weight, size, rng.random())]) for sample, weight in ends])
    first = drawn.min(axis=0)
    reached = np.isfinite(first)
    which = np.bincount(drawn.argmin(axis=0)[reached], minlength=len(ends))
    return first, which / size
