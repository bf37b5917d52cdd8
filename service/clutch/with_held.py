"""The remaining life of a clutch without its held runs, and with them.

Computed with the results of every run and change, and stored with them as the clutch's summary.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from service.api.life import LifePrediction
from service.api.over_life import MeasuredEngagement
from service.api.run import Evaluation
from service.clutch.condition import SHOWN, STORED, as_stored, recent
from service.clutch.engagements import StoredEngagement, engagements_over_life
from service.clutch.items import ended
from service.clutch.model_correction import RunReader
from service.clutch.quantities.ends import CriterionEnd, criteria_answer, criterion_end
from service.clutch.quantities.measured import ChosenLife, MeasuredLife, chosen_life
from service.clutch.recomputation import ClutchHistory, Levels, Tracking, with_cofs
from service.clutch.summary import Outlook, StoredSummary
from service.clutch.timeline import Life, moment_at, order, pace_of
from service.clutch.tracking import PREDICTED, States, carrier, predict_at
from service.errors import NotFoundError


@dataclass(frozen=True, slots=True, kw_only=True)
class ClutchMeasurements:
    """The stored measurements of a clutch by run_id, including its held runs."""

    levels: Levels
    receipts: Mapping[str, Evaluation]
    engagements: Mapping[str, StoredEngagement]
    reader: RunReader | None = None


def needs_evidence(state: ClutchHistory) -> bool:
    """Whether a clutch's summary needs more than its tracks."""
    return bool(state.held or state.record.end_of_life.criteria)


def summarised(state: ClutchHistory, tracking: Tracking, evidence: ClutchMeasurements | None) -> StoredSummary:
    """The summary of a tracked clutch; `evidence` is required if `needs_evidence`."""
    if not state.events:
        return held_summary(state, {}, evidence)
    last, life = state.events[-1].cycles, state.lives[-1]
    prediction = next(made.prediction for made in tracking.predictions if (made.cycles, made.method) == (last, SHOWN))
    if evidence is not None:
        prediction = by_own_criteria(state, SHOWN, prediction, evidence, tracking.filters)
    payload = prediction.model_dump(mode="json", exclude_unset=True)
    pace, pooled = pace_of(life.events), life.pooled(state.assumptions)
    predicted = as_stored({name: payload[name] for name in STORED})
    present: StoredSummary = {
        "runs": len(state.events),
        "new_levels": [event.run_id for event in state.events if event.new_level],
        "recent": recent(state.events, pooled).model_dump(mode="json"),
        "life": life.name,
        "from_cycles": life.origin,
        "tests": life.tests,
        "corrected": list(state.assumptions.model.corrected),
        "oil_question": life.oil_question,
        "rig_question": life.rig_question(pooled.new_levels),
        "places": len({measurement.progress for measurement in pooled.measurements}),
        "pace": None if pace is None else {"cycles_per_second": pace, "moment": moment_at(life.events, pace, last)},
    }
    return {**predicted, **present, **held_summary(state, tracking.filters, evidence)}


def held_summary(state: ClutchHistory, filters: States, evidence: ClutchMeasurements | None) -> StoredSummary:
    """The held runs in a clutch's summary: their number, and the prediction by each filter with them counted."""
    if not state.held or evidence is None:
        return {"held": len(state.held), "with_held": None}
    state_with_held = with_held(state, evidence)
    return {
        "held": len(state.held),
        "with_held": {method: outlook(state_with_held, method, evidence, filters) for method in PREDICTED},
    }


def with_held(state: ClutchHistory, evidence: ClutchMeasurements) -> ClutchHistory:
    """The clutch's history with its held runs accepted."""
    state_with_held = replace(state, events=order([*state.events, *state.held]), held=())
    if evidence.reader is None:
        raise ValueError("a history with held runs needs a reader of them")
    return with_cofs(state_with_held, evidence.levels, evidence.reader)[0]


def outlook(state: ClutchHistory, method: str, evidence: ClutchMeasurements, filters: States) -> Outlook:
    """The remaining life by a filter and the clutch's own criteria; `filters` are carried on only if they are of the
    same measurements."""
    prediction = predict_at(
        state.lives, state.assumptions, state.fraction, method=method, carried=filters.get(carrier(method))
    )
    prediction = by_own_criteria(state, method, prediction, evidence, filters)
    return {
        "status": prediction.status,
        "as_of_cycles": prediction.as_of_cycles,
        "remaining_cycles": prediction.remaining_cycles,
        "at_least": prediction.at_least,
    }


def by_own_criteria(
    state: ClutchHistory, method: str, prediction: LifePrediction, evidence: ClutchMeasurements, filters: States
) -> LifePrediction:
    """A prediction by mean COF, changed by the record's other criteria; unchanged if mean COF alone ends the life."""
    criteria = state.record.end_of_life.criteria
    measured = measured_life(state, chosen_life(state), evidence, filters) if criteria else None
    if measured is None:
        return prediction
    ends = []
    for criterion in criteria:
        try:
            ends.append(criterion_end(measured, criterion, method))
        except NotFoundError:  # measured, but not at the criterion's place: who asks for the remaining life is told so
            ends.append(CriterionEnd(criterion=criterion, tests=0))
    return ended(criteria_answer(measured, ends, prediction)[0], measured.life.end)


def measured_life(
    state: ClutchHistory, chosen: ChosenLife, evidence: ClutchMeasurements, filters: States | None = None
) -> MeasuredLife | None:
    """A life of a clutch with all its measurements; None if there are none yet."""
    if chosen.life is None:
        return None
    return MeasuredLife(
        life=chosen.life,
        assumptions=chosen.assumptions,
        geometry=state.geometry,
        fraction=state.fraction,
        levels=evidence.levels,
        receipts=evidence.receipts,
        engagements=engagement_rows(state.lives, evidence.engagements),
        filters=filters or {},
    )


def engagement_rows(lives: Sequence[Life], engagements: Mapping[str, StoredEngagement]) -> list[MeasuredEngagement]:
    """The engagements of a history with all indicators, by life and cycles."""
    names = [[event.run_id for event in life.events] for life in lives]
    stored = [engagements[run_id] for of_life in names for run_id in of_life if run_id in engagements]
    return engagements_over_life(stored, names) if stored else []
