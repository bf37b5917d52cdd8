"""Eq. 6 of a series by the exact filter, and of every Stribeck parameter at every reference pressure."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.first_passage import weighted_quantiles
from models.tracking.courses import Course
from models.tracking.filters.grid import Grid
from models.tracking.posterior import Posterior
from service.columns import bar, whole
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF, Assumptions
from service.lives.criteria import TRAJECTORY_DRAWS, TRAJECTORY_LATTICE
from service.lives.history import Life, Series, nearest
from service.lives.payloads import PARAMETER_UNITS
from service.lives.run_analysis import LevelFit, Value
from service.lives.tracks import step_rng

#: A series and a weighted sample of its eq. 6.
Track = tuple[Series, Posterior]

#: Points of a drawn trajectory, how far past the last test it goes, and its quantiles.
_POINTS, _AHEAD = 40, 1.5
_BAND = (0.05, 0.5, 0.95)
_NODES, _ROWS, _LEVELS = TRAJECTORY_LATTICE
_GRID = Grid(nodes=_NODES, rows=_ROWS, levels=_LEVELS)


def posterior_of(clutch_id: str, series: Series, assumptions: Assumptions) -> Posterior:
    """A weighted sample of a series' eq. 6 by the exact filter; the same each time."""
    first = series.measurements[0]
    posteriors = {}
    for name, prior in assumptions.priors(series.quantity, first, series.scale).items():
        state = _GRID.from_history(prior, series.measurements)
        rng = step_rng(clutch_id, f"trajectory-{name}", series, len(series.measurements))
        posteriors[name] = _GRID.posterior(state, TRAJECTORY_DRAWS, rng)
    return assumptions.pooled(posteriors, first, series.scale)


def tests_of(life: Life, fits: Mapping[str, Sequence[LevelFit]]) -> list[Sequence[LevelFit]]:
    """The levels of each of a life's events, none where it is no test."""
    return [fits.get(event.run_id, ()) for event in life.events]


def parameter_series(
    life: Life, assumptions: Assumptions, tests: Sequence[Sequence[LevelFit]], name: str
) -> list[Series]:
    """One Stribeck parameter at every reference pressure, by the fits that determine it."""
    column = PARAMETER_NAMES.index(name)
    values = [_parameter(levels, name, column) for levels in tests]
    return [
        life.series(assumptions, name, level, [nearest(level, of_test) for of_test in values])
        for level in life.reference
    ]


def parameter_tracks(
    clutch_id: str, life: Life, assumptions: Assumptions, tests: Sequence[Sequence[LevelFit]]
) -> dict[tuple[str, float], Track]:
    """Every Stribeck parameter's own eq. 6 at every reference pressure where it is known, by name and pressure [Pa]."""
    return {
        (name, series.pressure): (series, posterior_of(clutch_id, series, assumptions))
        for name in PARAMETER_NAMES
        for series in parameter_series(life, assumptions, tests, name)
        if series.measurements
    }


def _parameter(levels: Sequence[LevelFit], name: str, column: int) -> dict[float, Value]:
    return {
        level.fit.pressure: (
            float(level.fit.parameters.as_array()[column]),
            float(level.fit.covariance[column, column] ** 0.5),
        )
        for level in levels
        if name not in level.fit.undetermined
    }


def track_item(series: Series, posterior: Posterior, assumptions: Assumptions) -> dict[str, Any]:
    """One quantity at one pressure as `/degradation` shows it; the course of the model in force is put back on."""
    public, unit = (MEAN_COF, "1") if series.quantity == MEAN_COF else PARAMETER_UNITS[series.quantity]
    origin, last = series.scale.origin, float(series.scale.cycles(series.measurements[-1].progress))
    cycles = origin + np.linspace(0.0, max(1.0, last - origin) * _AHEAD, _POINTS)
    course = assumptions.offset(series.quantity, series.pressure, cycles)
    values = posterior.values(series.scale.progress(cycles)) + course[:, None]
    band = np.array([weighted_quantiles(row, posterior.weight, _BAND) for row in values])
    tested = series.scale.cycles(np.array([measurement.progress for measurement in series.measurements]))
    off = assumptions.offset(series.quantity, series.pressure, tested)
    measured = zip(series.measurements, off.tolist(), strict=True)
    return {
        "quantity": public,
        "unit": unit,
        "pressure_bar": None if series.pressure == ALL_PRESSURES else bar(series.pressure),
        "coefficients": _coefficients(posterior),
        "eq6_probability": float(posterior.weight[posterior.course == Course.EQ_6].sum()),
        "measured": {
            "cycles": [whole(count) for count in tested.tolist()],
            "value": [measurement.value + added for measurement, added in measured],
            "sd": [measurement.variance**0.5 for measurement in series.measurements],
        },
        "trajectory": {
            "cycles": cycles.tolist(),
            "lower": band[:, 0].tolist(),
            "median": band[:, 1].tolist(),
            "upper": band[:, 2].tolist(),
        },
    }


def _coefficients(posterior: Posterior) -> dict[str, dict[str, float]] | None:
    """Mean and deviation of eq. 6's coefficients among the draws that follow it; None where none does."""
    home = np.flatnonzero(posterior.course == Course.EQ_6)
    share = float(posterior.weight[home].sum())
    if share == 0.0:
        return None
    draws = posterior.taken(home, posterior.weight[home] / share)
    samples = {
        "initial": draws.initial,
        "change": draws.change,
        "scale_cycles": draws.scale,
        "exponent": draws.exponent,
    }
    return {name: dict(zip(("value", "sd"), draws.moments(sample), strict=True)) for name, sample in samples.items()}
