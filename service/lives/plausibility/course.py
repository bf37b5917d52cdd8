"""The course of mean COF over a life, as a distribution of what a test at any cycles shows.

With y = log COF, ζ the cycles since the life began, Z those of its latest test, and s = 2 log(1 + ζ/φ)/log(1 + Z/φ),

    y(s) = level + slope · s + ∫∫ bend · dW + steps at maintenance + scatter

a Gaussian process whose level, slope and bend (an integrated random walk) are normal, averaged over φ, bend and scatter by
their marginal likelihood on the tests of the life. Before the first test the level is what physics allows of a wet clutch.
After a rebuild the level starts anew, and COF may go on as it did in the life before, or not: both are averaged likewise.
One test in some is off by more than its scatter. It is looser than eq. 6 on purpose: lives that accelerate, run in
steeply or drift with their oil are honest.

Source: the integrated Wiener process as a prior of smooth functions is G. Wahba, J. R. Statist. Soc. B 40 (1978) 364.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.tracking.measurement import Measurement
from service.lives.plausibility import criteria

_GRID = np.array(
    [(scale, bend, scatter) for scale in criteria.SCALES for bend in criteria.BENDS for scatter in criteria.SCATTERS]
)
#: By rows a test that is as others are and one that is off: the log of its share, and its further variance.
_FURTHER = np.array(
    [
        (math.log(1.0 - criteria.OUTLYING_SHARE), 0.0),
        (math.log(criteria.OUTLYING_SHARE), criteria.OUTLYING_SD**2),
    ]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """The tests of a life: cycles since it began [n], log COF [n], its variance [n], epoch of maintenance [n].

    `level` and `level_sd` are what was known of log COF before the first test; `before` is the course of the life before,
    cycles since that began and how far log COF had changed by then [2, k], None in a first life.
    """

    cycles: FloatArray
    log_cof: FloatArray
    variance: FloatArray
    epoch: FloatArray
    level: float
    level_sd: float
    before: FloatArray | None = None

    def predict(self, cycles: FloatArray, epoch: FloatArray) -> "Predicted":
        """log COF at cycles [m] since the life began, in epochs [m]."""
        near = self._nearest(cycles)
        x, e = np.append(self.cycles[near], cycles), np.append(self.epoch[near], epoch)
        latest = float(self.cycles.max()) if self.cycles.any() else float(cycles.max())
        kernel = self._kernel(x, e, max(latest, 1.0))
        n = len(near)
        scatter = _GRID[:, 2, None] ** 2
        noise = self.variance[near] + scatter
        means = self._means(x)
        residual = self.log_cof[near] - means[:, :n]
        if n == 0:
            mean = np.repeat(means, len(_GRID), axis=0)
            variance = np.tile(np.diagonal(kernel, axis1=1, axis2=2) + scatter, (len(means), 1))
            return _possible(np.full(len(mean), -math.log(len(mean))), mean, variance)
        factor = np.linalg.cholesky(kernel[:, :n, :n] + noise[:, :, None] * np.eye(n))
        both = np.concatenate([np.broadcast_to(residual.T, (len(_GRID), *residual.T.shape)), kernel[:, :n, n:]], axis=2)
        solved = np.linalg.solve(factor, both)
        of_residual, of_cross = solved[:, :, : len(means)], solved[:, :, len(means) :]
        determinant = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
        evidence = (-0.5 * (of_residual**2).sum(axis=1) - determinant[:, None]).T.ravel()
        log_weight = evidence - evidence.max()
        mean = means[:, None, n:] + np.einsum("gnk,gnm->kgm", of_residual, of_cross)
        left = np.diagonal(kernel[:, n:, n:], axis1=1, axis2=2) - (of_cross**2).sum(axis=1)
        return _possible(
            log_weight - math.log(np.exp(log_weight).sum()),
            mean.reshape(evidence.size, -1),
            np.tile(np.maximum(left, 0.0) + scatter, (len(means), 1)),
        )

    def _means(self, cycles: FloatArray) -> FloatArray:
        """What is expected of log COF at cycles [k] before the life's own tests are looked at [1 or 2, k]: its level, and
        the level with the course of the life before."""
        level = np.full((1, cycles.size), self.level)
        return level if self.before is None else np.vstack([level, level + np.interp(cycles, *self.before)])

    def _nearest(self, cycles: FloatArray) -> list[int]:
        """Indices of the tests that are looked at: the nearest to any of the cycles."""
        if self.cycles.size <= criteria.MOST_TESTS:
            return list(range(self.cycles.size))
        apart = np.abs(self.cycles[:, None] - cycles).min(axis=1)
        return sorted(np.argsort(apart, kind="stable")[: criteria.MOST_TESTS].tolist())

    def _kernel(self, cycles: FloatArray, epoch: FloatArray, latest: float) -> FloatArray:
        """Covariance [g, k, k] of y at cycles [k] for each of the grid's choices; `latest`: Z."""
        scale = _GRID[:, 0, None] * latest
        s = criteria.SPAN * np.log1p(cycles / scale) / np.log1p(latest / scale)
        a, b = np.minimum(s[:, :, None], s[:, None, :]), np.maximum(s[:, :, None], s[:, None, :])
        bent = _GRID[:, 1, None, None] ** 2 * a**2 * (b / 2 - a / 6)
        steps = criteria.STEP_SD**2 * np.minimum(epoch[:, None], epoch[None, :])
        return np.asarray(self.level_sd**2 + criteria.SLOPE_SD**2 * a * b + bent + steps)


@dataclass(frozen=True, slots=True, kw_only=True)
class Predicted:
    """A mixture of normals: log weight [g], mean [g, m] and variance [g, m] of log COF."""

    log_weight: FloatArray
    mean: FloatArray
    variance: FloatArray

    def log_density(self, index: int, log_cof: float, spread: float) -> float:
        """log density of a test's log COF, whose own deviation is `spread`, at the cycles of that index."""
        off = (log_cof - self.mean[:, index]) ** 2
        variance = self.variance[:, index] + spread**2 + _FURTHER[:, 1:]
        together = _FURTHER[:, :1] + self.log_weight - 0.5 * (off / variance + np.log(2 * math.pi * variance))
        most = float(together.max())
        return most + math.log(float(np.exp(together - most).sum()))

    def interval(self, index: int, spread: float) -> tuple[float, float]:
        """COF two deviations below and above its mean at the cycles of that index."""
        weight = np.exp(self.log_weight)
        mean = float(weight @ self.mean[:, index])
        square = float(weight @ (self.variance[:, index] + (self.mean[:, index] - mean) ** 2)) + spread**2
        return math.exp(mean - 2 * math.sqrt(square)), math.exp(mean + 2 * math.sqrt(square))


def _possible(log_weight: FloatArray, mean: FloatArray, variance: FloatArray) -> Predicted:
    """A prediction together with what physics allows at any cycles: far from all tests that is all there is to say."""
    physics = criteria.LOG_COF_SD**2
    both = 1.0 / (1.0 / variance + 1.0 / physics)
    return Predicted(
        log_weight=log_weight, mean=both * (mean / variance + math.log(criteria.COF) / physics), variance=both
    )


def course_of(
    measurements: Sequence[Measurement], *, level: float, level_sd: float, before: FloatArray | None = None
) -> Course:
    """The course of what was measured along a life, after the one `before`."""
    rows = [(m.progress, m.value, m.variance, float(m.epoch)) for m in measurements]
    columns = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return Course(
        cycles=columns[0],
        log_cof=columns[1],
        variance=columns[2],
        epoch=columns[3],
        level=level,
        level_sd=level_sd,
        before=before,
    )
