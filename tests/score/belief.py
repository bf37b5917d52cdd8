"""How much doubt of eq. 6 to keep: what each belief costs on lives that follow it, and gains on lives that do not.

Every life is laid once, under much doubt; the draws, weighted by belief over belief, tell what each belief would have said.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from models.tracking.criteria import SIZES
from models.tracking.discrepancy import log_size_weight
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior, weak
from tests.score.table import Score, percents, score
from tests.statistical.laws import LAWS, observed
from tests.statistical.lives import PRIOR, STAGES, lives

DOUBT, DRAWS = 0.3, 2_000
BELIEFS = (0.9, 0.95, 0.97, 0.99, 1.0)


def belief(count: int, seed: int) -> str:
    """By belief in eq. 6: how often the interval holds the truth, and CRPS of the end's logarithm over that of the sure."""
    eq_6 = _told(_from_prior(count, seed))
    sure = np.mean([each.log_crps for stage in eq_6[1.0] for each in stage])
    others = {name: _told(_off(name, max(8, count // 15), seed)) for name in LAWS if not name.startswith("one eq. 6")}
    lines = [
        f"{count} lives of eq. 6, {max(8, count // 15)} of each other law, seed {seed}; held at 20/40/60/80 % of life\n",
        f"| belief in eq. 6 | its lives, % | CRPS over that of the sure | {' | '.join(f'{each}, %' for each in others)} |",
        "|---" * (3 + len(others)) + "|",
    ]
    for share in BELIEFS:
        held = "/".join(f"{100 * np.mean([each.held for each in stage]):.1f}" for stage in eq_6[share])
        crps = np.mean([each.log_crps for stage in eq_6[share] for each in stage]) / sure
        rest = [
            percents([float(np.mean([e.held for e in stage])) for stage in outcomes[share]])
            for outcomes in others.values()
        ]
        lines.append(f"| {100 * share:.0f} % | {held} | {crps:.3f} | " + " | ".join(rest) + " |")
    return "\n".join(lines)


def _told(
    cases: Iterator[tuple[Prior, list[list[Measurement]], float, np.random.Generator]],
) -> dict[float, list[list[Score]]]:
    """By belief and stage the scores of all lives."""
    grid, found = Grid(), defaultdict(lambda: [[] for _ in STAGES])
    for prior, stages, end, rng in cases:
        doubtful = replace(prior, law_share=1.0 - DOUBT)
        for index, seen in enumerate(stages):
            drawn = grid.posterior(grid.from_history(doubtful, seen), DRAWS, rng)
            beside = drawn.discrepancy
            assert beside is not None
            kind = np.abs(beside.size[:, None] - SIZES).argmin(axis=1)
            for share in BELIEFS:
                lean = np.exp(log_size_weight(replace(prior, law_share=share)) - log_size_weight(doubtful))
                weight = drawn.weight * lean[kind]
                # where the data leave no draw of eq. 6 the sure are as wrong as can be
                weight = weight / weight.sum() if weight.any() else np.full(weight.size, 1.0 / weight.size)
                found[share][index].append(score(replace(drawn, weight=weight), end))
    return found


def _from_prior(count: int, seed: int) -> Iterator[tuple[Prior, list[list[Measurement]], float, np.random.Generator]]:
    for life, rng in lives(count, seed):
        measurements = life.measured(0.8, 25, rng)
        yield PRIOR, [measurements[: round(stage * 30) + 1] for stage in STAGES], life.end, rng


def _off(
    name: str, count: int, seed: int
) -> Iterator[tuple[Prior, list[list[Measurement]], float, np.random.Generator]]:
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        seen = observed(LAWS[name], rng, 10_000.0)
        stages = [[each for each in seen if each.progress <= (stage + 0.01) * 10_000.0] for stage in STAGES]
        yield weak(seen[0], falling=True), stages, 10_000.0, rng
