"""How good a prognosis was, once the end of life is known.

- CRPS: how far a predicted distribution is from the outcome, in cycles; the absolute error of a certain prediction
  (Gneiting, Raftery 2007).
- Coverage: the share of intervals that hold the outcome, nominally 0.9 for the 5 and 95 % quantiles; the interval's width
  is the prediction's sharpness.
- PIT: where in its predicted distribution each outcome lies; uniform where predictions are calibrated (Dawid 1984).
- α-λ accuracy: whether at the share λ of life the predicted remaining life is within ±α of the true one (Saxena 2010).
- Prognostic horizon: the remaining life from which on predictions stay within ±α of the whole life (Saxena 2010).

Words after ISO 13381-1: a prognosis estimates the time to failure (here the cycles to the threshold, the end of life)
and states a confidence; what is left of that time is the remaining useful life. A distribution is given by a weighted
sample or by quantiles; an end of life beyond the horizon is scored as if it were at the horizon.

Sources: T. Gneiting, A. E. Raftery, J. Am. Stat. Assoc. 102 (2007) 359; A. P. Dawid, J. R. Stat. Soc. A 147 (1984) 278;
A. Saxena, J. Celaya, B. Saha, S. Saha, K. Goebel, Int. J. Prognostics and Health Management 1 (2010) 4; ISO 13381-1:2015.
"""

from collections.abc import Sequence

import numpy as np

from models.arrays import FloatArray


def crps_of_quantiles(levels: Sequence[float], quantiles: Sequence[float], truth: float) -> float:
    """Continuous ranked probability score (CRPS) of a distribution known by its quantiles: twice the pinball loss,
    integrated over the levels.

    Each quantile stands for the levels that are nearer to it than to any other, the outermost for all up to 0 and 1.
    Levels ascend within (0, 1), quantiles ascend. A prediction that is certain has CRPS |x - truth| whatever the levels.
    """
    tau, x = np.asarray(levels, dtype=np.float64), np.asarray(quantiles, dtype=np.float64)
    if tau.size == 0 or tau.shape != x.shape or (np.diff(tau) <= 0).any() or tau[0] <= 0 or tau[-1] >= 1:
        raise ValueError("levels must ascend within (0, 1), one for each quantile")
    edges = np.concatenate([[0.0], 0.5 * (tau[1:] + tau[:-1]), [1.0]])
    under = 0.5 * np.diff(edges**2)  # ∫ τ dτ where the quantile is under the truth; ∫ (1 - τ) dτ where it is not
    loss = np.where(x < truth, under, np.diff(edges) - under)
    return float(2.0 * loss @ np.abs(truth - x))


def covered(low: float | None, high: float | None, truth: float | None) -> bool:
    """Whether an interval holds the outcome; None is beyond the horizon, for a bound as for the truth."""
    lower, upper, outcome = (np.inf if bound is None else bound for bound in (low, high, truth))
    return bool(lower <= outcome <= upper)


def pit_of_quantiles(levels: Sequence[float], quantiles: Sequence[float], truth: float) -> float:
    """Probability integral transform (PIT): the level of the truth, linear between quantiles; outside of them, the
    middle of the remaining probability."""
    x = np.asarray(quantiles, dtype=np.float64)
    if truth < x[0]:
        return 0.5 * levels[0]
    if truth > x[-1]:
        return 0.5 * (1.0 + levels[-1])
    return float(np.interp(truth, x, np.asarray(levels, dtype=np.float64)))


def pit_histogram(pits: Sequence[float], bins: int = 10) -> FloatArray:
    """The share of PIT values in equal bins of [0, 1]; [bins]."""
    counts, _ = np.histogram(pits, bins=bins, range=(0.0, 1.0))
    return np.asarray(counts / max(1, len(pits)))


def alpha_lambda(predicted: float | None, at: float, end: float, alpha: float = 0.2) -> bool:
    """Whether the remaining life predicted at progress `at` < end is within ±alpha of the true end - at."""
    if not at < end:
        raise ValueError(f"there is no life left at {at} of {end}")
    return predicted is not None and abs(predicted - (end - at)) <= alpha * (end - at)


def prognostic_horizon(
    at: Sequence[float], predicted: Sequence[float | None], end: float, alpha: float = 0.1
) -> float | None:
    """Remaining life at the first prediction from which on all are within ±alpha · end of the true remaining life.

    `predicted` are remaining lives at ascending progress `at` <= end. None where not even the last one is.
    """
    horizon = None
    for progress, remaining in zip(reversed(at), reversed(predicted), strict=True):
        if remaining is None or abs(remaining - (end - progress)) > alpha * end:
            break
        horizon = end - progress
    return horizon


def measured_end(progress: FloatArray, values: FloatArray, threshold: float) -> float | None:
    """First ζ at which straight lines between values [n] at ascending progress [n] pass the threshold; None where they
    never do, or begin below it."""
    below = np.flatnonzero(values <= threshold)
    if below.size == 0 or below[0] == 0:
        return None
    first = int(below[0])
    share = (values[first - 1] - threshold) / (values[first - 1] - values[first])
    return float(progress[first - 1] + share * (progress[first] - progress[first - 1]))
