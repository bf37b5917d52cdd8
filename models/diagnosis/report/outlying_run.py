"""An outlying run: another clutch, a unit that was mistyped, a cable the wrong way round.

No effect is in one run alone, and a report that only says "cycles" sends an engineer through all of them.
"""

import numpy as np

from models.diagnosis.criteria import OUTLYING_DEVIATIONS, OUTLYING_FEWEST_RUNS, OUTLYING_SHARE
from models.diagnosis.detection.lack_of_fit import without_likely_gains
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.problem import FitProblem

#: What to do about it.
ADVICE = "Check that run first."


def outlying_run(problem: FitProblem, fitted: Fit) -> str:
    """A sentence on the run whose error is far larger than the others', or nothing."""
    design = problem.design
    left = without_likely_gains(problem, fitted)
    squares = (left / problem.noise.deviation) ** 2
    count = np.bincount(design.rows.run, minlength=len(design.runs))
    beyond = np.maximum(np.bincount(design.rows.run, weights=squares, minlength=len(design.runs)) - count, 0.0)
    worst = int(np.argmax(beyond))
    least = max(OUTLYING_SHARE * beyond.sum(), OUTLYING_DEVIATIONS**2 * count[worst])
    if np.count_nonzero(count) < OUTLYING_FEWEST_RUNS or beyond[worst] < least:
        return ""
    here = design.rows.run == worst
    error, usual = (float(np.sqrt((left[rows] ** 2).mean())) for rows in (here, ~here))
    run = design.runs[worst]
    return (
        f"The run {run.run_id} at {run.cycles:,.0f} cycles is an outlier: the baseline's error there is {error:.2g} Nm RMS, "
        f"elsewhere {usual:.2g} Nm. {ADVICE}"
    )
