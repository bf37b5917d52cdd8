"""The answer by a life's criteria: which of them ends it first and when, what is known of each, and the least health."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import HORIZON, QUANTILES
from models.prognosis.first_passage import PassageStatus, weighted_quantiles
from models.prognosis.limits import Limit, first_reached
from service.lives.assumptions import MEAN_COF
from service.lives.payloads import INSUFFICIENT, SAFE, by_quantile, safe_bound, share_of_way
from service.lives.quantities.ends import CriterionEnd, Sample
from service.lives.quantities.measured import MeasuredLife
from service.lives.tracks import step_rng

#: Draws of the first of several ends.
_DRAWS = 2_000
#: What a criterion says of itself.
_GIVEN = ("quantity", "pressure_bar", "speed_rpm", "frequency_hz", "fraction", "below", "above")


def criteria_answer(measured: MeasuredLife, ends: Sequence[CriterionEnd], current: Mapping[str, Any]) -> dict[str, Any]:
    """When the first of several limits is reached, what is known of each, and `current` with the least health by any."""
    now = measured.life.events[-1].cycles
    samples = [end.ends for end in ends if end.ends is not None]
    if not samples:
        nothing = {"status": INSUFFICIENT, "probability_of_reaching": None, "at_least": None}
        items = [_item(end, now, 0.0) for end in ends]
        return _quantiles(None, now) | nothing | {"current": {**current, "health": None}, "criteria": items}
    shares: FloatArray = np.ones(1)
    first: Sample = samples[0]
    if len(samples) > 1:
        rng = step_rng(measured.clutch_id, "criteria", measured.life.pooled(measured.assumptions), ends[0].tests)
        draws, shares = first_reached(samples, _DRAWS, rng)
        first = draws, np.full(draws.size, 1.0 / draws.size)
    by_known = iter(shares.tolist())
    items = [_item(end, now, next(by_known) if end.ends is not None else 0.0) for end in ends]
    leading = max(range(len(items)), key=lambda index: items[index]["probability_first"])
    stated = _quantiles(first, now)
    passed = float(first[1][first[0] <= now].sum())
    ahead = PassageStatus.MAY_NEVER_REACH if None in stated["end_of_life_cycles"].values() else PassageStatus.PREDICTED
    health = [share for end in ends if (share := _health(end)) is not None]
    return stated | {
        "status": (PassageStatus.REACHED if passed >= 0.5 else ahead).value,
        "at_least": safe_bound(stated["end_of_life_cycles"][f"{SAFE:g}"], now, measured.life.origin),
        "probability_of_reaching": float(min(1.0, first[1][np.isfinite(first[0])].sum())),
        "current": {**current, "health": min(health, default=None)},
        "criterion": _criterion(ends[leading]),
        "criteria": items,
    }


def _health(end: CriterionEnd) -> float | None:
    limit = _limit(end)
    if end.current is None or end.initial is None or limit is None:
        return None
    return share_of_way(end.current[0], end.initial, limit, rises=end.criterion.above is not None)


def _quantiles(sample: Sample | None, now: float) -> dict[str, dict[str, float | None]]:
    """Quantiles of the end and of what remains from `now` cycles; null beyond the horizon."""
    if sample is None:
        return {"end_of_life_cycles": by_quantile({}), "remaining_cycles": by_quantile({})}
    ends, weight = sample
    cap = 10.0 * HORIZON
    at = weighted_quantiles(np.minimum(ends, cap), weight, QUANTILES).tolist()
    by_level = {level: number if number < 0.5 * cap else None for level, number in zip(QUANTILES, at, strict=True)}
    left = {level: None if end is None else max(0.0, end - now) for level, end in by_level.items()}
    return {"end_of_life_cycles": by_quantile(by_level), "remaining_cycles": by_quantile(left)}


def _item(end: CriterionEnd, now: float, first: float) -> dict[str, Any]:
    """One criterion, with its own end, and how probably it is the first."""
    value, sd = end.current or (None, None)
    reaching = None if end.ends is None else end.probability_by(np.nextafter(np.inf, 0.0))
    own = {"current": {"value": value, "sd": sd}, "probability_of_reaching": reaching, "probability_first": first}
    return _given(end) | _quantiles(end.ends, now) | own | {"tests": end.tests}


def _given(end: CriterionEnd) -> dict[str, Any]:
    given = {name: getattr(end.criterion, name) for name in _GIVEN}
    return given | {"initial": end.initial, "limit": _limit(end)}


def _limit(end: CriterionEnd) -> float | None:
    given = end.criterion
    if given.fraction is not None and end.initial is None:
        return None
    return float(Limit(fraction=given.fraction, below=given.below, above=given.above).level(end.initial or 0.0))


def _criterion(end: CriterionEnd) -> dict[str, Any]:
    """The leading criterion as the answer's own; mean COF's numbers only where it is mean COF."""
    of_cof = end.criterion.quantity == MEAN_COF
    given = _given(end)
    return given | {
        "initial_mean_cof": end.initial if of_cof else None,
        "threshold_mean_cof": given["limit"] if of_cof else None,
    }
