"""Whether the last test lies where the tests before it had it: the standardised innovation.

A filter's draws know the last test too. Weighted by one over the probability that each gives to its value, they foretell
it as the tests before it did; the heavy tail of a run that may be outlying keeps these weights within bounds. How
improbable the measured value is under all draws together, each with its own run-to-run scatter and none with an outlying
run, is told in
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
from service.lives.run_analysis import Warned

OFF_TRACK = "off_track"
#: Deviations beyond which a test is off the track: one in 16,000 of a clutch that follows eq. 6.
FAR = 4.0
#: Tests that must have been before anything is off their track.
FEWEST_BEFORE = 4


def innovation(posterior: Posterior, last: Measurement, prior: Prior) -> float:
    """How far the last measurement lies off what those before it foretold, in deviations with its sign.

    `posterior` knows all of them; `prior` says how often a run is outlying and by how much.
    """
    off = last.value - posterior.values(np.array([last.progress]))[0]
    variance = posterior.scatter**2 + last.variance
    sound = math.log1p(-prior.outlying_share) + _log_normal(off, variance)
    outlying = _log_normal(off, variance + (prior.outlying_size * prior.size) ** 2)
    told = sound if prior.outlying_share == 0.0 else np.logaddexp(sound, math.log(prior.outlying_share) + outlying)
    with np.errstate(divide="ignore"):
        log_weight = np.log(posterior.weight) - told
    log_weight = log_weight - logsumexp(log_weight)
    scaled = off / np.sqrt(variance)
    below, above = (min(float(logsumexp(log_weight + log_ndtr(sign * scaled))), 0.0) for sign in (1.0, -1.0))
    return float(ndtri_exp(below)) if below < above else -float(ndtri_exp(above))


def _log_normal(off: FloatArray, variance: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (np.log(2.0 * np.pi * variance) + off**2 / variance))


def off_track(posterior: Posterior, seen: Sequence[Measurement], prior: Prior) -> list[Warned]:
    """A warning where the last test is far off what the tests before it foretold, and no event lies between."""
    if len(seen) <= FEWEST_BEFORE or seen[-1].epoch != seen[-2].epoch:
        return []
    far = innovation(posterior, seen[-1], prior)
    if not abs(far) > FAR:
        return []
    side = "below" if far < 0 else "above"
    size = f"{abs(far):.1f}" if math.isfinite(far) else "very many"
    message = (
        f"the last test's mean COF of {seen[-1].value:.4g} lies {size} deviations {side} what the tests before it foretold: "
        "a bad run, or the clutch has left its course"
    )
    return [Warned(code=OFF_TRACK, message=message)]
