"""Lives past their end: is the interval of when the threshold was passed right, once it lies behind?

The simulated rig's clutches: mean COF of four parameters, an eq. 6 each, and scatter from run to run that is a gain, so
that fresh tests scatter the most.
"""

import numpy as np

from models.prognosis.first_passage import weighted_quantiles
from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.score.off_prior import rig_lives
from tests.score.table import percents
from tests.statistical.lives import ends

STAGES = (0.9, 1.0, 1.2, 1.4)
TESTS, GAIN, NOISE = 43, 0.003, 0.001


def after_end(count: int, seed: int) -> str:
    """The filters by stage: intervals that hold the end, begin after it and end before it, and how far off their medians."""
    told: dict[str, list[list[tuple[float, ...]]]] = {}
    for index, (course, end) in enumerate(rig_lives(count, seed)):
        rng = np.random.default_rng([seed, index])
        shares = np.linspace(0.0, STAGES[-1], TESTS)
        cofs = 0.1 * np.array([course(share) for share in shares.tolist()])
        values = cofs * (1.0 + GAIN * rng.standard_normal(TESTS)) + 0.1 * NOISE * rng.standard_normal(TESTS)
        tests = [
            Measurement(progress=share * end, value=value, variance=(0.1 * NOISE) ** 2)
            for share, value in zip(shares.tolist(), values.tolist(), strict=True)
        ]
        for tracker in (Grid(), Particle(), Ukf()):
            told.setdefault(tracker.name, []).append(_stages(tracker, tests, end, rng))
    lines = [
        f"{count} lives, seed {seed}, {TESTS} tests, scatter {GAIN:.1%} of the value\n",
        "| filter | holds the end at 90/100/120/140 % of life | begins after it | ends before it | median off, % of life |",
        "|---|---|---|---|---|",
    ]
    for name, each in told.items():
        held, late, early, off = np.array(each).transpose(2, 0, 1)
        columns = " | ".join(f"{percents(which.mean(axis=0).tolist())} %" for which in (held, late, early))
        bias = "/".join(f"{100 * x:+.2f}" for x in off.mean(axis=0).tolist())
        lines.append(f"| `{name}` | {columns} | {bias} |")
    return "\n".join(lines)


def _stages(
    tracker: Grid | Particle | Ukf, tests: list[Measurement], end: float, rng: np.random.Generator
) -> list[tuple[float, ...]]:
    state, told = tracker.start(weak(tests[0], falling=True)), []
    seen = 0
    for stage in STAGES:
        runs = sum(test.progress <= (stage + 1e-6) * end for test in tests)
        for test in tests[seen:runs]:
            state = tracker.update(state, test, rng)  # type: ignore[arg-type]
        seen = runs
        posterior = tracker.posterior(state, 1_000, rng)  # type: ignore[arg-type]
        low, middle, high = weighted_quantiles(ends(posterior), posterior.weight, (0.05, 0.5, 0.95)).tolist()
        told.append((low <= end <= high, low > end, high < end, (middle - end) / end))
    return told
