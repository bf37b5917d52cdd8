"""Eq. 6 for one quantity as `/degradation` shows it: coefficients, measurements, median and 90 % band."""

from typing import Any

import numpy as np

from models.degradation import value
from models.prognosis import weighted_quantiles
from models.tracking.grid import Grid
from models.tracking.prior import weak
from models.tracking.protocol import Posterior
from service.schemas.base import whole
from service.workflows.history import ALL_PRESSURES, MEAN_COF, Series
from service.workflows.receipts import PARAMETER_UNITS, bar
from service.workflows.tracks import step_rng

#: Points of a drawn trajectory, draws behind its band, and how far past the last test it goes.
_POINTS, _DRAWS, _AHEAD = 40, 400, 1.5
_BAND = (0.05, 0.5, 0.95)
_GRID = Grid(nodes=13, rows=13, levels=7)


def posterior_of(clutch_id: str, series: Series) -> Posterior:
    """A weighted sample of a series' eq. 6 by the exact filter; the same each time."""
    prior = weak(series.measurements[0], falling=series.quantity == MEAN_COF)
    state = _GRID.from_history(prior, series.measurements)
    return _GRID.posterior(state, _DRAWS, step_rng(clutch_id, "trajectory", series, len(series.measurements)))


def item(clutch_id: str, series: Series, origin: float) -> dict[str, Any]:
    """One quantity at one pressure, by the exact filter."""
    public, unit = (MEAN_COF, "1") if series.quantity == MEAN_COF else PARAMETER_UNITS[series.quantity]
    posterior = posterior_of(clutch_id, series)
    zeta = np.linspace(0.0, max(1.0, series.measurements[-1].progress) * _AHEAD, _POINTS)
    values = value(zeta[:, None], posterior.degradation)
    band = np.array([weighted_quantiles(row, posterior.weight, _BAND) for row in values])
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
            "cycles": [whole(each.progress + origin) for each in series.measurements],
            "value": [each.value for each in series.measurements],
            "sd": [each.variance**0.5 for each in series.measurements],
        },
        "trajectory": {
            "cycles": (zeta + origin).tolist(),
            "lower": band[:, 0].tolist(),
            "median": band[:, 1].tolist(),
            "upper": band[:, 2].tolist(),
        },
    }
