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
from models.prognosis.scoring import crps_of_sample
from models.prognosis.stated_end import stated_end
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.real.lag import Row, table
from tests.real.lives import cracks, filters
from tests.statistical.forecasts import DRAWS, GRID, STAGES

SEED, OTHERS = 2026, 10


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
    clogged = [life(*each) for each in filters()]
    print(f"### Filters that clog, with {OTHERS} ended lives of the same feed\n\n{table(judged(clogged, OTHERS))}\n")
    print(f"### Cracks, with the nine others\n\n{table(judged([life(*each) for each in cracks()], OTHERS))}\n")
    ends, feeds = np.array([each.end for each in clogged]), np.array([each.kind for each in clogged])
    exponent, deviation = severity_exponent(ends, feeds)
    print(f"### The feed as severity\n\nexponent {-exponent:.3f} ± {deviation:.3f} of {ends.size} lives")


if __name__ == "__main__":
    main()
