"""The end of life as it is stated: a filter's sample of it, and that of a clutch that was new at its first test as far as
that is probable; wider where earlier forecasts of the clutch fared badly, and as lives of the same kind that have ended have
it, as far as the clutch is of their kind.

Progress counts from 0, and the value when new is that of the course there. But the counter of a clutch that is first tested
late may have begun with another clutch, or before a new lining: then the clutch ages from its first test on, and was new
there. That is the same model with progress ζ - ζ_1, and the evidence of the tests weighs it. A clutch is alive at its first
test: with p the prior probability, Z the two evidences and A the share of the filter's draws that end after ζ_1,

    P = p Z_1/(p Z_1 + (1 - p) Z_0 A),

and those that end before are left out. A course led back over a long life that no test has seen asks for a value when new
far above the first one, which has ended by then or is improbable. The exact filter computes both evidences under the priors
in force, a fleet's among them, for whichever filter asks.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from models.arrays import FloatArray
from models.prognosis.criteria import COUNTED_ELSEWHERE, FEWEST_TESTS, LATE_START
from models.prognosis.ended_lives import ObservedLife, as_its_kind
from models.prognosis.first_passage import Offset, ends_of_life, paths, widened
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior, joined
from models.tracking.prior import TrackPrior, weak

_GRID, _DRAWS = Grid(nodes=13, rows=13, levels=7), 500


@dataclass(frozen=True, slots=True, kw_only=True)
class LateStart:
    """The alternative that a clutch was new at its first test, at ζ = `begun`: its log odds by the tests alone, and the
    ends of life ζ [n] under it with weights [n] that sum to one, the forms of these draws [n] (`courses`) and the mean
    of its value when new."""

    begun: float
    log_odds: float
    ends: FloatArray
    weight: FloatArray
    form: NDArray[np.intp]
    initial: float

    def weighed(self, own: FloatArray, weight: FloatArray) -> tuple[float, FloatArray]:
        """Posterior probability that the clutch was new at its first test, and the weights left to the ends [n] that a
        filter drew as if it was not, from their own weights [n]. Together they sum to one; ends before the first test
        get none."""
        alive = np.where(own > self.begun, weight, 0.0)
        share = float(alive.sum())
        if share == 0.0:
            return 1.0, alive
        probability = float(expit(self.log_odds - math.log(share)))
        return probability, alive * ((1.0 - probability) / share)


#: Priors with their probabilities, which sum to one.
WeightedPriors = tuple[tuple[float, TrackPrior], ...]


def late_start(
    tests: Sequence[Measurement],
    fraction: float,
    *,
    offset: Offset | None,
    horizon: float,
    priors: WeightedPriors = (),
) -> LateStart | None:
    """The alternative that a clutch was new at its first test, by its tests and the priors in force (none: the weak
    one); its end is where ξ + offset first falls to a fraction of that when new. `offset` gives [1, k].

    None where the first test came within the share LATE_START of what was measured, for where it was new is then much the
    same; and of fewer than FEWEST_TESTS tests at different ζ.
    """
    progress = {test.progress for test in tests}
    if len(progress) < FEWEST_TESTS or min(progress) <= LATE_START * max(progress):
        return None
    begun = min(progress)
    log_odds, drawn = _weighed(tuple(tests), begun, priors)
    since = None if offset is None else lambda progress: offset(progress + begun)
    return LateStart(
        begun=begun,
        log_odds=log_odds,
        ends=begun + ends_of_life(drawn, fraction, offset=since, horizon=max(horizon - begun, 1.0)),
        weight=drawn.weight,
        form=drawn.form,
        initial=float(drawn.weight @ paths(drawn, np.zeros(1), since)[0]),
    )


@lru_cache(maxsize=8)
def _weighed(tests: tuple[Measurement, ...], begun: float, priors: WeightedPriors) -> tuple[float, TrackPosterior]:
    """Log odds that the clutch was new at its first test, and draws under that alternative; cached for the next
    filter."""
    priors = priors or ((1.0, weak(min(tests, key=lambda test: test.progress), falling=True)),)
    since = [replace(test, progress=test.progress - begun) for test in tests]
    log_whole, log_later, parts = [], [], []
    for probability, prior in priors:
        whole, later = (_GRID.from_history(prior, each) for each in (tests, since))
        laid = _GRID.laid(later)
        # the exact filter leaves out what is the same for all points of a prior
        log_scale = math.log(probability) - math.log(prior.log_scale_sd * prior.log_exponent_sd * prior.log_scatter_sd)
        log_whole.append(log_scale + _GRID.laid(whole).log_evidence)
        log_later.append(log_scale + laid.log_evidence)
        parts.append(_GRID.drawn(later, laid, _DRAWS // len(priors), np.random.default_rng(0)))
    total = float(np.logaddexp.reduce(log_later))
    log_odds = total - float(np.logaddexp.reduce(log_whole))
    log_odds += math.log(COUNTED_ELSEWHERE / (1.0 - COUNTED_ELSEWHERE))
    shares = np.exp(np.array(log_later) - total).tolist()
    drawn = [replace(part, weight=share * part.weight) for share, part in zip(shares, parts, strict=True)]
    return log_odds, joined(drawn)


@dataclass(frozen=True, slots=True, kw_only=True)
class NewLater:
    """Probability that a clutch whose first test is late was new there; the mean of its value when new, and of that at
    ζ = 0, where the filter has it new."""

    probability: float
    initial: float
    extrapolated: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedEnd:
    """The end of life as stated: a sample of ζ [n], inf beyond the horizon, its weights [n], and the number of ended
    `lives` used; `late` is set if the first test came late."""

    ends: FloatArray
    weight: FloatArray
    lives: int
    late: NewLater | None


def stated_end(
    posterior: TrackPosterior,
    *,
    fraction: float,
    as_of: float,
    horizon: float,
    offset: Offset | None = None,
    powers: tuple[float, float] = (1.0, 1.0),
    ended: Sequence[ObservedLife] = (),
    tests: Sequence[Measurement] = (),
    priors: WeightedPriors = (),
) -> StatedEnd:
    """The end of a life that is at ζ = `as_of`, from `posterior`, its remaining part `widened` by `powers`.

    By its `tests`, under the `priors` in force, it may have been new at the first of them; and what lies ahead of it is that
    of a clutch like the `ended` ones, with the probability that it is of their kind. What is behind, and a life that is over
    more likely than not, stays.
    """
    ends = ends_of_life(posterior, fraction, offset=offset, horizon=horizon)
    weight, form = posterior.weight, posterior.form
    mean_offset = None if offset is None else lambda progress: _mean(posterior, offset(progress))
    elsewhere, late = late_start(tests, fraction, offset=mean_offset, horizon=horizon, priors=priors), None
    if elsewhere is not None:
        fresh = paths(posterior, np.zeros(1), offset)[0]
        probability, weight = elsewhere.weighed(ends, weight)
        late = NewLater(
            probability=probability,
            initial=float(weight @ fresh) + probability * elsewhere.initial,
            extrapolated=float(posterior.weight @ fresh),
        )
        ends, form = np.concatenate([ends, elsewhere.ends]), np.concatenate([form, elsewhere.form])
        weight = np.concatenate([weight, probability * elsewhere.weight])
    ends = widened(ends, weight, as_of=as_of, horizon=horizon, powers=powers)
    passed = float(weight[ends <= as_of].sum())
    kin, lives = None, 0
    if ended and as_of > 0.0 and passed < 0.5:
        added = None if mean_offset is None else mean_offset(np.array([test.progress for test in tests]))[0]
        kin = as_its_kind(tests, as_of, ended, added)
    if kin is not None:
        ends, weight = kin.together(ends, weight, form, as_of)
        lives = sum(not life.censored for life in ended)
    return StatedEnd(ends=ends, weight=weight, lives=lives, late=late)


def _mean(posterior: TrackPosterior, offsets: FloatArray) -> FloatArray:
    """Offset [1, k] averaged over the branches by their weights, from offsets by branch [b, k]."""
    at_offsets = posterior.beside(offsets)
    return np.asarray(at_offsets.T if at_offsets.shape[1] == 1 else (at_offsets @ posterior.weight)[None])
