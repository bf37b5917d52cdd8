"""What ended lives are worth, by course: to lives of their kind, and where they lived a quarter or four times as long."""

import math
from collections.abc import Callable

import numpy as np

from models.arrays import FloatArray
from models.prognosis.criteria import HORIZON
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.scoring import crps_of_sample
from models.prognosis.stated_end import stated_end
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.score.fleets import GRID, kind
from tests.score.table import percents
from tests.statistical.lives import STAGES, taught

#: Damage up to a factor, by the share of a life.
Damage = Callable[[FloatArray], FloatArray]
#: An end, and tests up to a share of the life.
Drawn = tuple[float, Callable[[float, int], list[Measurement]]]
COUNTS, LIVES, ENDED = (0, 2, 3, 10), 3, 10
EQ_6 = "eq. 6"


def _power(rng: np.random.Generator) -> Damage:
    exponent = 3.0 * math.exp(0.2 * rng.standard_normal())
    return lambda x: np.asarray(x**exponent)


def _knee(rng: np.random.Generator) -> Damage:
    at, pace = rng.uniform(0.55, 0.85), 6.0 * math.exp(0.3 * rng.standard_normal())
    return lambda x: np.asarray(x + (pace - 1.0) * np.maximum(x - at, 0.0))


def _logarithm(rng: np.random.Generator) -> Damage:
    bend = 0.1 * math.exp(0.4 * rng.standard_normal())
    return lambda x: np.asarray(np.log1p(x / bend))


SHAPES: dict[str, Callable[[np.random.Generator], Damage]] = {
    "a power near 3": _power,
    "a knee at 55 to 85 %": _knee,
    "logarithm": _logarithm,
    "straight line": lambda _: lambda x: x,
}
#: By row: the kind, and how many times as long those live that ended.
ROWS = ((EQ_6, 1.0), *((name, 1.0) for name in SHAPES), (EQ_6, 0.25), (EQ_6, 4.0))


def _drawn(name: str, longer: float, rng: np.random.Generator) -> Drawn:
    if name == EQ_6:
        life = next(
            each for each in iter(lambda: kind(rng, 0.75, 5_000.0 * longer, 0.7), None) if math.isfinite(each.end)
        )
        return life.end, lambda share, count: life.measured(share, count, rng)
    end, damage = 10_000.0 * longer * math.exp(0.25 * rng.standard_normal()), SHAPES[name](rng)

    def measured(share: float, count: int) -> list[Measurement]:
        x = np.linspace(0.0, share, count)
        cof = 0.13 * (1.0 - 0.5 * damage(x) / damage(np.ones(1))) * (1.0 + 0.003 * rng.standard_normal(count))
        return [
            Measurement(progress=end * a, value=y, variance=0.0) for a, y in zip(x.tolist(), cof.tolist(), strict=True)
        ]

    return end, measured


def ended(count: int, seed: int) -> str:
    """By kind: mean CRPS in shares of life by its own tests, and with ended lives; and what is then held."""
    lines = [
        f"{LIVES} lives of each of {count} fleets, seed {seed}; CRPS in % of life at 20/40/60/80 % of life\n",
        "| kind | its own tests | " + " | ".join(f"with {n} ended lives" for n in COUNTS[1:]) + " | held with 10, % |",
        "|---" * (len(COUNTS) + 2) + "|",
    ]
    for row, (name, longer) in enumerate(ROWS):
        found = np.array([one for fleet in range(count) for one in _fleet(name, longer, [seed, row, fleet])])
        scores = ["/".join(f"{100 * x:.3g}" for x in stages) for stages in found[:, :, :, 0].mean(axis=0).T]
        title = name if longer == 1.0 else f"{name}; those lived {longer:g} times as long"
        lines.append(f"| {title} | {' | '.join(scores)} | {percents(found[:, :, -1, 1].mean(axis=0).tolist())} |")
    return "\n".join(lines)


def _fleet(name: str, longer: float, seed: list[int]) -> list[list[list[tuple[float, bool]]]]:
    """Of each life by stage and count: CRPS in shares of life, and whether the end is held."""
    rng = np.random.default_rng(seed)
    others = [taught(tests(1.0, 25), end) for end, tests in (_drawn(name, longer, rng) for _ in range(ENDED))]
    lives = []
    for _ in range(LIVES):
        end, measured = _drawn(name, 1.0, rng)
        tests, stages = measured(0.8, 25), []
        for stage in STAGES:
            seen = tests[: round(stage * 30) + 1]
            drawn = GRID.posterior(GRID.from_history(weak(seen[0], falling=True), seen), 500, rng)
            outcomes = []
            for count in COUNTS:
                stated = stated_end(
                    drawn, fraction=0.5, as_of=seen[-1].progress, horizon=HORIZON, ended=others[:count], tests=seen
                )
                ends = np.minimum(stated.ends, HORIZON)
                low, high = weighted_quantiles(ends, stated.weight, (0.05, 0.95)).tolist()
                outcomes.append((crps_of_sample(ends, stated.weight, end) / end, low <= end <= high))
            stages.append(outcomes)
        lives.append(stages)
    return lives
