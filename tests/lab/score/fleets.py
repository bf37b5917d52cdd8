"""What earlier lives are worth, as a prior and by where they ended, and what they cost where few or of another kind."""

import math
from collections.abc import Callable

import numpy as np

from models.arrays import FloatArray
from models.degradation.general_order import DegradationLaw, first_passage
from models.prognosis import fleet as of_fleets
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.lab.score.table import EVERY, Scores, joined, percents, score_of_stated, written
from tests.models.tracking.tracked_series import sent
from tests.statistical.lives import STAGES, Life, taught, upto

GRID = Grid()
#: Damage up to a factor, by the share of a life.
Damage = Callable[[FloatArray], FloatArray]
#: An end, and tests up to a share of the life.
Drawn = tuple[float, Callable[[float, int], list[Measurement]]]
#: Of lives of every kind: by how many that ended they are judged, and how many are judged of a fleet.
COUNTS, LIVES = (0, 2, 3, 10), 3
EQ_6 = "eq. 6"


def kind(rng: np.random.Generator, change: float, scale: float, exponent: float) -> Life:
    """A clutch of a kind: 5 % apart in what is lost, a fifth in φ, a tenth in ε."""
    initial = 0.13 * math.exp(0.05 * rng.standard_normal())
    truth = DegradationLaw(
        initial=initial,
        change=-initial * change * math.exp(0.05 * rng.standard_normal()),
        scale=scale * math.exp(0.2 * rng.standard_normal()),
        exponent=exponent * math.exp(0.1 * rng.standard_normal()),
    )
    return Life(truth, 0.003 * initial, float(first_passage(0.5 * initial, truth)))


def fleets(count: int, seed: int) -> str:
    """CRPS with a fleet's prior, and calibrated by its ended lives too, over that with the weak one, on the same lives."""
    rows = []
    for name, size, other in (("20 of the kind", 20, 1.0), ("3 of the kind", 3, 1.0), ("20 of another kind", 20, 4.0)):
        scores = Scores()
        rng = np.random.default_rng([seed, size, int(other)])
        for index in range(count):
            if index % 4 == 0:
                fleet = [kind(rng, 0.75, 5_000.0 * other, 0.7) for _ in range(size)]
                taught_by = [(each.end, each.measured(1.0, 25, rng)) for each in fleet if math.isfinite(each.end)]
                learned = of_fleets.population([of_fleets.taught(history) for _, history in taught_by])
                ended = [taught(history, end) for end, history in taught_by]
            life = kind(rng, 0.75, 5_000.0, 0.7)
            if not math.isfinite(life.end):
                continue
            measurements = life.measured(0.8, 25, rng)
            ours, theirs = weak(measurements[0], falling=True), learned.prior_for(measurements[0])
            for stage in STAGES:
                seen = upto(measurements, stage)
                plain, informed = (GRID.posterior(GRID.from_history(p, seen), 1_000, rng) for p in (ours, theirs))
                scores.add("weak", stage, plain, life.end)
                together = learned.together(plain, informed, measurements[0])
                scores.add("fleet", stage, together, life.end)
                scores.kept["ended", stage].append(score_of_stated(together, seen, ended, life.end))
        rows += [
            (
                name,
                title,
                *("{:.2f} ± {:.2f}".format(*scores.ratio(by, "weak", stages)) for stages in EVERY),
                percents(scores.means(by, "held")),
            )
            for by, title in (("fleet", "under its prior"), ("ended", "calibrated by its ended lives"))
        ]
    return written(
        f"{count} lives, seed {seed}, a new fleet for every fourth",
        "fleet | what is stated | CRPS over the weak prior's, all stages | 20 % | 40 % | 60 % | 80 % of life | held",
        rows,
    )


def _power(rng: np.random.Generator) -> Damage:
    exponent = 3.0 * math.exp(0.2 * rng.standard_normal())
    return lambda x: x**exponent


def _knee(rng: np.random.Generator) -> Damage:
    at, pace = rng.uniform(0.55, 0.85), 6.0 * math.exp(0.3 * rng.standard_normal())
    return lambda x: x + (pace - 1.0) * np.maximum(x - at, 0.0)


def _logarithm(rng: np.random.Generator) -> Damage:
    bend = 0.1 * math.exp(0.4 * rng.standard_normal())
    return lambda x: np.log1p(x / bend)


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
        return sent(
            end * x, 0.13 * (1.0 - 0.5 * damage(x) / damage(np.ones(1))) * (1.0 + 0.003 * rng.standard_normal(count))
        )

    return end, measured


def ended(count: int, seed: int) -> str:
    """By kind: mean CRPS in shares of life by its own tests, and with ended lives; and what is then held."""
    rows = []
    for row, (name, longer) in enumerate(ROWS):
        found = np.array([one for fleet in range(count) for one in _fleet(name, longer, [seed, row, fleet])])
        crps, held = found.mean(axis=0).transpose(2, 1, 0)
        title = name if longer == 1.0 else f"{name}; those lived {longer:g} times as long"
        rows.append((title, *(joined("{:.3g}", (100 * each).tolist()) for each in crps), percents(held[-1].tolist())))
    return written(
        f"{LIVES} lives of each of {count} fleets, seed {seed}; CRPS in % of life at 20/40/60/80 % of life",
        f"kind | its own tests | {' | '.join(f'with {n} ended lives' for n in COUNTS[1:])} | held with 10, %",
        rows,
    )


def _fleet(name: str, longer: float, seed: list[int]) -> list[list[list[tuple[float, bool]]]]:
    """Of each life by stage and count: CRPS in shares of life, and whether the end is held."""
    rng = np.random.default_rng(seed)
    others = [taught(tests(1.0, 25), end) for end, tests in (_drawn(name, longer, rng) for _ in range(COUNTS[-1]))]
    lives = []
    for _ in range(LIVES):
        end, measured = _drawn(name, 1.0, rng)
        tests, stages = measured(0.8, 25), []
        for stage in STAGES:
            seen = upto(tests, stage)
            drawn = GRID.posterior(GRID.from_history(weak(seen[0], falling=True), seen), 500, rng)
            scored = [score_of_stated(drawn, seen, others[:count], end) for count in COUNTS]
            stages.append([(one.crps, one.held) for one in scored])
        lives.append(stages)
    return lives
