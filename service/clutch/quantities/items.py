"""A quantity at one place as `/degradation` shows it: what was measured, its course, and the coefficients of eq. 6."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import BAND, FEWEST_TESTS, QUANTILES
from models.prognosis.first_passage import weighted_quantiles
from models.tracking.courses import CourseForm
from models.tracking.posterior import TrackPosterior
from models.tracking.sampling import thinned
from service.channels import whole
from service.clutch.quantities.measured import Quantity, place_of
from service.clutch.timeline import Series

#: The coefficients of eq. 6 by their public names.
COEFFICIENTS = ("initial", "change", "scale_cycles", "exponent")
#: What an item says of eq. 6.
_OF_EQ_6 = ("coefficients", "correlations", "eq6_probability", "draws")
#: Points of a trajectory, and how far past the last test it goes.
_POINTS, _AHEAD = 40, 1.5


def trajectory_cycles(series: Series, until: float | None) -> FloatArray:
    """The cycles since new [k] at which a trajectory is shown, up to `until` where that is asked for."""
    origin, last = series.scale.origin, float(series.scale.cycles(series.measurements[-1].progress))
    length = max(1.0, last - origin) * _AHEAD if until is None else max(1.0, until - origin)
    return origin + np.linspace(0.0, length, _POINTS)


def track_item(
    quantity: Quantity, series: Series, posterior: TrackPosterior, draws: int = 0, until: float | None = None
) -> dict[str, Any]:
    """A quantity that has a track of its own; the course of the model in force is put back on. `draws` > 0: with so many
    joint draws of the coefficients. With too few tests there is only what was measured."""
    if len({measurement.progress for measurement in series.measurements}) < FEWEST_TESTS:
        return paths_item(quantity, series, None)
    cycles = trajectory_cycles(series, until)
    course = series.assumptions.offsets(series.quantity, series.pressure, cycles)
    values = posterior.values(series.scale.progress(cycles)) + posterior.beside(course)
    band = np.array([weighted_quantiles(row, posterior.weight, BAND) for row in values])
    home = np.flatnonzero(posterior.course == CourseForm.EQ_6)
    share = float(posterior.weight[home].sum())
    coefficients: dict[str, Any] = dict.fromkeys(_OF_EQ_6) | {"eq6_probability": share}
    if share > 0.0:
        following = posterior.taken(home, posterior.weight[home] / share)
        coefficients["coefficients"] = _coefficients(following)
        coefficients["correlations"] = _correlations(following)
        if draws:  # of equal weight, a row of the columns a draw
            samples = _samples(thinned(following, draws, 0.5))
            coefficients["draws"] = {name: own.tolist() for name, own in zip(COEFFICIENTS, samples, strict=True)}
    return _item(quantity, series, coefficients, cycles, band)


def paths_item(
    quantity: Quantity, series: Series, paths: FloatArray | None, until: float | None = None
) -> dict[str, Any]:
    """A quantity that follows from others' tracks, whose `paths` [k, n] over `trajectory_cycles` are equal draws (None: too
    few tests): it has no coefficients of its own."""
    band = np.zeros((0, len(BAND))) if paths is None else np.quantile(paths, BAND, axis=1).T
    cycles = trajectory_cycles(series, until)[: band.shape[0]]
    return _item(quantity, series, dict.fromkeys(_OF_EQ_6), cycles, band)


def _item(
    quantity: Quantity, series: Series, coefficients: Mapping[str, Any], cycles: FloatArray, band: FloatArray
) -> dict[str, Any]:
    tested = series.scale.cycles(np.array([measurement.progress for measurement in series.measurements]))
    off = series.assumptions.offset(series.quantity, series.pressure, tested)
    measured = zip(series.measurements, off.tolist(), strict=True)
    lower, median, upper = band.T.tolist()
    head = {"quantity": quantity.name, "unit": quantity.unit} | place_of(series)
    return {
        **head,
        **coefficients,
        "measured": {
            "cycles": [whole(count) for count in tested.tolist()],
            "value": [measurement.value + added for measurement, added in measured],
            "sd": [measurement.variance**0.5 for measurement in series.measurements],
        },
        "trajectory": {"cycles": cycles.tolist(), "lower": lower, "median": median, "upper": upper},
    }


def _samples(draws: TrackPosterior) -> Sequence[FloatArray]:
    """The coefficients [n] in the order of COEFFICIENTS."""
    return draws.initial, draws.change, draws.scale, draws.exponent


def _coefficients(draws: TrackPosterior) -> dict[str, dict[str, Any]]:
    """Mean, deviation and quantiles of each coefficient."""
    coefficients = {}
    for name, sample in zip(COEFFICIENTS, _samples(draws), strict=True):
        value, sd = draws.moments(sample)
        quantiles = weighted_quantiles(sample, draws.weight, QUANTILES).tolist()
        by_level = {f"{level:g}": number for level, number in zip(QUANTILES, quantiles, strict=True)}
        coefficients[name] = {"value": value, "sd": sd, "quantiles": by_level}
    return coefficients


def _correlations(draws: TrackPosterior) -> list[list[float]]:
    """The correlations of ξ0, Δ, log φ and log ε, [4][4]; none with what has no spread."""
    table = np.stack([draws.initial, draws.change, np.log(draws.scale), np.log(draws.exponent)])
    off = table - (table @ draws.weight)[:, None]
    covariance = (off * draws.weight) @ off.T
    sd = np.sqrt(np.diag(covariance))
    scale = np.where(sd > 0.0, sd, np.inf)
    correlation = np.clip(covariance / np.outer(scale, scale), -1.0, 1.0)
    np.fill_diagonal(correlation, 1.0)
    rows: list[list[float]] = correlation.tolist()
    return rows
