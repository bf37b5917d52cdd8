"""A sample of eq. 6 of any series by any filter, and of every Stribeck parameter at every reference pressure."""

import math
from collections.abc import Collection, Mapping, Sequence

from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.back_cast import BackCast
from models.tracking.filters.grid import Grid
from models.tracking.posterior import Posterior, mixture
from service.lives.assumptions import Assumptions
from service.lives.criteria import TRAJECTORY_DRAWS, TRAJECTORY_LATTICE
from service.lives.history import Life, Series, nearest
from service.lives.run_analysis import LevelFit, Value
from service.lives.tracks import advance, drawn, step_rng

#: A series and a weighted sample of its eq. 6.
Track = tuple[Series, Posterior]

_NODES, _ROWS, _LEVELS = TRAJECTORY_LATTICE
_GRID = Grid(nodes=_NODES, rows=_ROWS, levels=_LEVELS)


def posterior_of(clutch_id: str, series: Series, assumptions: Assumptions, method: str = _GRID.name) -> Posterior:
    """A weighted sample of a series' eq. 6, the same each time; by the exact filter on a lattice fit for plots, else by the
    filter of that name taken through all measurements."""
    if method != _GRID.name:
        runs = len(series.measurements)
        tracked = advance(clutch_id, method, series, assumptions, None, runs, back_cast=BackCast.nothing())
        return drawn(clutch_id, method, series, assumptions, tracked)
    parts = []
    for weight, measurements in series.weighted:
        posteriors = {}
        for name, prior in assumptions.priors(series.quantity, measurements[0], series.scale).items():
            state = _GRID.from_history(prior, measurements)
            rng = step_rng(clutch_id, f"trajectory-{name}", series, len(measurements))
            posteriors[name] = _GRID.posterior(state, math.ceil(TRAJECTORY_DRAWS / len(series.weighted)), rng)
        parts.append((weight, assumptions.pooled(posteriors, measurements[0], series.scale)))
    return parts[0][1] if len(parts) == 1 else mixture(parts)


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
    clutch_id: str,
    life: Life,
    assumptions: Assumptions,
    tests: Sequence[Sequence[LevelFit]],
    method: str = _GRID.name,
    pressures: Collection[float] | None = None,
) -> dict[tuple[str, float], Track]:
    """The eq. 6 of Stribeck parameters at every reference pressure where they are known, by name and pressure [Pa]."""
    return {
        (name, series.pressure): (series, posterior_of(clutch_id, series, assumptions, method))
        for name in PARAMETER_NAMES
        for series in parameter_series(life, assumptions, tests, name)
        if series.measurements and (pressures is None or series.pressure in pressures)
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
