"""A clutch to which runs are sent as to the service, without its database and tracking: what is doubted, what refused."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from time import process_time
from typing import Any

from service.errors import InvalidError
from service.lives.history import (
    REBUILD,
    Event,
    Life,
    duty_block,
    life_with,
    lives_of,
    moment_of,
    order,
    reference_velocities,
)
from service.lives.incoming_run import IncomingRun
from service.lives.plausibility.doubts import doubts
from service.lives.recomputation import ClutchState
from service.lives.run_analysis import Analysis, analyse, mean_cofs
from service.run_files.json_run import read_run
from service.schemas.clutch import ClutchIn
from tests.plausibility.ablation import WITHOUT, without

Body = dict[str, Any]
#: Instead of a code: the run is not stored at all.
REFUSED = "refused"
#: When the spool delivers everything: it says nothing of when runs were made.
RECEIVED = "2026-11-02T00:00:00+00:00"


@dataclass(frozen=True)
class Answer:
    """Codes of the doubts, what they say, how long they took [s], and whether there were any without each mechanism."""

    codes: tuple[str, ...]
    message: str = ""
    seconds: float = 0.0
    without: Mapping[str, bool] = field(default_factory=dict)


@dataclass
class Bench:
    """One clutch: its record, and the runs that were accepted."""

    record: Mapping[str, Any] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    _analyses: dict[str, Analysis] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clutch = ClutchIn.model_validate({"clutch_id": "bench", **self.record})
        self.geometry = self.clutch.geometry.to_model()

    def accept(self, body: Body) -> None:
        """The run becomes part of the history, whatever is doubted about it."""
        self._accept(self._read(body)[2])

    def answer(self, body: Body, *, ablated: bool = False) -> Answer:
        """What is doubted; a run without doubts is accepted."""
        try:
            run, analysis, event = self._read(body)
        except InvalidError as error:
            return Answer(codes=(REFUSED,), message=str(error), without=dict.fromkeys(WITHOUT, True))
        before = ClutchState(record=self.clutch, revision=0, events=self.events, adoptions=(), priors={})
        began = process_time()
        notices = doubts(run, analysis, event, before)
        seconds = process_time() - began
        held = {}
        for name in WITHOUT if ablated else ():
            with without(name):
                held[name] = bool(doubts(run, analysis, event, before))
        if not notices:
            self._accept(event)
        return Answer(
            codes=tuple(notice.code for notice in notices),
            message=" ".join(notice.message for notice in notices),
            seconds=seconds,
            without=held,
        )

    def _read(self, body: Body) -> tuple[IncomingRun, Analysis, Event]:
        run = read_run(json.dumps(body).encode())
        analysis = self._analyses.get(run.run_id) or analyse(run, self.geometry, 0.0)
        self._analyses[run.run_id] = analysis
        event = _event(run, analysis)
        life = life_with(order([*self.events, event]), event)
        return run, analysis, replace(event, cofs=self._cofs(life, event))

    def _accept(self, event: Event) -> None:
        self.events = order([*self.events, event])
        # under one protocol the means that were computed already hold
        if all(one.speed_range in (None, life.speed_range) for life in lives_of(self.events) for one in life.events):
            return
        self.events = tuple(
            replace(one, cofs=self._cofs(life, one)) if one.speed_range is not None else one
            for life in lives_of(self.events)
            for one in life.events
        )

    def _cofs(self, life: Life, event: Event) -> Mapping[float, tuple[float, float]]:
        if life.speed_range is None or event.speed_range is None:
            return {}
        fits = self._analyses[event.run_id].fits
        return mean_cofs(fits, reference_velocities(life.speed_range, self.geometry), self.geometry)


def _event(run: IncomingRun, analysis: Analysis) -> Event:
    duty, maintenance = run.details.get("duty") or {}, run.details.get("event")
    names = ("cycles", "energy_per_cycle_kj", "initial_speed_rpm", "engagement_duration_s")
    return Event(
        run_id=run.run_id,
        kind=run.kind,
        cycles=run.cycles,
        moment=moment_of(run.started_at, RECEIVED),
        speed_range=analysis.speed_range,
        rebuild=maintenance == REBUILD,
        shift=maintenance not in (None, REBUILD),
        duty=duty_block(run.cycles, *(duty.get(name) for name in names)),
        dated=run.started_at is not None,
    )
