"""`/remaining-useful-life` by other criteria than mean COF alone: any quantity, several limits at once, an earlier life."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from service import measured_lives, records, stored_runs
from service.errors import NotFoundError
from service.lives.assumptions import MEAN_COF
from service.lives.condition import beside_held
from service.lives.outlook import Evidence, measured_life, with_held
from service.lives.payloads import ended
from service.lives.prediction_at import predict_at
from service.lives.quantities.answer import criteria_answer
from service.lives.quantities.chosen_life import ChosenLife, chosen_life
from service.lives.quantities.ends import criterion_end
from service.lives.quantities.measured import MeasuredLife
from service.lives.quantities.names import SLOPE_SPEEDS, Family, quantity_named
from service.lives.recomputation import ClutchState
from service.schemas.clutch import EndOfLifeIn
from service.schemas.prognosis.criteria import CriterionIn
from storage.engine.database import Database

#: What is said of mean COF's course and of its forecasts, where another quantity is asked for.
_NOT_OF_MEAN_COF: dict[str, Any] = {"course": None, "back_cast": None, "ended_lives": 0, "sample": None}


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
        evidence = measured_lives.evidence(connection, clutch_id)
    request = _Request(method=method, quantity=quantity, criterion=criterion, pressure_bar=pressure_bar)
    chosen = chosen_life(state, life, at_cycles)
    answer = _by_criteria(state, chosen, evidence, request)
    now = chosen.number == chosen.of and (at_cycles is None or at_cycles >= row.summary.get("as_of_cycles", math.inf))
    among = None
    if state.held and now:
        evidence = replace(evidence, reader=stored_runs.run_reader(database, clutch_id))
        held = with_held(state, evidence)
        among = _by_criteria(held, chosen_life(held), evidence, request)
    head = {"clutch_id": clutch_id, "method": method, "revision": row.revision, "origin": state.record.origin}
    return head | answer | beside_held(answer, row.summary if now else {}, among)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Request:
    """By which filter and criteria an answer is asked for."""

    method: str
    quantity: str | None
    criterion: str | None
    pressure_bar: float | None


def _by_criteria(state: ClutchState, chosen: ChosenLife, evidence: Evidence, request: _Request) -> dict[str, Any]:
    events = () if chosen.life is None else chosen.life.events
    by_mean_cof = predict_at(state.clutch_id, events, chosen.assumptions, state.fraction, method=request.method)
    answer = by_mean_cof | {"life": chosen.item(), "criteria": []}
    measured = measured_life(state, chosen, evidence)
    if measured is None:
        return answer
    wanted = _wanted(state.record.end_of_life, measured, request.quantity, request.criterion, request.pressure_bar)
    if all(criterion_in.quantity != MEAN_COF for criterion_in in wanted):
        answer |= _NOT_OF_MEAN_COF
    ends = [criterion_end(measured, criterion_in, request.method) for criterion_in in wanted]
    return ended(answer | criteria_answer(measured, ends, answer["current"]), measured.life.end)


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
