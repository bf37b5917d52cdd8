"""A long history with its older tests merged into bins: what they say of the coefficients at a cost that does not grow.

Given scatter s, tests at nearly one progress say the same as their number n, their mean ȳ and the sum S of squares about it:

    Σ log N(y_i | f, d) = n log N(ȳ | f, d) - S / (2 d),   d = v + s²

exactly where the course f and the variance d are the same for all of them. A bin holds tests of one epoch over which f is
nearly a parabola: S is taken about the one of least squares through the bins around, and ȳ freed of its bend, since what the
course does within a bin is no scatter. With u the share of the measured progress and t tests, bins are of equal width in

    c(u) = LINEAR u + LOGARITHMIC [log(1 + t u) - log(1 + t (1 - u))]

for a course may fall fast at the start and at the end, and have a knee anywhere. A bin whose tests scatter more than is
usual, as where the level steps, is split in halves.

Apart stay the newest tests, the first of each epoch, and those that may or may not be outlying by how far they are off the
median of their neighbours. One that probably is outlying is binned with others of its kind, by the variance of such runs.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.criteria import DOUBTFUL, LINEAR, LOGARITHMIC, MAX_APART, MAX_SPLIT, NEWEST, SPLIT_FROM, UNMERGED
from models.tracking.history import History
from models.tracking.prior import TrackPrior

#: Tests on either side of one that say where it should lie, and that say how far tests scatter.
_BESIDE, _ABOUT = 5, 100
#: Bins on either side of one that say how the course runs through it.
_AROUND = 3
#: The median of a squared standard normal.
_MEDIAN = 0.4549


@dataclass(frozen=True, slots=True, kw_only=True)
class MergedHistory(History):
    """A history of which a row may stand for several tests: `count` of them [t], at their mean progress and value, and
    `within` [t], the sum of their squares about it."""

    count: FloatArray
    within: FloatArray

    @property
    def single(self) -> NDArray[np.bool_]:
        """Whether a row is one test [t]."""
        return np.asarray(self.count == 1.0)


def merged(history: History, prior: TrackPrior) -> History:
    """The history with its older tests merged; unchanged if it has no more than UNMERGED tests."""
    if history.value.size <= UNMERGED:
        return history
    order = np.argsort(history.progress, kind="stable")
    progress, value, variance = history.progress[order], history.value[order], history.variance[order]
    epoch, levels, sensor = history.epoch[order], history.new_levels[order], history.sensor[order]
    scatter, apart, certain = judged(value, variance, epoch, prior)
    variance = variance + np.where(certain, (prior.outlying_size * prior.size) ** 2, 0.0)
    weight = 1.0 / (variance + scatter)
    number = np.where(apart, np.arange(value.size), bins_of(progress))
    of = _distinct(epoch, certain, apart, number)
    for _ in range(MAX_SPLIT + 1):
        bins, first = _Bins(of=of, weight=weight), np.unique(of, return_index=True)[1]
        at, level = bins.mean(progress), bins.mean(value)
        sound = ~certain[first] & ~apart[first]
        slope, bend = _course(at, level, bins.total, epoch[first], sound)
        ahead = progress - at[of]
        bulge = 0.5 * bend[of] * (np.square(ahead) - bins.mean(np.square(ahead))[of])
        left = np.square(value - level[of] - slope[of] * ahead - bulge)
        # how far the tests of a bin are off the course between its neighbours, in deviations of what is usual
        excess = (bins.sum(weight * left) / bins.count - 1.0) * np.sqrt(0.5 * bins.count)
        worst = int(np.argmax(np.where(sound & (bins.count > 1.0), excess, 0.0)))
        if not (sound[worst] and excess[worst] >= SPLIT_FROM):
            break
        inside = of == worst
        of = np.where(inside & (np.cumsum(inside) > 0.5 * bins.count[worst]), bins.count.size, of)
    alone, rows = bins.count == 1.0, np.argsort(at, kind="stable")
    usual = bins.count / bins.total - bins.mean(scatter)
    columns = {
        "progress": np.where(alone, progress[first], at),
        "value": np.where(alone, value[first], level - 0.5 * bend * bins.mean(np.square(ahead))),
        "variance": np.where(alone, variance[first], np.maximum(usual, variance.min())),
        "epoch": epoch[first],
        "new_levels": levels[first],
        "sensor": sensor[first],
        "count": bins.count,
        "within": np.where(alone, 0.0, bins.sum(np.square(weight) * left) * np.square(bins.count / bins.total)),
    }
    return MergedHistory(**{name: column[rows] for name, column in columns.items()})


def judged(
    value: FloatArray, variance: FloatArray, epoch: FloatArray, prior: TrackPrior
) -> tuple[FloatArray, NDArray[np.bool_], NDArray[np.bool_]]:
    """Three columns [t] for tests in ascending progress: the scatter variance beside each test's own, whether the test
    is kept apart from merging, and whether it is otherwise taken as outlying."""
    off, scatter = _off_neighbours(value, variance, epoch)
    log_odds = _log_odds(off, variance + scatter, prior)
    apart = _apart(log_odds, epoch)
    return scatter, apart, (log_odds > 0.0) & ~apart


def _distinct(*columns: NDArray[Any]) -> NDArray[np.intp]:
    """Which of the distinct rows of several columns [t], in ascending order, each row is [t]."""
    order = np.lexsort(columns[::-1])
    begins = np.zeros(order.size, dtype=bool)
    for column in columns:
        begins[1:] |= np.diff(column[order]) != 0
    of = np.empty(order.size, dtype=np.intp)
    of[order] = np.cumsum(begins)
    return of


class _Bins:
    """A grouping of weighted tests into bins: `of` is each test's bin [t], `weight` its weight [t]."""

    def __init__(self, of: NDArray[np.intp], weight: FloatArray) -> None:
        self.of, self._weight = of, weight
        self.count, self.total = self.sum(np.ones(of.size)), self.sum(weight)

    def sum(self, column: FloatArray) -> FloatArray:
        """The sum over the tests of each bin [k]."""
        return np.asarray(np.bincount(self.of, column), dtype=np.float64)

    def mean(self, column: FloatArray) -> FloatArray:
        """The weighted mean over the tests of each bin [k]."""
        return self.sum(self._weight * column) / self.total


def _off_neighbours(value: FloatArray, variance: FloatArray, epoch: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Deviation of each test from the median of its neighbours in its epoch [t], and the local scatter variance beside
    the test's own [t]."""
    off, scatter = np.empty(value.size), np.empty(value.size)
    for each in np.unique(epoch):
        rows = np.flatnonzero(epoch == each)
        medians = _medians(value[rows], _BESIDE)
        for half in range(min(_BESIDE, (rows.size - 1) // 2)):  # a course falls: no more on one side than on the other
            for place in (half, rows.size - 1 - half):
                medians[place] = np.median(value[rows[place - half : place + half + 1]])
        off[rows] = value[rows] - medians
        scatter[rows] = _medians(np.square(off[rows]) / _MEDIAN - variance[rows], _ABOUT, stride=_ABOUT // 10)
    return off, np.maximum(scatter, 0.5 * max(float(np.median(scatter)), 0.0))


def _medians(values: FloatArray, beside: int, stride: int = 1) -> FloatArray:
    """Running median [t] over `beside` values on either side of each value; with a `stride`, that of a value less than
    a stride away."""
    half = min(beside, (values.size - 1) // 2)
    medians = np.median(sliding_window_view(values, 2 * half + 1)[::stride], axis=1)
    return np.asarray(medians[np.clip((np.arange(values.size) - half) // stride, 0, medians.size - 1)])


def _log_odds(off: FloatArray, variance: FloatArray, prior: TrackPrior) -> FloatArray:
    """Log odds [t] that tests with a deviation `off` [t] from the course and that variance [t] are outlying."""
    if prior.outlying_share == 0.0:
        return np.full(off.size, -np.inf)
    ratio = (prior.outlying_size * prior.size) ** 2 / variance
    gain = 0.5 * (off**2 / variance * ratio / (1.0 + ratio) - np.log1p(ratio))
    return np.asarray(gain + math.log(prior.outlying_share) - math.log1p(-prior.outlying_share))


def _apart(log_odds: FloatArray, epoch: FloatArray) -> NDArray[np.bool_]:
    """Whether each test [t] is kept apart from merging: the newest, the first of each epoch, and tests of doubtful
    outlier odds, at most the MAX_APART most doubtful."""
    apart = np.zeros(log_odds.size, dtype=bool)
    doubt = np.abs(log_odds)
    most = np.argsort(doubt, kind="stable")[:MAX_APART]
    apart[most[doubt[most] < DOUBTFUL]] = True
    apart[-NEWEST:] = True
    apart[np.unique(epoch, return_index=True)[1]] = True
    return apart


def bins_of(progress: FloatArray) -> FloatArray:
    """The bin number [t] of each test, in ascending progress."""
    span = max(float(progress[-1] - progress[0]), 1e-300)
    share = (progress - progress[0]) / span
    start, end = np.log1p(share * progress.size), np.log1p((1.0 - share) * progress.size)
    return np.asarray(np.floor(LINEAR * share + LOGARITHMIC * (start - end)))


def _course(
    progress: FloatArray, value: FloatArray, weight: FloatArray, epoch: FloatArray, sound: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Slope and second derivative [k] of the course at each bin, from a least-squares parabola through the bin and its
    nearest `sound` neighbours in the epoch, up to _AROUND on either side; 0 where an epoch has fewer than four sound
    bins."""
    slopes, bends = np.zeros(progress.size), np.zeros(progress.size)
    for each in np.unique(epoch):
        rows = np.flatnonzero((epoch == each) & sound)
        if rows.size < 4:
            continue
        rows = rows[np.argsort(progress[rows], kind="stable")]
        width = min(2 * _AROUND + 1, rows.size)
        start = np.clip(np.arange(rows.size) - _AROUND, 0, rows.size - width)
        near = rows[start[:, None] + np.arange(width)]
        ahead = progress[near] - progress[rows, None]
        unit = np.maximum(np.abs(ahead).max(axis=1, keepdims=True), 1e-300)
        powers = (ahead / unit)[:, :, None] ** np.arange(3)
        leaned = np.swapaxes(powers * weight[near][:, :, None], 1, 2)
        gram = leaned @ powers
        gram += 1e-9 * np.eye(3) * gram[:, :1, :1]
        _, slope, bend = np.linalg.solve(gram, leaned @ value[near][:, :, None])[:, :, 0].T
        slopes[rows], bends[rows] = slope / unit[:, 0], 2.0 * bend / unit[:, 0] ** 2
    return slopes, bends
