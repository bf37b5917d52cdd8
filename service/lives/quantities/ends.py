"""The end of a life by one criterion on any quantity, as a weighted sample of cycles."""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import FEWEST_TESTS, HORIZON
from models.prognosis.first_passage import paths as track_paths
from models.prognosis.limits import Limit, places
from service.columns import PASCALS_PER_BAR
from service.errors import NotFoundError
from service.lives.assumptions import ALL_PRESSURES
from service.lives.history import Series, nearest_pressure
from service.lives.quantities.levels import slopes_along
from service.lives.quantities.measured import MeasuredLife, rounded_frequency
from service.lives.quantities.names import Family, Quantity, place_of, quantity_named
from service.lives.quantities.parameters import parameter_tracks, posterior_of
from service.lives.tracks import advance, drawn, end_of_life, offset_of
from service.schemas.prognosis.criteria import CriterionIn

#: Draws [n] with their weights [n].
Sample = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class CriterionEnd:
    """When a quantity reaches its limit: `ends` in cycles since new (inf: not by the horizon) with their weights; `current`
    is mean and deviation of the quantity now, `initial` its mean when new. With too few tests `current` is the last of them
    as it was measured, and the others are None."""

    criterion: CriterionIn
    tests: int
    ends: Sample | None = None
    current: tuple[float, float] | None = None
    initial: float | None = None

    def probability_by(self, cycles: float) -> float:
        """The probability that the limit is reached by so many cycles since new."""
        if self.ends is None:
            return 0.0
        passages, weight = self.ends
        return float(min(1.0, weight[passages <= cycles].sum()))


def criterion_end(measured: MeasuredLife, criterion: CriterionIn, method: str) -> CriterionEnd:
    """The end of a life by a criterion; a share of mean COF by a filter, all else by the exact posterior on a lattice.

    Raises NotFoundError where the quantity is not measured there.
    """
    quantity = quantity_named(criterion.quantity)
    series = _series_at(measured, quantity, criterion)
    if series is None:
        return CriterionEnd(criterion=criterion, tests=0)
    count = len(series.measurements)
    too_few = CriterionEnd(
        criterion=criterion, tests=count, current=series.as_measured(measured.assumptions, count - 1)[1]
    )
    if len({measurement.progress for measurement in series.measurements}) < FEWEST_TESTS:
        return too_few
    now = float(series.scale.progress(measured.life.events[-1].cycles))
    horizon = max(now, float(series.scale.progress(series.scale.origin + HORIZON)))
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
    """The series of the criterion's quantity at its pressure, speed and frequency; None where it was not measured yet."""
    speeds = () if criterion.speed_rpm is None else (criterion.speed_rpm,)
    wanted = None if criterion.frequency_hz is None else rounded_frequency(criterion.frequency_hz)
    tracks = [series for series in measured.series(quantity, speeds) if wanted is None or series.frequency_hz == wanted]
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
        raise NotFoundError(f"{quantity.name} is not measured there; it is at: {places_of}")
    return by_pressure[level]


def _mean_cof(
    measured: MeasuredLife, series: Series, fraction: float, method: str, at: FloatArray, horizon: float
) -> tuple[Sample, Sample]:
    """The end by a share of mean COF as `/remaining-useful-life` states it, and mean COF [2, n] at progress `at` [2]."""
    assumptions, cycles = measured.assumptions, measured.life.events[-1].cycles
    carried = measured.filters.get(method)
    tracked = advance(measured.clutch_id, method, series, assumptions, carried, len(series.measurements))
    sample = drawn(measured.clutch_id, method, series, assumptions, tracked)
    end = end_of_life(sample, series, assumptions, tracked, cycles, fraction, horizon)
    return (end.ends, end.weight), (track_paths(sample, at, offset_of(series, assumptions)), sample.weight)


def _paths(measured: MeasuredLife, quantity: Quantity, series: Series, progress: FloatArray) -> Sample | None:
    """The quantity at progress [k] in every draw [k, n], with the draws' weights [n]; None with too few tests."""
    clutch_id, assumptions = measured.clutch_id, measured.assumptions
    if quantity.family is not Family.SLOPE:
        posterior = posterior_of(clutch_id, series, assumptions)
        return track_paths(posterior, progress, offset_of(series, assumptions)), posterior.weight
    tracks = parameter_tracks(clutch_id, measured.life, assumptions, measured.tests, pressures={series.pressure})
    cof = measured.mean_cofs()[series.pressure]
    direct = cof, posterior_of(clutch_id, cof, assumptions)
    paths = slopes_along(measured, tracks, direct, series.speed_rpm or 0.0, progress)
    return None if paths is None else (paths, np.full(paths.shape[1], 1.0 / paths.shape[1]))
