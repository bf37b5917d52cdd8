"""The doubts about a clutch's runs: those of a run by itself, and the joint judgement over all of them in words.

Dead channels are found in a run by itself, and nothing that other runs show takes them back. All else is one question,
`models.plausibility.judgement`, asked again whenever a run comes in or is changed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from models.clutch import Geometry
from models.plausibility.judgement import judge
from service.errors import Notice
from service.lives.history import Event, Shown, beyond_end, order
from service.lives.incoming_run import IncomingRun
from service.lives.plausibility.dead_channels import dead_channels
from service.lives.plausibility.reading import columns_of, runs_of, shown_by
from service.lives.plausibility.wording import doubt, negative
from service.lives.run_analysis import Analysis

#: So many runs are named as the evidence of a change.
_NAMED = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """What the joint judgement says: the doubts about each run that is to be held, by run_id; the runs that were held and
    are now accepted, those that were accepted and are now held, and why, by run_id."""

    doubts: Mapping[str, tuple[Notice, ...]] = field(default_factory=dict)
    accepted: tuple[Event, ...] = ()
    held: tuple[Event, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)

    @property
    def changes(self) -> bool:
        """Whether the state of a run changes that was there already."""
        return bool(self.accepted or self.held)

    def settled(self, events: Sequence[Event], further: Sequence[Event] = ()) -> tuple[Event, ...]:
        """The accepted runs as they are from now on: `events` were accepted before, `further` come in accepted."""
        gone = {event.run_id for event in self.held}
        return order([*(event for event in events if event.run_id not in gone), *self.accepted, *further])

    def aside(self, held: Sequence[Event], further: Sequence[Event] = ()) -> tuple[Event, ...]:
        """The held runs as they are from now on: `held` were before, `further` come in held."""
        back = {event.run_id for event in self.accepted}
        return order([*(event for event in held if event.run_id not in back), *self.held, *further])


def doubts_alone(run: IncomingRun, analysis: Analysis, geometry: Geometry) -> tuple[Shown | None, tuple[Notice, ...]]:
    """What the rows of a run show, and what is odd about them whatever other runs show; None and why where a channel is
    dead."""
    columns = columns_of(run, analysis)
    odd = [] if columns is None else dead_channels(run.kind, columns, geometry)
    if odd:
        return None, tuple(odd)
    shown = shown_by(columns, geometry)
    if shown.cof is not None and shown.cof <= 0:
        return None, (negative(shown.cof),)
    return shown, ()


def doubts_together(
    accepted: Sequence[Event], held: Sequence[Event], incoming: Event | None, geometry: Geometry, *, corrected: bool
) -> Judged:
    """Which runs are to be held, all of them weighed together.

    `accepted` and `held` are the runs as they stand, `incoming` one that comes in or was changed (None: none is new). Held
    runs with a dead channel are no part of the question, nor are those after the declared end of their life. `corrected`:
    a model in force corrects the mean COFs of tests.
    """
    new = [] if incoming is None else [incoming]
    doubted = [
        event for event in held if event.shown is not None and beyond_end(order([*accepted, *new, event])) is None
    ]
    if incoming is None and not doubted:
        return Judged()
    events = order([*accepted, *doubted, *new])
    aside = {event.run_id for event in doubted}
    runs = runs_of(events, aside, geometry, corrected=corrected)
    place = {run.name: index for index, run in enumerate(runs)}
    in_question = [place[event.run_id] for event in [*doubted, *new]]
    verdicts = judge(runs, in_question, [place[name] for name in aside])
    doubts = {
        runs[index].name: (doubt(verdict, runs[index].sent, events[index].shown or Shown()),)
        for index, verdict in verdicts.items()
    }
    back = tuple(event for event in doubted if event.run_id not in doubts)
    gone = tuple(event for event in accepted if event.run_id in doubts)
    counted = [event for event in events if event.run_id not in doubts]
    reasons = {event.run_id: f"agrees with {_beside(event, counted)}" for event in back}
    reasons |= {event.run_id: f"does not agree with {_beside(event, counted)}" for event in gone}
    return Judged(doubts=doubts, accepted=back, held=gone, reasons=reasons)


def _beside(event: Event, counted: Sequence[Event]) -> str:
    """The runs nearest to one in the history, of its kind where there are any, by their names."""
    others = [other for other in counted if other.run_id != event.run_id]
    alike = [other for other in others if other.kind == event.kind] or others
    nearest = sorted(alike, key=lambda other: (abs(other.cycles - event.cycles), other.run_id))[:_NAMED]
    return ", ".join(other.run_id for other in nearest) or "no other run"
