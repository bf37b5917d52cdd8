"""The largest projected likelihood ratio among many changes, and its threshold.

    Λ = max over gains and changes of  evidence(gains) + ½ z²,     z = score/√info

is, but for the gains, a maximum of correlated standard normals. Its distribution is simulated and extrapolated into the tail
by the number of independent tests that would give the same maximum.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from models.arrays import FloatArray
from models.diagnosis.criteria import LEAST_VISIBLE_SHARE
from models.diagnosis.pooled_fit.projection import Projected

_DRAWS = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmStatistic:
    """A statistic: its value [nats], its threshold, its p-value, and the index of the column that it is of."""

    value: float
    threshold: float
    p_value: float
    index: int

    @property
    def raised(self) -> bool:
        """Beyond what chance makes."""
        return self.value > self.threshold


def likelihood_ratios(projections: Sequence[Projected], columns: slice, one_sided: FloatArray) -> FloatArray:
    """[m] nats: the best amplitude of each change against none, the gains' scatter free under both."""
    null = max(projected.evidence for projected in projections)
    best = np.full(one_sided.size, -np.inf)
    for projected in projections:
        z = _standard(projected, columns)
        z = np.where((one_sided > 0) & (z < 0), 0.0, z)
        best = np.maximum(best, projected.evidence + 0.5 * z * z)
    return best - null


def _standard(projected: Projected, columns: slice) -> FloatArray:
    info = np.diag(projected.info)[columns]
    visible = info > LEAST_VISIBLE_SHARE * np.maximum(projected.whole[columns], 1e-300)
    return np.where(visible, projected.score[columns] / np.sqrt(np.where(visible, info, 1.0)), 0.0)


def largest_ratio(
    projections: Sequence[Projected], columns: slice, one_sided: FloatArray, share: float, rng: np.random.Generator
) -> AlarmStatistic:
    """The largest ratio among `columns` and its threshold for `share` of false alarms."""
    if one_sided.size == 0:
        return AlarmStatistic(value=0.0, threshold=np.inf, p_value=1.0, index=-1)
    ratios = likelihood_ratios(projections, columns, one_sided)
    index = int(np.argmax(ratios))
    tests = _independent_tests(max(projections, key=lambda projected: projected.evidence), columns, rng)
    value = max(float(ratios[index]), 0.0)
    tail = 2 * ndtr(-np.sqrt(2 * value))
    return AlarmStatistic(
        value=value,
        threshold=0.5 * float(ndtri(-np.expm1(np.log1p(-share) / tests) / 2)) ** 2,
        p_value=float(-np.expm1(tests * np.log1p(-min(tail, 1 - 1e-12)))),
        index=index,
    )


def _independent_tests(projected: Projected, columns: slice, rng: np.random.Generator) -> float:
    """How many independent standard normals have maxima like these correlated ones, in their upper tenth."""
    info = projected.info[columns, columns]
    scale = np.sqrt(np.maximum(np.diag(info), 1e-300))
    keep = np.diag(info) > LEAST_VISIBLE_SHARE * np.maximum(projected.whole[columns], 1e-300)
    if not keep.any() or not np.isfinite(info).all():
        return float(max(info.shape[0], 1))
    correlation = (info / scale[:, None] / scale)[np.ix_(keep, keep)]
    values, vectors = np.linalg.eigh(correlation)
    strong = values > 1e-6 * values[-1]
    root = vectors[:, strong] * np.sqrt(values[strong])
    draws = np.abs(root @ rng.standard_normal((int(strong.sum()), _DRAWS))).max(axis=0)
    quantiles = np.array([0.8, 0.9, 0.95])
    tails = 2 * ndtr(-np.quantile(draws, quantiles))
    counts = np.log(quantiles) / np.log1p(-tails)
    return float(np.clip(counts.mean(), 1.0, keep.sum()))
