"""Converts between database rows and values: loads the state of a clutch and its runs, and stores its results.

A change reads a `ClutchHistory`, computes outside any transaction, and stores with `unchanged` and `store`. Stored runs are
as they were sent, each read in a transaction of its own when it is asked for; `recomputed` computes all results from them.
"""

from __future__ import annotations

import logging
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection

from models.degradation.severity import Severity
from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.ended_lives import ObservedLife
from models.prognosis.fleet import FleetPrior
from service.alarms import raising
from service.api.base import Answer, of_row
from service.api.clutch import ClutchIn, LatestDiagnosis
from service.api.fleet import Kind
from service.api.inspection import InspectionOut, PhotographOut
from service.api.life import LifePrediction, PriorName
from service.api.over_life import MeasuredEngagement
from service.api.rig import RigIn, RigOut
from service.api.run import Evaluation, Receipt
from service.channels import content_of, instant, whole
from service.clutch import items
from service.clutch.analysis import LevelFit, analyse
from service.clutch.assumptions import ALL_PRESSURES, FLEET, LearnedPrior, kind_of, severity_name, severity_under
from service.clutch.condition import DISAGREES, as_stored, rank_of, state_of, top_line
from service.clutch.engagements import DUTY_KINDS, StoredEngagement, stored_engagement
from service.clutch.incoming_run import IncomingRun, content_hash
from service.clutch.items import doubted
from service.clutch.model_correction import RunReader, extension_of
from service.clutch.plausibility.doubts import Judged, doubts_alone
from service.clutch.recomputation import (
    Adoption,
    ClutchHistory,
    Levels,
    Results,
    Tracking,
    computed_again,
    newest_adoption,
    with_set_aside,
)
from service.clutch.timeline import ByPressure, Event, lives_of, order
from service.clutch.tracking import CARRIED, PREDICTED, States, Tracked
from service.clutch.with_held import ClutchMeasurements, engagement_rows, needs_evidence, summarised
from service.errors import BusyError, InvalidError, NotFoundError, unknown_clutch
from service.kept_history import FIT_COLUMNS, event_of, history
from service.kept_history import filters as kept_filters
from service.kept_history import levels as levels_of
from service.logging import request_id
from service.settings import CODE_VERSION
from storage import assumptions, changes, clutches, diagnoses, inspections, jobs, raw_columns, results, rigs, runs
from storage.blobs import raw_stores
from storage.clutches import ClutchRow
from storage.diagnoses import DiagnosisRow, VerdictRow
from storage.encoding import Json
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.inspections import InspectionRow, PhotographRow
from storage.jobs import JobRow
from storage.results import FilterStateRow, FitRow, PredictionRow
from storage.rigs import RigRow
from storage.rows import allow_damage
from storage.runs import RunRow

if TYPE_CHECKING:
    from models.diagnosis.extension import Extension

_log = logging.getLogger("clutchlife")

#: How often what depends on a clutch's history is computed where others change it meanwhile. Derived: beside three services
#: that change it all the time, each as often as this one, one in a hundred gives up (0.75^16).
MAX_ATTEMPTS = 16
#: Who changes the state of a run where other runs do.
BY_EVIDENCE = "evidence"


def clutch(connection: Connection, clutch_id: str) -> ClutchRow:
    """The clutch's row; NotFoundError if there is none."""
    row = clutches.get(connection, clutch_id)
    if row is None:
        raise unknown_clutch(clutch_id)
    return row


def diagnosis(connection: Connection, clutch_id: str, diagnosis_id: str) -> DiagnosisRow:
    """A diagnosis of a clutch; NotFoundError if there is none."""
    row = diagnoses.get(connection, clutch_id, diagnosis_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no diagnosis {diagnosis_id!r}")
    return row


def rig(connection: Connection, name: str) -> RigOut:
    """The rig profile in force under this name; NotFoundError if there is none."""
    row = rigs.get(connection, name)
    if row is None:
        names = ", ".join(repr(profile.name) for profile in rigs.page(connection, limit=10))
        raise NotFoundError(f"there is no rig {name!r}; the rigs are: {names or 'none yet'}")
    return rig_out(row)


def rig_out(row: RigRow) -> RigOut:
    """A stored profile; fields that it lacks, because they are newer, have their defaults."""
    return of_row(RigOut, row, **dict(RigIn.model_validate(row.content)))


def record(row: ClutchRow) -> ClutchIn:
    return ClutchIn.model_validate(row.record)


def state(
    connection: Connection,
    clutch_id: str,
    *,
    also: Extension | None = None,
    edited: ClutchIn | None = None,
    carried: bool = False,
    newest_prior: bool = False,
    damaged: bool = False,
) -> ClutchHistory:
    """The clutch's history at its present revision, with priors and adopted models. Raises NotFoundError.

    `also`: an extension that may come into force; what fleets taught for its severity is loaded beside the others'.
    `edited`: a record that is about to come into force in place of the stored one.
    `carried`: with the filters after the last run, to be carried on; all else is computed without them.
    `newest_prior`: under what its fleet knows now; else a clutch stays under the version that it was tracked under last.
    `damaged`: what follows from its runs may be damaged and is computed again; its record must not be.
    """
    if damaged:
        allow_damage(connection)
    row = clutch(connection, clutch_id)
    if damaged and content_of(row.record) != row.content_sha256:
        raise DamagedData(f"the record of clutch {clutch_id!r} is damaged: restore a backup")
    past = history(connection, row)
    own, adoptions = edited or record(row), _adoptions(connection, clutch_id)
    extensions = [also, *(None if adopted is None else adopted.extension for adopted in adoptions)]
    exponents = {None, *(extension.severity_exponent for extension in extensions if extension is not None)}
    severities = {severity_under(own, exponent) for exponent in exponents}
    last = results.prediction_at(connection, clutch_id, CARRIED, ALL_PRESSURES)
    tracked = None if last is None or newest_prior or damaged or edited is not None else prediction(last)
    return ClutchHistory(
        record=own,
        revision=row.revision,
        archived=row.archived,
        events=past.events,
        adoptions=adoptions,
        priors={severity: _learned_prior(connection, own, severity, tracked) for severity in severities},
        filters=_filters(connection, row) if carried else None,
        held=past.held,
        summary=as_stored({} if damaged else row.summary),
    )


def adoption(connection: Connection, clutch_id: str) -> Adoption | None:
    """The newest adopted model among the lives in the history, None under the baseline. Whether it is in force depends
    on the present life."""
    adopted = _adoptions(connection, clutch_id)
    return newest_adoption(adopted, [row.run_id for row in runs.rebuilds(connection, clutch_id)])


def _adoptions(connection: Connection, clutch_id: str) -> tuple[Adoption | None, ...]:
    """The adopted models, newest first, at most one per life, back to the last return to the baseline (None) or the
    clutch's first life."""
    adopted: dict[str, Adoption] = {}
    for row in assumptions.adoptions_of(connection, clutch_id):
        diagnosed = None if row.diagnosis_id is None else diagnoses.get(connection, clutch_id, row.diagnosis_id)
        if diagnosed is None or diagnosed.extension is None:
            return (*adopted.values(), None)
        if diagnosed.life not in adopted:
            extension = extension_of(diagnosed.extension)
            adopted[diagnosed.life] = Adoption(
                diagnosis_id=diagnosed.diagnosis_id, life=diagnosed.life, extension=extension
            )
        if not diagnosed.life:
            break
    return tuple(adopted.values())


def present_life(connection: Connection, clutch_id: str) -> str:
    """The present life's name: the run_id of the rebuild that began it, "" if there was none."""
    rebuilds = order([event_of(row, {}) for row in runs.rebuilds(connection, clutch_id)])
    return rebuilds[-1].run_id if rebuilds else ""


def events(connection: Connection, clutch_id: str) -> tuple[Event, ...]:
    """All accepted runs of a clutch as events of its history, in order; mean COF is corrected by the model in force."""
    return history(connection, clutch(connection, clutch_id)).events


def set_aside(connection: Connection, clutch_id: str) -> dict[str, Event]:
    """The held and withdrawn runs by run_id, as events of the history without their mean COFs."""
    return {row.run_id: replace(event_of(row, {}), confirmed=False) for row in runs.set_aside(connection, clutch_id)}


def levels(connection: Connection, clutch_id: str) -> dict[str, list[LevelFit]]:
    """The fits at each pressure level of all runs of a clutch, by run_id."""
    return levels_of(connection, clutch_id)


def json_of(answer: Answer) -> Json:
    """A model's set fields as the value of a JSON column."""
    return answer.model_dump(mode="json", exclude_unset=True)


def prediction(row: PredictionRow) -> LifePrediction:
    """The prediction in a stored row."""
    return LifePrediction.model_validate(row.payload)


def receipt(row: RunRow) -> Receipt:
    """A run's present receipt: the stored one with the run's state, doubts, cycles as sent, and sender."""
    sent_cycles = row.cycles if row.sent_cycles is None else row.sent_cycles
    present = {"state": row.state, "doubts": row.doubts, "sent_cycles": whole(sent_cycles)}
    return Receipt.model_validate(row.receipt | present | {"received_by": row.received_by})


def summary(row: RunRow) -> dict[str, Any]:
    """The fields of a run that the audit trail records before and after a change."""
    return {"state": row.state, "cycles": whole(row.cycles), "doubts": list(row.doubts)}


def receipts(connection: Connection, clutch_id: str) -> dict[str, Evaluation]:
    """All stored receipts of a clutch by run_id."""
    return {row.run_id: Evaluation.model_validate(row.receipt) for row in runs.page(connection, clutch_id)}


def answers(connection: Connection, clutch_id: str) -> list[Any]:
    """Stored receipts, predictions, summary and history of a clutch, compared before and after a change to decide on a
    new revision."""
    tracks = [results.predictions_of(connection, clutch_id, method, ALL_PRESSURES) for method in PREDICTED]
    past = history(connection, clutch(connection, clutch_id))
    return [receipts(connection, clutch_id), tracks, clutch(connection, clutch_id).summary, past.events, past.held]


def store_change(connection: Connection, clutch_id: str, computed: Results, *, by: str, at: str) -> int:
    """Store the results of a new or changed run and its effects on other runs, and move the clutch's revision on;
    returns the new revision."""
    store(connection, clutch_id, computed)
    revision = clutches.bump_revision(connection, clutch_id)
    _store_judged(connection, clutch_id, computed.judged, at=at, revision=revision)
    if computed.teaches is not None:
        ask_fleet_refresh(connection, computed.teaches, by=by, at=at)
    return revision


def _store_judged(connection: Connection, clutch_id: str, judged: Judged, *, at: str, revision: int) -> None:
    """Store the new states of runs that other runs' evidence accepted or held, each with an entry in the audit trail."""
    states = [(event, runs.ACCEPTED, changes.ACCEPT) for event in judged.accepted]
    states += [(event, runs.HELD, changes.DOUBT) for event in judged.held]
    for event, new_state, action in states:
        row = runs.get(connection, clutch_id, event.run_id)
        if row is None:
            raise LookupError(f"run {event.run_id!r} of clutch {clutch_id!r} is not stored")
        doubts = tuple(doubted(judged.doubts.get(event.run_id, ())))
        after = replace(row, state=new_state, doubts=doubts)
        runs.set_state(
            connection, row.run_key, state=new_state, cycles=row.cycles, sent_cycles=row.sent_cycles, doubts=doubts
        )
        entry = {"run_id": event.run_id, "at": at, "by": BY_EVIDENCE, "reason": judged.reasons[event.run_id]}
        changes.insert(connection, clutch_id, action, summary(row), summary(after), revision=revision, **entry)
    for run_id, notices in judged.doubts.items():  # the question to several held runs names all of them
        held = runs.get(connection, clutch_id, run_id) if any(notice.hypothesis for notice in notices) else None
        doubts = tuple(doubted(notices))
        if held is not None and held.state == runs.HELD and list(held.doubts) != list(doubts):
            runs.set_state(
                connection,
                held.run_key,
                state=runs.HELD,
                cycles=held.cycles,
                sent_cycles=held.sent_cycles,
                doubts=doubts,
            )


def unchanged(connection: Connection, clutch_id: str, revision: int) -> bool:
    """Whether the clutch is still at the revision from which results were computed."""
    return clutches.revision(connection, clutch_id) == revision


def attempts(clutch_id: str) -> Iterator[int]:
    """Numbers of attempts to compute and store, from 1; raises BusyError after the last, because the clutch changed
    during each."""
    yield from range(1, MAX_ATTEMPTS + 1)
    raise BusyError(
        f"clutch {clutch_id!r} was changed by other requests {MAX_ATTEMPTS} times during this request: send it again"
    )


def replace_results(database: Database, state: ClutchHistory, computed: Results, *, damaged: bool = False) -> bool:
    """Store a clutch's results if its revision is still that of `state`; false if it is not. The revision moves on if
    an answer changes, or if the replaced results may be `damaged`."""
    with database.writing() as connection:
        if damaged:
            allow_damage(connection)
        is_unchanged = unchanged(connection, state.clutch_id, state.revision)
        if is_unchanged and damaged:
            store(connection, state.clutch_id, computed)
            clutches.bump_revision(connection, state.clutch_id)
        elif is_unchanged:
            before = answers(connection, state.clutch_id)
            store(connection, state.clutch_id, computed)
            if answers(connection, state.clutch_id) != before:
                clutches.bump_revision(connection, state.clutch_id)
    return is_unchanged


def store(connection: Connection, clutch_id: str, computed: Results) -> None:
    """Replace a clutch's stored results by these. The caller moves the revision on. Raises ValueError for tracks without
    the summary that follows from them."""
    if computed.tracking is not None and computed.summary is None:
        raise ValueError("tracks are stored with the summary that follows from them")
    if computed.levels or computed.receipts or computed.corrected:
        rows = runs.keys(connection, clutch_id)
        for run_id, own in computed.levels.items():
            results.write_fits(connection, rows[run_id], fit_rows(own, computed.cofs.get(run_id, {})))
        for run_id, receipt in computed.receipts.items():
            if run_id in computed.details:
                runs.set_results(
                    connection, rows[run_id], dict(computed.details[run_id]), json_of(receipt), CODE_VERSION
                )
            else:
                runs.set_receipt(connection, rows[run_id], json_of(receipt))
    if computed.corrected_again:
        assumptions.clear_corrected_cofs(connection, clutch_id)
    for run_id, cofs in computed.corrected.items():
        assumptions.write_corrected_cofs(connection, rows[run_id], cofs)
    states_sum = None
    if computed.tracking is not None:
        _store_tracking(connection, clutch_id, computed.tracking)
        states_sum = results.states_sum(connection, clutch_id)
    if computed.summary is not None:
        clutches.set_summary(
            connection,
            clutch_id,
            rank_of(computed.summary),
            dict(computed.summary),
            life=computed.summary.get("life", ""),
            state=state_of(computed.summary, disputed=False)["name"],
            if_disputed=state_of(computed.summary, disputed=True)["name"],
            states_sum=states_sum,
        )
        raising.evaluate(connection, clutch_id)


def ask_fleet_refresh(connection: Connection, kind: Kind | None, *, by: str, at: str, learned: bool = False) -> None:
    """Queue a refresh of a kind's fleet prior (None: all kinds), because the lessons of an ended life have changed,
    unless an equal job waits. `learned`: the prior is up to date, and only its clutches are tracked again."""
    fleet = None if kind is None else assumptions.fleet_key(json_of(kind))
    for row in jobs.open_of(connection, jobs.FLEET_REFRESH):
        if row.state == jobs.WAITING and row.of in (fleet, None) and row.arguments.get("learned", False) <= learned:
            return
    job = JobRow(
        job_id=secrets.token_hex(8),
        kind=jobs.FLEET_REFRESH,
        clutch_id=None,
        asked_at=at,
        asked_by=by,
        arguments={"request": request_id.get(), "fleet": fleet, "learned": learned},
    )
    jobs.insert(connection, job)


def _store_tracking(connection: Connection, clutch_id: str, tracking: Tracking) -> None:
    """Replace the stored filter states of a clutch, and add its new predictions."""
    if tracking.again:
        results.clear_predictions(connection, clutch_id)
    made: dict[str, Any] = {"pressure": ALL_PRESSURES, "code_version": CODE_VERSION}
    predictions = [
        PredictionRow(cycles=each.cycles, method=each.method, payload=json_of(each.prediction), **made)
        for each in tracking.predictions
    ]
    filters = [
        FilterStateRow(method=method, runs=tracked.runs, arrays=tracked.to_arrays(), **made)
        for method, tracked in tracking.filters.items()
    ]
    results.put_predictions(connection, clutch_id, predictions)
    results.clear_filter_states(connection, clutch_id)
    results.put_filter_states(connection, clutch_id, filters)


def states_finding(connection: Connection, row: ClutchRow) -> str | None:
    """What is wrong where the filter states of a clutch are not those that were stored last, each whole as it may be."""
    if results.states_sum(connection, row.clutch_id) == row.states_sum:
        return None
    return f"the filter states of clutch {row.clutch_id!r} are not those of its revision {row.revision}"


def _filters(connection: Connection, row: ClutchRow) -> States | None:
    """The filter states, kept or stored; None if they are damaged or of another release, so that the clutch is tracked from
    its runs."""
    if (kept := kept_filters(connection, row)) is not None:
        return kept
    try:
        rows = {method: row for (method, _), row in results.filter_states_of(connection, row.clutch_id).items()}
    except DamagedData as error:
        finding: str | None = str(error)
    else:
        finding = states_finding(connection, row)
    if finding is not None:
        _log.warning("%s: the clutch is tracked again from its runs", finding)
        return None
    if any(row.code_version != CODE_VERSION for row in rows.values()):
        return None
    return {method: Tracked.from_arrays(row.runs, row.arrays) for method, row in rows.items()}


def _learned_prior(
    connection: Connection, own: ClutchIn, severity: Severity, tracked: LifePrediction | None
) -> LearnedPrior:
    """The fleet's prior, learned without this clutch: the version named by the prediction `tracked`, or the newest."""
    version = None
    if tracked is not None and tracked.severity == severity_name(severity):
        version = tracked.prior.version or 0
    try:
        row = assumptions.fleet_prior_for(connection, json_of(kind_of(own, severity)), own.clutch_id, version)
    except DamagedData as error:
        _log.warning("%s: the weak prior takes its place until the next clutchlife fleet refresh", error)
        row = None
    if row is None:
        return LearnedPrior()
    fleet = FleetPrior.from_dict(row.content)
    ended = tuple(ObservedLife.from_dict(life) for name in ("ended", "censored") for life in row.content.get(name, ()))
    name = PriorName(name=FLEET, version=row.version, clutches=fleet.clutches)
    return LearnedPrior(fleet=fleet, ended=ended, name=name)


def fit_rows(own: Sequence[LevelFit], cofs: ByPressure) -> list[FitRow]:
    """The rows of these fits, with mean COF by pressure if the level determines it."""
    rows = []
    for level in own:
        fit = level.fit
        parameters: dict[str, Any] = {name: float(getattr(fit.parameters, name)) for name in PARAMETER_NAMES}
        mean_cof, mean_cof_sd = cofs.get(fit.pressure, (None, None))
        row = FitRow(
            **{name: getattr(fit, name) for name in FIT_COLUMNS},
            **parameters,
            mean_pressure=level.mean_pressure,
            covariance=tuple(fit.covariance.ravel().tolist()),
            unbiased_covariance=tuple(fit.unbiased_covariance.ravel().tolist()),
            status=fit.status.value,
            speeds=level.speeds,
            mean_cof=mean_cof,
            mean_cof_sd=mean_cof_sd,
            code_version=CODE_VERSION,
            measured=None if level.measured is None else tuple(level.measured.columns().ravel().tolist()),
        )
        rows.append(row)
    return rows


def latest_diagnosis(row: ClutchRow, verdict: VerdictRow | None) -> LatestDiagnosis | None:
    """The newest finished diagnosis as sent to clients; if a rebuild has ended its life, it can no longer be adopted."""
    if verdict is None:
        return None
    earlier = verdict.life != row.summary.get("life", "")
    return of_row(
        LatestDiagnosis,
        verdict,
        causes=list(verdict.causes),
        advice={name: verdict.advice[0][name] for name in ("test", "separates")} if verdict.advice else None,
        adoptable=verdict.adoptable and not earlier,
        adopted=verdict.adopted and not earlier,
        earlier_life=earlier,
    )


def condition(row: ClutchRow) -> dict[str, str]:
    return state_of(as_stored(row.summary), disputed=row.is_disputed, silent=row.silent)


def first_line(row: ClutchRow, diagnosis: LatestDiagnosis | None, *, raised: int) -> dict[str, str]:
    """The clutch's `headline` and `action`. `diagnosis`: its newest one as sent to clients; `raised`: its number of
    unacknowledged alarms."""
    summary = as_stored(row.summary)
    return top_line(summary, disputed=row.is_disputed, diagnosis=diagnosis, silent=row.silent, raised=raised)


def note_dispute(connection: Connection, clutch_id: str) -> None:
    """Store whether data and model disagree, and the clutch's state that follows; called after a diagnosis, an adoption
    or a return to the baseline. A dispute belongs to one life and counts while that is the present one."""
    verdict = diagnoses.newest(connection, [clutch_id]).get(clutch_id)
    disputed = None if verdict is None or verdict.adopted or verdict.verdict not in DISAGREES else verdict.life
    row = replace(clutch(connection, clutch_id), disputed=disputed)
    clutches.set_disputed(connection, clutch_id, disputed, state=condition(row)["name"])
    raising.evaluate(connection, clutch_id)


def inspection(connection: Connection, clutch_id: str, inspection_id: str) -> InspectionRow:
    """The inspection's row; NotFoundError if there is none."""
    row = inspections.get(connection, clutch_id, inspection_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no inspection {inspection_id!r}")
    return row


def inspection_hash(content: Mapping[str, Any]) -> str:
    """The sha256 of an inspection's content."""
    return content_of({**content, "performed_at": instant(content["performed_at"])})


def inspection_answers(connection: Connection, rows: Sequence[InspectionRow]) -> list[InspectionOut]:
    """Inspections with their photographs, as sent to clients."""
    photographs = inspections.photographs(connection, [row.inspection_key for row in rows])
    return [
        of_row(
            InspectionOut,
            row,
            **row.content,
            duplicate=False,
            photographs=[photograph_answer(photograph) for photograph in photographs[row.inspection_key]],
        )
        for row in rows
    ]


def photograph_answer(row: PhotographRow) -> PhotographOut:
    """A photograph's description as sent to clients."""
    return of_row(PhotographOut, row, photograph_id=row.sha256)


def evidence(connection: Connection, clutch_id: str, *, of_fits: bool = False) -> ClutchMeasurements:
    """Stored fits, receipts and engagements of all runs of a clutch, held ones too, without a reader of its runs.
    `of_fits`: fits alone."""
    return ClutchMeasurements(
        levels=levels(connection, clutch_id),
        receipts={} if of_fits else receipts(connection, clutch_id),
        engagements={} if of_fits else _engagements(connection, clutch_id),
    )


def evidence_for(database: Database, state: ClutchHistory, reader: RunReader) -> ClutchMeasurements | None:
    """The measurements that a clutch's summary needs in addition to its tracks; None if the tracks suffice."""
    if not needs_evidence(state):
        return None
    with database.reading() as connection:
        return replace(evidence(connection, state.clutch_id), reader=reader)


def tracked_again(
    database: Database, state: ClutchHistory, levels: Levels, receipts: Mapping[str, Evaluation]
) -> Results:
    """A clutch's results after a change of its state, with the fits of its runs unchanged."""
    reader = run_reader(database, state.clutch_id)
    final, computed = computed_again(state, levels, receipts, reader, evaluated=state.stationary_tests)
    evidence = evidence_for(database, final, reader)
    return replace(computed, summary=summarised(final, computed.tracking or Tracking(), evidence))


def engagements(connection: Connection, clutch_id: str) -> list[MeasuredEngagement]:
    """The accepted engagements that have all indicators, by life and cycles."""
    stored = _engagements(connection, clutch_id)
    return engagement_rows(lives_of(events(connection, clutch_id)), stored) if stored else []


def _at(row: RunRow) -> Evaluation:
    """A run's stored receipt with the run's present cycles."""
    return Evaluation.model_validate(row.receipt | {"cycles": whole(row.cycles)})


def _engagements(connection: Connection, clutch_id: str) -> dict[str, StoredEngagement]:
    rows = [row for kind in DUTY_KINDS for row in runs.page(connection, clutch_id, kind=kind)]
    stored = {row.run_id: stored_engagement(_at(row), row.details) for row in rows}
    return {run_id: engagement for run_id, engagement in stored.items() if engagement is not None}


def run(connection: Connection, clutch_id: str, run_id: str) -> RunRow:
    """The run's row; NotFoundError if the clutch or the run is unknown."""
    clutch(connection, clutch_id)
    row = runs.get(connection, clutch_id, run_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no run {run_id!r}")
    return row


def run_reader(database: Database, clutch_id: str, *, damaged: bool = False) -> RunReader:
    """A reader of the clutch's stored runs; each read has a transaction of its own, so that none stays open between
    reads."""

    def read(run_id: str, *, whole: bool = True) -> IncomingRun:
        with database.reading() as connection:
            if damaged:
                allow_damage(connection)
            row = run(connection, clutch_id, run_id)
            columns = raw_columns.stored_of_run(connection, row.run_key) if whole else ()
        return decoded(row, columns)

    with database.reading() as connection:
        if damaged:
            allow_damage(connection)
        own = record(clutch(connection, clutch_id))
        sampled = raw_columns.samples(connection, clutch_id)
        names = runs.keys(connection, clutch_id)
    return RunReader(
        read=read,
        describe=partial(read, whole=False),
        sampled=frozenset(run_id for run_id, run_key in names.items() if run_key in sampled),
        torque_filter=own.torque_filter,
    )


def placed(database: Database, columns: raw_columns.Encoded) -> raw_columns.Encoded:
    """The run's columns, with the long ones moved to the store of raw records if one is in use; call it before the
    run's row is inserted."""
    with database.reading() as connection:
        store = raw_stores.in_use(connection)
    return columns if store is None else columns.put(store)


def _loaded_reader(database: Database, record: ClutchIn, rows: Sequence[RunRow]) -> RunReader:
    """A reader with all stored channels in memory, so that it needs no database and can be pickled."""
    loaded = {}
    for row in rows:
        with database.reading() as connection:
            columns = raw_columns.stored_of_run(connection, row.run_key)
        loaded[row.run_id] = tuple(column.loaded() for column in columns)
    by_name = {row.run_id: row for row in rows}
    return RunReader(
        read=partial(_read_loaded, by_name, loaded),
        describe=partial(_read_loaded, by_name, {}),
        sampled=frozenset(run_id for run_id, own in loaded.items() if any(column.name == "time_s" for column in own)),
        torque_filter=record.torque_filter,
    )


def _read_loaded(
    rows: Mapping[str, RunRow], loaded: Mapping[str, tuple[raw_columns.Stored, ...]], run_id: str
) -> IncomingRun:
    """A run with its loaded channels; a module-level function, so that it can be pickled."""
    return decoded(rows[run_id], loaded.get(run_id, ()))


def decoded(row: RunRow, columns: Sequence[raw_columns.Stored]) -> IncomingRun:
    """A stored run with its channels. Raises DamagedData, naming the run."""
    try:
        return incoming(row, raw_columns.values_of(columns))
    except DamagedData as error:
        raise DamagedData(f"run {row.run_id} is damaged: {error}") from error


def content_now(row: RunRow, sent: IncomingRun) -> str:
    """The hash of a run's stored content, for comparison with the hash in its receipt."""
    sha256 = content_hash(replace(sent, cycles=row.cycles if row.sent_cycles is None else row.sent_cycles))
    read_again = row.details.get("file", {}).get("content_sha256")
    return row.content_sha256 if sha256 == read_again else sha256


def _refuse_restated(row: RunRow, trail: Mapping[str, Any]) -> None:
    """Raise DamagedData if a run's state or cycles differ from the audit trail: the sent content cannot restore them."""
    now = summary(row)
    for name, stated in ({"state": runs.ACCEPTED} | dict(trail)).items():
        if name in ("state", "cycles") and now[name] != stated:
            said = f"the audit trail says {stated!r}, the run {now[name]!r}"
            raise DamagedData(f"the {name} of run {row.run_id} is damaged ({said}): restore a backup")


def _refuse_changed(database: Database, row: RunRow) -> None:
    """Raise DamagedData if a run's stored content differs from the content sent."""
    with database.reading() as connection:
        columns = raw_columns.stored_of_run(connection, row.run_key)
    try:
        sha256 = content_now(row, decoded(row, columns))
    except KeyError as error:
        raise DamagedData(f"run {row.run_id} is damaged: its details lack {error}") from error
    if sha256 != row.content_sha256:
        raise DamagedData(f"run {row.run_id} differs from what was sent: restore a backup")


def incoming(row: RunRow, columns: Mapping[str, NDArray[np.float64]]) -> IncomingRun:
    """A stored run as it was sent, with the given channels."""
    return IncomingRun(
        kind=row.kind,
        cycles=row.cycles,
        run_id=row.run_id,
        content_sha256=row.content_sha256,
        started_at=row.started_at,
        origin=row.details["origin"],
        channels=columns,
        details={name: row.details[name] for name in ("duty", "event", "reason", "note") if name in row.details},
        file=row.details.get("file"),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """The input of a clutch's results: its history, its runs in order of arrival, the held and withdrawn runs as
    events, and a reader of the channels. It can be pickled if it was loaded `whole`."""

    state: ClutchHistory
    rows: tuple[RunRow, ...]
    aside: Mapping[str, Event]
    reader: RunReader


def recorded(database: Database, state: ClutchHistory, *, whole: bool = False, damaged: bool = False) -> Recorded:
    """The input of a clutch's results, read from the database; `whole`: with all channels in memory, else each is read
    when needed. `damaged`: stored results may be damaged. Raises DamagedData if sent content is damaged."""
    with database.reading() as connection:
        if damaged:
            allow_damage(connection)
        rows, aside = runs.page(connection, state.clutch_id), set_aside(connection, state.clutch_id)
        failing = runs.damaged(connection, state.clutch_id) if damaged else set()
        trail = changes.newest_of_runs(connection, state.clutch_id) if failing else {}
    if damaged:
        for row in rows:
            _refuse_changed(database, row)
            if row.run_id in failing:
                _refuse_restated(row, trail.get(row.run_id, {}))
    reader = (
        _loaded_reader(database, state.record, rows)
        if whole
        else run_reader(database, state.clutch_id, damaged=damaged)
    )
    reader = replace(reader, torque_filter=state.record.torque_filter)
    return Recorded(state=state, rows=tuple(rows), aside=aside, reader=reader)


def recomputed(recorded: Recorded) -> Results:
    """All results of a clutch, with every run analysed again under the state's record.

    Raises InvalidError where this code refuses a run that is stored, DamagedData where its channels are damaged.
    """
    state, rows, aside, reader = recorded.state, recorded.rows, recorded.aside, recorded.reader
    details, receipts, levels = {}, {}, {}
    measured: dict[str, dict[str, Any]] = {}
    for row in rows:
        sent = reader.read(row.run_id)
        try:
            analysis = analyse(sent, state.geometry, state.record.torque_filter)
        except InvalidError as error:
            raise InvalidError(f"run {row.run_id!r} is refused: {error}", errors=error.errors) from error
        measured[row.run_id] = {"speed_range": analysis.speed_range, "oil_temperature": analysis.oil_temperature}
        shown, _ = doubts_alone(sent, analysis, state.geometry)
        details[row.run_id] = analysis.details_to_store(sent) | ({} if shown is None else {"shown": shown.to_list()})
        receipts[row.run_id] = items.receipt(row.clutch_id, incoming(row, {}), analysis, received_at=row.received_at)
        levels[row.run_id] = analysis.fits
    events = order([replace(event, **measured[event.run_id]) for event in state.events])
    held = tuple(replace(event, **measured[event.run_id]) for event in state.held)
    state = replace(state, events=events, held=held)
    final, computed = computed_again(state, levels, receipts, reader, evaluated={})
    set_aside = [replace(event, **measured[run_id]) for run_id, event in aside.items()]
    computed = with_set_aside(computed, final, set_aside, levels, receipts, reader)
    receipts |= computed.receipts
    engagements = {row.run_id: stored_engagement(receipts[row.run_id], details[row.run_id]) for row in rows}
    evidence = ClutchMeasurements(
        levels=levels,
        receipts=receipts,
        engagements={run_id: engagement for run_id, engagement in engagements.items() if engagement is not None},
        reader=reader,
    )
    summary = summarised(final, computed.tracking or Tracking(), evidence)
    return replace(computed, details=details, receipts=receipts, levels=levels, summary=summary)


def mend(database: Database, clutch_id: str, damage: DamagedData) -> None:
    """Replace all results of a clutch, some of them damaged, by results recomputed from its runs.

    Raises DamagedData where what was sent is damaged too, InvalidError as `recomputed` does.
    """
    _log.warning("%s: all results of clutch %s are computed again from its runs", damage, clutch_id)
    for _ in attempts(clutch_id):
        with database.reading() as connection:
            before = state(connection, clutch_id, damaged=True)
        computed = recomputed(recorded(database, before, damaged=True))
        if replace_results(database, before, computed, damaged=True):
            return
