"""Whether the last test lies where the tests before it predict it: the standardised innovation.

A filter's draws know the last test too. Weighted by one over the probability that each gives to its value, they predict
it as the tests before it did; the heavy tail of a run that may be outlying keeps these weights within bounds. How improbable
the measured value is under all draws together, each with its own run-to-run scatter and none with an outlying run, is given in
deviations of a normal: what is not known yet about scatter and coefficients raises no alarm.

Source: A. E. Gelfand, D. K. Dey, H. Chang, Bayesian Statistics 4 (1992) 147-167, for the weights.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.special import log_ndtr, logsumexp, ndtri_exp

from models.arrays import FloatArray
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import Prior

#: Deviations beyond which a test is off the track: one in 16,000 of a clutch that follows eq. 6.
FAR = 4.0
#: Tests that must have been before anything is off their track.
FEWEST_BEFORE = 4


def innovation(posterior: Posterior, last: Measurement, prior: Prior) -> float:
    """How far the last measurement lies off what those before it predict, in deviations with its sign.

    `posterior` knows all of them; `prior` says how often a run is outlying and by how much.
    """
    off = last.value - posterior.values(np.array([last.progress]))[0]
    variance = posterior.scatter**2 + last.variance
    sound = math.log1p(-prior.spoiled_share) + _log_normal(off, variance)
    outlying = _log_normal(off, variance + (prior.spoiled_size * prior.size) ** 2)
    likelihood = sound if prior.spoiled_share == 0.0 else np.logaddexp(sound, math.log(prior.spoiled_share) + outlying)
    with np.errstate(divide="ignore"):
        log_weight = np.log(posterior.weight) - likelihood
    log_weight = log_weight - logsumexp(log_weight)
    scaled = off / np.sqrt(variance)
    below, above = (min(float(logsumexp(log_weight + log_ndtr(sign * scaled))), 0.0) for sign in (1.0, -1.0))
    return float(ndtri_exp(below)) if below < above else -float(ndtri_exp(above))


def off_track_by(posterior: Posterior, measurements: Sequence[Measurement], prior: Prior) -> float | None:
    """The innovation of the last measurement [deviations] where it is off the track and no event lies before it; else None."""
    if len(measurements) <= FEWEST_BEFORE or measurements[-1].epoch != measurements[-2].epoch:
        return None
    far = innovation(posterior, measurements[-1], prior)
    return far if abs(far) > FAR else None


def _log_normal(off: FloatArray, variance: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (np.log(2.0 * np.pi * variance) + off**2 / variance))
