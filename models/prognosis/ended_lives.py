"""What lives of the same kind that have ended say of one that has not.

They say two things of its end T: where the others ended, and how right the filter was of them when it knew as little.
Both are densities of log T, and their product, given that the clutch is alive at ζ, is what is stated:

    p(T) ∝ t((log T - c - μ)/σ) · t((log T - m - a r)/(k r)),    T > ζ

The first is Student's t, the predictive of the others' log ends about their median c. In the second the filter's forecast is
taken as a measurement of log T, m its median, whose error is learned: a and k from the errors (log T_j - m_j)/r_j that the
forecasts of the ended lives had at the same ζ, again as a Student's t predictive. A forecast that is wider errs more, if
not in proportion: r is the root of its deviation times the mean (geometric) of all. So a filter that
is far off late in earlier lives is corrected, one that told nothing hardly counts, and one that was right decides.

An end may be uncertain: a life that was declared worn just short of its threshold. Its log T has a deviation s, and both
predictives have s² more in their sum of squares (the expected one). Or it is censored: a life that was taken out at C for
another reason says T > C, a factor 1 - F(log C) in the likelihood of each predictive's mean and deviation, which are then
averaged over numerically.

Source: D. V. Lindley, A. Tversky, R. V. Brown, J. R. Stat. Soc. A 142 (1979) 146-162, for a forecast as a measurement;
A. Gelman et al., Bayesian Data Analysis (2013) ch. 3, for the predictive.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, log_ndtr, logsumexp, ndtri

from models.arrays import FloatArray
from models.prognosis.back_cast import HALF_WIDTH, kept_after
from models.prognosis.criteria import (
    BAND,
    DECLARED_EARLY,
    DECLARED_UNSEEN,
    END_WORTH,
    ERROR_VAGUE,
    ERROR_WORTH,
    FAR_BEYOND,
    FEWEST_ALIVE,
    FEWEST_TESTS,
    LEAST_DEVIATION,
    MOST_ENDED,
    VAGUE,
)
from models.prognosis.first_passage import Offset, ends_of_life, weighted_quantiles
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import weak

_GRID, _DRAWS, _PLACES = Grid(), 500, 500
#: Means, and deviations, that a predictive with censored values is averaged over.
_NODES = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class EndedLife:
    """A life's end [ζ] by the criterion's `fraction`, and what was forecast of it: the logarithm of BAND's quantiles of the
    end [f, 3] at progress [f]; the mean energy [J] of its cycles, None where its duty does not state it.

    `deviation` is that of the logarithm of an uncertain end; of a `censored` life `end` is when it was taken out before it.
    """

    end: float
    fraction: float
    progress: FloatArray
    forecasts: FloatArray
    energy: float | None = None
    deviation: float = 0.0
    censored: bool = False

    def forecast_at(self, progress: float) -> FloatArray:
        """The forecast [3] at that progress, between those before and after it."""
        return np.array([np.interp(progress, self.progress, column) for column in self.forecasts.T])

    def in_unit(self, cycles: float) -> "EndedLife":
        """The same life with ζ counted in units of so many cycles."""
        return replace(
            self,
            end=self.end / cycles,
            progress=self.progress / cycles,
            forecasts=self.forecasts - math.log(cycles),
        )

    def to_dict(self) -> dict[str, Any]:
        """As JSON can carry it."""
        return {
            "end": self.end,
            "fraction": self.fraction,
            "progress": self.progress.tolist(),
            "forecasts": self.forecasts.tolist(),
            "energy": self.energy,
            "deviation": self.deviation,
            "censored": self.censored,
        }

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> "EndedLife":
        """The inverse of `to_dict`, exactly."""
        return cls(
            end=stored["end"],
            fraction=stored["fraction"],
            progress=np.array(stored["progress"]),
            forecasts=np.array(stored["forecasts"]),
            energy=stored["energy"],
            deviation=stored["deviation"],
            censored=stored["censored"],
        )


def ended_life(
    history: Sequence[Measurement], end: float, *, fraction: float, horizon: float, offset: Offset | None = None
) -> EndedLife | None:
    """What a life that ended at ζ = `end` > 0 teaches, by its measurements in order and the exact filter.

    The filter runs under the weak prior. None where it was measured at fewer than FEWEST_TESTS different ζ before its end.
    """
    before = [measurement for measurement in history if measurement.progress < end]
    prior, rng = weak(history[0], falling=True), np.random.default_rng(0)
    progress, forecasts = [], []
    for count in range(FEWEST_TESTS, len(before) + 1):
        tests = before[:count]
        if len({measurement.progress for measurement in tests}) >= FEWEST_TESTS and kept_after(count):
            posterior = _GRID.posterior(_GRID.from_history(prior, tests), _DRAWS, rng)
            progress.append(tests[-1].progress)
            forecasts.append(
                forecast(posterior, ends_of_life(posterior, fraction, offset=offset, horizon=horizon), horizon)
            )
    if not progress:
        return None
    return EndedLife(end=end, fraction=fraction, progress=np.array(progress), forecasts=np.array(forecasts))


def declared_end(
    history: Sequence[Measurement], at: float, *, fraction: float, horizon: float, offset: Offset | None = None
) -> tuple[float, float]:
    """The end [ζ] of a life that was declared worn at ζ = `at` > 0 before any test passed its threshold; and its log's sd.

    x = log T - log at is exponential with the mean DECLARED_EARLY, for nobody declares a life worn that has most of itself
    to come. The exact filter's draws of x >= 0, those before `at` being at it, are weighted by exp(-x/DECLARED_EARLY); and
    with DECLARED_UNSEEN to one against them all the tests show nothing of what ended the life, and x is that alone.
    """
    prior = weak(history[0], falling=True)
    posterior = _GRID.posterior(_GRID.from_history(prior, history), _DRAWS, np.random.default_rng(0))
    ends = ends_of_life(posterior, fraction, offset=offset, horizon=horizon)
    early = np.log(np.clip(ends, at, horizon) / at)
    weight = posterior.weight * np.exp(-early / DECLARED_EARLY)
    total = float(weight.sum()) + DECLARED_UNSEEN
    mean = (float(weight @ early) + DECLARED_UNSEEN * DECLARED_EARLY) / total
    square = (float(weight @ early**2) + 2.0 * DECLARED_UNSEEN * DECLARED_EARLY**2) / total
    return at * math.exp(mean), math.sqrt(max(0.0, square - mean**2))


def representative(lives: Sequence[EndedLife]) -> list[EndedLife]:
    """The lives; of more than MOST_ENDED, so many, evenly taken by their ends."""
    if len(lives) <= MOST_ENDED:
        return list(lives)
    ordered = sorted(lives, key=lambda life: life.end)
    places = np.round(np.linspace(0, len(ordered) - 1, MOST_ENDED)).astype(int)
    return [ordered[place] for place in places.tolist()]


def forecast(posterior: Posterior, ends: FloatArray, horizon: float) -> FloatArray:
    """The logarithm of BAND's quantiles [3] of the ends of life [n] of a sample; of an end beyond the horizon, that."""
    stated = weighted_quantiles(np.clip(ends, 1e-9 * horizon, horizon), posterior.weight, BAND)
    return np.log(stated)


def calibrated(own: FloatArray, as_of: float, alive: Sequence[EndedLife]) -> tuple[FloatArray, FloatArray] | None:
    """The end of life of a clutch that is alive at ζ = `as_of` > 0, given its forecast `own` [3] and ended lives that were
    alive then: a sample [n] with weights [n] that sum to one. None of fewer than FEWEST_ALIVE lives that are not censored.
    """
    exact = np.array([not life.censored for life in alive])
    if np.count_nonzero(exact) < FEWEST_ALIVE:
        return None
    log_ends = np.log([life.end for life in alive])
    variance = np.array([life.deviation**2 for life in alive])
    beyond = float(log_ends.max()) + math.log(FAR_BEYOND)
    forecasts = np.minimum([*(life.forecast_at(as_of) for life in alive), own], beyond)
    median, deviation = forecasts[:, 1], (forecasts[:, 2] - forecasts[:, 0]) / (2.0 * HALF_WIDTH)
    size = np.sqrt(np.maximum(deviation, LEAST_DEVIATION))
    size *= math.exp(float(np.log(size).mean()))
    centre = float(np.median(log_ends[exact]))
    of_ends = _predictive(log_ends - centre, variance, exact, VAGUE, END_WORTH)
    errors = (log_ends - median[:-1]) / size[:-1]
    of_errors = _predictive(errors, variance / size[:-1] ** 2, exact, ERROR_VAGUE, ERROR_WORTH)
    now = math.log(as_of)
    far = max(beyond, now + 1.0)
    log_end = now + (far - now) * np.linspace(0.0, 1.0, _PLACES + 1)[1:] ** 2
    log_weight = of_ends.log_density(log_end - centre) + of_errors.log_density((log_end - median[-1]) / size[-1])
    weight = np.exp(log_weight - log_weight.max()) * np.gradient(log_end)
    return np.exp(log_end), weight / weight.sum()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Predictive:
    """Student's t of the next value; with `beyond`, values [c] of which it is known only that they are greater.

    Given the others the mean is normal with `precision` in units of the variance, the variance inverse gamma.
    """

    mean: float
    precision: float
    shape: float
    rate: float
    beyond: FloatArray

    def log_density(self, values: FloatArray) -> FloatArray:
        """Log density at values [n], up to a constant."""
        if self.beyond.size:
            return self._averaged(values)
        scale, freedom = math.sqrt(self.rate / self.shape * (1.0 + 1.0 / self.precision)), 2.0 * self.shape
        deviations = (values - self.mean) / scale
        return np.asarray(-0.5 * (freedom + 1.0) * np.log1p(deviations**2 / freedom))

    def _averaged(self, values: FloatArray) -> FloatArray:
        """Over means and deviations, evenly by their probability, each weighted by what lies beyond."""
        even = (np.arange(_NODES) + 0.5) / _NODES
        deviation = np.repeat(np.sqrt(self.rate / gammaincinv(self.shape, even)), _NODES)
        mean = self.mean + deviation / math.sqrt(self.precision) * np.tile(ndtri(even), _NODES)
        log_weight = log_ndtr((mean - self.beyond[:, None]) / deviation).sum(axis=0) - np.log(deviation)
        off = (values[:, None] - mean) / deviation
        return np.asarray(logsumexp(log_weight - 0.5 * off**2, axis=1))


def _predictive(
    values: FloatArray, variance: FloatArray, exact: NDArray[np.bool_], deviation: float, worth: tuple[float, float]
) -> _Predictive:
    """Of values [n] that are normal with unknown mean and variance: the mean normal about 0 with so many of their
    deviations, the variance inverse gamma, worth so much: (shape, scale).

    Each value is known up to its own `variance` [n], or not `exact` [n]: greater than that.
    """
    own = values[exact]
    precision = own.size + deviation**-2
    mean = float(own.sum()) / precision
    squares = float(own @ own + variance[exact].sum())
    return _Predictive(
        mean=mean,
        precision=precision,
        shape=worth[0] + 0.5 * own.size,
        rate=worth[1] + 0.5 * (squares - precision * mean**2),
        beyond=values[~exact],
    )


def severity_exponent(ends: FloatArray, work: FloatArray) -> tuple[float, float]:
    """The exponent q of lives that end after work^-q cycles, of ends [n] and their cycles' work [n] > 0, and its deviation.

    Least squares of the logarithms. Raises ValueError where fewer than three lives, or all alike, cannot tell it.
    """
    x = np.log(work) - np.log(work).mean()
    spread = float(x @ x)
    if x.size < FEWEST_ALIVE or spread == 0.0:
        raise ValueError(f"lives under different work are needed, {FEWEST_ALIVE} or more, got {x.size}")
    y = np.log(ends) - np.log(ends).mean()
    slope = float(x @ y) / spread
    left = y - slope * x
    return -slope, math.sqrt(float(left @ left) / (x.size - 2) / spread)
