"""The end of life as it is stated: a filter's sample of it, wider where earlier forecasts of the clutch fared badly, and as
lives of the same kind that have ended have it, as far as the clutch is of their kind."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.prognosis.ended_lives import EndedLife, as_its_kind
from models.prognosis.first_passage import Offset, ends_of_life, widened
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedEnd:
    """A sample of ζ at the end of life [n], inf beyond the horizon, its weights [n], and by how many ended lives."""

    ends: FloatArray
    weight: FloatArray
    lives: int


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

    What lies ahead of it is that of a clutch like the `ended` ones, by its `tests`, with the probability that it is of their
    kind; what is behind, and a life that is over more likely than not, stays as it is.
    """
    ends = ends_of_life(posterior, fraction, offset=offset, horizon=horizon)
    ends = widened(ends, posterior.weight, as_of=as_of, horizon=horizon, power=power)
    passed = float(posterior.weight[ends <= as_of].sum())
    kin = None
    if ended and as_of > 0.0 and passed < 0.5:
        kin = as_its_kind(tests, as_of, ended, _added(posterior, tests, offset))
    if kin is None:
        return StatedEnd(ends=ends, weight=posterior.weight, lives=0)
    ends, weight = kin.together(ends, posterior.weight, as_of)
    return StatedEnd(ends=ends, weight=weight, lives=sum(not life.censored for life in ended))


def _added(posterior: Posterior, tests: Sequence[Measurement], offset: Offset | None) -> FloatArray | None:
    """What the offset adds at the tests, in the mean over the branches [t]; None where there is none."""
    if offset is None:
        return None
    beside = posterior.beside(offset(np.array([test.progress for test in tests])))
    return np.asarray(beside[:, 0] if beside.shape[1] == 1 else beside @ posterior.weight)
