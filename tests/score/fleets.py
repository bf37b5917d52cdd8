"""What earlier lives are worth, as a prior and by where they ended, and what they cost where few or of another kind."""

import math

import numpy as np

from models.degradation.general_order import Degradation, first_passage
from models.prognosis.criteria import HORIZON
from models.prognosis.ended_lives import EndedLife
from models.prognosis.fleet import learn
from models.prognosis.stated_end import stated_end
from models.tracking.filters.grid import Grid
from models.tracking.prior import weak
from tests.score.table import Scores
from tests.statistical.lives import STAGES, Life, taught

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
    """CRPS with a fleet's prior, and calibrated by its ended lives too, over that with the weak one, on the same lives."""
    lines = [
        f"{count} lives, seed {seed}, a new fleet for every fourth\n",
        "| fleet | what is stated | CRPS over the weak prior's, all stages | 20 % | 40 % | 60 % | 80 % of life | held |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, size, other in (("20 of the kind", 20, 1.0), ("3 of the kind", 3, 1.0), ("20 of another kind", 20, 4.0)):
        scores = Scores()
        rng = np.random.default_rng([seed, size, int(other)])
        learned, ended = None, list[EndedLife]()
        for index in range(count):
            if index % 4 == 0:
                fleet = [kind(rng, 0.75, 5_000.0 * other, 0.7) for _ in range(size)]
                taught_by = [(each.end, each.measured(1.0, 25, rng)) for each in fleet if math.isfinite(each.end)]
                learned = learn([history for _, history in taught_by])
                ended = [taught(history, end) for end, history in taught_by]
            life = kind(rng, 0.75, 5_000.0, 0.7)
            assert learned is not None
            if not math.isfinite(life.end):
                continue
            measurements = life.measured(0.8, 25, rng)
            ours, theirs = weak(measurements[0], falling=True), learned.prior_for(measurements[0])
            for stage in STAGES:
                seen = measurements[: round(stage * 30) + 1]
                plain, informed = (GRID.posterior(GRID.from_history(p, seen), 1_000, rng) for p in (ours, theirs))
                scores.add("weak", stage, plain, life.end)
                together, now = learned.together(plain, informed, measurements[0]), seen[-1].progress
                scores.add("fleet", stage, together, life.end)
                stated = stated_end(together, fraction=0.5, as_of=now, horizon=HORIZON, ended=ended, tests=seen)
                scores.add_sample("ended", stage, np.minimum(stated.ends, HORIZON), stated.weight, life.end)
        for stated_by, title in (("fleet", "under its prior"), ("ended", "calibrated by its ended lives")):
            cells = [
                "{:.2f} ± {:.2f}".format(*scores.ratio(stated_by, "weak", stages))
                for stages in (STAGES, *((stage,) for stage in STAGES))
            ]
            held = "/".join(f"{100 * scores.column(stated_by, stage, 'held').mean():.0f}" for stage in STAGES)
            lines.append(f"| {name} | {title} | " + " | ".join(cells) + f" | {held} |")
    return "\n".join(lines)
