"""Tracking a life: three filters over mean COF, and what each foretells after every event.

A run that comes last in order of cycles carries the stored filter states one step on; any other run makes the life be
tracked anew from its first test. Both ways give the same answer: the random numbers of a step depend on clutch, series
and step alone.
"""

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.prognosis import first_passage
from models.tracking.grid import Grid, GridState
from models.tracking.particle import Particle, ParticleState
from models.tracking.prior import weak
from models.tracking.protocol import Posterior, Tracker
from models.tracking.ukf import Ukf, UkfState
from service.workflows.foretold import foretold, unknown
from service.workflows.history import Life, Series

FilterState = ParticleState | UkfState | GridState

#: Eq. 6 has four coefficients; from fewer tests at different cycles nothing is foretold.
FEWEST_TESTS = 3
_DRAWS = 1000
_GRID = Grid()
_TRACKERS: Mapping[str, Tracker[Any]] = {tracker.name: tracker for tracker in (Particle(), Ukf(), _GRID)}
METHODS = tuple(_TRACKERS)
#: The exact filter is laid anew over the whole history at each step: these carry a state from run to run. When a life is
#: tracked anew, only these say again what they would have said all along; the exact one is worked out when asked.
CARRIED = tuple(method for method in METHODS if method != _GRID.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What was said at `cycles` by one method, in the public shape."""

    cycles: float
    method: str
    payload: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """A filter's state after `runs` measurements of a series."""

    runs: int
    state: FilterState


States = dict[str, Tracked]


def follow(
    clutch_id: str, life: Life, series: Series, fraction: float, states: States, *, first_event: int = 0
) -> Iterator[tuple[States, list[Prediction]]]:
    """Walk a life's events from `first_event` on; after each, the states by method and what is predicted of the series.

    `states` are those before `first_event`. A life that says too little yields `insufficient_data`.
    """
    for index in range(first_event, len(life.events)):
        runs = series.until(index)
        cycles = life.events[index].cycles
        methods = METHODS if index == len(life.events) - 1 else CARRIED
        if runs:
            states = {method: advance(clutch_id, method, series, states.get(method), runs) for method in methods}
        yield (
            states,
            [
                Prediction(
                    cycles=cycles,
                    method=method,
                    payload=predict(clutch_id, method, series, states.get(method), life.origin, cycles, fraction),
                )
                for method in methods
            ],
        )


def advance(clutch_id: str, method: str, series: Series, tracked: Tracked | None, runs: int) -> Tracked:
    """Carry one filter on until it has taken in the first `runs` measurements of the series."""
    if tracked is not None and tracked.runs == runs:
        return tracked
    prior = weak(series.measurements[0], falling=True)
    if method == _GRID.name:
        return Tracked(runs=runs, state=_GRID.from_history(prior, series.measurements[:runs]))
    tracker = _TRACKERS[method]
    state = tracker.start(prior) if tracked is None else tracked.state
    for step in range(0 if tracked is None else tracked.runs, runs):
        state = tracker.update(state, series.measurements[step], step_rng(clutch_id, method, series, step))
    return Tracked(runs=runs, state=state)


def draws(clutch_id: str, method: str, series: Series, tracked: Tracked, size: int = _DRAWS) -> Posterior:
    """A weighted sample of eq. 6's coefficients after `tracked.runs` measurements; the same each time."""
    tracker = _TRACKERS[method]
    return tracker.posterior(tracked.state, size, step_rng(clutch_id, f"{method}-posterior", series, tracked.runs))


def step_rng(clutch_id: str, purpose: str, series: Series, step: int) -> np.random.Generator:
    """The random numbers of one step: they depend on clutch, purpose, series and step alone."""
    named = f"{clutch_id}/{purpose}/{series.quantity}/{series.pressure!r}"
    return np.random.default_rng([zlib.crc32(named.encode()), step])


def predict(
    clutch_id: str, method: str, series: Series, tracked: Tracked | None, origin: float, cycles: float, fraction: float
) -> dict[str, Any]:
    """What is said at `cycles` of a series, in the public shape."""
    if tracked is None:
        return unknown(cycles, series.pressure, fraction)
    passage = first_passage(draws(clutch_id, method, series, tracked), fraction=fraction, as_of=cycles - origin)
    enough = len({each.progress for each in series.measurements[: tracked.runs]}) >= FEWEST_TESTS
    return foretold(passage, tracked.runs, origin, cycles, series.pressure, fraction, enough=enough)
