"""The end of life as it is stated: a filter's sample of it, and that of a clutch that was new at its first test as far as
that is probable; wider where earlier forecasts of the clutch fared badly, and as lives of the same kind that have ended have
it, as far as the clutch is of their kind."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.prognosis.ended_lives import EndedLife, as_its_kind
from models.prognosis.first_passage import Offset, ends_of_life, paths, widened
from models.prognosis.late_start import late_start
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior


@dataclass(frozen=True, slots=True, kw_only=True)
class NewLater:
    """How probably a clutch whose first test is late was new there; the mean of its value when new, and of that at ζ = 0,
    where the filter has it new."""

    probability: float
    initial: float
    extrapolated: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedEnd:
    """A sample of ζ at the end of life [n], inf beyond the horizon, its weights [n], and by how many ended `lives`; of a
    clutch that is first tested `late`, when it was new."""

    ends: FloatArray
    weight: FloatArray
    lives: int
    late: NewLater | None


def stated_end(
    posterior: Posterior,
    *,
    fraction: float,
    as_of: float,
    horizon: float,
    offset: Offset | None = None,
    power: float = 1.0,
    ended: Sequence[EndedLife] = (),
    tests: Sequence[Measurement] = (),
) -> StatedEnd:
    """The end of a life that is at ζ = `as_of`, as `posterior` has it, its remaining part `widened` by `power`.

    By its `tests` it may have been new at the first of them; and what lies ahead of it is that of a clutch like the `ended`
    ones, with the probability that it is of their kind. What is behind, and a life that is over more likely than not, stays.
    """
    ends = ends_of_life(posterior, fraction, offset=offset, horizon=horizon)
    weight, form = posterior.weight, posterior.form
    mean_offset = None if offset is None else lambda progress: _mean(posterior, offset(progress))
    elsewhere, late = late_start(tests, fraction, offset=mean_offset, horizon=horizon), None
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
    ends = widened(ends, weight, as_of=as_of, horizon=horizon, power=power)
    passed = float(weight[ends <= as_of].sum())
    kin, lives = None, 0
    if ended and as_of > 0.0 and passed < 0.5:
        added = None if mean_offset is None else mean_offset(np.array([test.progress for test in tests]))[0]
        kin = as_its_kind(tests, as_of, ended, added)
    if kin is not None:
        ends, weight = kin.together(ends, weight, form, as_of)
        lives = sum(not life.censored for life in ended)
    return StatedEnd(ends=ends, weight=weight, lives=lives, late=late)


def _mean(posterior: Posterior, offsets: FloatArray) -> FloatArray:
    """What an offset adds [b, k], in the mean over the branches [1, k]."""
    beside = posterior.beside(offsets)
    return np.asarray(beside.T if beside.shape[1] == 1 else (beside @ posterior.weight)[None])
