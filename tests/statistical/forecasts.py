"""Forecasts along a life by the exact filter: as it has them, and as they are stated after what came of earlier ones."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from models.prognosis.back_cast import BackCast, kept_after
from models.prognosis.criteria import HORIZON
from models.prognosis.first_passage import predict_first_passage
from models.prognosis.stated_end import stated_end
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.statistical.laws import observed

STAGES = (0.2, 0.4, 0.6, 0.8)
DRAWS, FEWEST = 1_000, 3
GRID = Grid()


def forecast(tests: Sequence[Measurement], end: float, rng: np.random.Generator) -> dict[float, tuple[float, ...]]:
    """At each stage of a life that has three tests: does the 90 % interval hold the end, does it begin after it, and how
    wide is it in lives, as the filter has it and as it is stated; how many tests earlier forecasts held, and of how many."""
    prior, back_cast, told = weak(tests[0], falling=True), BackCast.nothing(), {}
    stages = {sum(test.progress <= (stage + 1e-3) * end for test in tests): stage for stage in STAGES}
    for count, test in enumerate(tests, start=1):
        back_cast = back_cast.judged(test)
        if count < FEWEST or not (kept_after(count) or count in stages):
            continue
        posterior = GRID.posterior(GRID.from_history(prior, tests[:count]), DRAWS, rng)
        if kept_after(count):
            back_cast = back_cast.forecast(posterior, test, prior)
        if count in stages:
            found: list[float] = []
            for power in (1.0, back_cast.widening):
                as_stated = stated_end(posterior, fraction=0.5, as_of=test.progress, horizon=HORIZON, power=power)
                passage = predict_first_passage(
                    posterior, fraction=0.5, as_of=test.progress, stated=(as_stated.ends, as_stated.weight)
                )
                low, high = (passage.end_of_life[q] or math.inf for q in (0.05, 0.95))
                found += [low <= end <= high, low > end, (min(high, HORIZON) - min(low, HORIZON)) / end]
            told[stages[count]] = (*found, float(back_cast.held), float(back_cast.misses.size))
    return told


def followed(
    course: Callable[[float], float], rng: np.random.Generator, end: float = 10_000.0
) -> dict[float, tuple[float, ...]]:
    """The forecasts of a life along `course`, the share of its fresh value over the share of its life."""
    return forecast(observed(course, rng, end), end, rng)
