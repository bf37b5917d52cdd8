"""A quantity at one place as `/degradation` shows it: what was measured, its course, and the coefficients of eq. 6."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import BAND, FEWEST_TESTS, QUANTILES
from models.prognosis.first_passage import weighted_quantiles
from models.tracking.courses import CourseForm
from models.tracking.posterior import TrackPosterior
from models.tracking.sampling import thinned
from service.api.over_life import CoefficientDraws, Coefficients, DegradationItem, Estimate, Measured, Trajectory
from service.channels import whole
from service.clutch.quantities.measured import Quantity, place_of
from service.clutch.timeline import Series

Own = TypeVar("Own")
#: The coefficients of eq. 6 by their public names.
COEFFICIENTS = ("initial", "change", "scale_cycles", "exponent")
#: Points of a trajectory, and how far past the last test it goes.
_POINTS, _AHEAD = 40, 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class _OfEq6:
    """The fields of an item about eq. 6; empty if the quantity has no track of its own."""

    coefficients: Coefficients | None = None
    correlations: list[list[float]] | None = None
    eq6_probability: float | None = None
    draws: CoefficientDraws | None = None


def trajectory_cycles(series: Series, until: float | None) -> FloatArray:
    """The cycles since new [k] at which a trajectory is shown, up to `until` if that is given."""
    origin, last = series.scale.origin, float(series.scale.cycles(series.measurements[-1].progress))
    length = max(1.0, last - origin) * _AHEAD if until is None else max(1.0, until - origin)
    return origin + np.linspace(0.0, length, _POINTS)


def track_item(
    quantity: Quantity, series: Series, posterior: TrackPosterior, draws: int = 0, until: float | None = None
) -> DegradationItem:
    """A quantity with a track of its own; the course of the model in force is added back. `draws` > 0: with as many
    joint draws of the coefficients. With too few tests it has only the measured values."""
    if len({measurement.progress for measurement in series.measurements}) < FEWEST_TESTS:
        return paths_item(quantity, series, None)
    cycles = trajectory_cycles(series, until)
    course = series.assumptions.offsets(series.quantity, series.pressure, cycles)
    values = posterior.values(series.scale.progress(cycles)) + posterior.beside(course)
    band = np.array([weighted_quantiles(row, posterior.weight, BAND) for row in values])
    home = np.flatnonzero(posterior.course == CourseForm.EQ_6)
    share = float(posterior.weight[home].sum())
    if share == 0.0:
        return _item(quantity, series, _OfEq6(eq6_probability=share), cycles, band)
    following = posterior.taken(home, posterior.weight[home] / share)
    samples = _samples(thinned(following, draws, 0.5)) if draws else ()  # of equal weight, a row of the columns a draw
    of_eq_6 = _OfEq6(
        coefficients=_coefficients(following),
        correlations=_correlations(following),
        eq6_probability=share,
        draws=CoefficientDraws(**_named(sample.tolist() for sample in samples)) if draws else None,
    )
    return _item(quantity, series, of_eq_6, cycles, band)


def paths_item(
    quantity: Quantity, series: Series, paths: FloatArray | None, until: float | None = None
) -> DegradationItem:
    """A quantity computed from others' tracks, with `paths` [k, n] over `trajectory_cycles` as equal draws (None: too
    few tests); it has no coefficients of its own."""
    band = np.zeros((0, len(BAND))) if paths is None else np.quantile(paths, BAND, axis=1).T
    cycles = trajectory_cycles(series, until)[: band.shape[0]]
    return _item(quantity, series, _OfEq6(), cycles, band)


def _item(quantity: Quantity, series: Series, of_eq_6: _OfEq6, cycles: FloatArray, band: FloatArray) -> DegradationItem:
    """A tracked quantity as an answer shows it: its measurements, its band, and eq. 6's coefficients."""
    tested = series.scale.cycles(np.array([measurement.progress for measurement in series.measurements]))
    off = series.assumptions.offset(series.quantity, series.pressure, tested)
    measured = zip(series.measurements, off.tolist(), strict=True)
    lower, median, upper = band.T.tolist()
    return DegradationItem(
        quantity=quantity.name,
        unit=quantity.unit,
        **place_of(series),
        coefficients=of_eq_6.coefficients,
        correlations=of_eq_6.correlations,
        eq6_probability=of_eq_6.eq6_probability,
        draws=of_eq_6.draws,
        measured=Measured(
            cycles=[whole(count) for count in tested.tolist()],
            value=[measurement.value + added for measurement, added in measured],
            sd=[measurement.variance**0.5 for measurement in series.measurements],
        ),
        trajectory=Trajectory(cycles=cycles.tolist(), lower=lower, median=median, upper=upper),
    )


def _samples(draws: TrackPosterior) -> Sequence[FloatArray]:
    """The samples of each coefficient [n], in the order of COEFFICIENTS."""
    return draws.initial, draws.change, draws.scale, draws.exponent


def _named(each: Iterable[Own]) -> dict[str, Own]:
    """The values, one for each coefficient, by coefficient name."""
    return dict(zip(COEFFICIENTS, each, strict=True))


def _coefficients(draws: TrackPosterior) -> Coefficients:
    return Coefficients(**_named(_estimate(draws, sample) for sample in _samples(draws)))


def _estimate(draws: TrackPosterior, sample: FloatArray) -> Estimate:
    """Mean, deviation and quantiles of a coefficient [n]."""
    value, sd = draws.moments(sample)
    quantiles = weighted_quantiles(sample, draws.weight, QUANTILES).tolist()
    by_level = {f"{level:g}": number for level, number in zip(QUANTILES, quantiles, strict=True)}
    return Estimate(value=value, sd=sd, quantiles=by_level)


def _correlations(draws: TrackPosterior) -> list[list[float]]:
    """The correlations of ξ0, Δ, log φ and log ε, [4][4]; 0 for a coefficient without spread."""
    table = np.stack([draws.initial, draws.change, np.log(draws.scale), np.log(draws.exponent)])
    off = table - (table @ draws.weight)[:, None]
    covariance = (off * draws.weight) @ off.T
    sd = np.sqrt(np.diag(covariance))
    scale = np.where(sd > 0.0, sd, np.inf)
    correlation = np.clip(covariance / np.outer(scale, scale), -1.0, 1.0)
    np.fill_diagonal(correlation, 1.0)
    rows: list[list[float]] = correlation.tolist()
    return rows
