"""Scores of a prognosis that is a weighted sample; the service states quantiles (`models.prognosis.scoring`)."""

import numpy as np

from models.arrays import FloatArray


def crps_of_sample(sample: FloatArray, weight: FloatArray, truth: float) -> float:
    """E|x - truth| - E|x - x'|/2 of a finite sample [n] with weights [n] >= 0, in the unit of the sample.

    >>> crps_of_sample(np.array([0.0, 2.0]), np.array([1.0, 1.0]), 1.0)
    0.5
    """
    order = np.argsort(sample)
    x, w = sample[order], weight[order] / weight.sum()
    spread = 2.0 * float(np.sum(w * x * (np.cumsum(w) - 0.5 * w - 0.5)))
    return float(w @ np.abs(x - truth) - spread)


def pit_of_sample(sample: FloatArray, weight: FloatArray, truth: float) -> float:
    """P(x < truth) + P(x = truth)/2 under a weighted sample [n]."""
    share = weight / weight.sum()
    return min(1.0, float(share[sample < truth].sum() + 0.5 * share[sample == truth].sum()))
