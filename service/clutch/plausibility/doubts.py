"""The doubts about runs, in words: what is odd, the value, the expected value, the likely mistake, and what to do.

Dead channels are found in a run by itself, and nothing that other runs show takes them back. All else is one question
over all runs, `models.plausibility.judgement`, asked again whenever a run comes in or is changed.
"""

import bisect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import reduce

from models.clutch import Geometry
from models.plausibility import criteria
from models.plausibility.common_causes import (
    OFFSET,
    RESTART,
    ROLL_OVER,
    STUCK,
    TWO_CLUTCHES,
    CommonCause,
    common_cause_of,
)
from models.plausibility.common_causes import (
    UNIT as OTHER_UNIT,
)
from models.plausibility.judgement import JointJudgement, SlipVerdict, judge
from models.plausibility.slips import OF_CYCLES, OTHER_CYCLES, RunReading
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.clutch.analysis import Analysis
from service.clutch.incoming_run import IncomingRun
from service.clutch.plausibility.reading import DEAD, DEAD_PRESSURE, columns_of, dead_channels, runs_of, shown_by
from service.clutch.timeline import Event, Shown, beyond_end, lives_of, order, with_event
from service.errors import Hypothesis, Notice

OFF_PACE, AGAINST_TIME = "cycles_off_pace", "cycles_against_time"
BEYOND_PHYSICS, OFF_COURSE = "cof_beyond_physics", "cof_off_course"
#: Of many runs with one cause: a counter that changed, or runs of two clutches under one name.
COUNTER = "counter"
#: The kinds of hypotheses, as answers call them.
_KINDS = {OTHER_UNIT: "other_unit", TWO_CLUTCHES: "other_clutch"}
UNIT = "unit"


def doubt(verdict: SlipVerdict, sent: RunReading, shown: Shown) -> Notice:
    """The doubt about a run whose most probable explanation is the verdict's slip."""
    slip = verdict.slip
    if slip.name in OF_CYCLES:
        return _cycles_notice(verdict, sent)
    if slip.unit and (slip.name in ("oil", "speed") or _expected_then(verdict)):
        return _unit_notice(verdict, shown)
    if slip.name == DEAD_PRESSURE:
        message = (
            f"by its pressure the clutch is open, but a torque of {shown.open_torque or 0.0:.3g} Nm needs a closed one: "
            "is the pressure sensor connected? Withdraw the run, or confirm it."
        )
        return Notice(code=DEAD, message=message)
    return _cof_notice(verdict, sent)


def negative(cof: float) -> Notice:
    """The doubt about a run with negative friction: its torque pushes instead of braking."""
    message = (
        f"torque drives the clutch instead of braking it (COF {cof:.3g}): is the sign of torque or speed wrong? "
        "Send the run with the right sign, or confirm it."
    )
    return Notice(code=BEYOND_PHYSICS, message=message)


def common_doubts(cause: CommonCause, events: Sequence[Event]) -> dict[str, tuple[Notice, ...]]:
    """One common doubt for all runs with the same cause, by run_id, with the cycles of each run; `events` are all runs.
    The question stays as it is while further runs join."""
    own = [events[index] for index in cause.runs]
    moment = datetime.fromtimestamp(own[0].moment, UTC)
    day, since = f"{moment.day} {moment:%b %Y}", f"the runs since {own[0].run_id}"
    reached, number = _number(cause.reached), _number(abs(cause.number))
    question = {
        RESTART: f"Did the counter restart at zero by {day}? Then {since} count from {number}",
        ROLL_OVER: f"Did the counter roll over at {number} by {day}? Then {since} count from there",
        OFFSET: f"Was the counter exchanged by {day}? By dates and pace {since} count {number} cycles "
        f"{'too few' if cause.number > 0 else 'too many'}",
        OTHER_UNIT: f"Is one of the counter {number} cycles since {day}? Then {since} count in another unit",
        STUCK: f"Did the counter stand still at {reached} cycles from {day} on? Then {since} count by their dates",
        TWO_CLUTCHES: f"Are runs since {own[0].run_id} on {day} another clutch's, or was the clutch rebuilt? By their dates "
        f"they do not go with the others, which reach {reached} cycles",
    }[cause.name]
    hypothesis = Hypothesis(
        name=f"{COUNTER}-{own[0].run_id}",
        kind=_KINDS.get(cause.name, cause.name),
        runs=tuple(event.run_id for event in own),
        cycles_offset=cause.number if cause.name in (RESTART, ROLL_OVER, OFFSET) else None,
        cycles_factor=cause.number if cause.name == OTHER_UNIT else None,
    )
    doubts: dict[str, tuple[Notice, ...]] = {}
    for event, cycles in zip(own, cause.cycles, strict=True):
        if cause.name == TWO_CLUTCHES:
            message = (
                f"{question}. Withdraw them together, or send maintenance with the event rebuild, or confirm them."
            )
            doubts[event.run_id] = (Notice(code=COUNTER, message=message, hypothesis=hypothesis),)
            continue
        message = (
            f"{question}. {reached} cycles were reached before; this run, sent at {_number(event.cycles)}, would be at "
            f"{_number(cycles)}. Correct them together, or confirm them."
        )
        doubts[event.run_id] = (Notice(code=COUNTER, message=message, likely_cycles=cycles, hypothesis=hypothesis),)
    return doubts


def _cycles_notice(verdict: SlipVerdict, sent: RunReading) -> Notice:
    """The doubt about a run's cycles, with the likely value if one is known."""
    sentences = [_gap(verdict, sent.cycles)]
    if verdict.against_time:
        sentences.append("Its date (started_at) does not fit the order of the cycles.")
    if verdict.expected is not None and sent.log_cof is not None:
        (low, high), cof = verdict.expected, math.exp(sent.log_cof)
        if not low <= cof <= high:
            sentences.append(f"Its mean COF is {cof:.3g}; {low:.3g} to {high:.3g} is expected at these cycles.")
    guessed = verdict.slip.name != OTHER_CYCLES and verdict.latest is not None
    likely = verdict.slip.likely.cycles if guessed else None
    ask = "" if likely is None else f"Is it {_number(likely)}? "
    message = " ".join([*sentences, f"{ask}Confirm or correct it."])
    return Notice(code=AGAINST_TIME if verdict.against_time else OFF_PACE, message=message, likely_cycles=likely)


def _gap(verdict: SlipVerdict, cycles: float) -> str:
    """The sentence that compares a run's cycles with those of the runs around it."""
    if verdict.latest is None:
        return f"{_number(cycles)} cycles are more than any clutch lasts."
    if verdict.before is None or cycles <= verdict.latest + 0.5:
        return (
            f"{_number(cycles)} cycles lie between those of other runs; the last run was at {_number(verdict.latest)}."
        )
    gap = f"{_number(cycles)} cycles are {_number(cycles - verdict.before)} after the previous run"
    usual = verdict.usual_gap
    return f"{gap}." if usual is None else f"{gap}; earlier runs were about {_number(usual)} cycles apart."


def _unit_notice(verdict: SlipVerdict, shown: Shown) -> Notice:
    """The doubt about a channel that was probably sent in another unit."""
    slip = verdict.slip
    if slip.name == "oil":
        oil = (shown.oil or 0.0) - ZERO_CELSIUS
        message = f"oil temperature is {oil:.4g} °C: was it sent in {slip.unit}?"
    else:
        of = {
            "pressure": f"pressure is up to {(shown.pressure or 0.0) / PASCALS_PER_BAR:.4g} bar",
            "torque": "torque",
            "speed": f"speed is up to {(shown.speed or 0.0) / RADIANS_PER_SECOND_PER_RPM:.4g} rpm",
        }[slip.name]
        low, high = verdict.expected or (math.inf, -math.inf)
        if shown.cof is None or low <= shown.cof <= high:
            odd = ", unlike in other tests"
        else:
            odd = f"{'' if slip.name == 'torque' else ' and'} gives a COF of {shown.cof:.3g}{_expected(verdict)}"
        message = f"{of}{odd}: was it sent in {slip.unit}?"
    return Notice(code=UNIT, message=f"{message} Withdraw the run and send it in the channel's unit, or confirm it.")


def _expected_then(verdict: SlipVerdict) -> bool:
    """Whether COF without the slip would be as expected; if not, the doubt does not ask for the unit, although a wrong
    one explains part of the deviation."""
    likely = verdict.slip.likely
    if verdict.expected_then is None or likely.log_cof is None:
        return True
    return verdict.expected_then[0] <= math.exp(likely.log_cof) <= verdict.expected_then[1]


def _expected(verdict: SlipVerdict) -> str:
    """The clause with the expected interval; empty if there is none."""
    if verdict.expected is None:
        return ""
    return f", where {verdict.expected[0]:.3g} to {verdict.expected[1]:.3g} is expected"


def _cof_notice(verdict: SlipVerdict, sent: RunReading) -> Notice:
    """The doubt about a mean COF that is off the course or beyond physics."""
    cof = math.exp(sent.log_cof or -20.0)
    beyond = abs(math.log(cof / criteria.COF)) / criteria.LOG_COF_SD > 2.5
    cause = "Is a sensor or a unit wrong?" if beyond else "Is it another clutch's test?"
    at = f"at {_number(sent.cycles)} cycles{_expected(verdict)}"
    message = f"mean COF is {cof:.3g} {at}. {cause} Withdraw the run, or confirm it."
    return Notice(code=BEYOND_PHYSICS if beyond else OFF_COURSE, message=message)


def _number(value: float) -> str:
    return f"{value:.0f}" if float(value).is_integer() else f"{value:g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """The result of the joint judgement: doubts about each run to be held, by run_id; held runs now accepted, accepted
    runs now held, and the reasons, by run_id; and changes of whether a test begins a new level, by run_id."""

    doubts: Mapping[str, tuple[Notice, ...]] = field(default_factory=dict)
    accepted: tuple[Event, ...] = ()
    held: tuple[Event, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)
    levels: Mapping[str, bool] = field(default_factory=dict)

    @property
    def changes(self) -> bool:
        """Whether the judgement changes the state or level of any earlier run."""
        return bool(self.accepted or self.held or self.levels)

    def settled(self, events: Sequence[Event], further: Sequence[Event] = ()) -> tuple[Event, ...]:
        """The accepted runs after the judgement; `events` were accepted before, `further` are newly accepted."""
        gone = {event.run_id for event in self.held}
        settled = order([*(event for event in events if event.run_id not in gone), *self.accepted, *further])
        return tuple(replace(event, new_level=self.levels.get(event.run_id, event.new_level)) for event in settled)

    def aside(self, held: Sequence[Event], further: Sequence[Event]) -> tuple[Event, ...]:
        """The held runs after the judgement; `held` were held before, `further` are newly held."""
        back = {event.run_id for event in self.accepted}
        return order([*(event for event in held if event.run_id not in back), *self.held, *further])


def doubts_alone(run: IncomingRun, analysis: Analysis, geometry: Geometry) -> tuple[Shown | None, tuple[Notice, ...]]:
    """The friction that a run's rows show, and the doubts about them that need no other run; if a channel is dead, None
    and the reason."""
    columns = columns_of(run, analysis)
    odd = [] if columns is None else dead_channels(run.kind, columns, geometry)
    if odd:
        return None, tuple(odd)
    shown = shown_by(columns, geometry)
    if shown.cof is not None and shown.cof <= 0:
        return None, (negative(shown.cof),)
    return shown, ()


def doubts_together(
    accepted: tuple[Event, ...],
    held: Sequence[Event],
    incoming: Event | None,
    geometry: Geometry,
    *,
    corrected: bool,
    changed: Sequence[Event] = (),
) -> Judged:
    """The joint judgement on all runs of a clutch: which are to be held and which accepted.

    `accepted` and `held` are the runs in their present states, `incoming` a new or changed run (None: none), `changed`
    the runs changed or removed, whose neighbours are judged again. `corrected`: a model in force corrects the mean COFs
    of tests.
    """
    new = [] if incoming is None else [incoming]
    doubted = _doubted(accepted, held, new)
    events = reduce(with_event, [*doubted, *new], accepted)
    runs = runs_of(events, geometry, corrected=corrected)
    place = {run.name: index for index, run in enumerate(runs)}
    cycles = [event.cycles for event in events]
    about = [min(bisect.bisect_left(cycles, event.cycles), len(events) - 1) for event in changed if events]
    asked = [*(place[event.run_id] for event in [*doubted, *new]), *about]
    judgement = judge(runs, asked)
    if incoming is None and not doubted:  # what somebody has changed is no reason to hold other runs
        return Judged(levels=_levels(events, judgement))
    doubts: dict[str, tuple[Notice, ...]] = {}
    cause, judged_events = common_cause_of(runs), events
    # of a single run its slips say more, unless the cause is more probable than they are
    if cause is not None and (cause.log_odds > 0.0 or len(cause.runs) > 1):
        doubts = common_doubts(cause, events)
        left = [index for index in range(len(runs)) if runs[index].name not in doubts]
        places = {index: k for k, index in enumerate(left)}
        runs, judged_events = [runs[index] for index in left], tuple(events[index] for index in left)
        judgement = judge(runs, [places[index] for index in asked if index in places])
    levels = _levels(judged_events, judgement)
    doubts |= {
        runs[index].name: (doubt(verdict, runs[index].sent, judged_events[index].shown or Shown()),)
        for index, verdict in judgement.held.items()
    }
    back = tuple(event for event in doubted if event.run_id not in doubts)
    gone = tuple(event for event in accepted if event.run_id in doubts)
    counted = [event for event in events if event.run_id not in doubts]
    reasons = {event.run_id: f"agrees with {_names_of_nearest_runs(event, counted)}" for event in back}
    reasons |= {event.run_id: f"does not agree with {_names_of_nearest_runs(event, counted)}" for event in gone}
    return Judged(doubts=doubts, accepted=back, held=gone, reasons=reasons, levels=levels)


def levelled(
    accepted: Sequence[Event], held: Sequence[Event], geometry: Geometry, *, corrected: bool
) -> tuple[Event, ...]:
    """The accepted runs with the new levels that they show; arguments as in `doubts_together`, which finds the same
    levels."""
    doubted = _doubted(accepted, held)
    events = order([*accepted, *doubted])
    names = {event.run_id for event in doubted}
    about = [index for index, event in enumerate(events) if event.run_id in names]
    judgement = judge(runs_of(events, geometry, corrected=corrected), about)
    return Judged(levels=_levels(events, judgement)).settled(accepted)


def _doubted(accepted: Sequence[Event], held: Sequence[Event], new: Sequence[Event] = ()) -> list[Event]:
    """The held runs to be judged again: those without a dead channel, and not after the declared end of their life."""
    return [
        event
        for event in held
        if event.shown is not None and beyond_end(lives_of(order([*accepted, *new, event]))) is None
    ]


def _levels(events: Sequence[Event], judgement: JointJudgement) -> dict[str, bool]:
    """Changes of whether a test begins a new level, by run_id."""
    return {
        events[index].run_id: index in judgement.levels
        for index in judgement.tests
        if events[index].new_level is not (index in judgement.levels)
    }


def _names_of_nearest_runs(event: Event, counted: Sequence[Event]) -> str:
    """The names of the runs nearest to one in the history, of its kind if there are any."""
    other_runs = [other for other in counted if other.run_id != event.run_id]
    alike = [other for other in other_runs if other.kind == event.kind] or other_runs
    nearest = sorted(alike, key=lambda other: (abs(other.cycles - event.cycles), other.run_id))[:3]
    return ", ".join(other.run_id for other in nearest) or "no other run"
