"""Remaining useful life: when eq. 6 first passes the threshold, with the uncertainty of everything that decides it.

The criterion is ξ(ζ) <= fraction · ξ0, with ξ0 the value at ζ = 0. Each draw of the coefficients has its own ξ0,
hence its own threshold, and one end of life in closed form. Eq. 6 saturates: a draw whose ξ0 + Δ stays above its
threshold never gets there. How probable that is, is an answer; a quantile that lies beyond the horizon is None, never
an infinity.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from models import degradation
from models.arrays import FloatArray
from models.tracking.protocol import Posterior

QUANTILES = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95)
#: Cycles beyond which an end of life is not told from never.
HORIZON = 1_000_000.0


class PassageStatus(StrEnum):
    """Whether the threshold is ahead, more likely than not behind, or may never be reached within the horizon."""

    PREDICTED = "predicted"
    REACHED = "reached"
    MAY_NEVER_REACH = "may_never_reach"


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstPassage:
    """End of life [cycles since new] and remaining life [cycles from `as_of`] by quantile, None beyond the horizon.

    `probability_of_reaching` is that of reaching the threshold within the horizon. `initial` is the mean of ξ0,
    `threshold` fraction · initial, `current` the mean and deviation of ξ at `as_of`.
    """

    as_of: float
    end_of_life: dict[float, float | None]
    remaining: dict[float, float | None]
    probability_of_reaching: float
    status: PassageStatus
    initial: float
    threshold: float
    current: tuple[float, float]


def first_passage(
    posterior: Posterior,
    *,
    fraction: float,
    as_of: float,
    horizon: float = HORIZON,
    quantiles: Sequence[float] = QUANTILES,
) -> FirstPassage:
    """The end of life of a weighted sample of coefficients; 0 < fraction < 1, as_of >= 0 and horizon > 0 in cycles.

    A horizon before `as_of` is taken to be `as_of`. Raises ValueError where an argument is out of its range.
    """
    if not 0.0 < fraction < 1.0:
        raise ValueError(f"fraction must lie between 0 and 1, got {fraction}")
    if not (np.isfinite(as_of) and as_of >= 0.0):
        raise ValueError(f"as_of must be finite and not negative, got {as_of}")
    if not (np.isfinite(horizon) and horizon > 0.0):
        raise ValueError(f"horizon must be finite and positive, got {horizon}")
    horizon = max(horizon, as_of)
    passages = ends_of_life(posterior, fraction)
    found = weighted_quantiles(np.minimum(passages, 10.0 * horizon), posterior.weight, quantiles)
    end = {q: float(x) if x <= horizon else None for q, x in zip(quantiles, found, strict=True)}
    initial = float(posterior.weight @ posterior.initial)
    return FirstPassage(
        as_of=as_of,
        end_of_life=end,
        remaining={q: None if x is None else max(0.0, x - as_of) for q, x in end.items()},
        probability_of_reaching=_probability(passages <= horizon, posterior.weight),
        status=_status(end, _probability(passages <= as_of, posterior.weight)),
        initial=initial,
        threshold=fraction * initial,
        current=posterior.moments(degradation.value(as_of, posterior.degradation)),
    )


def ends_of_life(posterior: Posterior, fraction: float) -> FloatArray:
    """The ζ [n] at which each draw first has ξ(ζ) <= fraction · ξ0; inf where it never has."""
    threshold = fraction * posterior.initial
    crossing = degradation.first_passage(threshold, posterior.degradation)
    return np.where(posterior.initial <= threshold, 0.0, crossing)


def weighted_quantiles(sample: FloatArray, weight: FloatArray, quantiles: Sequence[float]) -> FloatArray:
    """Quantiles of a finite sample [n] with weights [n] >= 0, linear between the middles of the draws' shares."""
    order = np.argsort(sample, kind="stable")
    share = weight[order] / weight.sum()
    return np.asarray(np.interp(quantiles, np.cumsum(share) - 0.5 * share, sample[order]))


def _probability(event: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], weight: FloatArray) -> float:
    return float(min(1.0, weight[event].sum() / weight.sum()))


def _status(end_of_life: dict[float, float | None], passed: float) -> PassageStatus:
    if passed >= 0.5:
        return PassageStatus.REACHED
    return PassageStatus.MAY_NEVER_REACH if None in end_of_life.values() else PassageStatus.PREDICTED
