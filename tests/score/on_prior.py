"""Lives whose coefficients are drawn from the prior: coverage, sharpness, and CRPS beside the exact posterior's."""

import numpy as np

from models.tracking.filters.grid import Grid
from models.tracking.filters.particle import Particle
from models.tracking.filters.ukf import Ukf
from tests.score.table import Scores, shares
from tests.statistical.lives import PRIOR, STAGES, at_stages, exact, lives

RUNS, DRAWS = 25, 1_000
FILTERS = (Grid(), Particle(), Ukf())


def calibration(count: int, seed: int, outlying: float = 0.0) -> str:
    """How often the 90 % interval holds the end of life, by stage, and how wide it is."""
    scores = Scores()
    for life, rng in lives(count, seed):
        measurements = life.measured(0.8, RUNS, rng, outlying)
        for tracker in FILTERS:
            for stage, state in at_stages(tracker, PRIOR, measurements, rng):
                scores.add(tracker.name, stage, tracker.posterior(state, DRAWS, rng), life.end)  # type: ignore[arg-type]
    lines = [
        f"{count} lives, seed {seed}"
        + (f", of the runs {100 * outlying:.0f} % outlying (gain off by 10 %)" if outlying else "")
        + "\n",
        "| filter | holds the truth at 20 | 40 | 60 | 80 % of life | CRPS, median at 20 | 40 | 60 | 80 % "
        "| PIT in tenths, % |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for tracker in FILTERS:
        held = shares([scores.column(tracker.name, stage, "held").mean() for stage in STAGES])
        crps = " | ".join(f"{np.median(scores.column(tracker.name, stage, 'crps')):.4f}" for stage in STAGES)
        lines.append(f"| `{tracker.name}` | {held} | {crps} | {scores.histogram(tracker.name, STAGES)} |")
    return "\n".join(lines)


def beside_exact(count: int, seed: int, outlying: float = 0.0) -> str:
    """CRPS and width relative to the exact posterior under the same prior, by importance sampling of the density written
    out in full."""
    scores, counts = Scores(), []
    for life, rng in lives(count, seed):
        measurements = life.measured(0.8, RUNS, rng, outlying)
        states = {tracker.name: dict(at_stages(tracker, PRIOR, measurements, rng)) for tracker in FILTERS}
        for stage in STAGES:
            seen = measurements[: round(stage * 30) + 1]
            reference, effective = exact(states["particle"][stage], seen, 5_000, rng)
            counts.append(effective)
            scores.add("exact", stage, reference, life.end)
            for tracker in FILTERS:
                scores.add(tracker.name, stage, tracker.posterior(states[tracker.name][stage], DRAWS, rng), life.end)  # type: ignore[arg-type]
    lines = [
        f"{count} lives, seed {seed}; the exact sample counts for {np.median(counts):.0f} draws in the median, "
        f"{np.quantile(counts, 0.05):.0f} at the 5 % quantile\n",
        "| filter | CRPS over exact, all stages | 20 % | 40 % | 60 % | 80 % of life | of the end's logarithm, all stages "
        "| 20 % | 40 % | 60 % | 80 % |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    every = (STAGES, *((stage,) for stage in STAGES))
    for tracker in FILTERS:
        cells = [
            "{:.3f} ± {:.3f}".format(*scores.ratio(tracker.name, "exact", stages, what))
            for what in ("crps", "log_crps")
            for stages in every
        ]
        lines.append(f"| `{tracker.name}` | " + " | ".join(cells) + " |")
    lines += [
        "",
        "| filter | CRPS over exact, life by life, median at 20 | 40 | 60 | 80 % | width over exact, median at 20 | 40 | 60 "
        "| 80 % |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for tracker in FILTERS:
        typical = [
            f"{scores.typical_ratio(tracker.name, 'exact', stage, what):.3f}"
            for what in ("crps", "width")
            for stage in STAGES
        ]
        lines.append(f"| `{tracker.name}` | " + " | ".join(typical) + " |")
    return "\n".join(lines)
