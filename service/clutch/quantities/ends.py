"""The end of a life by criteria on any quantity, each a weighted sample of cycles; which is first; the least health."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import FEWEST_TESTS, QUANTILES
from models.prognosis.first_passage import Limit, PassageStatus, first_reached, horizon_at, places, weighted_quantiles
from models.prognosis.first_passage import paths as track_paths
from service.api.life import (
    Criterion,
    CriterionIn,
    CriterionOutcome,
    CriterionValue,
    LifePrediction,
    Quantiles,
)
from service.channels import PASCALS_PER_BAR
from service.clutch.assumptions import ALL_PRESSURES, MEAN_COF
from service.clutch.items import INSUFFICIENT, SAFE, by_quantile, safe_bound, share_of_way
from service.clutch.quantities.measured import (
    Family,
    MeasuredLife,
    Quantity,
    parameter_tracks,
    place_of,
    posterior_of,
    quantity_named,
    rounded_frequency,
    slopes_along,
)
from service.clutch.timeline import Series, nearest_pressure
from service.clutch.tracking import advance, carrier, drawn, end_of_life, offset_of, step_rng
from service.errors import NotFoundError

#: Draws [n] with their weights [n].
Sample = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class CriterionEnd:
    """The end of life by one criterion: `ends` in cycles since new (inf: not by the horizon) with their weights;
    `current` is mean and standard deviation of the quantity now, `initial` its mean when new. With too few tests
    `current` is the last measured value, and the others are None."""

    criterion: CriterionIn
    tests: int
    ends: Sample | None = None
    current: tuple[float, float] | None = None
    initial: float | None = None


def criterion_end(measured: MeasuredLife, criterion: CriterionIn, method: str) -> CriterionEnd:
    """The end of life by a criterion; a share of mean COF by a filter, other criteria by the exact posterior on a
    lattice.

    Raises NotFoundError if the quantity is not measured at the criterion's place.
    """
    quantity = quantity_named(criterion.quantity)
    series = _series_at(measured, quantity, criterion)
    if series is None:
        return CriterionEnd(criterion=criterion, tests=0)
    count = len(series.measurements)
    _, last = series.as_measured(count - 1)
    too_few = CriterionEnd(criterion=criterion, tests=count, current=last)
    if len({measurement.progress for measurement in series.measurements}) < FEWEST_TESTS:
        return too_few
    cycles, origin = measured.life.events[-1].cycles, series.scale.origin
    now, horizon = series.scale.progress(np.array([cycles, origin + horizon_at(cycles - origin)])).tolist()
    at = places(now, horizon)
    if quantity.family is Family.MEAN_COF and criterion.fraction is not None:
        passages, paths = _mean_cof(measured, series, criterion.fraction, method, np.array([0.0, now]), horizon)
    else:
        sample = _paths(measured, quantity, series, np.append(at, now))
        if sample is None:
            return too_few
        limit = Limit(fraction=criterion.fraction, below=criterion.below, above=criterion.above)
        passages, paths = (limit.passages(sample[0][:-1], at), sample[1]), sample
    (ends, weight_of_ends), (values, weight) = passages, paths
    mean = float(weight @ values[-1])
    return CriterionEnd(
        criterion=criterion,
        tests=count,
        ends=(np.where(ends <= horizon, series.scale.cycles(np.minimum(ends, horizon)), np.inf), weight_of_ends),
        current=(mean, float(np.sqrt(max(0.0, weight @ np.square(values[-1] - mean))))),
        initial=float(weight @ values[0]),
    )


def _series_at(measured: MeasuredLife, quantity: Quantity, criterion: CriterionIn) -> Series | None:
    """The series of the criterion's quantity at its pressure, speed and frequency; None if not measured yet."""
    speeds = () if criterion.speed_rpm is None else (criterion.speed_rpm,)
    frequency = None if criterion.frequency_hz is None else rounded_frequency(criterion.frequency_hz)
    tracks = [
        series for series in measured.series(quantity, speeds) if frequency is None or series.frequency_hz == frequency
    ]
    if not tracks:
        return None
    by_pressure = {series.pressure: series for series in tracks}
    if criterion.pressure_bar is None:
        level: float | None = ALL_PRESSURES if ALL_PRESSURES in by_pressure else None
    else:
        levels = [pressure for pressure in by_pressure if pressure != ALL_PRESSURES]
        level = nearest_pressure(criterion.pressure_bar * PASCALS_PER_BAR, levels)
    if level is None:
        places_of = "; ".join(
            ", ".join(f"{name} {number:g}" for name, number in place_of(series).items() if number is not None)
            for series in tracks
        )
        raise NotFoundError(f"{quantity.name} is not measured at this place, only at: {places_of}")
    return by_pressure[level]


def _mean_cof(
    measured: MeasuredLife, series: Series, fraction: float, method: str, at: FloatArray, horizon: float
) -> tuple[Sample, Sample]:
    """The end by a share of mean COF as in `/remaining-useful-life`, and mean COF [2, n] at progress `at` [2]."""
    tracked = advance(method, series, measured.filters.get(carrier(method)), len(series.measurements))
    sample = drawn(method, series, tracked)
    end = end_of_life(sample, series, tracked, measured.life.events[-1].cycles, fraction, horizon)
    values = np.maximum(track_paths(sample, at, offset_of(series)), 0.0)
    return (end.ends, end.weight), (values, sample.weight)


def _paths(measured: MeasuredLife, quantity: Quantity, series: Series, progress: FloatArray) -> Sample | None:
    """The quantity at progress [k] in every draw [k, n], with the draws' weights [n]; None with too few tests."""
    if quantity.family is not Family.SLOPE:
        posterior = posterior_of(series)
        return track_paths(posterior, progress, offset_of(series)), posterior.weight
    tracks = parameter_tracks(measured.life, measured.assumptions, measured.tests, pressures={series.pressure})
    cof = measured.mean_cofs()[series.pressure]
    direct = cof, posterior_of(cof)
    paths = slopes_along(measured, tracks, direct, series.speed_rpm or 0.0, progress)
    return None if paths is None else (paths, np.full(paths.shape[1], 1.0 / paths.shape[1]))


#: Draws of the first of several ends.
_DRAWS = 2_000
#: What a criterion says of itself.
GIVEN = ("quantity", "pressure_bar", "speed_rpm", "frequency_hz", "fraction", "below", "above")


def criteria_answer(
    measured: MeasuredLife, ends: Sequence[CriterionEnd], prediction: LifePrediction
) -> tuple[LifePrediction, list[CriterionOutcome]]:
    """A prediction by several limits, of which the first reached ends the life: its present health is the lowest of
    all; and the state by each limit."""
    now = measured.life.events[-1].cycles
    samples = [end.ends for end in ends if end.ends is not None]
    if not samples:
        nothing = _quantiles(None, now) | {
            "status": INSUFFICIENT,
            "probability_of_reaching": None,
            "at_least": None,
            "current": prediction.current.model_copy(update={"health": None}),
            "criterion": _criterion(ends[0]),
        }
        return prediction.model_copy(update=nothing), [_item(end, now, 0.0) for end in ends]
    shares: FloatArray = np.ones(1)
    first: Sample = samples[0]
    if len(samples) > 1:
        rng = step_rng("criteria", measured.life.pooled(measured.assumptions), ends[0].tests)
        draws, shares = first_reached(samples, _DRAWS, rng)
        first = draws, np.full(draws.size, 1.0 / draws.size)
    by_known = iter(shares.tolist())
    items = [_item(end, now, next(by_known) if end.ends is not None else 0.0) for end in ends]
    leading = max(range(len(items)), key=lambda index: items[index].probability_first)
    stated = _quantiles(first, now)
    passed = float(first[1][first[0] <= now].sum())
    ahead = PassageStatus.MAY_NEVER_REACH if None in stated["end_of_life_cycles"].values() else PassageStatus.PREDICTED
    health = [share for end in ends if (share := _health(end)) is not None]
    known = stated | {
        "status": (PassageStatus.REACHED if passed >= 0.5 else ahead).value,
        "at_least": safe_bound(stated["end_of_life_cycles"][f"{SAFE:g}"], now, measured.life.origin),
        "probability_of_reaching": _probability_of_reaching(first),
        "current": prediction.current.model_copy(update={"health": min(health, default=None)}),
        "criterion": _criterion(ends[leading]),
    }
    return prediction.model_copy(update=known), items


def _probability_of_reaching(sample: Sample) -> float:
    """The weight of draws whose limit is ever reached."""
    ends, weight = sample
    return float(min(1.0, weight[np.isfinite(ends)].sum()))


def _health(end: CriterionEnd) -> float | None:
    """The remaining share of the way to a criterion's limit; None if it is not known."""
    limit = _limit(end)
    if end.current is None or end.initial is None or limit is None:
        return None
    return share_of_way(end.current[0], end.initial, limit, rises=end.criterion.above is not None)


def _quantiles(sample: Sample | None, now: float) -> dict[str, Quantiles]:
    """Quantiles of the end of life and of the remaining cycles from `now`; null beyond the horizon."""
    if sample is None:
        return {"end_of_life_cycles": by_quantile({}), "remaining_cycles": by_quantile({})}
    ends, weight = sample
    cap = 10.0 * horizon_at(now)
    at = weighted_quantiles(np.minimum(ends, cap), weight, QUANTILES).tolist()
    by_level = {level: number if number < 0.5 * cap else None for level, number in zip(QUANTILES, at, strict=True)}
    left = {level: None if end is None else max(0.0, end - now) for level, end in by_level.items()}
    return {"end_of_life_cycles": by_quantile(by_level), "remaining_cycles": by_quantile(left)}


def _item(end: CriterionEnd, now: float, first: float) -> CriterionOutcome:
    """One criterion with its own end, and the probability that it is reached first."""
    value, sd = end.current or (None, None)
    quantiles = _quantiles(end.ends, now)
    return CriterionOutcome(
        **_place(end),
        end_of_life_cycles=quantiles["end_of_life_cycles"],
        remaining_cycles=quantiles["remaining_cycles"],
        probability_of_reaching=None if end.ends is None else _probability_of_reaching(end.ends),
        current=CriterionValue(value=value, sd=sd),
        probability_first=first,
        tests=end.tests,
    )


def _place(end: CriterionEnd) -> Mapping[str, Any]:
    """A criterion of the record, with its quantity when new and its limit."""
    return {name: getattr(end.criterion, name) for name in GIVEN} | {"initial": end.initial, "limit": _limit(end)}


def _limit(end: CriterionEnd) -> float | None:
    """The value at which a criterion ends the life; None for a share of an unknown initial value."""
    criterion = end.criterion
    if criterion.fraction is not None and end.initial is None:
        return None
    limit = Limit(fraction=criterion.fraction, below=criterion.below, above=criterion.above)
    return float(limit.level(end.initial or 0.0))


def _criterion(end: CriterionEnd) -> Criterion:
    """The leading criterion as the answer's `criterion`; with mean COF's numbers only if it is mean COF."""
    of_cof = end.criterion.quantity == MEAN_COF
    return Criterion(
        **_place(end),
        initial_mean_cof=end.initial if of_cof else None,
        threshold_mean_cof=_limit(end) if of_cof else None,
    )
