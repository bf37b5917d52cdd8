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
from models.gaussian_evidence import log_normal
from models.plausibility import criteria
from models.tracking.courses import CourseForm, basis
from models.tracking.discrepancy import FUTURE, PAST, smooth

#: The nodes [g] that are averaged over: the scale, the deviations of the change and of δ, and the scatter of each.
_NODES = np.array(
    [(scale, *size, scatter) for scale in criteria.SCALES for size in criteria.SIZES for scatter in criteria.SCATTERS]
)
_LOG_SCALES = np.log(np.array(criteria.SCALES))


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


def _course_clock(cycles: FloatArray, latest: float) -> FloatArray:
    """Clock u = b(ζ)/b(T) [scales, k] of the logarithm's course at cycles ζ [k], for each scale φ of SCALES; T is
    `latest`.

    Without a test after the start (T = 0) u is ζ, at most 1: the next test is at u = 1.
    """
    if latest < 1e-300:  # floats cannot hold the inverse of less
        return np.tile(np.minimum(cycles, 1.0), (_LOG_SCALES.size, 1))
    log_scale = (_LOG_SCALES + math.log(latest))[:, None]
    course = np.full(1, CourseForm.LOGARITHM, dtype=np.intp)
    at, at_end = (basis(zeta, log_scale, np.zeros((1, 1)), course) for zeta in (cycles[None], np.array([[latest]])))
    return np.asarray(at / at_end)


@dataclass(frozen=True)
class CourseFit:
    """The posterior of log COF's course given the tests of a life, from which further tests are predicted.

    At a node y - level = A w + scatter with w standard normal: A holds level and steps, the change and δ in their prior
    deviations, d the variance of every test about its course. With M = I + AᵀA/d = LLᵀ and N = L⁻¹Aᵀ/d the inverse of the
    covariance of y is P = 1/d - NᵀN. Arrays by node [g] first.
    """

    tests: Tests

    def _columns(self, cycles: FloatArray, epoch: FloatArray, stretches: int = PAST + FUTURE) -> FloatArray:
        """Design matrix A [g, k, p] at cycles [k] in epochs [k], with the columns of so many of δ's stretches last,
        stretches after T behind the others."""
        u = _course_clock(cycles, self.latest)
        levels = [criteria.LEVEL_SD * (cycles >= at) for at in self.tests.levels]
        steps = [criteria.STEP_SD * (epoch > e) for e in np.unique(self.tests.epoch)]
        level = np.stack([np.full(cycles.shape, self.tests.level_sd), *levels, *steps], axis=1)
        shared = np.broadcast_to(level, (*u.shape, level.shape[1]))
        terms = np.concatenate([shared, u[:, :, None], smooth(u, 1.0, stretches)], axis=2)
        by_node = np.repeat(terms, len(_NODES) // _LOG_SCALES.size, axis=0)
        by_node[..., level.shape[1]] *= _NODES[:, 1, None]
        by_node[..., level.shape[1] + 1 :] *= _NODES[:, 2, None, None]
        return by_node

    @cached_property
    def latest(self) -> float:
        """Cycles T of the latest test."""
        return float(self.tests.cycles.max(initial=0.0))

    @cached_property
    def noise(self) -> FloatArray:
        """Variance d [g, n] of every test about its course."""
        return np.asarray(self.tests.variance + np.square(_NODES[:, 3, None]))

    @cached_property
    def _own(self) -> FloatArray:
        """Design matrix A [g, n, p] of the tests, without the stretches after T."""
        return self._columns(self.tests.cycles, self.tests.epoch, PAST)

    @cached_property
    def _root(self) -> FloatArray:
        """Inverse Cholesky factor L⁻¹ [g, p, p]."""
        weighted = np.swapaxes(self._own, 1, 2) / self.noise[:, None]
        return np.asarray(np.linalg.inv(np.linalg.cholesky(np.eye(weighted.shape[1]) + weighted @ self._own)))

    @cached_property
    def _explained(self) -> FloatArray:
        """Matrix N [g, p, n]."""
        return np.asarray(self._root @ np.swapaxes(self._own, 1, 2) / self.noise[:, None])

    @cached_property
    def _off(self) -> FloatArray:
        """Deviation y - level [n] of log COF."""
        return np.asarray(self.tests.log_cof - self.tests.level)

    @cached_property
    def pull(self) -> FloatArray:
        """Precision-weighted deviation P (y - level) [g, n]."""
        pulled = (self._explained @ self._off)[:, None] @ self._explained
        return np.asarray(self._off / self.noise - pulled[:, 0])

    @cached_property
    def log_evidence_by_node(self) -> FloatArray:
        """Log density of the tests under every node [g]."""
        roots = np.diagonal(self._root, axis1=1, axis2=2)
        log_volume = 0.5 * np.log(self.noise).sum(axis=1) - np.log(roots).sum(axis=1)
        return np.asarray(-0.5 * (self.pull @ self._off) - log_volume - 0.5 * self._off.size * math.log(2.0 * math.pi))

    @property
    def log_evidence(self) -> float:
        """Log density of the tests, averaged over the nodes."""
        return float(np.logaddexp.reduce(self.log_evidence_by_node)) - math.log(len(_NODES))

    @cached_property
    def log_weight(self) -> FloatArray:
        """Log posterior probability of the nodes [g]."""
        return np.asarray(self.log_evidence_by_node - np.logaddexp.reduce(self.log_evidence_by_node))

    @cached_property
    def without(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Leave-one-out prediction of each test by the others: mean [g, n], variance of the test [g, n], log weight of
        the nodes [g, n]."""
        variance = 1.0 / (1.0 / self.noise - np.square(self._explained).sum(axis=1))
        mean = self.tests.log_cof - self.pull * variance
        log_weight = self.log_weight[:, None] - log_normal(self.tests.log_cof - mean, variance)
        return mean, variance, log_weight - np.logaddexp.reduce(log_weight, axis=0)

    def misses(self) -> FloatArray:
        """Log density [n] that each test loses against the middle of its leave-one-out prediction."""
        mean, variance, log_weight = self.without
        return missed(self.tests.log_cof - mean, variance, log_weight)

    def log_step_gains(self) -> FloatArray:
        """Gain [n] of log evidence by a new level from each test on; 0 for the first, -inf for a further test at the
        same cycles."""
        order = np.argsort(self.tests.cycles, kind="stable")[::-1]
        explained = np.square(self._explained[:, :, order].cumsum(axis=2)).sum(axis=1)
        volume = (1.0 / self.noise[:, order]).cumsum(axis=1) - explained
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
        """Predictive distribution of log COF y at cycles [m] since the life began, in epochs [m]."""
        columns = self._columns(cycles, epoch)
        turned = columns[..., :-FUTURE] @ np.swapaxes(self._root, 1, 2)
        mean = self.tests.level + (turned @ (self._explained @ self._off)[..., None])[..., 0]
        variance = np.square(turned).sum(axis=2) + np.square(columns[..., -FUTURE:]).sum(axis=2)
        return Predicted(log_weight=self.log_weight, mean=mean, variance=variance + np.square(_NODES[:, 3, None]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicted:
    """A mixture of normal distributions of log COF: log weight [g], mean [g, m] and variance [g, m]."""

    log_weight: FloatArray
    mean: FloatArray
    variance: FloatArray

    def at(self, places: NDArray[np.intp]) -> "Predicted":
        """The prediction at the indices [k] of its cycles."""
        return replace(self, mean=self.mean[:, places], variance=self.variance[:, places])

    def log_density(self, log_cof: FloatArray, spread: FloatArray, new_level: FloatArray) -> FloatArray:
        """Log density [m] of log COF [m], of measurement deviation `spread` [m], at the cycles of the prediction; with
        probability `new_level` [m] COF has a new level there."""
        off, variance, weight = log_cof - self.mean, self.variance + spread**2, self.log_weight[:, None]
        same = np.log1p(-new_level) + log_unless_outlying(off, variance, weight)
        stepped = np.logaddexp.reduce(weight + log_normal(off, variance + criteria.LEVEL_SD**2), axis=0)
        return np.asarray(np.logaddexp(same, np.log(np.maximum(new_level, 1e-300)) + stepped))

    def interval(self, index: int, spread: float) -> tuple[float, float]:
        """COF two standard deviations below and above its mean at the cycles of that index."""
        weight = np.exp(self.log_weight)
        mean = float(weight @ self.mean[:, index])
        square = float(weight @ (self.variance[:, index] + (self.mean[:, index] - mean) ** 2)) + spread**2
        return math.exp(mean - 2 * math.sqrt(square)), math.exp(mean + 2 * math.sqrt(square))


def log_unless_outlying(off: FloatArray, variance: FloatArray, log_weight: FloatArray) -> FloatArray:
    """Log density [m] of a deviation `off` from the mean [g, m] under normal nodes of log weight [g, m], contaminated
    by the share of outlying tests with its larger variance."""
    plain = math.log1p(-criteria.OUTLYING_SHARE) + log_normal(off, variance)
    further = math.log(criteria.OUTLYING_SHARE) + log_normal(off, variance + criteria.OUTLYING_SD**2)
    return np.asarray(np.logaddexp.reduce(log_weight + np.logaddexp(plain, further), axis=0))


def missed(off: FloatArray, variance: FloatArray, log_weight: FloatArray) -> FloatArray:
    """Log density [m] lost by the deviation `off` from the mean [g, m]."""
    return np.asarray(
        log_unless_outlying(0.0 * off, variance, log_weight) - log_unless_outlying(off, variance, log_weight)
    )


def log_physics(log_cof: FloatArray) -> FloatArray:
    """Log plausibility of a COF by physics, any shape: 0 for usual values of wet clutches, negative beyond."""
    beyond = np.abs(log_cof - math.log(criteria.COF)) / criteria.LOG_COF_SD - criteria.USUAL
    return np.asarray(-0.5 * np.maximum(beyond, 0.0) ** 2)
