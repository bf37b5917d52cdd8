"""Tracking a life: three filters over mean COF, and what each foretells after every event.

A run that comes last in order of cycles carries the stored filter states one step on; any other run makes the life be
tracked anew from its first test. Both ways give the same answer: the random numbers of a step depend on clutch, series
and step alone. Where a fleet's prior stands beside the weak one a filter runs under both, and its draws are put together
as the data have it (`models.prognosis.fleet`).
"""

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.prognosis.criteria import FEWEST_TESTS, HORIZON
from models.prognosis.first_passage import Offset, predict_first_passage
from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.particle import Particle, ParticleState
from models.tracking.filters.ukf import Ukf, UkfState
from models.tracking.posterior import Posterior, Tracker
from models.tracking.prior import Prior
from service.lives.assumptions import WEAK, Basis
from service.lives.history import Life, Series
from service.lives.prediction import foretold, unknown
from service.lives.surprise import off_track

FilterState = ParticleState | UkfState | GridState

_DRAWS = 1000
_GRID = Grid()
_TRACKERS: Mapping[str, Tracker[Any]] = {tracker.name: tracker for tracker in (Particle(), Ukf(), _GRID)}
METHODS = tuple(_TRACKERS)
#: The exact filter is laid anew over the whole history at each step, and worked out when it is asked for: these carry a
#: state from run to run, and what they say is stored with each.
CARRIED = tuple(method for method in METHODS if method != _GRID.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What was said at `cycles` by one method, in the public shape."""

    cycles: float
    method: str
    payload: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """A filter's states after `runs` measurements of a series, by what was believed before the first."""

    runs: int
    states: Mapping[str, FilterState]


States = dict[str, Tracked]


def follow(
    clutch_id: str, life: Life, basis: Basis, fraction: float, states: States, *, first_event: int = 0
) -> Iterator[tuple[States, list[Prediction]]]:
    """Walk a life's events from `first_event` on; after each, the states by method and what is predicted of the series.

    `states` are those before `first_event`. A life that says too little yields `insufficient_data`.
    """
    whole = life.pooled(basis)
    for index in range(first_event, len(life.events)):
        series = whole if basis.counts_cycles else life.until(index).pooled(basis)
        runs = series.until(index)
        cycles = life.events[index].cycles
        if runs:
            states = {method: advance(clutch_id, method, series, basis, states.get(method), runs) for method in CARRIED}
        yield (
            states,
            [
                Prediction(
                    cycles=cycles,
                    method=method,
                    payload=predict(clutch_id, method, series, basis, states.get(method), cycles, fraction),
                )
                for method in CARRIED
            ],
        )


def advance(clutch_id: str, method: str, series: Series, basis: Basis, tracked: Tracked | None, runs: int) -> Tracked:
    """Carry one filter on until it has taken in the first `runs` measurements of the series.

    A state that was made of other measurements or other beliefs is of no use: then it starts anew.
    """
    beliefs = basis.beliefs(series.quantity, series.measurements[0], series.scale)
    if tracked is not None and not _continues(tracked, series, beliefs):
        tracked = None
    if tracked is not None and tracked.runs == runs:
        return tracked
    if method == _GRID.name:
        seen = series.measurements[:runs]
        return Tracked(runs=runs, states={name: _GRID.from_history(prior, seen) for name, prior in beliefs.items()})
    tracker = _TRACKERS[method]
    states = {name: tracker.start(prior) for name, prior in beliefs.items()} if tracked is None else tracked.states
    for step in range(0 if tracked is None else tracked.runs, runs):
        states = {
            name: tracker.update(
                state, series.measurements[step], step_rng(clutch_id, _purpose(method, name), series, step)
            )
            for name, state in states.items()
        }
    return Tracked(runs=runs, states=states)


def _continues(tracked: Tracked, series: Series, beliefs: Mapping[str, Prior]) -> bool:
    """Whether the states are those of the series' first measurements under these beliefs."""
    if tracked.states.keys() != beliefs.keys() or any(tracked.states[name].prior != p for name, p in beliefs.items()):
        return False
    seen = series.measurements[: tracked.runs]
    for state in tracked.states.values():
        history = state.history
        known = zip(seen, history.progress.tolist(), history.value.tolist(), history.epoch.tolist(), strict=False)
        if any((m.progress, m.value, m.epoch) != (zeta, value, epoch) for m, zeta, value, epoch in known):
            return False
    return True


def draws(clutch_id: str, method: str, series: Series, basis: Basis, tracked: Tracked, size: int = _DRAWS) -> Posterior:
    """A weighted sample of eq. 6's coefficients after `tracked.runs` measurements; the same each time."""
    tracker = _TRACKERS[method]
    found = {}
    for name, state in tracked.states.items():
        rng = step_rng(clutch_id, f"{_purpose(method, name)}-posterior", series, tracked.runs)
        found[name] = tracker.posterior(state, size, rng)
    return basis.together(found, series.measurements[0], series.scale)


def _purpose(method: str, belief: str) -> str:
    """What a step's random numbers are for."""
    return method if belief == WEAK else f"{method}-{belief}"


def step_rng(clutch_id: str, purpose: str, series: Series, step: int) -> np.random.Generator:
    """The random numbers of one step: they depend on clutch, purpose, series and step alone."""
    named = f"{clutch_id}/{purpose}/{series.quantity}/{series.pressure!r}"
    return np.random.default_rng([zlib.crc32(named.encode()), step])


def predict(
    clutch_id: str,
    method: str,
    series: Series,
    basis: Basis,
    tracked: Tracked | None,
    cycles: float,
    fraction: float,
) -> dict[str, Any]:
    """What is said at `cycles` of a series, in the public shape."""
    if tracked is None:
        return unknown(basis, cycles, series.pressure, fraction)
    posterior = draws(clutch_id, method, series, basis, tracked)
    passage = predict_first_passage(
        posterior,
        fraction=fraction,
        as_of=float(series.scale.progress(cycles)),
        horizon=float(series.scale.progress(series.scale.origin + HORIZON)),
        offset=offset_of(series, basis),
    )
    seen = series.measurements[: tracked.runs]
    enough = len({each.progress for each in seen}) >= FEWEST_TESTS
    warnings = off_track(posterior, seen, basis.beliefs(series.quantity, seen[0], series.scale)[WEAK])
    return foretold(passage, basis, series, cycles, fraction, runs=tracked.runs, enough=enough, warnings=warnings)


def offset_of(series: Series, basis: Basis) -> Offset | None:
    """The adopted model's course over ζ, None where there is none."""
    if basis.course is None:
        return None
    return lambda progress: basis.offset(series.quantity, series.pressure, series.scale.cycles(progress))
