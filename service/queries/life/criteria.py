"""`/remaining-useful-life` by other criteria than mean COF alone: any quantity, several limits at once, an earlier life."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import HORIZON, QUANTILES
from models.prognosis.first_passage import PassageStatus, weighted_quantiles
from models.prognosis.limits import Limit, first_reached
from service import measured_lives, records
from service.errors import NotFoundError
from service.lives.assumptions import MEAN_COF
from service.lives.payloads import INSUFFICIENT, by_quantile
from service.lives.prediction_at import predict_at
from service.lives.quantities.chosen_life import chosen_life
from service.lives.quantities.ends import CriterionEnd, Sample, criterion_end
from service.lives.quantities.measured import MeasuredLife
from service.lives.quantities.names import SLOPE_SPEEDS, Family, quantity_named
from service.lives.tracks import step_rng
from service.schemas.clutch import EndOfLifeIn
from service.schemas.prognosis.criteria import CriterionIn
from storage.engine.database import Database

#: Draws of the first of several ends.
_DRAWS = 2_000
#: What is said of mean COF's course and of its forecasts, where another quantity is asked for.
_NOT_OF_MEAN_COF: dict[str, Any] = {"course": None, "back_cast": None, "ended_lives": 0, "sample": None}
#: What a criterion says of itself.
_GIVEN = ("quantity", "pressure_bar", "speed_rpm", "frequency_hz", "fraction", "below", "above")


def life_by_criteria(
    database: Database,
    clutch_id: str,
    method: str,
    pressure_bar: float | None = None,
    at_cycles: float | None = None,
    quantity: str | None = None,
    criterion: str | None = None,
    life: int | None = None,
) -> dict[str, Any]:
    """The remaining life by a clutch's criteria, by those of one `criterion`'s quantity, or by one `quantity` at a pressure.

    As it was at `at_cycles`, of the present life or of an earlier one by its number. Raises NotFoundError, and InvalidError
    for a quantity that is none.
    """
    with database.reading() as connection:
        row = records.clutch(connection, clutch_id)
        state = records.state(connection, clutch_id)
        chosen = chosen_life(state, life, at_cycles)
        measured = measured_lives.measured_life(connection, state, chosen)
    head = {"clutch_id": clutch_id, "method": method, "revision": row.revision, "origin": state.record.origin}
    by_mean_cof = predict_at(
        clutch_id, () if chosen.life is None else chosen.life.events, chosen.assumptions, state.fraction, method=method
    )
    answer = head | by_mean_cof | {"life": chosen.item(), "criteria": []}
    if measured is None:
        return answer
    wanted = _wanted(state.record.end_of_life, measured, quantity, criterion, pressure_bar)
    if all(criterion_in.quantity != MEAN_COF for criterion_in in wanted):
        answer |= _NOT_OF_MEAN_COF
    return answer | _answered(measured, [criterion_end(measured, criterion_in, method) for criterion_in in wanted])


def _wanted(
    record: EndOfLifeIn,
    measured: MeasuredLife,
    quantity: str | None,
    criterion: str | None,
    pressure_bar: float | None,
) -> Sequence[CriterionIn]:
    """The criteria that an answer is by."""
    own = record.criteria or (CriterionIn(quantity="mean_cof", fraction=record.cof_fraction),)
    if quantity is None and criterion is None and pressure_bar is None:
        return own
    name = quantity_named(quantity or criterion or MEAN_COF).name
    chosen = [given for given in own if given.quantity == name and pressure_bar in (None, given.pressure_bar)]
    if chosen:
        return chosen
    if criterion is not None:
        raise NotFoundError(
            f"the clutch has no criterion on {name}; it has: {', '.join(given.quantity for given in own)}"
        )
    return [_usual(name, record.cof_fraction, measured, pressure_bar)]


def _usual(name: str, fraction: float, measured: MeasuredLife, pressure_bar: float | None) -> CriterionIn:
    """What would end a life by a quantity that its clutch has no criterion on: its fraction, of a slope 0; at the lowest
    pressure and frequency where it is measured, unless one is given."""
    quantity = quantity_named(name)
    tracks = measured.series(quantity)
    if not tracks:
        raise NotFoundError(f"{name} is not measured in this life")
    first = min(tracks, key=lambda series: (series.frequency_hz or 0.0, series.pressure))
    given: dict[str, Any] = {"quantity": name, "pressure_bar": pressure_bar}
    if pressure_bar is None and quantity.family is not Family.MEAN_COF:
        given["pressure_bar"] = first.pressure / 1e5
    if quantity.family is Family.SLOPE:
        return CriterionIn(**given, speed_rpm=SLOPE_SPEEDS[1])
    return CriterionIn(**given, fraction=fraction, frequency_hz=first.frequency_hz)


def _answered(measured: MeasuredLife, ends: Sequence[CriterionEnd]) -> dict[str, Any]:
    """When the first of several limits is reached, and what is known of each."""
    now = measured.life.events[-1].cycles
    samples = [end.ends for end in ends if end.ends is not None]
    if not samples:
        items = [_item(end, now, 0.0) for end in ends]
        return {"status": INSUFFICIENT, "criteria": items} | _quantiles(None, now) | {"probability_of_reaching": None}
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
    return stated | {
        "status": (PassageStatus.REACHED if passed >= 0.5 else ahead).value,
        "probability_of_reaching": float(min(1.0, first[1][np.isfinite(first[0])].sum())),
        "criterion": _criterion(ends[leading]),
        "criteria": items,
    }


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
