"""The fleet's priors: learned from all clutches of a kind, kept by version, and the tracks brought up to date with them.

No clutch is tracked under what was learned from itself: for each clutch that taught a version, or each group of them in a
large fleet, there is the same version learned from the others.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from models.prognosis.criteria import FEWEST_CLUTCHES, FEWEST_TESTS_TO_LEARN
from models.prognosis.ended_lives import ObservedLife, declared_end, ended_life, new_and_laws, representative
from models.prognosis.first_passage import horizon_at
from models.prognosis.fleet import Taught, population, taught
from models.prognosis.scoring import measured_end
from service import repository
from service.api.fleet import Kind
from service.api.run import Evaluation
from service.clutch.assumptions import ALL_PRESSURES, Assumptions, may_be_of
from service.clutch.criteria import MAX_ATTEMPTS
from service.clutch.notices import warned_again
from service.clutch.recomputation import ClutchHistory, Results, track
from service.clutch.timeline import WORN, Life
from service.clutch.tracking import CARRIED, mean_offset_of
from service.clutch.with_held import ClutchMeasurements, needs_evidence, summarised
from service.jobs.change import ChangeTask
from service.jobs.executor import Ended, Ending, Executor, in_rounds
from service.settings import CODE_VERSION
from storage import assumptions, clutches, jobs, results
from storage.assumptions import NOBODY, FleetPriorRow
from storage.encoding import Json, to_object
from storage.engine.database import Database
from storage.rows import allow_damage

#: Why a refresh leaves a clutch.
LEFT = "not updated, because runs arrived during the computation: the next refresh updates it"
GAVE_WAY = "not refreshed now, because another fleet is being refreshed: a separate job follows"


@dataclass(frozen=True, slots=True, kw_only=True)
class Lesson:
    """The information of one life for the fleet prior: the coefficients of eq. 6 and, if the life has ended, its end; ζ
    in standard cycles."""

    taught: Taught
    ended: ObservedLife | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Fleet:
    """The clutches of a kind with their lives' lessons, and the version of the kind's prior stored before they were
    read (0: none)."""

    kind: Kind
    version: int
    lessons: dict[str, list[Lesson]] = field(default_factory=dict)

    def without(self, left_out: Collection[str]) -> Json | None:
        """The prior learned from all clutches but those `left_out`, as JSON; None if too few remain."""
        left = [lessons for name, lessons in sorted(self.lessons.items()) if name not in left_out]
        if len(left) < FEWEST_CLUTCHES:
            return None
        lessons = [lesson for own in left for lesson in own]
        ended = [lesson.ended for lesson in lessons if lesson.ended is not None]
        return population([lesson.taught for lesson in lessons]).to_dict() | {
            name: [life.to_dict() for life in representative([life for life in ended if life.censored is censored])]
            for name, censored in (("ended", False), ("censored", True))
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Refreshed:
    """The outcome of a refresh: kinds with a new version, clutches with changed answers, and clutches left to the next
    refresh, with the reason."""

    kinds: tuple[Kind, ...]
    changed: tuple[str, ...]
    left: Mapping[str, str]


#: What a clutch's tracks are computed again from: its state, its receipts, and what else its summary follows from.
_Tracked: TypeAlias = tuple[ClutchHistory, Mapping[str, Evaluation], ClutchMeasurements | None]


def refresh(
    database: Database,
    executor: Executor,
    *,
    now: str,
    of: str | None = None,
    learned: bool = False,
    advance: Callable[[], object] = lambda: None,
    gives_way: Callable[[], bool] = lambda: False,
) -> Refreshed:
    """Learn the prior of a fleet again, by its key (None: of all fleets); store a changed one as a new version, and
    track its clutches again.

    If it is `learned` already, only track clutches; stop once `gives_way` is true, but after at least one clutch.
    `advance` is called twice per clutch: after its lessons are learned, and once its tracks are up to date.
    """
    fresh = set() if learned else _learned(database, of, now, executor, advance)
    names = _names(database, of)
    ended: dict[Ending, list[str]] = {ending: [] for ending in Ending}
    left: dict[str, str] = {}
    for clutch in _brought_up(database, names, executor):
        if clutch.error is not None:
            raise clutch.error
        ended[clutch.ending].append(clutch.name)
        advance()
        if clutch.ending is Ending.STORED and gives_way():
            left = dict.fromkeys(set(names).difference(*ended.values()), GAVE_WAY)
            break
    left |= dict.fromkeys(ended[Ending.LEFT], LEFT)
    return Refreshed(
        kinds=tuple(map(_kind, sorted(fresh))),
        changed=tuple(sorted(ended[Ending.STORED])),
        left=dict(sorted(left.items())),
    )


def _names(database: Database, of: str | None) -> list[str]:
    """The clutches that may belong to a fleet; those with a life that goes on come first, because their predictions are
    needed soonest."""
    kind = None if of is None else _kind(of)
    with database.reading() as connection:
        rows = [repository.clutch(connection, clutch_id) for clutch_id in clutches.all_ids(connection)]
    rows = [row for row in rows if kind is None or may_be_of(repository.record(row), kind)]
    return [row.clutch_id for row in sorted(rows, key=lambda row: row.summary.get("ended") is not None)]


def _learned(
    database: Database, of: str | None, now: str, executor: Executor, advance: Callable[[], object]
) -> set[str]:
    """The keys of the fleets with a newly learned and stored version."""
    fresh: set[str] = set()
    while True:
        endings = {
            key: _stored_again(database, fleet, now, executor)
            for key, fleet in _fleets(database, executor, _names(database, of), advance).items()
            if of in (key, None)
        }
        fresh.update(key for key, ending in endings.items() if ending is Ending.STORED)
        if Ending.LEFT not in endings.values():  # else another refresh was quicker, perhaps with less than is known now
            return fresh
        advance = _silent


def _silent() -> None:
    """A progress function that does nothing, for progress already counted."""


def _fleets(
    database: Database, executor: Executor, names: Sequence[str], advance: Callable[[], object]
) -> dict[str, Fleet]:
    """The fleets with their clutches' lessons, by key; `advance` is called for each clutch."""
    with database.reading() as connection:
        allow_damage(connection, everywhere=True)  # versions alone
        versions = {
            assumptions.fleet_key(row.fleet): row.version for row in assumptions.current_fleet_priors(connection)
        }
    fleets: dict[str, Fleet] = {}
    taught_by = executor.map(lessons_of, (_state(database, clutch_id) for clutch_id in names))
    for clutch_id, outcome in zip(names, taught_by, strict=True):
        kind, lessons = outcome.value()
        if lessons:
            name = assumptions.fleet_key(repository.json_of(kind))
            fleet = fleets.setdefault(name, Fleet(kind=kind, version=versions.get(name, 0)))
            fleet.lessons[clutch_id] = lessons
        advance()
    return fleets


def as_job(
    database: Database, task: ChangeTask, *, say: Callable[[Json], None], executor: Executor
) -> tuple[dict[str, int], dict[str, str]]:
    """The job that refreshes one fleet's prior or all, and reports progress.

    Once it has tracked a clutch, it gives way to another waiting fleet job: the remaining clutches become a new job.
    Returns the numbers of kinds with a new version and of clutches with changed answers, and why others were left.
    """
    number, learned = len(_names(database, task.of)), task.arguments.get("learned", False)
    advanced = number if learned else 0

    def say_so() -> None:
        if advanced <= number and not learned:
            say({"step": "learns from the clutches", "done": advanced, "of": number})
        else:
            say({"step": "updates their predictions", "done": advanced - number, "of": number})

    def advance() -> None:
        nonlocal advanced
        advanced += 1
        say_so()

    def gives_way() -> bool:
        with database.reading() as connection:
            open_jobs = jobs.open_of(connection, jobs.FLEET_REFRESH)
        return any(row.state == jobs.WAITING and not row.arguments.get("learned", False) for row in open_jobs)

    say_so()
    done = refresh(database, executor, now=task.at, of=task.of, learned=learned, advance=advance, gives_way=gives_way)
    if GAVE_WAY in done.left.values():
        _ask_for_the_rest(database, task)
    return {"kinds": len(done.kinds), "changed": len(done.changed)}, dict(done.left)


def _ask_for_the_rest(database: Database, task: ChangeTask) -> None:
    """Ask for another job, which tracks the remaining clutches again under the new priors."""
    kind = None if task.of is None else _kind(task.of)
    with database.writing(of=jobs.FLEET_REFRESH) as connection:
        repository.ask_fleet_refresh(connection, kind, by=task.by, at=task.at, learned=True)


def _state(database: Database, clutch_id: str) -> ClutchHistory:
    with database.reading() as connection:
        return repository.state(connection, clutch_id)


def _kind(name: str) -> Kind:
    """The kind of clutches with this fleet key."""
    return Kind.model_validate(to_object(name))


def lessons_of(state: ClutchHistory) -> tuple[Kind, list[Lesson]]:
    """A clutch's kind, and the lesson of each of its lives."""
    assumptions = state.assumptions
    lessons = [_lesson(life, assumptions, state.fraction) for life in state.lives]
    return state.kind, [lesson for lesson in lessons if lesson is not None]


def _lesson(life: Life, assumptions: Assumptions, fraction: float) -> Lesson | None:
    """The lesson of a life; None if it has too few tests."""
    series = life.pooled(assumptions)
    measurements, unit = series.measurements, series.scale.severity.unit
    if len(measurements) < FEWEST_TESTS_TO_LEARN:
        return None
    lesson = taught([replace(measurement, progress=measurement.progress * unit) for measurement in measurements])
    offset = mean_offset_of(series)
    progress = np.array([measurement.progress for measurement in measurements])
    values = np.array([measurement.value for measurement in measurements])
    initial, laws = new_and_laws(measurements)
    if offset is not None:
        values = values + offset(progress)[0]
        initial += float(offset(np.zeros(1))[0, 0])
    end, deviation, censored = measured_end(progress, values, fraction * initial), 0.0, False
    origin = series.scale.origin
    horizon = float(series.scale.progress(origin + horizon_at(life.events[-1].cycles - origin)))
    if end is None and life.end is not None:  # stopped before any test passed the threshold
        end, censored = float(series.scale.progress(life.end.cycles)), life.end.end != WORN
        if not censored and end > 0.0:
            end, deviation = declared_end(measurements, end, fraction=fraction, horizon=horizon, offset=offset)
    ended = ended_life(progress, values, end, initial=initial, fraction=fraction, laws=laws) if end else None
    if ended is None:
        return Lesson(taught=lesson, ended=None)
    ended = replace(ended, deviation=deviation, censored=censored)
    duty = [event.duty for event in life.events if event.duty is not None and event.duty.energy is not None]
    worked, done = sum(block.cycles for block in duty), sum(block.cycles * (block.energy or 0.0) for block in duty)
    return Lesson(taught=lesson, ended=replace(ended.in_unit(1.0 / unit), energy=done / worked if worked else None))


def _stored_again(database: Database, fleet: Fleet, now: str, executor: Executor) -> Ending:
    """Learn and store the next version of a fleet's prior, with the same learned without each of its clutches.

    Returns NOTHING if the stored prior is equal, LEFT if another refresh has stored a version meanwhile.
    """
    (learned,) = executor.map(learned_without, [(fleet, ())])
    with database.reading() as connection:
        allow_damage(connection, everywhere=True)  # it is replaced
        stored = assumptions.current_fleet_prior(connection, repository.json_of(fleet.kind))
    if learned.value() is None or (stored is not None and stored.content == learned.value()):
        return Ending.NOTHING
    rows = _versions(fleet, learned.value(), fleet.version + 1, now, executor)
    with database.writing() as connection:
        allow_damage(connection, everywhere=True)
        newest = assumptions.current_fleet_prior(connection, repository.json_of(fleet.kind))
        if newest is not None and newest.version > fleet.version:
            return Ending.LEFT
        for row in rows:
            assumptions.insert_fleet_prior(connection, row)
        # clutches are still under the last
        assumptions.forget_left_out(connection, repository.json_of(fleet.kind), before=fleet.version)
    return Ending.STORED


def learned_without(of: tuple[Fleet, Collection[str]]) -> Json | None:
    """The prior of a fleet without some of its clutches; a module-level function, so that it can be pickled."""
    fleet, left_out = of
    return fleet.without(left_out)


def _versions(fleet: Fleet, whole: Json | None, version: int, now: str, executor: Executor) -> Sequence[FleetPriorRow]:
    """The rows of the prior of all clutches, and of the priors without each clutch or group of clutches."""
    members = tuple(sorted(fleet.lessons))
    groups = assumptions.groups(members)
    learned = executor.map(learned_without, ((fleet, group) for group in groups))
    priors = {NOBODY: whole} | {group[0]: prior.value() for group, prior in zip(groups, learned, strict=True)}
    return [
        FleetPriorRow(
            fleet=repository.json_of(fleet.kind),
            version=version,
            left_out=left_out,
            created_at=now,
            members=members,
            content=prior,
            code_version=CODE_VERSION,
        )
        for left_out, prior in priors.items()
        if prior is not None
    ]


def _brought_up(database: Database, names: Sequence[str], executor: Executor) -> Iterator[Ended[Results]]:
    """Track the clutches again whose stored predictions are based on another prior."""

    def load(clutch_id: str) -> _Tracked | None:
        """The state of a clutch to be tracked again; None if its prediction rests on the newest prior already."""
        with database.reading() as connection:
            state = repository.state(connection, clutch_id, newest_prior=True)
            last = results.prediction_at(connection, clutch_id, CARRIED, ALL_PRESSURES)
            if last is None or repository.prediction(last).prior == state.assumptions.prior.name:
                return None
            receipts = repository.receipts(connection, clutch_id)
        evidence = None
        if needs_evidence(state):
            reader = repository.recorded(database, state, whole=executor.elsewhere).reader
            evidence = repository.evidence_for(database, state, reader)
        return state, receipts, evidence

    def store(tracked: _Tracked, retracked: Results) -> bool:
        return repository.replace_results(database, tracked[0], retracked)

    return in_rounds(executor, names, load=load, compute=_retracked, store=store, rounds=MAX_ATTEMPTS)


def _retracked(tracked: _Tracked) -> Results:
    """The results of a clutch tracked under its fleet's newest prior."""
    state, receipts, evidence = tracked
    tracking = track(state)
    return Results(
        tracking=tracking,
        receipts=warned_again(state.lives, tracking.warnings, receipts),
        summary=summarised(state, tracking, evidence),
    )
