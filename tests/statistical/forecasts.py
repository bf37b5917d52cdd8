"""Laws of degradation that are not eq. 6, and forecasts along a life by the exact filter: as it has them, and as they are
stated after what came of earlier ones."""

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
from tests.models.tracking.tracked_series import sent
from tests.statistical.lives import STAGES

DRAWS, FEWEST = 1_000, 3
GRID = Grid()
TESTS, SCATTER = 25, 0.003
#: COF as a share of when new, by the share x of life at which it has halved; written apart from `models`.
LAWS: dict[str, Callable[[float], float]] = {
    "one eq. 6 (Δ = -0.75, ε = 0.8)": lambda x: 1 - 0.75 * (1 - (1 + 2.948 * x) ** -0.8),
    "exponential to a floor": lambda x: 1 - 0.6 * (1 - math.exp(-1.792 * x)),
    "logarithm": lambda x: 1 - 0.5 * math.log1p(20 * x) / math.log(21),
    "straight line": lambda x: 1 - 0.5 * x,
    "accelerating (n = -1)": lambda x: 1 - 0.75 * (1 - math.sqrt(1 - x / 1.125)),
    "exponential growth": lambda x: 1 - 0.5 * math.expm1(3 * x) / math.expm1(3),
    "two stages": lambda x: 1 - 0.25 * (1 - math.exp(-8 * x)) - 0.25 * max(0.0, x - 0.3) / 0.7,
}


def observed(course: Callable[[float], float], rng: np.random.Generator, end: float) -> list[Measurement]:
    """Tests up to 80 % of a life."""
    share = np.linspace(0.0, 0.8, TESTS)
    cof = 0.1 * np.array([course(x) for x in share.tolist()]) * (1 + SCATTER * rng.standard_normal(TESTS))
    return sent(share * end, cof, (0.001 * cof) ** 2)


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
            for powers in ((1.0, 1.0), back_cast.widening):
                as_stated = stated_end(posterior, fraction=0.5, as_of=test.progress, horizon=HORIZON, powers=powers)
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
