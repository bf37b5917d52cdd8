"""A run as it comes in, and the stored runs with it in its place: what all after a late run is computed anew from."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from models.diagnosis.campaign import StationaryRun
from service.errors import Notice
from service.lives.diagnosis.campaign import tested
from service.lives.history import STATIONARY, Life, Shown
from service.lives.incoming_run import IncomingRun
from service.lives.model_correction import RunReader
from service.lives.run_analysis import Analysis


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrival:
    """A run by itself: as it came in, whether it is a sampled record, its own results, what its rows show of friction and
    what is odd about them, and when it was received."""

    run: IncomingRun
    sampled: bool
    analysis: Analysis
    shown: Shown | None
    odd: tuple[Notice, ...]
    received_at: str

    @property
    def kept(self) -> dict[str, Any]:
        """What is kept beside the run's channels."""
        return self.analysis.kept_beside(self.run) | ({} if self.shown is None else {"shown": self.shown.to_list()})


def test_of(arrival: Arrival, life: Life) -> StationaryRun | None:
    """The run as a stationary test of a life, by the plateaus that were cut already."""
    plateaus = arrival.analysis.plateaus
    if plateaus is None:
        return None
    return tested(arrival.run, plateaus, arrival.analysis.times, origin=life.origin)


def tests_with(reader: RunReader, life: Life, arrival: Arrival) -> Iterator[StationaryRun]:
    """The stationary tests of a life in order, the run that comes in among them."""
    for event in life.events:
        if event.run_id != arrival.run.run_id:
            yield from reader.stationary_tests(replace(life, events=(event,)))
        elif event.kind == STATIONARY:
            test = test_of(arrival, life)
            if test is not None:
                yield test


def reader_with(stored: RunReader, arrival: Arrival) -> RunReader:
    """The stored runs, and the one that comes in."""
    name = arrival.run.run_id
    return replace(
        stored,
        read=lambda run_id: arrival.run if run_id == name else stored.read(run_id),
        describe=lambda run_id: arrival.run if run_id == name else stored.describe(run_id),
        sampled=stored.sampled | ({name} if arrival.sampled else frozenset()),
    )
