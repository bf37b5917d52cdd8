"""A clutch to which runs are sent as to the service, without its database and tracking: what is doubted, what refused."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from time import process_time
from typing import Any

import numpy as np

from service.api.clutch import ClutchIn
from service.changes import ingest_run
from service.clutch.analysis import Analysis, analyse, mean_cofs
from service.clutch.incoming_run import IncomingRun
from service.clutch.plausibility import doubts
from service.clutch.recomputation import Arrival
from service.clutch.timeline import Event, Life, lives_of, order, reference_velocities
from service.errors import InvalidError
from service.runs.json_run import read_run
from tests.lab.plausibility.ablation import WITHOUT, without

Body = dict[str, Any]
#: Instead of a code: the run is not stored at all.
REFUSED = "refused"
#: When the spool delivers everything: it says nothing of when runs were made.
RECEIVED = "2036-11-02T00:00:00+00:00"


def with_values(run: Body, channel: str, values: np.ndarray) -> Body:
    """The run with other values of a channel."""
    return run | {"channels": run["channels"] | {channel: values.tolist()}}


def with_gain(run: Body, gain: float) -> Body:
    """The run with its torque times a gain."""
    return with_values(run, "torque_nm", gain * np.array(run["channels"]["torque_nm"]))


@dataclass(frozen=True)
class Answer:
    """Codes of the doubts, what they say, how long they took [s], and whether there were any without each mechanism."""

    codes: tuple[str, ...]
    message: str = ""
    seconds: float = 0.0
    without: Mapping[str, bool] = field(default_factory=dict)


@dataclass
class Bench:
    """One clutch: its record, the runs that were accepted, those that are held, and the results of each by run_id."""

    record: Mapping[str, Any] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    held: tuple[Event, ...] = ()
    analyses: dict[str, Analysis] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.clutch = ClutchIn.model_validate({"clutch_id": "bench", **self.record})
        self.geometry = self.clutch.geometry.to_model()

    def accept(self, body: Body) -> None:
        """Somebody confirms the run, whatever is doubted about it."""
        event = self._read(body)[2]
        self.held = tuple(one for one in self.held if one.run_id != event.run_id)
        self._settle(order([*self.events, replace(event, confirmed=True)]))

    def answer(self, body: Body, *, ablated: bool = False) -> Answer:
        """What is doubted; all runs are then accepted or held as the judgement has them."""
        try:
            run, analysis, event = self._read(body)
        except InvalidError as error:
            return Answer(codes=(REFUSED,), message=str(error), without=dict.fromkeys(WITHOUT, True))
        began = process_time()
        _, notices = doubts.doubts_alone(run, analysis, self.geometry)
        together = {} if notices else self._together(event).doubts
        seconds = process_time() - began
        left_out = {}
        for name in WITHOUT if ablated else ():
            with without(name):
                lone = doubts.doubts_alone(run, analysis, self.geometry)
                asked = replace(event, shown=lone[0])
                left_out[name] = bool(lone[1]) or event.run_id in self._together(asked).doubts
        if notices:
            self.held = (*self.held, event)
        else:
            every = [*self.events, *self.held, event]
            self.held = tuple(
                one for one in every if one.run_id in together or (one.shown is None and not one.confirmed)
            )
            aside = {one.run_id for one in self.held}
            self._settle(order([one for one in every if one.run_id not in aside]))
        notices = notices or together.get(event.run_id, ())
        return Answer(
            codes=tuple(notice.code for notice in notices),
            message=" ".join(notice.message for notice in notices),
            seconds=seconds,
            without=left_out,
        )

    def _together(self, event: Event) -> doubts.Judged:
        return doubts.doubts_together(self.events, self.held, event, self.geometry, corrected=False)

    def _read(self, body: Body) -> tuple[IncomingRun, Analysis, Event]:
        run = read_run(json.dumps(body).encode())
        analysis = self.analyses.get(run.run_id) or analyse(run, self.geometry, 0.0)
        self.analyses[run.run_id] = analysis
        shown, odd = doubts.doubts_alone(run, analysis, self.geometry)
        arrival = Arrival(run=run, sampled=False, analysis=analysis, shown=shown, odd=odd, received_at=RECEIVED)
        event = ingest_run._event_of(arrival)
        lives = lives_of(order([*self.events, event]))
        life = next(life for life in lives if any(member.run_id == event.run_id for member in life.events))
        return run, analysis, replace(event, cofs=self._cofs(life, event))

    def _settle(self, events: tuple[Event, ...]) -> None:
        self.events = events
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
        fits = self.analyses[event.run_id].fits
        return mean_cofs(fits, reference_velocities(life.speed_range, self.geometry), self.geometry)
