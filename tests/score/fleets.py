"""What a prior learned from earlier lives is worth, and what it costs where the fleet is small or of another kind."""

import math

import numpy as np

from models.degradation.general_order import Degradation, first_passage
from models.prognosis.fleet import learn
from models.tracking.filters.grid import Grid
from models.tracking.prior import weak
from tests.score.table import Scores
from tests.statistical.lives import STAGES, Life

GRID = Grid()


def kind(rng: np.random.Generator, change: float, scale: float, exponent: float) -> Life:
    """A clutch of a kind: 5 % apart in what is lost, a fifth in φ, a tenth in ε."""
    initial = 0.13 * math.exp(0.05 * rng.standard_normal())
    truth = Degradation(
        initial=initial,
        change=-initial * change * math.exp(0.05 * rng.standard_normal()),
        scale=scale * math.exp(0.2 * rng.standard_normal()),
        exponent=exponent * math.exp(0.1 * rng.standard_normal()),
    )
    return Life(truth, 0.003 * initial, float(first_passage(0.5 * initial, truth)))


def fleets(count: int, seed: int) -> str:
    """CRPS with a fleet's prior over that with the weak one, on the same lives."""
    lines = [
        f"{count} lives, seed {seed}, a new fleet for every fourth\n",
        "| fleet | CRPS over the weak prior's, all stages | 20 % | 40 % | 60 % | 80 % of life |",
        "|---|---|---|---|---|---|",
    ]
    for name, size, other in (("20 of the kind", 20, 1.0), ("3 of the kind", 3, 1.0), ("20 of another kind", 20, 4.0)):
        scores = Scores()
        rng = np.random.default_rng([seed, size, int(other)])
        learned = None
        for index in range(count):
            if index % 4 == 0:
                fleet = [kind(rng, 0.75, 5_000.0 * other, 0.7) for _ in range(size)]
                learned = learn([each.measured(1.0, 25, rng) for each in fleet if math.isfinite(each.end)])
            life = kind(rng, 0.75, 5_000.0, 0.7)
            assert learned is not None
            if not math.isfinite(life.end):
                continue
            measurements = life.measured(0.8, 25, rng)
            ours, theirs = weak(measurements[0], falling=True), learned.prior_for(measurements[0])
            for stage in STAGES:
                seen = measurements[: round(stage * 30) + 1]
                plain, taught = (GRID.posterior(GRID.from_history(p, seen), 1_000, rng) for p in (ours, theirs))
                scores.add("weak", stage, plain, life.end)
                scores.add("fleet", stage, learned.together(plain, taught, measurements[0]), life.end)
        cells = [
            "{:.2f} ± {:.2f}".format(*scores.ratio("fleet", "weak", stages))
            for stages in (STAGES, *((stage,) for stage in STAGES))
        ]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
