"""The state of a clutch as one value, and all results that are computed from it; nothing here uses a database.

A change loads a `ClutchHistory`, computes `Results` with the functions below, and stores them in one short transaction that
checks that the state's revision is still the newest. An `Arrival` is a run as it comes in, among the stored ones. Where
the filters may go one step on from their stored states, and where a life is tracked again, is decided here.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

from models.clutch import Geometry
from models.degradation.severity import Severity
from models.diagnosis.campaign import StationaryRun
from service.api.clutch import ClutchIn
from service.api.fleet import Kind
from service.api.run import Evaluation, Loop, Warned
from service.clutch import timeline
from service.clutch.analysis import Analysis, LevelFit, loops_of, mean_cofs
from service.clutch.assumptions import Assumptions, LearnedPrior, ModelInForce, kind_of, severity_under
from service.clutch.condition import SHOWN
from service.clutch.diagnosis.campaign import head_of
from service.clutch.incoming_run import IncomingRun
from service.clutch.items import fit_items, loop_items
from service.clutch.model_correction import RunReader, corrected_cofs, model_in_force
from service.clutch.notices import OF_HISTORY, OFF_TRACK, warned_again
from service.clutch.plausibility.doubts import Judged, levelled
from service.clutch.summary import StoredSummary
from service.clutch.tracking import CARRIED, States, TrackPrediction, follow
from service.errors import Notice
from service.tracing import tracer

if TYPE_CHECKING:
    from models.diagnosis.extension import Extension

#: The levels of stationary tests by run_id.
Levels = Mapping[str, Sequence[LevelFit]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Adoption:
    """A diagnosis with an adopted extension, and the life it is about."""

    diagnosis_id: str
    life: str
    extension: Extension


def newest_adoption(adoptions: Iterable[Adoption | None], lives: Collection[str]) -> Adoption | None:
    """The first of `adoptions` (newest first; None: the baseline) whose life is still in the history; a life is no
    longer in it after its rebuild was withdrawn."""
    return next(
        (adoption for adoption in adoptions if adoption is None or not adoption.life or adoption.life in lives), None
    )


@dataclass(frozen=True, kw_only=True)
class ClutchHistory:
    """The input for the results of a clutch's next run, at one revision. Derived values are computed once.

    `events` are all accepted runs in the order of the history, with mean COF as corrected by the model in force; `held`
    the held runs, with the mean COFs that they would have in it; `adoptions` the adopted models, newest first (None:
    the baseline); `priors` the fleet priors for each severity that may come into force; `filters` the filters' states
    after the last test, None if another release stored them; `summary` the stored summary of the clutch's condition.
    """

    record: ClutchIn
    revision: int
    events: tuple[timeline.Event, ...]
    adoptions: tuple[Adoption | None, ...]
    priors: Mapping[Severity, LearnedPrior]
    archived: bool = False
    filters: States | None = None
    held: tuple[timeline.Event, ...] = ()
    summary: StoredSummary = field(default_factory=StoredSummary)

    @property
    def clutch_id(self) -> str:
        return self.record.clutch_id

    @cached_property
    def geometry(self) -> Geometry:
        return self.record.geometry.to_model()

    @property
    def fraction(self) -> float:
        """The share of the initial mean COF at which a life ends."""
        return self.record.end_of_life.cof_fraction

    @cached_property
    def lives(self) -> tuple[timeline.Life, ...]:
        """The lives, separated by rebuilds."""
        return tuple(timeline.lives_of(self.events))

    @cached_property
    def adoption(self) -> Adoption | None:
        """The newest adopted model among the lives in the history."""
        return newest_adoption(self.adoptions, [life.name for life in self.lives])

    @cached_property
    def extension(self) -> Extension | None:
        """The extension for tracking the present life, None under the baseline: a rebuild ends an adoption."""
        name, adoption = self.lives[-1].name if self.events else "", self.adoption
        return adoption.extension if adoption is not None and adoption.life == name else None

    @property
    def kind(self) -> Kind:
        """The kind of clutches that share a fleet prior with this one."""
        return kind_of(self.record, self.assumptions.severity)

    @cached_property
    def assumptions(self) -> Assumptions:
        """The assumptions for tracking the present life."""
        return self.assumptions_under(self.extension, self.lives[-1] if self.events else None)

    @cached_property
    def stationary_tests(self) -> Mapping[str, str | None]:
        """run_id of each dynamic test -> run_id of the stationary test to evaluate it against."""
        return timeline.stationary_tests_of(self.lives)

    def life_of(self, event: timeline.Event) -> timeline.Life:
        """The life that contains the run of an event, even if the event itself was replaced since."""
        return next(life for life in self.lives if any(member.run_id == event.run_id for member in life.events))

    def with_event(self, event: timeline.Event) -> ClutchHistory:
        """The history with one more accepted run."""
        return replace(self, events=timeline.with_event(self.events, event))

    def __getstate__(self) -> dict[str, object]:
        """The fields alone, for pickling: derived values are not sent to other processes."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def assumptions_under(self, extension: Extension | None, life: timeline.Life | None) -> Assumptions:
        """The assumptions for tracking a life if this extension were in force (None: the baseline)."""
        model = ModelInForce()
        if extension is not None and life is not None:
            model = model_in_force(extension, life, self.geometry)
        severity = severity_under(self.record, model.severity_exponent)
        return Assumptions(severity=severity, prior=self.priors[severity], model=model)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracking:
    """Predictions after events, the filters' states after the last, and by run_id the warnings of predictions right
    after tests; `again`: they replace all earlier predictions."""

    predictions: tuple[TrackPrediction, ...] = ()
    filters: States = field(default_factory=dict)
    warnings: Mapping[str, list[Warned]] = field(default_factory=dict)
    again: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """The results to be stored of a clutch: fitted levels with mean COFs by run_id; changed receipts; corrected mean
    COFs (replacing all if `corrected_again`); tracking and summary (None: unchanged); `details`, stored with the
    channels, of runs analysed again; changed doubts about other runs; and the kind of clutches that it `teaches`, if
    the lessons of an ended life change."""

    levels: Levels = field(default_factory=dict)
    cofs: Mapping[str, timeline.ByPressure] = field(default_factory=dict)
    receipts: Mapping[str, Evaluation] = field(default_factory=dict)
    details: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    corrected: Mapping[str, timeline.Corrected] = field(default_factory=dict)
    corrected_again: bool = False
    tracking: Tracking | None = None
    summary: StoredSummary | None = None
    judged: Judged = field(default_factory=Judged)
    teaches: Kind | None = None


def computed_again(
    state: ClutchHistory,
    levels: Levels,
    receipts: Mapping[str, Evaluation],
    reader: RunReader,
    *,
    evaluated: Mapping[str, str | None],
) -> tuple[ClutchHistory, Results]:
    """All results of a clutch recomputed from its fits: mean COFs over the protocol of each life, corrected by the
    model in force, and tracks.

    `levels` and `receipts` are those of all runs; `evaluated` as in `loops_again`. Returns the history with its mean
    COFs, and the results to be stored.
    """
    final, cofs, corrected = with_cofs(state, levels, reader)
    fresh = {
        run_id: receipts[run_id].model_copy(update={"fits": fit_items(levels[run_id], cofs[run_id])}) for run_id in cofs
    }
    for run_id, items in loops_again(final, levels, reader, evaluated).items():
        fresh[run_id] = receipts[run_id].model_copy(update={"loops": items})
    tracking = track(final)
    results = Results(
        levels={run_id: levels[run_id] for run_id in cofs},
        cofs=cofs,
        receipts=fresh | warned_again(final.lives, tracking.warnings, {**receipts, **fresh}),
        corrected=corrected,
        corrected_again=True,
        tracking=tracking,
    )
    return final, results


def with_cofs(
    state: ClutchHistory, levels: Levels, reader: RunReader
) -> tuple[ClutchHistory, dict[str, timeline.ByPressure], dict[str, timeline.Corrected]]:
    """The history with the mean COFs of its events and their new levels; the mean COFs of the fits by run_id; and those
    corrected by the model in force. Arguments as in `computed_again`."""
    cofs = _cofs_of_tests(state.lives, levels, state.geometry)
    events = tuple(replace(event, cofs=cofs.get(event.run_id, {}), under={}) for event in state.events)
    plain = replace(state, events=events)
    corrected: dict[str, timeline.Corrected] = {}
    if plain.extension is not None and plain.events:
        life = plain.lives[-1]
        runs = reader.campaign_runs(life.events, origin=life.origin)
        corrected = corrected_cofs(plain.extension, plain.record, life, runs, reader.stationary_tests(life))
    freed = [event.corrected(corrected.get(event.run_id)) for event in plain.events]
    events = levelled(freed, state.held, state.geometry, corrected=state.extension is not None)
    return replace(plain, events=events), cofs, corrected


def cofs_among(state: ClutchHistory, event: timeline.Event, levels: Sequence[LevelFit]) -> timeline.ByPressure:
    """A run's mean COFs as part of the history: over the protocol of its life's first stationary test, which may be the
    run itself."""
    life = state.with_event(event).life_of(event)
    return _cofs_of_tests([life], {event.run_id: levels}, state.geometry).get(event.run_id, {})


def with_set_aside(
    computed: Results,
    state: ClutchHistory,
    events: Iterable[timeline.Event],
    levels: Levels,
    receipts: Mapping[str, Evaluation],
    reader: RunReader,
) -> Results:
    """The results with those of held and withdrawn runs added: their mean COFs and loops as if they were in the
    history, and receipts without warnings about the history."""
    cofs, fresh, own_levels = {**computed.cofs}, {**computed.receipts}, {**computed.levels}
    for event in events:
        name, fits = event.run_id, levels.get(event.run_id, ())
        state_with_event = replace(state, events=timeline.order([*state.events, event]))
        evaluated = {loop: test for loop, test in state_with_event.stationary_tests.items() if loop != name}
        loops = loops_again(state_with_event, levels, reader, evaluated).get(name, [])
        cofs[name], own_levels[name] = cofs_among(state, event, fits), fits
        warnings = [warning for warning in receipts[name].warnings if warning.code not in OF_HISTORY]
        own = {"fits": fit_items(fits, cofs[name]), "loops": loops, "warnings": warnings}
        fresh[name] = receipts[name].model_copy(update=own)
    return replace(computed, cofs=cofs, levels=own_levels, receipts=fresh)


def _cofs_of_tests(
    lives: Sequence[timeline.Life], levels: Levels, geometry: Geometry
) -> dict[str, timeline.ByPressure]:
    """Mean COF of every test with curves, over the protocol of its life's first test."""
    cofs: dict[str, timeline.ByPressure] = {}
    for life in lives:
        velocities = None if life.speed_range is None else timeline.reference_velocities(life.speed_range, geometry)
        for event in life.events:
            if levels.get(event.run_id):
                fits = levels[event.run_id]
                cofs[event.run_id] = {} if velocities is None else mean_cofs(fits, velocities, geometry)
    return cofs


def corrected_newest(
    state: ClutchHistory, newest: timeline.Event, test: StationaryRun | None, reader: RunReader
) -> timeline.Corrected | None:
    """The mean COFs of the last test, corrected by the model in force; None if it corrects nothing."""
    if state.extension is None or newest.speed_range is None or test is None:
        return None
    life = state.lives[-1]
    runs = reader.campaign_runs(life.events[:-1], origin=life.origin)
    return corrected_cofs(state.extension, state.record, life, runs, [test]).get(newest.run_id)


@tracer.start_as_current_span("track")
def track(state: ClutchHistory, *, newest: timeline.Event | None = None) -> Tracking:
    """Track the history: by one step if `newest` comes last and the filters' stored states can be carried on, else all
    lives again."""
    if not state.events:
        return Tracking()
    assumptions, lives = state.assumptions, state.lives
    last = lives[-1].pooled(assumptions)
    carried = None if newest is None else _carried(state, lives[-1], last, newest)
    first = 0 if carried is None else len(lives[-1].events) - 1
    walks: list[tuple[timeline.Life, timeline.Series, States, int]] = [(lives[-1], last, carried or {}, first)]
    if carried is None:
        walks[:0] = [(life, life.pooled(assumptions), {}, 0) for life in lives[:-1]]
    predictions: dict[tuple[float, str], TrackPrediction] = {}
    filters: States = {}
    warnings: dict[str, list[Warned]] = {}
    for life, full_life, start, first_event in walks:
        measured = set(full_life.events)
        walk = follow(life, full_life, state.fraction, start, first_event=first_event)
        for index, (after_event, after_test) in enumerate(walk, start=first_event):
            filters = after_event
            predictions |= {(prediction.cycles, prediction.method): prediction for prediction in after_test}
            if index in measured:
                shown = predictions[life.events[index].cycles, SHOWN].prediction
                odd = [warning for warning in shown.warnings if warning.code == OFF_TRACK]
                warnings[life.events[index].run_id] = odd
    return Tracking(predictions=tuple(predictions.values()), filters=filters, warnings=warnings, again=carried is None)


def _carried(
    state: ClutchHistory, life: timeline.Life, whole: timeline.Series, newest: timeline.Event
) -> States | None:
    """The stored filter states from before `newest`; None if a step from them would not give the same result as
    tracking again."""
    last = life.events[-1]
    is_test = newest.speed_range is not None
    index = (
        len(life.events) - 1
        if newest is last
        else next((place for place, event in enumerate(life.events) if event is newest), -1)
    )
    if newest.rebuild or index < 0 or (newest is not last and (is_test or newest.cycles < last.cycles)):
        return None
    if (newest is not last and newest.shift) or state.filters is None:
        return None
    before = sum(1 for event in whole.events if event != index)
    if state.filters.keys() != ({CARRIED} if before else set()):
        return None
    return None if any(tracked.runs != before for tracked in state.filters.values()) else state.filters


def loops_again(
    state: ClutchHistory, levels: Levels, reader: RunReader, evaluated: Mapping[str, str | None]
) -> dict[str, list[Loop]]:
    """run_id -> friction loops, for dynamic tests whose stationary test is no longer the one in `evaluated` (by
    run_id), or which are not in it."""
    loops = {}
    for run_id, test in state.stationary_tests.items():
        if run_id not in evaluated or evaluated[run_id] != test:
            fits = [] if test is None else levels.get(test, [])
            loops[run_id] = loop_items(
                loops_of(reader.read(run_id).channels, state.geometry, state.record.torque_filter, fits)
            )
    return loops


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """An arriving run: as sent, whether it is a sampled record, its own results, the friction its rows show, the doubts
    they raise, and its time of receipt."""

    run: IncomingRun
    sampled: bool
    analysis: Analysis
    shown: timeline.Shown | None
    odd: tuple[Notice, ...]
    received_at: str

    @property
    def kept(self) -> dict[str, object]:
        """The details stored with the run's channels."""
        return self.analysis.details_to_store(self.run) | (
            {} if self.shown is None else {"shown": self.shown.to_list()}
        )


def test_of(arrival: Arrival, life: timeline.Life) -> StationaryRun | None:
    """The run as a stationary test of a life, from the plateaus found already."""
    plateaus, times = arrival.analysis.plateaus, arrival.analysis.times
    if plateaus is None:
        return None
    return StationaryRun(**head_of(arrival.run, life.origin), plateaus=plateaus, time=times)


def reader_with(stored: RunReader, arrival: Arrival) -> RunReader:
    """A reader of the stored runs and the arriving one."""
    name = arrival.run.run_id
    return replace(
        stored,
        read=lambda run_id: arrival.run if run_id == name else stored.read(run_id),
        describe=lambda run_id: arrival.run if run_id == name else stored.describe(run_id),
        sampled=stored.sampled | ({name} if arrival.sampled else frozenset()),
        cut={name: partial(test_of, arrival)},
    )
