"""The end of life as it is stated: a filter's sample of it, wider where earlier forecasts of the clutch fared badly, and
calibrated by lives of the same kind that have ended."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.prognosis.ended_lives import EndedLife, calibrated, forecast
from models.prognosis.first_passage import Offset, ends_of_life, widened
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
) -> StatedEnd:
    """The end of a life that is at ζ = `as_of`, as `posterior` has it, its remaining part `widened` by `power`.

    What lies ahead of it is then that of a clutch like the `ended` ones; what is behind, and a life that is over more likely
    than not, stays as it is.
    """
    alone = ends_of_life(posterior, fraction, offset=offset, horizon=horizon)
    ends = widened(alone, posterior.weight, as_of=as_of, horizon=horizon, power=power)
    behind = ends <= as_of
    passed = float(posterior.weight[behind].sum())
    if not ended or as_of <= 0.0 or passed >= 0.5:
        return StatedEnd(ends=ends, weight=posterior.weight, lives=0)
    alive = [life for life in ended if life.end > as_of]
    sample = calibrated(forecast(posterior, alone, horizon), as_of, alive)
    if sample is None:
        return StatedEnd(ends=ends, weight=posterior.weight, lives=0)
    ahead, weight = sample
    return StatedEnd(
        ends=np.concatenate([ends[behind], ahead]),
        weight=np.concatenate([posterior.weight[behind], (1.0 - passed) * weight]),
        lives=sum(not life.censored for life in alive),
    )
