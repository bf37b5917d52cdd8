"""Converts between database rows and values: loads the state of a clutch, and stores its results.

A workflow reads a `ClutchState`, computes outside any transaction, and stores with `unchanged` and `store`.
"""

from __future__ import annotations

import logging
import secrets
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sqlalchemy import Connection

from models.degradation.severity import Severity
from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.ended_lives import EndedLife
from models.prognosis.fleet import FleetPrior
from service.alarms import raising
from service.columns import content_of, instant, whole
from service.errors import BusyError, NotFoundError, unknown_clutch
from service.kept_history import FIT_COLUMNS, event_of, history
from service.kept_history import levels as levels_of
from service.lives.assumptions import ALL_PRESSURES, FLEET, LearnedPrior, kind_of, severity_name, severity_under
from service.lives.condition import DISAGREES, rank_of, state_of, top_line
from service.lives.history import ByPressure, Event, order
from service.lives.model_correction import extension_of
from service.lives.payloads import notice_items
from service.lives.plausibility.doubts import Judged
from service.lives.recomputation import Adoption, ClutchState, Results, Tracking, newest_adoption
from service.lives.run_analysis import LevelFit
from service.lives.tracks import CARRIED, States, Tracked
from service.logging import request_id
from service.schemas.base import schema_fields
from service.schemas.clutch import ClutchIn, LatestDiagnosis
from service.schemas.inspection import InspectionOut, PhotographOut
from service.schemas.rig import RigOut
from service.settings import CODE_VERSION
from storage import assumptions, changes, clutches, diagnoses, inspections, jobs, results, rigs, runs
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
    saved = {"version": row.version, "saved_at": row.saved_at, "saved_by": row.saved_by}
    return RigOut.model_validate(row.content | saved)


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
) -> ClutchState:
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
    last = results.prediction_at(connection, clutch_id, CARRIED[0], ALL_PRESSURES)
    tracked = {} if last is None or newest_prior or damaged or edited is not None else last.payload
    return ClutchState(
        record=own,
        revision=row.revision,
        events=past.events,
        adoptions=adoptions,
        priors={severity: _learned_prior(connection, own, severity, tracked) for severity in severities},
        filters=_filters(connection, clutch_id) if carried else None,
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


def receipt(row: RunRow) -> dict[str, Any]:
    """A run's receipt as it is now: as it is stored, and whether the run counts, why not, and the cycles as sent."""
    sent_cycles = row.cycles if row.sent_cycles is None else row.sent_cycles
    return row.receipt | {
        "state": row.state,
        "doubts": list(row.doubts),
        "sent_cycles": whole(sent_cycles),
        "received_by": row.received_by,
    }


def summary(row: RunRow) -> dict[str, Any]:
    """What the audit trail keeps of a run before and after a change."""
    return {"state": row.state, "cycles": whole(row.cycles), "doubts": list(row.doubts)}


def receipts(connection: Connection, clutch_id: str) -> dict[str, dict[str, Any]]:
    """All receipts of a clutch by run_id, as they are stored."""
    return {row.run_id: row.receipt for row in runs.page(connection, clutch_id)}


def answers(connection: Connection, clutch_id: str) -> list[Any]:
    """Receipts, predictions, summary and history as they are stored: whether they have changed decides on a new revision."""
    tracks = [results.predictions_of(connection, clutch_id, method, ALL_PRESSURES) for method in CARRIED]
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
        doubts = tuple(notice_items(judged.doubts.get(event.run_id, ())))
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


def replace_results(database: Database, state: ClutchState, computed: Results, *, damaged: bool = False) -> bool:
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
    """Store results in place of those that were there. The revision is the workflow's to move on."""
    if computed.levels or computed.receipts or computed.corrected:
        rows = runs.keys(connection, clutch_id)
        for run_id, own in computed.levels.items():
            results.write_fits(connection, rows[run_id], fit_rows(own, computed.cofs.get(run_id, {})))
        for run_id, receipt in computed.receipts.items():
            if run_id in computed.details:
                runs.set_results(connection, rows[run_id], computed.details[run_id], receipt, CODE_VERSION)
            else:
                runs.set_receipt(connection, rows[run_id], receipt)
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
            computed.summary,
            life=computed.summary.get("life", ""),
            state=state_of(computed.summary, disputed=False)["name"],
            if_disputed=state_of(computed.summary, disputed=True)["name"],
        )
        raising.evaluate(connection, clutch_id)


def ask_fleet_refresh(connection: Connection, kind: Json | None, *, by: str, at: str, learned: bool = False) -> None:
    """Have the fleet of a kind (None: all) learn again, for what an ended life teaches has changed; where it has `learned`,
    only have its clutches tracked under that. Unless a job that will do it waits already."""
    fleet = None if kind is None else assumptions.fleet_key(kind)
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
        PredictionRow(cycles=prediction.cycles, method=prediction.method, payload=prediction.payload, **made)
        for prediction in tracking.predictions
    ]
    filters = [
        FilterStateRow(method=method, runs=tracked.runs, arrays=tracked.to_arrays(), **made)
        for method, tracked in tracking.filters.items()
    ]
    results.put_predictions(connection, clutch_id, predictions)
    results.clear_filter_states(connection, clutch_id)
    results.put_filter_states(connection, clutch_id, filters)


def _filters(connection: Connection, clutch_id: str) -> States | None:
    try:
        rows = {method: row for (method, _), row in results.filter_states_of(connection, clutch_id).items()}
    except DamagedData as error:
        _log.warning("%s: the clutch is tracked again from its runs", error)
        return None
    if any(row.code_version != CODE_VERSION for row in rows.values()):
        return None
    return {method: Tracked.from_arrays(method, row.runs, row.arrays) for method, row in rows.items()}


def _learned_prior(
    connection: Connection, own: ClutchIn, severity: Severity, tracked: Mapping[str, Any]
) -> LearnedPrior:
    """The prior of the clutch's kind not learned from it: the one that the prediction `tracked` names, or the newest."""
    version = None
    if tracked.get("severity") == severity_name(severity) and "prior" in tracked:
        version = tracked["prior"]["version"] or 0
    try:
        row = assumptions.fleet_prior_for(connection, kind_of(own, severity), own.clutch_id, version)
    except DamagedData as error:
        _log.warning("%s: the weak prior takes its place until the next clutchlife fleet refresh", error)
        row = None
    if row is None:
        return LearnedPrior()
    fleet = FleetPrior.from_dict(row.content)
    ended = tuple(EndedLife.from_dict(life) for name in ("ended", "censored") for life in row.content.get(name, ()))
    return LearnedPrior(
        fleet=fleet, ended=ended, name={"name": FLEET, "version": row.version, "clutches": fleet.clutches}
    )


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
        )
        rows.append(row)
    return rows


def latest_diagnosis(row: ClutchRow, verdict: VerdictRow | None) -> dict[str, Any] | None:
    """The newest finished diagnosis as it goes out; one of a life that a rebuild has ended is past."""
    if verdict is None:
        return None
    earlier = verdict.life != row.summary.get("life", "")
    return schema_fields(
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


def first_line(row: ClutchRow, diagnosis: dict[str, Any] | None) -> dict[str, str]:
    """What stands first of the clutch: `headline` and `action`; `diagnosis` is its newest one as it goes out."""
    return top_line(row.summary, disputed=row.is_disputed, diagnosis=diagnosis, silent=row.silent)


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


def inspection_answers(connection: Connection, rows: Sequence[InspectionRow]) -> list[dict[str, Any]]:
    photographs = inspections.photographs(connection, [row.inspection_key for row in rows])
    return [
        schema_fields(
            InspectionOut,
            row,
            **row.content,
            duplicate=False,
            photographs=[photograph_answer(photograph) for photograph in photographs[row.inspection_key]],
        )
        for row in rows
    ]


def photograph_answer(row: PhotographRow) -> dict[str, Any]:
    return schema_fields(PhotographOut, row, photograph_id=row.sha256)
