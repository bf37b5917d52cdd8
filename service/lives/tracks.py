"""Tracking a life: three filters over a series, and the prediction of each after every event.

A run that comes last in order of cycles carries the stored filter states one step on; any other run makes the life be
tracked anew from its first test. Both ways give the same answer: the random numbers of a step depend on clutch, series
and step alone. Where a fleet's prior stands beside the weak one a filter runs under both, and its draws are put together
by their evidence (`models.prognosis.fleet`).
"""

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from models.prognosis.criteria import FEWEST_TESTS, HORIZON
from models.prognosis.first_passage import Offset, predict_first_passage
from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.particle import Particle, ParticleState
from models.tracking.filters.ukf import Ukf, UkfState
from models.tracking.innovation import last_innovation
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior, Tracker
from models.tracking.prior import Prior
from service.columns import PASCALS_PER_BAR, bar
from service.errors import NotFoundError
from service.lives.assumptions import ALL_PRESSURES, WEAK, Assumptions
from service.lives.criteria import PREDICTION_DRAWS
from service.lives.history import Event, Life, Series, lives_of, nearest_pressure
from service.lives.payloads import insufficient, off_track, predicted
from service.lives.run_analysis import Notice

FilterState = ParticleState | UkfState | GridState

_GRID = Grid()
_TRACKERS: Mapping[str, Tracker[Any]] = {tracker.name: tracker for tracker in (Particle(), Ukf(), _GRID)}
METHODS = tuple(_TRACKERS)
#: The exact filter is laid anew over the whole history at each step, and computed when it is asked for: these carry a
#: state from run to run, and their predictions are stored with each.
CARRIED = tuple(method for method in METHODS if method != _GRID.name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """The prediction at `cycles` by one method, in the public shape."""

    cycles: float
    method: str
    payload: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """A filter's states after `runs` measurements of a series, by the name of the prior that they started from."""

    runs: int
    states: Mapping[str, FilterState]


States = Mapping[str, Tracked]


def follow(
    clutch_id: str,
    life: Life,
    whole: Series,
    assumptions: Assumptions,
    fraction: float,
    states: States,
    *,
    first_event: int = 0,
) -> Iterator[tuple[States, list[Prediction]]]:
    """Walk a life's events from `first_event` on; after each, the states by method and the predictions of the series.

    `whole` is the series of all its events, `states` are those before `first_event`. A life with too few tests yields
    `insufficient_data`.
    """
    for index in range(first_event, len(life.events)):
        series = whole if assumptions.counts_cycles else life.until(index).pooled(assumptions)
        runs = series.until(index)
        cycles = life.events[index].cycles
        if runs:
            states = {
                method: advance(clutch_id, method, series, assumptions, states.get(method), runs) for method in CARRIED
            }
        yield (
            states,
            [
                Prediction(
                    cycles=cycles,
                    method=method,
                    payload=predict(clutch_id, method, series, assumptions, states.get(method), cycles, fraction),
                )
                for method in CARRIED
            ],
        )


def advance(
    clutch_id: str, method: str, series: Series, assumptions: Assumptions, tracked: Tracked | None, runs: int
) -> Tracked:
    """Carry one filter on until it has taken in the first `runs` measurements of the series.

    States that were made of other measurements or under other priors are not carried on: then the filter starts anew.
    """
    priors = assumptions.priors(series.quantity, series.measurements[0], series.scale)
    if tracked is not None and not _continues(tracked, series, priors):
        tracked = None
    if tracked is not None and tracked.runs == runs:
        return tracked
    if method == _GRID.name:
        measurements = series.measurements[:runs]
        return Tracked(
            runs=runs, states={name: _GRID.from_history(prior, measurements) for name, prior in priors.items()}
        )
    tracker = _tracker(method, len(priors))
    states = {name: tracker.start(prior) for name, prior in priors.items()} if tracked is None else tracked.states
    for step in range(0 if tracked is None else tracked.runs, runs):
        states = {
            name: tracker.update(
                state, series.measurements[step], step_rng(clutch_id, _purpose(method, name), series, step)
            )
            for name, state in states.items()
        }
    return Tracked(runs=runs, states=states)


def _tracker(method: str, priors: int) -> Tracker[Any]:
    """A filter under one of so many priors, among which the particles are shared."""
    tracker = _TRACKERS[method]
    return replace(tracker, particles=tracker.particles // priors) if isinstance(tracker, Particle) else tracker


def _continues(tracked: Tracked, series: Series, priors: Mapping[str, Prior]) -> bool:
    """Whether the states are those of the series' first measurements under these priors."""
    if tracked.states.keys() != priors.keys() or any(tracked.states[name].prior != p for name, p in priors.items()):
        return False
    measurements = series.measurements[: tracked.runs]
    for state in tracked.states.values():
        history = state.history
        rows = zip(
            measurements, history.progress.tolist(), history.value.tolist(), history.epoch.tolist(), strict=False
        )
        if any((m.progress, m.value, m.epoch) != (zeta, value, epoch) for m, zeta, value, epoch in rows):
            return False
    return True


def draws(clutch_id: str, method: str, series: Series, assumptions: Assumptions, tracked: Tracked) -> Posterior:
    """A weighted sample of eq. 6's coefficients after `tracked.runs` measurements; the same each time.

    The draws are shared among the priors: so a prediction costs the same whether a fleet has taught or not.
    """
    tracker, size = _tracker(method, len(tracked.states)), PREDICTION_DRAWS // len(tracked.states)
    posteriors = {}
    for name, state in tracked.states.items():
        rng = step_rng(clutch_id, f"{_purpose(method, name)}-posterior", series, tracked.runs)
        posteriors[name] = tracker.posterior(state, size, rng)
    return assumptions.pooled(posteriors, series.measurements[0], series.scale)


def _purpose(method: str, prior: str) -> str:
    """What a step's random numbers are for."""
    return method if prior == WEAK else f"{method}-{prior}"


def step_rng(clutch_id: str, purpose: str, series: Series, step: int) -> np.random.Generator:
    """The random numbers of one step: they depend on clutch, purpose, series and step alone."""
    name = f"{clutch_id}/{purpose}/{series.quantity}/{series.pressure!r}"
    return np.random.default_rng([zlib.crc32(name.encode()), step])


def predict(
    clutch_id: str,
    method: str,
    series: Series,
    assumptions: Assumptions,
    tracked: Tracked | None,
    cycles: float,
    fraction: float,
) -> dict[str, Any]:
    """The prediction at `cycles` of a series, in the public shape."""
    if tracked is None:
        return insufficient(assumptions, cycles, series.pressure, fraction)
    posterior = draws(clutch_id, method, series, assumptions, tracked)
    passage = predict_first_passage(
        posterior,
        fraction=fraction,
        as_of=float(series.scale.progress(cycles)),
        horizon=float(series.scale.progress(series.scale.origin + HORIZON)),
        offset=offset_of(series, assumptions),
    )
    measurements = series.measurements[: tracked.runs]
    return predicted(
        passage,
        assumptions,
        series,
        cycles,
        fraction,
        runs=tracked.runs,
        enough=len({measurement.progress for measurement in measurements}) >= FEWEST_TESTS,
        warnings=_off_track(posterior, measurements, series, assumptions),
    )


def _off_track(
    posterior: Posterior, measurements: Sequence[Measurement], series: Series, assumptions: Assumptions
) -> list[Notice]:
    """A warning where the last test is far off what the tests before it predict, and no event lies between."""
    prior = assumptions.priors(series.quantity, measurements[0], series.scale)[WEAK]
    innovation = last_innovation(posterior, measurements, prior)
    if innovation is None or not innovation.off_track:
        return []
    return [off_track(measurements[-1].value, innovation.value)]


def offset_of(series: Series, assumptions: Assumptions) -> Offset | None:
    """The course of the model in force over ζ, None where there is none."""
    if assumptions.model.course is None:
        return None
    return lambda progress: assumptions.offset(series.quantity, series.pressure, series.scale.cycles(progress))


def predict_at(
    clutch_id: str,
    events: Sequence[Event],
    assumptions: Assumptions,
    fraction: float,
    *,
    method: str,
    pressure_bar: float | None = None,
    at_cycles: float | None = None,
) -> dict[str, Any]:
    """The prediction at one pressure of the reference test, or over all, as it would have been made at `at_cycles`.

    Raises NotFoundError where the reference test did not measure that pressure.
    """
    lives = lives_of(events)
    level = ALL_PRESSURES if pressure_bar is None else _level(lives[-1] if lives else None, pressure_bar)
    happened = [event for event in events if at_cycles is None or event.cycles <= at_cycles]
    if not happened:
        return insufficient(assumptions, None, level, fraction)
    life = lives_of(happened)[-1]
    cycles = happened[-1].cycles
    series = life.pooled(assumptions) if pressure_bar is None else life.at(assumptions, level)
    if not series.measurements:
        return insufficient(assumptions, cycles, level, fraction)
    tracked = advance(clutch_id, method, series, assumptions, None, len(series.measurements))
    return predict(clutch_id, method, series, assumptions, tracked, cycles, fraction)


def _level(life: Life | None, pressure_bar: float) -> float:
    levels = [] if life is None else sorted(life.reference)
    level = nearest_pressure(pressure_bar * PASCALS_PER_BAR, levels)
    if level is None:
        measured = ", ".join(f"{bar(level):g}" for level in levels) or "none"
        raise NotFoundError(f"no track at {pressure_bar:g} bar; the pressures of the first stationary test: {measured}")
    return level
