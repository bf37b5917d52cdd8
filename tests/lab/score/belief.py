"""How much to believe in eq. 6, and in knees: what it costs on lives that follow eq. 6, and gains on those of other courses.

Every life is laid once; its draws, weighted by belief over belief or given other knees, tell what each would have said.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from models.tracking.courses import log_form_weight
from models.tracking.criteria import KNEE_REACH
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import TrackPrior, weak
from tests.lab.score.table import Scores, joined, percents, written
from tests.statistical.forecasts import LAWS, observed
from tests.statistical.lives import PRIOR, STAGES, ends, lives, upto

LAID, DRAWS, END, GRID = 0.4, 2_000, 10_000.0, Grid()
BELIEFS = (0.3, 0.5, 0.55, 0.6, 0.7, 0.8, 0.9, 1.0)
HAZARDS = (0.0, 0.15, 0.3, 0.6, 1.0)
#: What of other laws is shown beside the hazards, and one that goes six times as fast from 0.7 of a life on.
KNEE = "a knee at 0.7 of a life"
BESIDE = ("logarithm", "accelerating (n = -1)", "exponential growth", KNEE)

#: A prior, the tests seen at each stage, the end.
Case = tuple[TrackPrior, list[list[Measurement]], float, np.random.Generator]
#: Beliefs or hazards, each with the ends of the draws and their weights.
Weighed = Iterator[tuple[float, np.ndarray, np.ndarray]]


def belief(count: int, seed: int) -> str:
    """By belief in eq. 6: how often the interval holds the truth, how wide it is and CRPS of the end's logarithm, both over
    those of the sure."""
    few, names = max(8, count // 15), [name for name in LAWS if not name.startswith("one eq. 6")]
    eq_6, *others = _scored(_by_belief, count, few, names, seed)
    rows = (
        (
            f"{100 * share:.0f} %",
            joined("{:.1f}", (100 * held for held in eq_6.means(share, "held"))),
            *_over(eq_6, share, 1.0),
            *(percents(other.means(share, "held")) for other in others),
        )
        for share in BELIEFS
    )
    return written(
        f"{count} lives of eq. 6, {few} of each other law, seed {seed}; held at 20/40/60/80 % of life",
        "belief in eq. 6 | its lives, % | width over that of the sure | CRPS over that of the sure | "
        + " | ".join(f"{name}, %" for name in names),
        rows,
    )


def knees(count: int, seed: int) -> str:
    """By hazard of a knee: how often the interval holds the truth, its width and CRPS of the end's logarithm over those
    without knees; of other laws how many intervals hold the truth and begin after it."""
    few = max(8, count // 8)
    eq_6, *others = _scored(_by_hazard, count, few, BESIDE, seed)
    rows = (
        (
            f"{hazard:g}",
            percents(eq_6.means(hazard, "held")),
            *_over(eq_6, hazard, 0.0),
            *(f"{percents(other.means(hazard, 'held'))}; {percents(other.means(hazard, 'late'))}" for other in others),
        )
        for hazard in HAZARDS
    )
    return written(
        f"{count} lives of eq. 6, {few} of each other law, seed {seed}; at 20/40/60/80 % of life",
        "hazard per e-fold | eq. 6: held, % | width over that without | CRPS over that without | "
        + " | ".join(f"{name}: held; begins after it, %" for name in BESIDE),
        rows,
    )


def _over(scores: Scores, choice: float, least: float) -> tuple[str, str]:
    """Widths by stage, and CRPS of all, over those of another choice."""
    wide = np.array(scores.medians(choice, "width")) / scores.medians(least, "width")
    return joined("{:.2f}", wide.tolist()), f"{scores.ratio(choice, least, what='log_crps')[0]:.3f}"


def _scored(
    weighed: Callable[[TrackPrior, list[Measurement], np.random.Generator], Weighed],
    count: int,
    few: int,
    names: Sequence[str],
    seed: int,
) -> Iterator[Scores]:
    """Scores by choice and stage: of lives of eq. 6, then of a few of each other law."""
    for cases in (_from_prior(count, seed), *(_off(name, few, seed) for name in names)):
        scores = Scores()
        for prior, stages, end, rng in cases:
            for stage, seen in zip(STAGES, stages, strict=True):
                for choice, sample, weight in weighed(prior, seen, rng):
                    scores.add_sample(choice, stage, sample, weight, end)
        yield scores


def _by_hazard(prior: TrackPrior, seen: list[Measurement], rng: np.random.Generator) -> Weighed:
    laid = GRID.posterior(GRID.from_history(replace(prior, knee_hazard=1.0), seen), DRAWS, rng)
    beside = laid.discrepancy
    for hazard in HAZARDS:
        # a knee of hazard 1 at T e^x is one of hazard h at T e^(x/h)
        knee = np.full(laid.weight.size, np.inf)
        if hazard > 0.0:
            with np.errstate(over="ignore"):
                knee = beside.span * (beside.knee / beside.span) ** (1.0 / hazard)
        knee[(beside.size == 0.0) & (knee > KNEE_REACH * beside.span)] = np.inf
        yield hazard, ends(replace(laid, discrepancy=replace(beside, knee=knee))), laid.weight


def _by_belief(prior: TrackPrior, seen: list[Measurement], rng: np.random.Generator) -> Weighed:
    doubtful = replace(prior, eq_6_share=LAID)
    drawn = GRID.posterior(GRID.from_history(doubtful, seen), DRAWS, rng)
    for share in BELIEFS:
        lean = np.exp(log_form_weight(replace(prior, eq_6_share=share)) - log_form_weight(doubtful))
        weight = drawn.weight * lean[drawn.form]
        # where the data leave no draw of eq. 6 the sure are as wrong as can be
        weight = weight / weight.sum() if weight.any() else np.full(weight.size, 1.0 / weight.size)
        yield share, ends(drawn), weight


def _from_prior(count: int, seed: int) -> Iterator[Case]:
    for life, rng in lives(count, seed):
        measurements = life.measured(0.8, 25, rng)
        yield PRIOR, [upto(measurements, stage) for stage in STAGES], life.end, rng


def _off(name: str, count: int, seed: int) -> Iterator[Case]:
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        seen = observed(_knee if name == KNEE else LAWS[name], rng, END)
        stages = [[each for each in seen if each.progress <= (stage + 0.01) * END] for stage in STAGES]
        yield weak(seen[0], falling=True), stages, END, rng


def _knee(share: float) -> float:
    return 1.0 - 0.5 * (0.4 * share if share < 0.7 else 0.28 + 2.4 * (share - 0.7))
