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
from service.clutch.condition import DISAGREES, rank_of, state_of, top_line
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
from service.kept_history import levels as levels_of
from service.logging import request_id
from service.settings import CODE_VERSION
from storage import assumptions, changes, clutches, diagnoses, inspections, jobs, raw_columns, results, rigs, runs
from storage.blobs import raw_stores
from storage.checksums import allow_damage
from storage.clutches import ClutchRow
from storage.diagnoses import DiagnosisRow, VerdictRow
from storage.encoding import Json
from storage.engine.database import Database
from storage.engine.errors import DamagedData
from storage.inspections import InspectionRow, PhotographRow
from storage.jobs import JobRow
from storage.results import FilterStateRow, FitRow, PredictionRow
from storage.rigs import RigRow
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
    """The clutch, or NotFoundError."""
    row = clutches.get(connection, clutch_id)
    if row is None:
        raise unknown_clutch(clutch_id)
    return row


def diagnosis(connection: Connection, clutch_id: str, diagnosis_id: str) -> DiagnosisRow:
    """The diagnosis of a clutch, or NotFoundError."""
    row = diagnoses.get(connection, clutch_id, diagnosis_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no diagnosis {diagnosis_id!r}")
    return row


def rig(connection: Connection, name: str) -> RigOut:
    """A rig profile in force, or NotFoundError."""
    row = rigs.get(connection, name)
    if row is None:
        names = ", ".join(repr(profile.name) for profile in rigs.page(connection, limit=10))
        raise NotFoundError(f"there is no rig {name!r}; the rigs are: {names or 'none yet'}")
    return rig_out(row)


def rig_out(row: RigRow) -> RigOut:
    """A stored profile, with the defaults of fields that came after it."""
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
    """The clutch's state at its present revision. Raises NotFoundError.

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
        summary={} if damaged else row.summary,
    )


def adoption(connection: Connection, clutch_id: str) -> Adoption | None:
    """What was adopted last of the lives that are in the history, None under the baseline; whether it is in force the
    present life tells."""
    adopted = _adoptions(connection, clutch_id)
    return newest_adoption(adopted, [row.run_id for row in runs.rebuilds(connection, clutch_id)])


def _adoptions(connection: Connection, clutch_id: str) -> tuple[Adoption | None, ...]:
    """What was adopted, newest first, as far back as any history could ask for: one of each life."""
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
    """The name of the present life: the run_id of the rebuild that began it, "" where there was none."""
    rebuilds = order([event_of(row, {}) for row in runs.rebuilds(connection, clutch_id)])
    return rebuilds[-1].run_id if rebuilds else ""


def events(connection: Connection, clutch_id: str) -> tuple[Event, ...]:
    """All accepted runs of a clutch as its history sees them, ordered; mean COF as the model in force corrects it."""
    return history(connection, clutch(connection, clutch_id)).events


def set_aside(connection: Connection, clutch_id: str) -> dict[str, Event]:
    """The runs that are held or were withdrawn by run_id, as the history would see them; their mean COFs yet to come."""
    return {row.run_id: replace(event_of(row, {}), confirmed=False) for row in runs.set_aside(connection, clutch_id)}


def levels(connection: Connection, clutch_id: str) -> dict[str, list[LevelFit]]:
    """The fits of all runs of a clutch, by run_id."""
    return levels_of(connection, clutch_id)


def json_of(answer: Answer) -> Json:
    """An answer's part as a JSON column keeps it."""
    return answer.model_dump(mode="json", exclude_unset=True)


def prediction(row: PredictionRow) -> LifePrediction:
    """A stored prediction."""
    return LifePrediction.model_validate(row.payload)


def receipt(row: RunRow) -> Receipt:
    """A run's receipt as it is now: as it is stored, and whether the run counts, why not, and the cycles as sent."""
    sent_cycles = row.cycles if row.sent_cycles is None else row.sent_cycles
    present = {"state": row.state, "doubts": row.doubts, "sent_cycles": whole(sent_cycles)}
    return Receipt.model_validate(row.receipt | present | {"received_by": row.received_by})


def summary(row: RunRow) -> dict[str, Any]:
    """What the audit trail keeps of a run before and after a change."""
    return {"state": row.state, "cycles": whole(row.cycles), "doubts": list(row.doubts)}


def receipts(connection: Connection, clutch_id: str) -> dict[str, Evaluation]:
    """All receipts of a clutch by run_id, as they are stored."""
    return {row.run_id: Evaluation.model_validate(row.receipt) for row in runs.page(connection, clutch_id)}


def answers(connection: Connection, clutch_id: str) -> list[Any]:
    """Receipts, predictions, summary and history as they are stored: whether they have changed decides on a new revision."""
    tracks = [results.predictions_of(connection, clutch_id, method, ALL_PRESSURES) for method in PREDICTED]
    past = history(connection, clutch(connection, clutch_id))
    return [receipts(connection, clutch_id), tracks, clutch(connection, clutch_id).summary, past.events, past.held]


def store_change(connection: Connection, clutch_id: str, computed: Results, *, by: str, at: str) -> int:
    """Store the results of a run that came in or was changed, and what it changes in others. Returns the clutch's revision,
    which moves on."""
    store(connection, clutch_id, computed)
    revision = clutches.bump_revision(connection, clutch_id)
    _store_judged(connection, clutch_id, computed.judged, at=at, revision=revision)
    if computed.teaches is not None:
        ask_fleet_refresh(connection, computed.teaches, by=by, at=at)
    return revision


def _store_judged(connection: Connection, clutch_id: str, judged: Judged, *, at: str, revision: int) -> None:
    """The states of runs that the evidence of others has changed, with the audit trail's entries."""
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


def unchanged(connection: Connection, clutch_id: str, revision: int) -> bool:
    """Whether the clutch still is at the revision that results were computed from."""
    return clutches.revision(connection, clutch_id) == revision


def attempts(clutch_id: str) -> Iterator[int]:
    """The numbers of the attempts to compute and store, from 1; raises BusyError where the clutch has changed at each."""
    yield from range(1, MAX_ATTEMPTS + 1)
    raise BusyError(
        f"clutch {clutch_id!r} was changed by other requests {MAX_ATTEMPTS} times during this request: send it again"
    )


def replace_results(database: Database, state: ClutchHistory, computed: Results, *, damaged: bool = False) -> bool:
    """Store a clutch's results where its revision still is that of the state they follow from; whether it was. The revision
    moves on where an answer changes, or where what is replaced may be `damaged`."""
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
    """Store results in place of those that were there. The revision is the change's to move on."""
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
    if computed.tracking is not None:
        _store_tracking(connection, clutch_id, computed.tracking)
    if computed.summary is not None:
        clutches.set_summary(
            connection,
            clutch_id,
            rank_of(computed.summary),
            dict(computed.summary),
            life=computed.summary.get("life", ""),
            state=state_of(computed.summary, disputed=False)["name"],
            if_disputed=state_of(computed.summary, disputed=True)["name"],
        )
        raising.evaluate(connection, clutch_id)


def ask_fleet_refresh(connection: Connection, kind: Kind | None, *, by: str, at: str, learned: bool = False) -> None:
    """Have the fleet of a kind (None: all) learn again, for what an ended life teaches has changed; where it has `learned`,
    only have its clutches tracked under that. Unless a job that will do it waits already."""
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
    clutches.set_states_sum(connection, clutch_id, results.states_sum(connection, clutch_id))


def states_finding(connection: Connection, row: ClutchRow) -> str | None:
    """What is wrong where the filter states of a clutch are not those that were stored last, each whole as it may be."""
    if results.states_sum(connection, row.clutch_id) == row.states_sum:
        return None
    return f"the filter states of clutch {row.clutch_id!r} are not those of its revision {row.revision}"


def _filters(connection: Connection, row: ClutchRow) -> States | None:
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
    """The prior of the clutch's kind not learned from it: the one that the prediction `tracked` names, or the newest."""
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
    """Fits as they are stored, with mean COF by pressure where a level determines it."""
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
    """The newest finished diagnosis as it goes out; one of a life that a rebuild has ended is past."""
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
    return state_of(row.summary, disputed=row.is_disputed, silent=row.silent)


def first_line(row: ClutchRow, diagnosis: LatestDiagnosis | None, *, raised: int) -> dict[str, str]:
    """What stands first of the clutch: `headline` and `action`; `diagnosis` is its newest one as it goes out, `raised` how
    many of its alarms nobody has acknowledged."""
    return top_line(row.summary, disputed=row.is_disputed, diagnosis=diagnosis, silent=row.silent, raised=raised)


def note_dispute(connection: Connection, clutch_id: str) -> None:
    """Note whether data and model are in dispute, and the state that follows: where a diagnosis has been finished, a model
    adopted or the baseline restored. A dispute stays noted of its life, and counts while that is the present one."""
    verdict = diagnoses.newest(connection, [clutch_id]).get(clutch_id)
    disputed = None if verdict is None or verdict.adopted or verdict.verdict not in DISAGREES else verdict.life
    row = replace(clutch(connection, clutch_id), disputed=disputed)
    clutches.set_disputed(connection, clutch_id, disputed, state=condition(row)["name"])
    raising.evaluate(connection, clutch_id)


def inspection(connection: Connection, clutch_id: str, inspection_id: str) -> InspectionRow:
    """The inspection, or NotFoundError."""
    row = inspections.get(connection, clutch_id, inspection_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no inspection {inspection_id!r}")
    return row


def inspection_hash(content: Mapping[str, Any]) -> str:
    """The sha256 of what an inspection states."""
    return content_of({**content, "performed_at": instant(content["performed_at"])})


def inspection_answers(connection: Connection, rows: Sequence[InspectionRow]) -> list[InspectionOut]:
    """Inspections with their photographs."""
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
    """A photograph as it goes out."""
    return of_row(PhotographOut, row, photograph_id=row.sha256)


def evidence(connection: Connection, clutch_id: str, *, of_fits: bool = False) -> ClutchMeasurements:
    """What was measured of a clutch, of held runs too; without a reader of its runs. `of_fits`: nothing but fits."""
    return ClutchMeasurements(
        levels=levels(connection, clutch_id),
        receipts={} if of_fits else receipts(connection, clutch_id),
        engagements={} if of_fits else _engagements(connection, clutch_id),
    )


def evidence_for(database: Database, state: ClutchHistory, reader: RunReader) -> ClutchMeasurements | None:
    """What a clutch's summary follows from beside its tracks; None where these are enough."""
    if not needs_evidence(state):
        return None
    with database.reading() as connection:
        return replace(evidence(connection, state.clutch_id), reader=reader)


def tracked_again(
    database: Database, state: ClutchHistory, levels: Levels, receipts: Mapping[str, Evaluation]
) -> Results:
    """Results of a clutch whose state has changed while its runs are unchanged."""
    reader = run_reader(database, state.clutch_id)
    final, computed = computed_again(state, levels, receipts, reader, evaluated=state.stationary_tests)
    evidence = evidence_for(database, final, reader)
    return replace(computed, summary=summarised(final, computed.tracking or Tracking(), evidence))


def engagements(connection: Connection, clutch_id: str) -> list[MeasuredEngagement]:
    """The accepted engagements of a clutch with all indicators, by life and cycles."""
    stored = _engagements(connection, clutch_id)
    return engagement_rows(lives_of(events(connection, clutch_id)), stored) if stored else []


def _at(row: RunRow) -> Evaluation:
    """A run's receipt with its present cycles."""
    return Evaluation.model_validate(row.receipt | {"cycles": whole(row.cycles)})


def _engagements(connection: Connection, clutch_id: str) -> dict[str, StoredEngagement]:
    rows = [row for kind in DUTY_KINDS for row in runs.page(connection, clutch_id, kind=kind)]
    stored = {row.run_id: stored_engagement(_at(row), row.details) for row in rows}
    return {run_id: engagement for run_id, engagement in stored.items() if engagement is not None}


def run(connection: Connection, clutch_id: str, run_id: str) -> RunRow:
    """The run of a known clutch, or NotFoundError."""
    clutch(connection, clutch_id)
    row = runs.get(connection, clutch_id, run_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no run {run_id!r}")
    return row


def run_reader(database: Database, clutch_id: str, *, damaged: bool = False) -> RunReader:
    """The clutch's stored runs, each read in a transaction of its own when it is asked for: none stays open meanwhile."""

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
    """The long columns of a run put into the store of raw records, where one is in use: before the row that names them."""
    with database.reading() as connection:
        store = raw_stores.in_use(connection)
    return columns if store is None else columns.put(store)


def _loaded_reader(database: Database, record: ClutchIn, rows: Sequence[RunRow]) -> RunReader:
    """A reader of runs whose stored channels are all in memory, so that it needs no database."""
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
    """A run with the channels that are loaded of it; a function of the module, which can be pickled."""
    return decoded(rows[run_id], loaded.get(run_id, ()))


def decoded(row: RunRow, columns: Sequence[raw_columns.Stored]) -> IncomingRun:
    """A run with its channels. Raises DamagedData, naming the run."""
    try:
        return incoming(row, raw_columns.values_of(columns))
    except DamagedData as error:
        raise DamagedData(f"run {row.run_id} is damaged: {error}") from error


def content_now(row: RunRow, sent: IncomingRun) -> str:
    """The hash of what is stored of a run, to be compared with the one that its sender was given."""
    sha256 = content_hash(replace(sent, cycles=row.cycles if row.sent_cycles is None else row.sent_cycles))
    read_again = row.details.get("file", {}).get("content_sha256")
    return row.content_sha256 if sha256 == read_again else sha256


def _refuse_restated(row: RunRow, trail: Mapping[str, Any]) -> None:
    """Raise DamagedData where a run has not the state or the cycles that the audit trail says: neither follows from what was
    sent."""
    now = summary(row)
    for name, stated in ({"state": runs.ACCEPTED} | dict(trail)).items():
        if name in ("state", "cycles") and now[name] != stated:
            said = f"the audit trail says {stated!r}, the run {now[name]!r}"
            raise DamagedData(f"the {name} of run {row.run_id} is damaged ({said}): restore a backup")


def _refuse_changed(database: Database, row: RunRow) -> None:
    """Raise DamagedData where what is stored of a run is not what was sent."""
    with database.reading() as connection:
        columns = raw_columns.stored_of_run(connection, row.run_key)
    try:
        sha256 = content_now(row, decoded(row, columns))
    except KeyError as error:
        raise DamagedData(f"run {row.run_id} is damaged: its details lack {error}") from error
    if sha256 != row.content_sha256:
        raise DamagedData(f"run {row.run_id} differs from what was sent: restore a backup")


def incoming(row: RunRow, columns: Mapping[str, NDArray[np.float64]]) -> IncomingRun:
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
    """All that a clutch's results are computed from: its state, its runs in the order of their arrival, those that are none
    of the history, and their channels. Picklable where it was loaded whole."""

    state: ClutchHistory
    rows: tuple[RunRow, ...]
    aside: Mapping[str, Event]
    reader: RunReader


def recorded(database: Database, state: ClutchHistory, *, whole: bool = False, damaged: bool = False) -> Recorded:
    """The clutch's runs as they are stored; `whole` with all channels in memory, else each is read when it is needed.
    `damaged`: what follows from what was sent may be damaged. Raises DamagedData where what was sent is."""
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
    """Every run of a clutch analysed again, under the state's record, and all that follows.

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
    """Compute all results of a clutch again from its runs, in place of those of which some are damaged.

    Raises DamagedData where what was sent is damaged too, InvalidError as `recomputed` does.
    """
    _log.warning("%s: all results of clutch %s are computed again from its runs", damage, clutch_id)
    for _ in attempts(clutch_id):
        with database.reading() as connection:
            before = state(connection, clutch_id, damaged=True)
        computed = recomputed(recorded(database, before, damaged=True))
        if replace_results(database, before, computed, damaged=True):
            return
