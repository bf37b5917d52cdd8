"""Eq. 6 for one quantity as `/degradation` shows it: coefficients, measurements, median and 90 % band."""

from typing import Any

import numpy as np

from models.prognosis.first_passage import weighted_quantiles
from models.tracking.filters.grid import Grid
from models.tracking.posterior import Posterior
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF, Basis
from service.lives.history import Series
from service.lives.receipt import PARAMETER_UNITS, bar
from service.lives.tracks import step_rng
from service.schemas.base import whole

#: Points of a drawn trajectory, draws behind its band, and how far past the last test it goes.
_POINTS, _DRAWS, _AHEAD = 40, 400, 1.5
_BAND = (0.05, 0.5, 0.95)
_GRID = Grid(nodes=13, rows=13, levels=7)


def posterior_of(clutch_id: str, series: Series, basis: Basis) -> Posterior:
    """A weighted sample of a series' eq. 6 by the exact filter; the same each time."""
    first = series.measurements[0]
    found = {}
    for name, prior in basis.beliefs(series.quantity, first, series.scale).items():
        state = _GRID.from_history(prior, series.measurements)
        rng = step_rng(clutch_id, f"trajectory-{name}", series, len(series.measurements))
        found[name] = _GRID.posterior(state, _DRAWS, rng)
    return basis.together(found, first, series.scale)


def item(series: Series, posterior: Posterior, basis: Basis) -> dict[str, Any]:
    """One quantity at one pressure, by the exact filter; the adopted model's course is put back on."""
    public, unit = (MEAN_COF, "1") if series.quantity == MEAN_COF else PARAMETER_UNITS[series.quantity]
    origin, last = series.scale.origin, float(series.scale.cycles(series.measurements[-1].progress))
    cycles = origin + np.linspace(0.0, max(1.0, last - origin) * _AHEAD, _POINTS)
    course = basis.offset(series.quantity, series.pressure, cycles)
    values = posterior.values(series.scale.progress(cycles)) + course[:, None]
    band = np.array([weighted_quantiles(row, posterior.weight, _BAND) for row in values])
    tested = series.scale.cycles(np.array([each.progress for each in series.measurements]))
    off = basis.offset(series.quantity, series.pressure, tested)
    samples = {
        "initial": posterior.initial,
        "change": posterior.change,
        "scale_cycles": posterior.scale,
        "exponent": posterior.exponent,
    }
    return {
        "quantity": public,
        "unit": unit,
        "pressure_bar": None if series.pressure == ALL_PRESSURES else bar(series.pressure),
        "coefficients": {
            name: dict(zip(("value", "sd"), posterior.moments(sample), strict=True)) for name, sample in samples.items()
        },
        "measured": {
            "cycles": [whole(each) for each in tested.tolist()],
            "value": [each.value + more for each, more in zip(series.measurements, off.tolist(), strict=True)],
            "sd": [each.variance**0.5 for each in series.measurements],
        },
        "trajectory": {
            "cycles": cycles.tolist(),
            "lower": band[:, 0].tolist(),
            "median": band[:, 1].tolist(),
            "upper": band[:, 2].tolist(),
        },
    }
