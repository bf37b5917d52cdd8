"""The course of mean COF over a life, as a distribution of what a test at any cycles shows.

The tracker's courses (`models.tracking.courses`, `discrepancy`) on y = log COF, in the closed form for given coefficients:

    y(ζ) = level + change · u + q δ(u) + steps + scatter,   u = b(ζ)/b(T)

with b the logarithm's course of scale φ, the limit of eq. 6 that fits steep starts and even wear alike, T the cycles of the
latest test and δ the tracker's discrepancy, which runs on the course's own clock u. Level, change, δ and steps are normal
and integrated out; φ/T, the sizes of change and δ, and the scatter are averaged over a few values by their evidence. A
course of eq. 6 is one of them, and so are knees, courses that level off and courses that do not change at all.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.plausibility import criteria
from models.tracking.courses import Course, basis
from models.tracking.discrepancy import smooth

_GRID = np.array(
    [(scale, *size, scatter) for scale in criteria.SCALES for size in criteria.SIZES for scatter in criteria.SCATTERS]
)
#: Variances of the change and of δ, by size.
_OF_CHANGE, _OF_DISCREPANCY = np.square(np.array(criteria.SIZES)).T
_SCALES = np.log(np.array(criteria.SCALES))
#: Columns [scales, k, p] of cycles k: of level and steps, of the change, of δ.
_Features = tuple[FloatArray, FloatArray, FloatArray]
#: A probability of nothing.
_NEVER = 1e-300


@dataclass(frozen=True, slots=True, kw_only=True)
class Tests:
    """The tests of a life: cycles ζ since it began [n], log COF [n], its variance [n], the epoch of maintenance [n].

    `levels` are the cycles from which on COF has a new level [l]; `level` and `level_sd` what was known of log COF before
    the first test.
    """

    cycles: FloatArray
    log_cof: FloatArray
    variance: FloatArray
    epoch: FloatArray
    levels: FloatArray
    level: float
    level_sd: float


def _own_clock(cycles: FloatArray, latest: float) -> FloatArray:
    """u of every scale [scales, k]; where no test was made after the start, any further one is at u = 1.

    Cycles of which floats cannot hold the inverse are none.
    """
    if latest < 1e-300:
        return np.tile(np.minimum(cycles, 1.0), (_SCALES.size, 1))
    log_scale = (_SCALES + math.log(latest))[:, None]
    course = np.full(1, Course.LOGARITHM, dtype=np.intp)
    zero = np.zeros((1, 1))
    at = basis(cycles[None, :], log_scale, zero, course)
    return np.asarray(at / basis(np.full((1, 1), latest), log_scale, zero, course))


@dataclass(frozen=True)
class Fit:
    """The tests of a life taken in, and what they say of further ones.

    Arrays by node of the grid [g] first. `log_weight` [g] is the log posterior probability of the nodes.
    """

    tests: Tests

    def _features(self, cycles: FloatArray, epoch: FloatArray) -> FloatArray:
        """Columns [scales, k, p] whose products sum to the covariance of level and steps."""
        u = _own_clock(cycles, self.latest)
        head = [np.full(u.shape, self.tests.level_sd)]
        further = [np.broadcast_to(criteria.LEVEL_SD * (cycles >= at), u.shape) for at in self.tests.levels]
        steps = [np.broadcast_to(criteria.STEP_SD * (epoch > e), u.shape) for e in np.unique(self.tests.epoch)]
        return np.stack([*head, *further, *steps], axis=2)

    @cached_property
    def latest(self) -> float:
        """T."""
        return float(self.tests.cycles.max(initial=0.0))

    def _covariance(self, a: "_Features", b: "_Features") -> FloatArray:
        """Covariance [g, k, m] of y without scatter between two sets of cycles."""
        plain, change, bent = (left @ np.swapaxes(right, 1, 2) for left, right in zip(a, b, strict=True))
        return _by_node(plain, change, bent)

    def _all(self, cycles: FloatArray, epoch: FloatArray) -> "_Features":
        u = _own_clock(cycles, self.latest)
        return self._features(cycles, epoch), u[:, :, None], smooth(u, 1.0)

    @cached_property
    def _own(self) -> "_Features":
        return self._all(self.tests.cycles, self.tests.epoch)

    @cached_property
    def noise(self) -> FloatArray:
        """Variance of every test about its course [g, n]."""
        return np.asarray(self.tests.variance + np.square(_GRID[:, -1, None]))

    @cached_property
    def precision(self) -> FloatArray:
        """The inverse P of the covariance of the tests [g, n, n]."""
        root = np.linalg.inv(self._root)
        return np.asarray(np.swapaxes(root, 1, 2) @ root)

    @cached_property
    def _root(self) -> FloatArray:
        covariance = self._covariance(self._own, self._own)
        n = self.tests.cycles.size
        covariance[:, np.arange(n), np.arange(n)] += self.noise
        return np.asarray(np.linalg.cholesky(covariance))

    @cached_property
    def pull(self) -> FloatArray:
        """P (y - level) [g, n]."""
        return np.asarray(self.precision @ (self.tests.log_cof - self.tests.level))

    @cached_property
    def log_evidence_by_node(self) -> FloatArray:
        """log density of the tests under every node [g]."""
        y = self.tests.log_cof - self.tests.level
        log_volume = np.log(np.diagonal(self._root, axis1=1, axis2=2)).sum(axis=1)
        return np.asarray(-0.5 * (self.pull @ y) - log_volume - 0.5 * y.size * math.log(2.0 * math.pi))

    @property
    def log_evidence(self) -> float:
        """log density of the tests."""
        return float(np.logaddexp.reduce(self.log_evidence_by_node)) - math.log(len(_GRID))

    @cached_property
    def log_weight(self) -> FloatArray:
        """log posterior probability of the nodes [g]."""
        return np.asarray(self.log_evidence_by_node - np.logaddexp.reduce(self.log_evidence_by_node))

    @cached_property
    def without(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Each test as the others predict it: mean [g, n], variance of the test [g, n], log weight of the nodes [g, n]."""
        own = np.diagonal(self.precision, axis1=1, axis2=2)
        variance = 1.0 / own
        mean = self.tests.log_cof - self.pull * variance
        log_weight = self.log_weight[:, None] - _log_normal(self.tests.log_cof - mean, variance)
        return mean, variance, log_weight - np.logaddexp.reduce(log_weight, axis=0)

    def log_step_gains(self) -> FloatArray:
        """By how much the log evidence would grow by a new level from each test on [n]; 0 for the first."""
        order = np.argsort(self.tests.cycles, kind="stable")[::-1]
        ordered = self.precision[:, order][:, :, order]
        volume = np.diagonal(ordered.cumsum(axis=1).cumsum(axis=2), axis1=1, axis2=2)
        pulled = self.pull[:, order].cumsum(axis=1)
        scale = 1.0 + criteria.LEVEL_SD**2 * volume
        gain = -0.5 * np.log(scale) + 0.5 * criteria.LEVEL_SD**2 * pulled**2 / scale
        total = np.logaddexp.reduce(self.log_weight[:, None] + gain, axis=0)
        gains = np.zeros(order.size)
        gains[order] = total
        # tests at the same cycles begin a new level together: the first of them stands for all
        first = np.unique(self.tests.cycles, return_index=True)[1]
        alone = np.full(order.size, -np.inf)
        alone[first] = gains[first]
        return alone

    def predict(self, cycles: FloatArray, epoch: FloatArray) -> "Predicted":
        """y at cycles [m] since the life began in epochs [m]."""
        features = self._all(cycles, epoch)
        n = self.tests.cycles.size
        prior = _diagonal(features)
        if n == 0:
            mean, variance = np.full((len(_GRID), cycles.size), self.tests.level), prior
            log_weight = np.full(len(_GRID), -math.log(len(_GRID)))
        else:
            cross = self._covariance(self._own, features)
            mean = self.tests.level + np.einsum("gn,gnm->gm", self.pull, cross)
            variance = np.maximum(prior - (cross * (self.precision @ cross)).sum(axis=1), 0.0)
            log_weight = self.log_weight
        return Predicted(log_weight=log_weight, mean=mean, variance=variance + np.square(_GRID[:, -1, None]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicted:
    """A mixture of normals: log weight [g], mean [g, m] and variance [g, m] of log COF."""

    log_weight: FloatArray
    mean: FloatArray
    variance: FloatArray

    def at(self, places: NDArray[np.intp]) -> "Predicted":
        """The same at these places of its cycles [k]."""
        return replace(self, mean=self.mean[:, places], variance=self.variance[:, places])

    def log_density(self, log_cof: FloatArray, spread: FloatArray, new_level: FloatArray) -> FloatArray:
        """log density [m] of log COF [m] whose own deviation is `spread` [m], at the cycles of the prediction; with
        probability `new_level` [m] COF has a new level there."""
        off, variance, weight = log_cof - self.mean, self.variance + spread**2, self.log_weight[:, None]
        same = np.log1p(-new_level) + log_outlying(off, variance, weight)
        stepped = np.logaddexp.reduce(weight + _log_normal(off, variance + criteria.LEVEL_SD**2), axis=0)
        return np.asarray(np.logaddexp(same, np.log(np.maximum(new_level, _NEVER)) + stepped))

    def interval(self, index: int, spread: float) -> tuple[float, float]:
        """COF two deviations below and above its mean at the cycles of that index."""
        weight = np.exp(self.log_weight)
        mean = float(weight @ self.mean[:, index])
        square = float(weight @ (self.variance[:, index] + (self.mean[:, index] - mean) ** 2)) + spread**2
        return math.exp(mean - 2 * math.sqrt(square)), math.exp(mean + 2 * math.sqrt(square))


def log_outlying(off: FloatArray, variance: FloatArray, log_weight: FloatArray) -> FloatArray:
    """log density [m] of what is `off` its mean [g, m] under nodes of weight [g, m], where a share of tests is outlying."""
    plain = math.log1p(-criteria.OUTLYING_SHARE) + _log_normal(off, variance)
    further = math.log(criteria.OUTLYING_SHARE) + _log_normal(off, variance + criteria.OUTLYING_SD**2)
    return np.asarray(np.logaddexp.reduce(log_weight + np.logaddexp(plain, further), axis=0))


def _diagonal(features: _Features) -> FloatArray:
    return _by_node(*(np.square(part).sum(axis=2) for part in features))


def _by_node(plain: FloatArray, change: FloatArray, bent: FloatArray) -> FloatArray:
    """The sum [g, ...] of the parts [scales, ...] of a covariance, each with its size at every node."""
    sizes = (-1, *(1,) * (plain.ndim - 1))
    both = plain[:, None] + _OF_CHANGE.reshape(sizes) * change[:, None] + _OF_DISCREPANCY.reshape(sizes) * bent[:, None]
    return np.asarray(np.repeat(both.reshape(-1, *plain.shape[1:]), len(criteria.SCATTERS), axis=0))


def log_physics(log_cof: FloatArray) -> FloatArray:
    """log of how far physics allows a COF, any shape: 0 for what wet clutches have, less beyond."""
    beyond = np.abs(log_cof - math.log(criteria.COF)) / criteria.LOG_COF_SD - criteria.USUAL
    return np.asarray(-0.5 * np.maximum(beyond, 0.0) ** 2)


def _log_normal(off: FloatArray, variance: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (np.log(2.0 * math.pi * variance) + off**2 / variance))
