"""What the prognosis says of real lives that are no eq. 6: filters that clog, with and without what earlier forecasts teach.

50 filters ran on one rig until their pressure reached 600 Pa (`filter_lives`; half of them are here): it accelerates, and
from some seven tenths of a life on grows in a straight line. Each is tested 30 times in a life, its value falling to a half
at 600 Pa, and forecast alone, with the weak prior.
"""

import math

import numpy as np

from models.prognosis.back_cast import BackCast, kept_after
from models.prognosis.criteria import HORIZON
from models.prognosis.first_passage import predict_first_passage
from models.prognosis.stated_end import stated_end
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.real.lag import Row, table
from tests.real.prognosis import columns

SEED, DRAWS, TESTS, LIMIT = 2026, 1_000, 30, 600.0
STAGES = (0.2, 0.4, 0.6, 0.8)
GRID = Grid()


def tests_of(seconds: np.ndarray, pressure: np.ndarray) -> tuple[list[Measurement], float]:
    """The tests of a life, and its end [s]: the medians of pressure about evenly spaced moments."""
    fresh = float(np.median(pressure[:3]))
    value = 0.1 * (1.0 - 0.5 * (pressure - fresh) / (LIMIT - fresh))
    clogged = np.flatnonzero(value <= 0.05)
    end = float(seconds[clogged[0] if clogged.size else -1])
    near = max(1.0, end / 200.0)
    return [
        Measurement(progress=at, value=float(np.median(value[np.abs(seconds - at) <= near])), variance=0.0)
        for at in np.linspace(0.0, end, TESTS + 1)[:-1].tolist()
    ], end


def forecast(tests: list[Measurement], end: float, rng: np.random.Generator) -> list[tuple[float, ...]]:
    """By stage: held, late and width in lives, as the filter has it and as it is stated; tests held, and judged."""
    prior, back_cast, told = weak(tests[0], falling=True), BackCast.nothing(), []
    stages = [sum(test.progress <= (stage + 1e-3) * end for test in tests) for stage in STAGES]
    for count, test in enumerate(tests, start=1):
        back_cast = back_cast.judged(test)
        if not kept_after(count) and count not in stages:
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
            told.append((*found, back_cast.held, back_cast.misses.size))
    return told


def filters() -> list[Row]:
    """A row a stage: the filter alone, and as it is stated."""
    data = columns("filter_lives", "filters_odd.csv")
    told = []
    for life in np.unique(data["life"]).tolist():
        here = data["life"] == life
        tests, end = tests_of(data["time_s"][here], data["differential_pressure_pa"][here])
        told.append(forecast(tests, end, np.random.default_rng([SEED, int(life)])))
    every = np.array(told, dtype=float)
    rows: list[Row] = []
    for number, stage in enumerate(STAGES):
        held, late, width, held_wide, late_wide, wide, within, judged = every[:, number].T
        rows.append(
            {
                "of life": f"{stage:.0%}",
                "held": f"{held.mean():.0%}",
                "begins after the end": f"{late.mean():.0%}",
                "width, lives": f"{np.median(width):.2g}",
                "as stated: held": f"{held_wide.mean():.0%}",
                "begins after it": f"{late_wide.mean():.0%}",
                "width": f"{np.median(wide):.2g}",
                "tests within earlier forecasts": f"{within.sum() / judged.sum():.0%}",
            }
        )
    return rows


def main() -> None:
    """The table."""
    print("### Filters that clog, each alone: the exact filter, and as it is stated after earlier forecasts\n")
    print(table(filters()))


if __name__ == "__main__":
    main()
