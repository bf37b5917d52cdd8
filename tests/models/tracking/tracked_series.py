"""Series of measurements and the filters that follow them, for the tests of tracking."""

from dataclasses import replace
from typing import Any

import numpy as np

from models.degradation.general_order import Degradation, value
from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.particle import Particle, ParticleState
from models.tracking.filters.ukf import Ukf, UkfState
from models.tracking.measurement import Measurement
from models.tracking.posterior import Posterior
from models.tracking.prior import Prior, weak

FILTERS = [(Grid(), GridState), (Particle(particles=300), ParticleState), (Ukf(), UkfState)]
COLUMNS = [name for name in Posterior.__slots__ if name not in ("discrepancy", "branch")]
NAMES = [tracker.name for tracker, _ in FILTERS]
TYPICAL = Degradation(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7)


def series(d: Degradation, progress: np.ndarray, noise: float, seed: int = 0) -> list[Measurement]:
    rng = np.random.default_rng(seed)
    values = value(progress, d) + noise * rng.standard_normal(progress.size)
    return [
        Measurement(progress=float(z), value=float(y), variance=1e-8) for z, y in zip(progress, values, strict=True)
    ]


def measured(progress: list[float], values: list[float]) -> list[Measurement]:
    return [Measurement(progress=z, value=y, variance=0.0) for z, y in zip(progress, values, strict=True)]


def followed(tracker: Any, prior: Prior, measurements: list[Measurement], seed: int = 0) -> Any:
    rng, state = np.random.default_rng(seed), tracker.start(prior)
    for measurement in measurements:
        state = tracker.update(state, measurement, rng)
    return state


def same(a: Any, b: Any) -> bool:
    return all(np.array_equal(x, b.to_arrays()[name]) for name, x in a.to_arrays().items())


CAMPAIGN = series(TYPICAL, np.linspace(0.0, 12_000.0, 13), 4e-4)
PRIOR = weak(CAMPAIGN[0], falling=True)
#: Eq. 6 for sure, and no run is ever outlying.
PLAIN = replace(PRIOR, law_share=1.0, eq_6_share=1.0, proportional_share=0.0, outlying_share=0.0)

#: Series that no clutch gives, or only seldom.
WEIRD = {
    "one": measured([0.0], [0.13]),
    "constant": measured([0.0, 1e3, 2e3, 3e3, 4e3, 5e3], [0.13] * 6),
    "rising": measured([0.0, 1e3, 2e3, 3e3, 4e3], [0.10, 0.12, 0.14, 0.16, 0.18]),
    "jump": measured([0.0, 1e3, 2e3, 3e3, 4e3, 5e3], [0.13, 0.129, 0.128, 0.04, 0.039, 0.2]),
    "noise free": series(replace(TYPICAL), np.linspace(0.0, 3e4, 31), 0.0),
    "same progress": measured([0.0, 0.0, 5e3, 5e3, 5e3], [0.13, 0.131, 0.1, 0.1, 0.101]),
    "out of order": measured([7e3, 0.0, 15e3, 1e3], [0.08, 0.13, 0.065, 0.11]),
    "huge gap": measured([0.0, 1.0, 2.0, 9e5], [0.13, 0.13, 0.13, 0.02]),
    "zero": measured([0.0, 1e3, 2e3], [0.0, 1e-5, 2e-5]),
    "tiny unit": measured([0.0, 1e3, 7e3, 15e3], [2e-9, 2.4e-9, 3.1e-9, 3.3e-9]),
    "negative": measured([0.0, 1e3, 7e3, 15e3], [-3.0, -2.5, -2.0, -1.9]),
}
