"""Whether a test lies where the tests before it predicted it: the standardised innovation.

It is a prediction, made of the draws before the test is taken in: what a knee or a discrepancy ahead may do lies between the
last test and this one, and draws that know the test have no such thing any more. How improbable the measured value is under
all draws together, each with its own run-to-run scatter and none with an outlying run, is converted to deviations of a
normal: uncertainty about scatter and coefficients widens the prediction, so that it raises no alarm.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from models.tracking.criteria import FEWEST_BEFORE
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior


def next_innovation(
    before: TrackPosterior, earlier: Sequence[Measurement], test: Measurement, prior: TrackPrior
) -> float | None:
    """The standardised innovation of a test under the draws `before` it, which know the `earlier` tests; infinite
    beyond the range of a float.

    None where fewer than FEWEST_BEFORE come before it, or where an event that may shift the level lies between.
    """
    if len(earlier) < FEWEST_BEFORE or earlier[-1].epoch != test.epoch:
        return None
    return innovation(before, test, prior)


def innovation(before: TrackPosterior, test: Measurement, prior: TrackPrior) -> float:
    """The standardised innovation of a test: its signed distance from the prediction of draws that do not know it, in
    standard deviations."""
    off = test.value - before.values(np.array([test.progress]))[0]
    scaled = off / np.sqrt(before.scatter_variance(test.value, prior) + test.variance)
    with np.errstate(divide="ignore"):
        log_weight = np.log(before.weight)
    below, above = (min(float(np.logaddexp.reduce(log_weight + log_ndtr(sign * scaled))), 0.0) for sign in (1.0, -1.0))
    return float(ndtri_exp(below)) if below < above else -float(ndtri_exp(above))
