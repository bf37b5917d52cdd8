"""Tracks a life: carries the particles over a series, and predicts after every event and whenever it is asked.

The particle filter is the answer. `ukf` is one unscented step from the particles before the newest test, kept beside them;
`grid` is the exact witness, computed when it is asked for.

A run that comes last in order of cycles carries the stored particles one step on; any other run makes the life be
tracked again from its first test. Both ways give the same answer: the random numbers of a step depend on series and step
alone. Where a fleet's prior stands beside the weak one a filter runs under both, and its draws are put together by their
evidence (`models.prognosis.fleet`).
"""

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.prognosis.back_cast import BackCast, kept_after
from models.prognosis.course_shares import CourseProbability, course_shares
from models.prognosis.criteria import FEWEST_TESTS
from models.prognosis.first_passage import FirstPassage, Offset, horizon_at, predict_first_passage
from models.prognosis.stated_end import StatedEnd, stated_end
from models.tracking.criteria import FEWEST_BEFORE
from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.ukf import Ukf, UkfState
from models.tracking.innovation import next_innovation
from models.tracking.measurement import Measurement
from models.tracking.posterior import Tracker, TrackPosterior, mixture
from models.tracking.prior import TrackPrior
from service.api.life import BackCastCount, Course, CourseShare, LifePrediction, SampleQuality
from service.channels import PASCALS_PER_BAR, bar, whole
from service.clutch import items, notices
from service.clutch.assumptions import ALL_PRESSURES, WEAK, Assumptions
from service.clutch.criteria import FEWEST_PARTICLES, PREDICTION_DRAWS
from service.clutch.timeline import Life, Series, lives_until, nearest_pressure
from service.errors import NotFoundError

FilterState = UkfState | GridState

#: The filter that is carried from run to run, and those whose predictions are stored with each: the unscented one starts
#: from it at every test.
CARRIED = "particle"
PREDICTED = CARRIED, Ukf.name
#: Those that are computed over the whole history when they are asked for.
_COMPUTED: Mapping[str, Tracker[Any]] = {tracker.name: tracker for tracker in (Grid(),)}
METHODS = *PREDICTED, *_COMPUTED

_UKF = Ukf()
#: What the arrays of a back-cast are named after, among the names of priors.
_BACK_CAST = "back_cast"
#: What of a state are flags; numbers that happen to be 0 and 1 are stored like them.
_FLAGS = "outlying"


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPrediction:
    """The prediction at `cycles` by one method, as sent to clients."""

    cycles: float
    method: str
    prediction: LifePrediction


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracked:
    """A filter's states after `runs` measurements of a series, by the name of the prior that they started from; scores of
    its forecasts along the way; and the samples that were drawn of them, by method, which are not stored.
    """

    runs: int
    states: Mapping[str, FilterState]
    back_cast: BackCast
    samples: Mapping[str, TrackPosterior] = field(default_factory=dict)

    def to_arrays(self) -> dict[str, FloatArray | NDArray[np.bool_]]:
        """Named arrays: each array of a state after the name of its prior, as `weak/mean`."""
        named = {
            f"{prior}/{name}": array
            for prior, state in self.states.items()
            for name, array in state.to_arrays().items()
        }
        back_cast = {name: getattr(self.back_cast, name) for name in ("forecasts", "misses", "innovation")}
        return named | {f"{_BACK_CAST}/{name}": array for name, array in back_cast.items()}

    @property
    def lean(self) -> "Tracked":
        """The same without what is large and computed again at the same bits: the closed form at the particles."""
        states = {
            name: replace(state, particles=replace(state.particles, solved=None))
            if isinstance(state, UkfState)
            else state
            for name, state in self.states.items()
        }
        return replace(self, states=states)

    @classmethod
    def from_arrays(cls, runs: int, arrays: Mapping[str, FloatArray | NDArray[np.bool_]]) -> "Tracked":
        """The inverse of `to_arrays`, of the carried filter."""
        parts: dict[str, dict[str, Any]] = {}
        for name, array in arrays.items():
            owner, _, part = name.partition("/")
            is_number = array.dtype == np.float64 or part == _FLAGS
            parts.setdefault(owner, {})[part] = array if is_number else array.astype(np.float64)
        back_cast = BackCast(**parts.pop(_BACK_CAST))
        states = {prior: UkfState.from_arrays(arrays_of_prior) for prior, arrays_of_prior in parts.items()}
        return cls(runs=runs, states=states, back_cast=back_cast)


States = Mapping[str, Tracked]


def follow(
    life: Life, whole_series: Series, fraction: float, states: States, *, first_event: int = 0
) -> Iterator[tuple[States, list[TrackPrediction]]]:
    """Walk a life's events from `first_event` on; after each, the carried states and the predictions of the series.

    `whole_series` is that of all its events, `states` are those before `first_event`. A life with too few tests yields
    `insufficient_data`.
    """
    for index in range(first_event, len(life.events)):
        so_far, cycles = life.until(index), life.events[index].cycles
        series = whole_series
        if not series.assumptions.counts_cycles:
            series = so_far.pooled(series.assumptions)
        runs, tests = series.until(index), so_far.tests
        if runs:
            states = {CARRIED: sampled(CARRIED, series, advance(CARRIED, series, states.get(CARRIED), runs))}
        predictions = []
        for method in PREDICTED:
            made = predict(method, series, states.get(CARRIED), cycles, fraction, tests=tests)
            predictions.append(TrackPrediction(cycles=cycles, method=method, prediction=items.ended(made, so_far.end)))
        yield states, predictions


def sampled(method: str, series: Series, tracked: Tracked) -> Tracked:
    """A filter with the sample that is drawn of it: the next prediction, or the next test, asks for it again."""
    return replace(tracked, samples={**tracked.samples, method: drawn(method, series, tracked)})


def carrier(method: str) -> str:
    """The method whose states a method's answers are drawn from."""
    return CARRIED if method in PREDICTED else method


def advance(
    method: str, series: Series, tracked: Tracked | None, runs: int, *, back_cast: BackCast | None = None
) -> Tracked:
    """Carry the filter that a method's answers are drawn from on until it has taken in the first `runs` measurements of the
    series.

    A `back_cast` that is known from another filter takes the place of its own. States that were made of other measurements
    or under other priors are not carried on: then the filter starts again.
    """
    branches = _branches(series)
    if tracked is not None and not _continues(tracked, branches):
        tracked = None
    if tracked is not None and tracked.runs == runs:
        return tracked
    method = carrier(method)
    tracker = _COMPUTED.get(method) or _carried(len(branches))
    weak_prior = series.priors(series.measurements[0])[WEAK]
    if tracked is None:
        start = {name: tracker.start(prior) for name, (prior, _) in branches.items()}
        tracked = Tracked(runs=0, states=start, back_cast=BackCast.nothing())
    for step in range(tracked.runs, runs):
        measurement, newest = series.measurements[step], step == runs - 1
        update: Any = tracker.passed if isinstance(tracker, Ukf) and not newest else tracker.update
        states = {
            name: update(state, branches[name][1][step], step_rng(_purpose(method, name), series, step))
            for name, state in tracked.states.items()
        }
        judged = back_cast
        if judged is None:
            innovation = _innovation(method, series, tracked) if newest else []
            judged = replace(tracked.back_cast.judged(measurement), innovation=np.array(innovation, dtype=np.float64))
        tracked = Tracked(runs=step + 1, states=states, back_cast=judged)
        if back_cast is None and kept_after(step + 1):
            sample = drawn(method, series, tracked)
            forecast = tracked.back_cast.forecast(sample, measurement, weak_prior)
            tracked = replace(tracked, back_cast=forecast, samples={method: sample})
    return tracked


def _branches(series: Series) -> dict[str, tuple[TrackPrior, tuple[Measurement, ...]]]:
    """The combinations that a filter runs under, by name: every prior with every draw of the series' measurements."""
    return {
        _branch(prior_name, draw, series): (prior, measurements)
        for draw, (_, measurements) in enumerate(series.weighted)
        for prior_name, prior in series.priors(measurements[0]).items()
    }


def _branch(prior: str, draw: int, series: Series) -> str:
    """The name of a state: the prior's, with the draw's number if there are several draws."""
    return f"{prior}@{draw}" if series.draws else prior


def _carried(branches: int) -> Ukf:
    """The carried filter in one of so many branches, among which the particles are shared."""
    particle = _UKF.particle
    share = max(particle.particles // branches, min(particle.particles, FEWEST_PARTICLES))
    return replace(_UKF, particle=replace(particle, particles=share))


def _continues(tracked: Tracked, branches: Mapping[str, tuple[TrackPrior, tuple[Measurement, ...]]]) -> bool:
    """Whether the states were made from the branches' first measurements under the branches' priors."""
    if tracked.states.keys() != branches.keys():
        return False
    for name, state in tracked.states.items():
        prior, branch_state = branches[name]
        if state.prior != prior or tracked.runs > len(branch_state):
            return False
        measurements, history = branch_state[: tracked.runs], state.history
        for name in ("progress", "value", "epoch"):
            if [getattr(m, name) for m in measurements] != getattr(history, name)[: len(measurements)].tolist():
                return False
    return True


def drawn(method: str, series: Series, tracked: Tracked) -> TrackPosterior:
    """A weighted sample of the coefficients after `tracked.runs` measurements; reproducible, and drawn once.

    Priors and draws of the model in force share its size, so that every prediction costs about the same.
    """
    if method in tracked.samples:
        return tracked.samples[method]
    size = PREDICTION_DRAWS // len(tracked.states)
    parts = []
    for draw, (weight, measurements) in enumerate(series.weighted):
        posteriors = {}
        for prior in series.priors(measurements[0]):
            name = _branch(prior, draw, series)
            rng = step_rng(f"{_purpose(method, name)}-posterior", series, tracked.runs)
            posteriors[prior] = _posterior(method, tracked.states[name], size, rng)
        parts.append((weight, series.assumptions.pooled(posteriors, measurements[0], series.scale)))
    return mixture(parts) if series.draws else parts[0][1]


def _posterior(method: str, state: FilterState, size: int, rng: np.random.Generator) -> TrackPosterior:
    """Weighted draws from a filter's state."""
    if method == CARRIED and isinstance(state, UkfState):
        return _UKF.particle.posterior(state.particles, size, rng)
    return _COMPUTED.get(method, _UKF).posterior(state, size, rng)


def _purpose(method: str, prior: str) -> str:
    """The name of a random stream, by method and prior."""
    return method if prior == WEAK else f"{method}-{prior}"


def step_rng(purpose: str, series: Series, step: int) -> np.random.Generator:
    """The random generator of one step; it depends on purpose, series and step alone, not on the clutch's name."""
    name = f"{purpose}/{series.quantity}/{series.pressure!r}"
    return np.random.default_rng([zlib.crc32(name.encode()), step])


def predict(
    method: str, series: Series, tracked: Tracked | None, cycles: float, fraction: float, *, tests: int
) -> LifePrediction:
    """The prediction of a series at `cycles`, for a life with this many `tests`.

    With too few tests it has only the last value and the safe bound.
    """
    answer = items.insufficient(series.assumptions, cycles, series.pressure, fraction)
    if tracked is None:
        return answer
    end = _predicted_end(method, series, tracked, cycles, fraction)
    runs = tracked.runs
    warnings = [
        *notices.left_out(tests, runs),
        *notices.new_level([at for at in series.new_levels if at <= cycles]),
        *notices.off_track(tracked.back_cast, series.measurements[runs - 1].value),
    ]
    answer = _with_last_value(answer, series, runs, cycles, end)
    if len({measurement.progress for measurement in series.measurements[:runs]}) < FEWEST_TESTS:
        return answer.model_copy(update={"warnings": items.warned(warnings)})  # what else the prior says is no finding
    courses = course_shares(end.sample)
    warnings += [
        *notices.not_eq_6(courses),
        *notices.approximate(method, courses),
        *notices.new_extrapolated(series, end.stated.late, fraction),
        *notices.missed(tracked.back_cast),
    ]
    answer = _with_end(answer, series, cycles, fraction, end).model_copy(
        update={"course": _course_item(courses), "back_cast": _back_cast_item(tracked.back_cast)}
    )
    return answer.model_copy(update={"warnings": items.warned(warnings)})


@dataclass(frozen=True, slots=True, kw_only=True)
class _PredictedEnd:
    """The end of life that a weighted sample predicts: as stated, as the first passage of the limit, and its quantiles in
    cycles since new; the horizon [cycles]."""

    sample: TrackPosterior
    stated: StatedEnd
    passage: FirstPassage
    quantiles: Mapping[float, float | None]
    horizon: float


def _predicted_end(method: str, series: Series, tracked: Tracked, cycles: float, fraction: float) -> _PredictedEnd:
    """The end of life that the draws of a filter predict as of `cycles`."""
    sample, scale = drawn(method, series, tracked), series.scale
    horizon_cycles = horizon_at(cycles - scale.origin)
    horizon = float(scale.progress(scale.origin + horizon_cycles))
    stated = end_of_life(sample, series, tracked, cycles, fraction, horizon)
    passage = predict_first_passage(
        sample,
        fraction=fraction,
        as_of=float(scale.progress(cycles)),
        horizon=horizon,
        offset=offset_of(series),
        stated=(stated.ends, stated.weight),
        initial=None if stated.late is None else stated.late.initial,
    )
    quantiles = {q: None if zeta is None else float(scale.cycles(zeta)) for q, zeta in passage.end_of_life.items()}
    return _PredictedEnd(sample=sample, stated=stated, passage=passage, quantiles=quantiles, horizon=horizon_cycles)


def _with_last_value(
    answer: LifePrediction, series: Series, runs: int, cycles: float, end: _PredictedEnd
) -> LifePrediction:
    """The prediction with the last measured value and the safe bound."""
    measured_at, (value, sd) = series.as_measured(runs - 1)
    measured = {"mean_cof": value, "mean_cof_sd": sd, "measured_at_cycles": whole(round(measured_at, 3))}
    return answer.model_copy(
        update={
            "runs_used": runs,
            "current": answer.current.model_copy(update=measured),
            "horizon_cycles": whole(end.horizon),
            "at_least": items.safe_bound(end.quantiles[items.SAFE], cycles, series.scale.origin),
        }
    )


def _with_end(
    answer: LifePrediction, series: Series, cycles: float, fraction: float, end: _PredictedEnd
) -> LifePrediction:
    """The prediction with the present state, and the end of life in cycles since new and from now."""
    passage, ends = end.passage, end.quantiles
    mean, deviation = passage.current
    left = mean / passage.initial if passage.initial > 0 else None
    health = None if left is None else items.share_of_way(left, 1.0, fraction)
    now = {"mean_cof": mean, "mean_cof_sd": deviation, "fraction_of_initial": left, "health": health}
    remaining = {q: None if at is None else max(0.0, at - cycles) for q, at in ends.items()}
    return answer.model_copy(
        update={
            "status": passage.status.value,
            "criterion": items.criterion_item(fraction, series.pressure, passage.initial, passage.threshold),
            "current": answer.current.model_copy(update=now),
            "remaining_cycles": items.by_quantile(remaining),
            "end_of_life_cycles": items.by_quantile(ends),
            "probability_of_reaching": passage.probability_of_reaching,
            "ended_lives": end.stated.lives,
            "sample": SampleQuality(effective_draws=end.sample.effective_draws, status=end.sample.status.value),
        }
    )


def _course_item(courses: Sequence[CourseProbability]) -> Course:
    """The most probable course, with the others as alternatives."""
    course, *alternatives = (
        CourseShare(name=share.name.value, probability=share.probability, order=share.order) for share in courses
    )
    return Course(**dict(course), alternatives=alternatives)


def _back_cast_item(back_cast: BackCast) -> BackCastCount:
    """How many tests lay within their forecasts, and how much remaining life is widened for it."""
    earlier, later = back_cast.widening
    return BackCastCount(held=back_cast.held, of=back_cast.misses.size, widening=earlier, widening_later=later)


def _innovation(method: str, series: Series, tracked: Tracked) -> list[float]:
    """The innovation of the next test, the smallest under any draw of the model in force; [] if it is not known."""
    runs = tracked.runs
    if runs < FEWEST_BEFORE:
        return []
    sample, found = drawn(method, series, tracked), []
    for draw, (_, measurements) in enumerate(series.weighted):
        prior = series.priors(measurements[0])[WEAK]
        found.append(next_innovation(sample.of_branch(draw), measurements[:runs], measurements[runs], prior))
    known = [each for each in found if each is not None]
    return [min(known, key=abs)] if len(known) == len(found) else []


def end_of_life(
    sample: TrackPosterior, series: Series, tracked: Tracked, cycles: float, fraction: float, horizon: float
) -> StatedEnd:
    """The end of life in ζ as predicted at `cycles`, up to a horizon in ζ."""
    as_of = float(series.scale.progress(cycles))
    return stated_end(
        sample,
        fraction=fraction,
        as_of=as_of,
        horizon=max(horizon, as_of),
        offset=offset_of(series),
        powers=tracked.back_cast.widening,
        ended=series.assumptions.ended((series.quantity, series.pressure), fraction, series.scale),
        tests=series.measurements[: tracked.runs],
        priors=series.assumptions.weighted_priors(series.quantity, series.measurements[0], series.scale),
    )


def offset_of(series: Series) -> Offset | None:
    """The course of the model in force as a function of ζ; None if there is none."""
    if series.assumptions.model.course is None:
        return None
    return lambda progress: series.assumptions.offsets(series.quantity, series.pressure, series.scale.cycles(progress))


def mean_offset_of(series: Series) -> Offset | None:
    """The mean of that course over the model's draws [1, k]."""
    quantity, pressure, assumptions = series.quantity, series.pressure, series.assumptions
    if assumptions.model.course is None:
        return None
    return lambda progress: assumptions.offset(quantity, pressure, series.scale.cycles(progress))[None]


def predict_at(
    lives: Sequence[Life],
    assumptions: Assumptions,
    fraction: float,
    *,
    method: str,
    pressure_bar: float | None = None,
    at_cycles: float | None = None,
    back_cast: BackCast | None = None,
    carried: Tracked | None = None,
) -> LifePrediction:
    """The prediction for the last life as of `at_cycles`, at one pressure of its reference test or over all.

    A known `back_cast` is reused: for the exact filter it takes most of the time. A filter `carried` through the first
    measurements is carried on. Raises NotFoundError if the reference test did not measure that pressure.
    """
    level = ALL_PRESSURES if pressure_bar is None else _level(lives[-1] if lives else None, pressure_bar)
    happened = lives_until(lives, at_cycles)
    if not happened:
        return items.insufficient(assumptions, None, level, fraction)
    life = happened[-1]
    cycles = life.events[-1].cycles
    series = life.pooled(assumptions) if pressure_bar is None else life.at(assumptions, level)
    if not series.measurements:
        return items.ended(items.insufficient(assumptions, cycles, level, fraction), life.end)
    tracked = advance(method, series, carried, len(series.measurements), back_cast=back_cast)
    return items.ended(predict(method, series, tracked, cycles, fraction, tests=life.tests), life.end)


def _level(life: Life | None, pressure_bar: float) -> float:
    """The pressure of the reference test nearest to the requested one. Raises NotFoundError."""
    levels = [] if life is None else sorted(life.reference)
    level = nearest_pressure(pressure_bar * PASCALS_PER_BAR, levels)
    if level is None:
        measured = ", ".join(f"{bar(level):g}" for level in levels) or "none"
        raise NotFoundError(f"no track at {pressure_bar:g} bar; the pressures of the first stationary test: {measured}")
    return level
