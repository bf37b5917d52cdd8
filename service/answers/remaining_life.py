"""`/remaining-useful-life`: the stored prediction, or one computed for the requested quantity, criterion or earlier life."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from sqlalchemy import Connection

from service import repository
from service.api.clutch import EndOfLifeIn
from service.api.life import CriterionIn, CriterionOutcome, CriterionValue, LifePrediction, RemainingLife
from service.clutch.assumptions import ALL_PRESSURES, MEAN_COF
from service.clutch.condition import as_stored, in_short, with_held_runs
from service.clutch.items import ended, warned
from service.clutch.notices import filters_disagree
from service.clutch.quantities.ends import GIVEN, criteria_answer, criterion_end
from service.clutch.quantities.measured import (
    SLOPE_SPEEDS,
    ChosenLife,
    Family,
    MeasuredLife,
    chosen_life,
    quantity_named,
)
from service.clutch.recomputation import ClutchHistory
from service.clutch.summary import Outlook, StoredSummary
from service.clutch.tracking import CARRIED, PREDICTED, predict_at
from service.clutch.with_held import ClutchMeasurements, measured_life, with_held
from service.errors import NotFoundError, unknown_clutch
from service.tables import Cells, cells
from storage import clutches, results
from storage.engine.database import Database

#: What `criteria_of` says of a clutch whose life ends by mean COF alone.
NO_CRITERIA = b"[]"


def criteria_of(database: Database, clutch_id: str) -> bytes:
    """The criteria of a clutch's record as a JSON array, empty if mean COF is the only one. Raises NotFoundError."""
    with database.reading() as connection:
        row = clutches.get(connection, clutch_id)
    if row is None:
        raise unknown_clutch(clutch_id)
    return json.dumps(row.record["end_of_life"].get("criteria", [])).encode()


def remaining_life(
    database: Database, clutch_id: str, method: str, pressure_bar: float | None, at_cycles: float | None
) -> RemainingLife:
    """The remaining useful life as it is now, or as it would have been predicted at `at_cycles`.

    The predictions of the particles and of `ukf` over all pressures are stored; those of the exact filter and at one
    pressure are computed. Raises NotFoundError for an unknown clutch or a pressure that its first stationary test did not
    measure.
    """
    with database.reading() as connection:
        row = clutches.get(connection, clutch_id)
        if row is None:
            raise unknown_clutch(clutch_id)
        carried = {} if pressure_bar is not None else _by_method(connection, clutch_id, at_cycles)
        stored = carried.get(method)
        carried_on = pressure_bar is None and at_cycles is None
        now = at_cycles is None or at_cycles >= row.summary.get("as_of_cycles", math.inf)
        earlier = not now and bool(row.summary.get("held"))
        state = repository.state(connection, clutch_id, carried=carried_on) if stored is None or earlier else None
    stored_summary = as_stored(row.summary)
    summary: StoredSummary = stored_summary if now else {}
    count = stored_summary.get("held", 0)
    outlook_with_held = (summary.get("with_held") or {}).get(method)
    if state is not None:
        count = len(chosen_life(state, at_cycles=None if now else at_cycles).held)
        outlook_with_held = (
            _with_held(database, state, method, pressure_bar, None if now else at_cycles) if count else None
        )
    if stored is not None:
        prediction = stored
    elif state is None:
        raise AssertionError("a prediction is stored, or the state was loaded")
    else:
        prediction = _predicted(state, method, pressure_bar, at_cycles)
    disagree = filters_disagree({**carried, method: prediction}) if carried else []
    prediction = prediction.model_copy(update={"warnings": [*prediction.warnings, *warned(disagree)]})
    beside = with_held_runs(in_short(prediction), summary, outlook_with_held, count)
    head = {"clutch_id": clutch_id, "method": method, "revision": row.revision, "origin": row.record["origin"]}
    return RemainingLife(**{**head, **dict(prediction), **beside.of(prediction)}, criteria=_criteria(prediction))


def _by_method(connection: Connection, clutch_id: str, at_cycles: float | None) -> dict[str, LifePrediction]:
    """The predictions of the remaining life by mean COF that are stored."""
    stored = {
        method: results.prediction_at(connection, clutch_id, method, ALL_PRESSURES, at_cycles) for method in PREDICTED
    }
    return {method: repository.prediction(row) for method, row in stored.items() if row is not None}


def _predicted(
    state: ClutchHistory, method: str, pressure_bar: float | None, at_cycles: float | None
) -> LifePrediction:
    """The prediction of remaining life by mean COF, computed from the clutch's history."""
    carried = (state.filters or {}).get(CARRIED)
    return predict_at(
        state.lives,
        state.assumptions,
        state.fraction,
        method=method,
        pressure_bar=pressure_bar,
        at_cycles=at_cycles,
        back_cast=None if carried is None else carried.back_cast,
    )


def _with_held(
    database: Database, state: ClutchHistory, method: str, pressure_bar: float | None, at_cycles: float | None
) -> Outlook:
    """The prediction that also counts the held runs."""
    evidence = repository.evidence_for(database, state, repository.run_reader(database, state.clutch_id))
    if evidence is None:
        raise AssertionError("runs are held: the evidence was loaded")
    return in_short(_predicted(with_held(state, evidence), method, pressure_bar, at_cycles))


def _criteria(prediction: LifePrediction) -> list[CriterionOutcome]:
    """The `criteria` of a stored prediction: mean COF alone, which is certainly reached first."""
    criterion, current = prediction.criterion, prediction.current
    return [
        CriterionOutcome(
            **{name: getattr(criterion, name) for name in GIVEN},
            initial=criterion.initial_mean_cof,
            limit=criterion.threshold_mean_cof,
            end_of_life_cycles=prediction.end_of_life_cycles,
            remaining_cycles=prediction.remaining_cycles,
            probability_of_reaching=prediction.probability_of_reaching,
            current=CriterionValue(value=current.mean_cof, sd=current.mean_cof_sd),
            probability_first=1.0,
            tests=prediction.runs_used,
        )
    ]


def rows(answer: RemainingLife) -> Iterator[Cells]:
    """Quantiles of the remaining life as rows of a table."""
    held_runs = answer.held_runs
    for quantile, remaining in answer.remaining_cycles.items():
        yield cells(answer, ("as_of_cycles", "status")) | {
            "quantile": quantile,
            "remaining_cycles": remaining,
            "end_of_life_cycles": answer.end_of_life_cycles[quantile],
            "at_least": answer.at_least,
            "held_runs": 0 if held_runs is None else held_runs.count,
            "remaining_cycles_with_held": None if held_runs is None else held_runs.remaining_cycles[quantile],
        }


COLUMNS = (
    "as_of_cycles", "status", "quantile", "remaining_cycles", "end_of_life_cycles", "at_least", "held_runs",
    "remaining_cycles_with_held",
)  # fmt: skip


#: What is said of mean COF's course and of its forecasts, where another quantity is asked for.
_NOT_OF_MEAN_COF = {"course": None, "back_cast": None, "ended_lives": 0, "sample": None}


def life_by_criteria(
    database: Database,
    clutch_id: str,
    method: str,
    pressure_bar: float | None = None,
    at_cycles: float | None = None,
    quantity: str | None = None,
    criterion: str | None = None,
    life: int | None = None,
) -> RemainingLife:
    """The remaining life by a clutch's criteria, by those of one `criterion`'s quantity, or by one `quantity` at a
    pressure.

    It is as of `at_cycles`, of the present life or an earlier one by its number. Raises NotFoundError, and InvalidError
    for an unknown quantity.
    """
    with database.reading() as connection:
        row = repository.clutch(connection, clutch_id)
        state = repository.state(connection, clutch_id)
        evidence = repository.evidence(connection, clutch_id)
        plain = quantity is None and life is None and pressure_bar is None
        disagree = warned(filters_disagree(_by_method(connection, clutch_id, at_cycles))) if plain else []
    by_criteria = partial(
        _by_criteria, method=method, quantity=quantity, criterion=criterion, pressure_bar=pressure_bar
    )
    chosen = chosen_life(state, life, at_cycles)
    prediction, criteria = by_criteria(state, chosen, evidence)
    prediction = prediction.model_copy(update={"warnings": [*prediction.warnings, *disagree]})
    now = chosen.number == chosen.of and (at_cycles is None or at_cycles >= row.summary.get("as_of_cycles", math.inf))
    among = None
    if chosen.held:
        evidence = replace(evidence, reader=repository.run_reader(database, clutch_id))
        state_with_held = with_held(state, evidence)
        chosen_with_held = chosen_life(state_with_held, life, None if now else at_cycles)
        among = in_short(by_criteria(state_with_held, chosen_with_held, evidence)[0])
    beside = with_held_runs(in_short(prediction), as_stored(row.summary if now else {}), among, len(chosen.held))
    head = {"clutch_id": clutch_id, "method": method, "revision": row.revision, "origin": state.record.origin}
    return RemainingLife(**{**head, **dict(prediction), **beside.of(prediction)}, life=chosen.item(), criteria=criteria)


def _by_criteria(
    state: ClutchHistory,
    chosen: ChosenLife,
    evidence: ClutchMeasurements,
    *,
    method: str,
    quantity: str | None,
    criterion: str | None,
    pressure_bar: float | None,
) -> tuple[LifePrediction, list[CriterionOutcome]]:
    """The prediction by the requested criteria together, and what each of them says alone."""
    prediction = predict_at(
        [] if chosen.life is None else [chosen.life], chosen.assumptions, state.fraction, method=method
    )
    measured = measured_life(state, chosen, evidence)
    if measured is None:
        return prediction, []
    requested = _requested_criteria(state.record.end_of_life, measured, quantity, criterion, pressure_bar)
    if all(criterion_in.quantity != MEAN_COF for criterion_in in requested):
        prediction = prediction.model_copy(update=_NOT_OF_MEAN_COF)
    ends = [criterion_end(measured, criterion_in, method) for criterion_in in requested]
    prediction, criteria = criteria_answer(measured, ends, prediction)
    return ended(prediction, measured.life.end), criteria


def _requested_criteria(
    record: EndOfLifeIn, measured: MeasuredLife, quantity: str | None, criterion: str | None, pressure_bar: float | None
) -> Sequence[CriterionIn]:
    """The criteria that a request asks for: those of the clutch's record, or one on the requested quantity."""
    of_clutch = record.criteria or (CriterionIn(quantity="mean_cof", fraction=record.cof_fraction),)
    if quantity is None and criterion is None and pressure_bar is None:
        return of_clutch
    name = quantity_named(quantity or criterion or MEAN_COF).name
    chosen = [
        candidate
        for candidate in of_clutch
        if candidate.quantity == name and pressure_bar in (None, candidate.pressure_bar)
    ]
    if chosen:
        return chosen
    if criterion is not None:
        raise NotFoundError(
            f"the clutch has no criterion on {name}; it has: {', '.join(candidate.quantity for candidate in of_clutch)}"
        )
    return [_usual(name, record.cof_fraction, measured, pressure_bar)]


def _usual(name: str, fraction: float, measured: MeasuredLife, pressure_bar: float | None) -> CriterionIn:
    """The default criterion for a quantity on which the clutch's record has none: the record's fraction, or slope 0 for
    a slope; at the lowest measured pressure and frequency unless a pressure is given."""
    quantity = quantity_named(name)
    tracks = measured.series(quantity)
    if not tracks:
        raise NotFoundError(f"{name} is not measured in this life")
    first = min(tracks, key=lambda series: (series.frequency_hz or 0.0, series.pressure))
    if pressure_bar is None and first.pressure != ALL_PRESSURES:
        pressure_bar = first.pressure / 1e5
    place = {"quantity": name, "pressure_bar": pressure_bar}
    if quantity.family is Family.SLOPE:
        return CriterionIn.model_validate(place | {"speed_rpm": SLOPE_SPEEDS[1]})
    return CriterionIn.model_validate(place | {"fraction": fraction, "frequency_hz": first.frequency_hz})
