"""Whether the last test lies where the tests before it predicted it: the standardised innovation.

A filter's draws are conditioned on the last test too. Weighted by one over the probability that each gives to the last
value, they predict that value as the tests before it did,

    p(y_t | y_1..t-1) = Σ_i w_i p(y_t | θ_i),    w_i ∝ W_i / p(y_t | θ_i)

with W the posterior's weights. In p the run may be outlying, whose heavy tail keeps the weights w within bounds. How
improbable the measured value is under all draws together, each with its own run-to-run scatter and none with an outlying
run, is converted to deviations of a normal: uncertainty about scatter and coefficients widens the prediction, so that it
raises no alarm.

Source: A. E. Gelfand, D. K. Dey, H. Chang, Bayesian Statistics 4 (1992) 147-167, for the weights.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from models.gaussian_evidence import log_normal
from models.tracking.criteria import FEWEST_BEFORE
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior


def last_innovation(posterior: TrackPosterior, measurements: Sequence[Measurement], prior: TrackPrior) -> float | None:
    """The innovation of the last of `measurements`, all of which `posterior` is conditioned on; infinite beyond what a float
    can express.

    None where fewer than FEWEST_BEFORE come before it, or where an event that may shift the level lies between.
    """
    if len(measurements) <= FEWEST_BEFORE or measurements[-1].epoch != measurements[-2].epoch:
        return None
    return innovation(posterior, measurements[-1], prior)


def innovation(posterior: TrackPosterior, last: Measurement, prior: TrackPrior) -> float:
    """How far the last measurement lies off the prediction of those before it, in deviations with its sign.

    `posterior` is conditioned on all of them; `prior` says how often a run is outlying and by how much.
    """
    off = last.value - posterior.values(np.array([last.progress]))[0]
    variance = posterior.scatter_variance(last.value, prior) + last.variance
    log_density = math.log1p(-prior.outlying_share) + log_normal(off, variance)
    if prior.outlying_share > 0.0:
        outlying = log_normal(off, variance + (prior.outlying_size * prior.size) ** 2)
        log_density = np.logaddexp(log_density, math.log(prior.outlying_share) + outlying)
    with np.errstate(divide="ignore"):
        log_weight = np.log(posterior.weight) - log_density
    log_weight -= np.logaddexp.reduce(log_weight)
    scaled = off / np.sqrt(variance)
    below, above = (min(float(np.logaddexp.reduce(log_weight + log_ndtr(sign * scaled))), 0.0) for sign in (1.0, -1.0))
    return float(ndtri_exp(below)) if below < above else -float(ndtri_exp(above))
