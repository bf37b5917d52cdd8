"""Series of measurements, draws, and the filters that follow them, for the tests of tracking and prognosis."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from models.degradation.general_order import DegradationLaw, value
from models.tracking.discrepancy import FUTURE, PAST, CourseDiscrepancy
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior, weak

FILTERS = [Grid(), Particle(particles=300), Ukf()]
COLUMNS = [name for name in TrackPosterior.__slots__ if name not in ("discrepancy", "branch")]
NAMES = [tracker.name for tracker in FILTERS]
TYPICAL = DegradationLaw(initial=0.134, change=-0.1, scale=5_000.0, exponent=0.7)


def series(d: DegradationLaw, progress: np.ndarray, noise: float, seed: int = 0) -> list[Measurement]:
    rng = np.random.default_rng(seed)
    return sent(progress, value(progress, d) + noise * rng.standard_normal(progress.size), 1e-8)


def sent(progress: ArrayLike, values: ArrayLike, variance: ArrayLike = 0.0, epoch: ArrayLike = 0) -> list[Measurement]:
    columns = (column.tolist() for column in np.broadcast_arrays(progress, values, variance, epoch))
    return [Measurement(progress=z, value=y, variance=v, epoch=int(e)) for z, y, v, e in zip(*columns, strict=True)]


def on_grid(
    tests: list[Measurement], count: int, rng: np.random.Generator, prior: TrackPrior | None = None
) -> TrackPosterior:
    """Draws of what the grid makes of the tests, by the weak prior of a COF where no other is given."""
    return Grid().posterior(Grid().from_history(prior or weak(tests[0], falling=True), tests), count, rng)


def draws_of(count: int, **columns: Any) -> TrackPosterior:
    """Draws that weigh the same; a number stands for all of them, and scatter is 0.3 % unless given."""
    given = {"weight": 1.0 / count, "scatter": 0.003} | columns
    beside = {"discrepancy": given.pop("discrepancy")} if "discrepancy" in given else {}
    return TrackPosterior(**{name: np.broadcast_to(np.asarray(x, float), count) for name, x in given.items()}, **beside)


def beside(count: int, **given: Any) -> CourseDiscrepancy:
    """Over 1,000 cycles, of so many draws: nothing but what is given."""
    nothing = {
        "size": np.zeros(count),
        "curvature": np.zeros((count, PAST + FUTURE)),
        "at": np.zeros(0),
        "height": np.zeros((count, 0)),
        "knee": np.full(count, np.inf),
        "steepening": np.ones(count),
    }
    return CourseDiscrepancy(**{"span": 1_000.0} | nothing | given)


def followed(
    tracker: Any, prior: TrackPrior, measurements: list[Measurement], seed: int | np.random.Generator = 0
) -> Any:
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
    "one": sent([0.0], [0.13]),
    "constant": sent([0.0, 1e3, 2e3, 3e3, 4e3, 5e3], [0.13] * 6),
    "rising": sent([0.0, 1e3, 2e3, 3e3, 4e3], [0.10, 0.12, 0.14, 0.16, 0.18]),
    "jump": sent([0.0, 1e3, 2e3, 3e3, 4e3, 5e3], [0.13, 0.129, 0.128, 0.04, 0.039, 0.2]),
    "noise free": series(replace(TYPICAL), np.linspace(0.0, 3e4, 31), 0.0),
    "same progress": sent([0.0, 0.0, 5e3, 5e3, 5e3], [0.13, 0.131, 0.1, 0.1, 0.101]),
    "out of order": sent([7e3, 0.0, 15e3, 1e3], [0.08, 0.13, 0.065, 0.11]),
    "huge gap": sent([0.0, 1.0, 2.0, 9e5], [0.13, 0.13, 0.13, 0.02]),
    "zero": sent([0.0, 1e3, 2e3], [0.0, 1e-5, 2e-5]),
    "tiny unit": sent([0.0, 1e3, 7e3, 15e3], [2e-9, 2.4e-9, 3.1e-9, 3.3e-9]),
    "negative": sent([0.0, 1e3, 7e3, 15e3], [-3.0, -2.5, -2.0, -1.9]),
}
