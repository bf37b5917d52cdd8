"""How much to believe in eq. 6, and in knees: what it costs on lives that follow eq. 6, and gains on those of other courses.

Every life is laid once; its draws, weighted by belief over belief or given other knees, tell what each would have said.
"""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from models.tracking.courses import log_form_weight
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior, weak
from tests.score.table import Score, percents, score
from tests.statistical.laws import LAWS, observed
from tests.statistical.lives import PRIOR, STAGES, ends, lives

LAID, DRAWS = 0.4, 2_000
BELIEFS = (0.3, 0.5, 0.55, 0.6, 0.7, 0.8, 0.9, 1.0)
HAZARDS = (0.0, 0.15, 0.3, 0.6, 1.0)
#: What of other laws is shown beside the hazards, and one that goes six times as fast from 0.7 of a life on.
KNEE = "a knee at 0.7 of a life"
BESIDE = ("logarithm", "accelerating (n = -1)", "exponential growth", KNEE)


def belief(count: int, seed: int) -> str:
    """By belief in eq. 6: how often the interval holds the truth, how wide it is and CRPS of the end's logarithm, both over
    those of the sure."""
    eq_6 = _told(_from_prior(count, seed))
    sure = np.mean([each.log_crps for stage in eq_6[1.0] for each in stage])
    narrow = [np.median([each.width for each in stage]) for stage in eq_6[1.0]]
    others = {name: _told(_off(name, max(8, count // 15), seed)) for name in LAWS if not name.startswith("one eq. 6")}
    lines = [
        f"{count} lives of eq. 6, {max(8, count // 15)} of each other law, seed {seed}; held at 20/40/60/80 % of life\n",
        "| belief in eq. 6 | its lives, % | width over that of the sure | CRPS over that of the sure | "
        + " | ".join(f"{each}, %" for each in others)
        + " |",
        "|---" * (4 + len(others)) + "|",
    ]
    for share in BELIEFS:
        held = "/".join(f"{100 * np.mean([each.held for each in stage]):.1f}" for stage in eq_6[share])
        crps = np.mean([each.log_crps for stage in eq_6[share] for each in stage]) / sure
        wide = "/".join(
            f"{np.median([each.width for each in stage]) / least:.2f}"
            for stage, least in zip(eq_6[share], narrow, strict=True)
        )
        rest = [
            percents([float(np.mean([e.held for e in stage])) for stage in outcomes[share]])
            for outcomes in others.values()
        ]
        lines.append(f"| {100 * share:.0f} % | {held} | {wide} | {crps:.3f} | " + " | ".join(rest) + " |")
    return "\n".join(lines)


def knees(count: int, seed: int) -> str:
    """By hazard of a knee: how often the interval holds the truth, its width and CRPS of the end's logarithm over those
    without knees; of other laws how many intervals hold the truth and begin after it."""
    told = _with_knees(_from_prior(count, seed))
    plain = [float(np.median([each.width for each in stage])) for stage in told[0.0]]
    score_without = np.mean([each.log_crps for stage in told[0.0] for each in stage])
    others = {name: _with_knees(_off(name, max(8, count // 8), seed)) for name in BESIDE}
    lines = [
        f"{count} lives of eq. 6, {max(8, count // 8)} of each other law, seed {seed}; at 20/40/60/80 % of life\n",
        "| hazard per e-fold | eq. 6: held, % | width over that without | CRPS over that without | "
        + " | ".join(f"{name}: held; begins after it, %" for name in BESIDE)
        + " |",
        "|---" * (4 + len(BESIDE)) + "|",
    ]
    for hazard in HAZARDS:
        wide = "/".join(
            f"{np.median([each.width for each in stage]) / least:.2f}"
            for stage, least in zip(told[hazard], plain, strict=True)
        )
        rest = [
            f"{percents([float(np.mean([each.held for each in stage])) for stage in by[hazard]])}; "
            f"{percents([float(np.mean([each.late for each in stage])) for stage in by[hazard]])}"
            for by in others.values()
        ]
        held = percents([float(np.mean([each.held for each in stage])) for stage in told[hazard]])
        crps = np.mean([each.log_crps for stage in told[hazard] for each in stage]) / score_without
        lines.append(f"| {hazard:g} | {held} | {wide} | {crps:.3f} | " + " | ".join(rest) + " |")
    return "\n".join(lines)


def _with_knees(
    cases: Iterator[tuple[Prior, list[list[Measurement]], float, np.random.Generator]],
) -> dict[float, list[list[Score]]]:
    """By hazard and stage the scores of all lives."""
    grid, found = Grid(), defaultdict(lambda: [[] for _ in STAGES])
    for prior, stages, end, rng in cases:
        for index, seen in enumerate(stages):
            laid = grid.posterior(grid.from_history(replace(prior, knee_hazard=1.0), seen), DRAWS, rng)
            beside = laid.discrepancy
            assert beside is not None
            for hazard in HAZARDS:
                # a knee of hazard 1 at T e^x is one of hazard h at T e^(x/h)
                knee = np.full(laid.weight.size, np.inf)
                if hazard > 0.0:
                    with np.errstate(over="ignore"):
                        knee = beside.span * (beside.knee / beside.span) ** (1.0 / hazard)
                given = replace(laid, discrepancy=replace(beside, knee=knee))
                found[hazard][index].append(score(ends(given), given.weight, end))
    return found


def _told(
    cases: Iterator[tuple[Prior, list[list[Measurement]], float, np.random.Generator]],
) -> dict[float, list[list[Score]]]:
    """By belief and stage the scores of all lives."""
    grid, found = Grid(), defaultdict(lambda: [[] for _ in STAGES])
    for prior, stages, end, rng in cases:
        doubtful = replace(prior, eq_6_share=LAID)
        for index, seen in enumerate(stages):
            drawn = grid.posterior(grid.from_history(doubtful, seen), DRAWS, rng)
            for share in BELIEFS:
                lean = np.exp(log_form_weight(replace(prior, eq_6_share=share)) - log_form_weight(doubtful))
                weight = drawn.weight * lean[drawn.form]
                # where the data leave no draw of eq. 6 the sure are as wrong as can be
                weight = weight / weight.sum() if weight.any() else np.full(weight.size, 1.0 / weight.size)
                found[share][index].append(score(ends(drawn), weight, end))
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
        seen = observed(_knee if name == KNEE else LAWS[name], rng, 10_000.0)
        stages = [[each for each in seen if each.progress <= (stage + 0.01) * 10_000.0] for stage in STAGES]
        yield weak(seen[0], falling=True), stages, 10_000.0, rng


def _knee(share: float) -> float:
    return 1.0 - 0.5 * (0.4 * share if share < 0.7 else 0.28 + 2.4 * (share - 0.7))
