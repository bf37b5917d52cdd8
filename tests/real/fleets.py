"""What ended lives say of the next: filters under one dust feed, cracks of one population, and the exponent of the feed.

Each life is forecast from its own tests and from others that have ended: of filters ten of the same feed, of cracks all
others. The rival is what one knows without any model: the ends of the same others that were later than now, each as
probable. Cracks are counted in thousandths of the time given, and end at a length of 0.25.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.prognosis.criteria import HORIZON
from models.prognosis.ended_lives import EndedLife, ended_life, severity_exponent
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.scoring import crps_of_sample, measured_end
from models.prognosis.stated_end import stated_end
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.real.lag import Row, table
from tests.real.lives import STAGES, tests_of
from tests.real.prognosis import columns

SEED, DRAWS, OTHERS, CRACK = 2026, 1_000, 10, 0.25
GRID = Grid()


@dataclass(frozen=True, slots=True, kw_only=True)
class Life:
    """A life's tests, its end, its kind, and what it teaches others."""

    kind: float
    tests: list[Measurement]
    end: float
    teaches: EndedLife


def life(kind: float, tests: list[Measurement], end: float) -> Life:
    teaches = ended_life(tests, end, fraction=0.5, horizon=HORIZON)
    assert teaches is not None
    return Life(kind=kind, tests=tests, end=end, teaches=teaches)


def filters() -> list[Life]:
    data = columns("filter_lives", "filters_odd.csv")
    lives = []
    for number in np.unique(data["life"]).tolist():
        here = data["life"] == number
        tests, end = tests_of(data["time_s"][here], data["differential_pressure_pa"][here])
        lives.append(life(float(data["dust_feed"][here][0]), tests, end))
    return lives


def cracks() -> list[Life]:
    data = columns("crack_growth", "crack_growth.csv")
    lives = []
    for unit in range(1, 11):
        lengths = data[f"unit{unit}"]
        values = 0.1 * (1.0 - 0.5 * (lengths - lengths[0]) / (CRACK - lengths[0]))
        end = measured_end(1_000.0 * data["time"], values, 0.05)
        assert end is not None
        tests = [
            Measurement(progress=progress, value=value, variance=0.0)
            for progress, value in zip((1_000.0 * data["time"]).tolist(), values.tolist(), strict=True)
        ]
        lives.append(life(0.0, tests, end))
    return lives


def judged(lives: Sequence[Life], others: int) -> list[Row]:
    """A row a stage: the exact filter with ended lives, those ends alone, and by how many."""
    told: dict[float, list[tuple[float, ...]]] = {stage: [] for stage in STAGES}
    for number, each in enumerate(lives):
        rng = np.random.default_rng([SEED, number])
        kin = [other for other in lives if other.kind == each.kind and other is not each]
        ended = [kin[index].teaches for index in rng.permutation(len(kin))[:others]]
        prior = weak(each.tests[0], falling=True)
        for stage in STAGES:
            seen = [test for test in each.tests if test.progress <= (stage + 1e-3) * each.end]
            if len(seen) < 3:
                continue
            alive = np.array([other.end for other in ended if other.end > seen[-1].progress])
            if alive.size == 0:
                continue
            drawn = GRID.posterior(GRID.from_history(prior, seen), DRAWS, rng)
            now = seen[-1].progress
            stated = stated_end(drawn, fraction=0.5, as_of=now, horizon=HORIZON, ended=ended)
            even = np.full(alive.size, 1.0 / alive.size)
            low, high = weighted_quantiles(np.minimum(stated.ends, HORIZON), stated.weight, (0.05, 0.95))
            told[stage].append(
                (
                    low <= each.end <= high,
                    low > each.end,
                    (high - low) / each.end,
                    crps_of_sample(np.minimum(stated.ends, HORIZON), stated.weight, each.end) / each.end,
                    crps_of_sample(alive, even, each.end) / each.end,
                )
            )
    rows: list[Row] = []
    for stage, found in told.items():
        if found:
            held, late, width, score, rival = np.array(found, dtype=float).T
            rows.append(
                {
                    "of life": f"{stage:.0%}",
                    "lives": str(len(found)),
                    "held": f"{held.mean():.0%}",
                    "begins after the end": f"{late.mean():.0%}",
                    "width, lives": f"{np.median(width):.2g}",
                    "CRPS, % of life": f"{100 * score.mean():.2f}",
                    "of the ends alone": f"{100 * rival.mean():.2f}",
                }
            )
    return rows


def main() -> None:
    """The tables."""
    clogged = filters()
    print(f"### Filters that clog, with {OTHERS} ended lives of the same feed\n\n{table(judged(clogged, OTHERS))}\n")
    print(f"### Cracks, with the nine others\n\n{table(judged(cracks(), OTHERS))}\n")
    ends, feeds = np.array([each.end for each in clogged]), np.array([each.kind for each in clogged])
    exponent, deviation = severity_exponent(ends, feeds)
    print(f"### The feed as severity\n\nexponent {-exponent:.3f} ± {deviation:.3f} of {ends.size} lives")


if __name__ == "__main__":
    main()
