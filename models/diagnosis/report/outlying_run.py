"""Which run stands off the others: another clutch, a unit that was mistyped, a cable the wrong way round.

No effect is in one run alone, and a report that only says "cycles" sends an engineer through all of them.
"""

import numpy as np

from models.diagnosis.design.design import Design
from models.diagnosis.detection.lack_of_fit import without_likely_gains
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit

#: A run is odd that makes this share of all that is missed beyond noise, among so many runs at least, and is missed by so
#: many deviations beyond noise.
SHARE, FEWEST, MISSES = 0.6, 4, 2.0


def odd_run(design: Design, noise: Noise, fitted: Fit) -> str:
    """A sentence on the run that stands off the others, or nothing."""
    left = without_likely_gains(design, noise, fitted)
    squares = (left / noise.deviation) ** 2
    count = np.bincount(design.rows.run, minlength=len(design.runs))
    beyond = np.maximum(np.bincount(design.rows.run, weights=squares, minlength=len(design.runs)) - count, 0.0)
    oddest = int(np.argmax(beyond))
    if np.count_nonzero(count) < FEWEST or beyond[oddest] < max(SHARE * beyond.sum(), MISSES**2 * count[oddest]):
        return ""
    here = design.rows.run == oddest
    misses, usual = (float(np.sqrt((left[rows] ** 2).mean())) for rows in (here, ~here))
    run = design.runs[oddest]
    return (
        f"The run {run.run_id} at {run.cycles:,.0f} cycles stands off the others: it is missed by {misses:.2g} Nm, they by "
        f"{usual:.2g} Nm. Look at that run first."
    )
