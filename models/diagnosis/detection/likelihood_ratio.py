"""The largest projected likelihood ratio among many changes, and its threshold.

    Λ = max over gains and changes of  evidence(gains) + ½ z²,     z = score/√info

is, but for the gains, a maximum of correlated standard normals, whose tail is `largest_deviate`'s.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.criteria import LEAST_VISIBLE_SHARE
from models.diagnosis.detection.largest_deviate import LargestDeviate
from models.diagnosis.pooled_fit.projection import Projected


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
    likely = max(projections, key=lambda projected: projected.evidence)
    correlation = _correlation(likely, columns)
    if correlation.size == 0:
        return AlarmStatistic(value=0.0, threshold=np.inf, p_value=1.0, index=-1)
    ratios = likelihood_ratios(projections, columns, one_sided)
    index = int(np.argmax(ratios))
    value = max(float(ratios[index]), 0.0)
    largest = LargestDeviate(correlation, rng)
    return AlarmStatistic(
        value=value,
        threshold=0.5 * largest.threshold(share) ** 2,
        p_value=largest.probability(float(np.sqrt(2 * value))),
        index=index,
    )


def _correlation(projected: Projected, columns: slice) -> FloatArray:
    """The correlation matrix of the deviates of those columns that are visible."""
    info = projected.info[columns, columns]
    visible = np.diag(info) > LEAST_VISIBLE_SHARE * np.maximum(projected.whole[columns], 1e-300)
    info = info[np.ix_(visible, visible)]
    scale = 1 / np.sqrt(np.diag(info))
    return np.asarray(info * scale[:, None] * scale, dtype=np.float64)
