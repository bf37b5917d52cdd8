"""Alarms by a safe bound: how early the first one comes, and how often for nothing, by when the rule is judged."""

import math

import numpy as np

from models.prognosis.first_passage import weighted_quantiles
from models.tracking.filters.grid import Grid
from tests.lab.score.table import written
from tests.statistical.lives import PRIOR, ends, typical

#: Tests over a life, the first the rule is judged at, draws, and the limit [cycles].
TESTS, FIRST, DRAWS, LIMIT = 25, 3, 1_000, 4_000.0
#: The multiples of the limit below which the median must be; the last: the bound alone.
WITHIN = (1.0, 1.5, 2.0, 3.0, 5.0, math.inf)


def bounds(count: int, seed: int) -> str:
    """The true remaining cycles at the first alarm, over the limit: called far too early (more than three limits are left),
    at the third test, or too late (less than half of the limit is left, or never)."""
    grid, found = Grid(), {within: [] for within in WITHIN}
    for life, rng in typical(count, seed):
        tests = life.measured(1.0, TESTS, rng)
        open_rules = set(WITHIN)
        for last in range(FIRST, TESTS):
            now = tests[last - 1].progress
            drawn = grid.posterior(grid.from_history(PRIOR, tests[:last]), DRAWS, rng)
            bound, median = weighted_quantiles(ends(drawn) - now, drawn.weight, (0.05, 0.5)).tolist()
            for within in [each for each in open_rules if bound < LIMIT and median < each * LIMIT]:
                found[within].append((life.end - now, last == FIRST))
                open_rules.remove(within)
            if not open_rules:
                break
        for within in open_rules:
            found[within].append((0.0, False))
    rows = []
    for within, raised in found.items():
        left = np.array([cycles for cycles, _ in raised]) / LIMIT
        shares = ((left > 3.0).mean(), np.mean([third for _, third in raised]), (left < 0.5).mean())
        low, middle, high = np.quantile(left, (0.05, 0.5, 0.95))
        name = "the bound alone" if math.isinf(within) else f"{within:g}"
        rows.append((name, *(f"{100 * share:.0f}" for share in shares), f"{low:.1f}, {middle:.1f}, {high:.1f}"))
    return written(
        f"{count} lives like the reference's, seed {seed}, {TESTS} tests each, a limit of {LIMIT:,.0f} cycles",
        "median below so many limits | called with more than 3 limits left, % | at the third test, % | with less than half "
        "a limit left, or never, % | limits left at the call: 5 %, median, 95 %",
        rows,
    )
