"""The check of a case: what a hypothesis leaves must look like noise, and its amplitude must be the same everywhere.

Three tests on the residual (smooth contrasts, parts of the data, lines over the clock), each with what a right template may
leave (`Hypothesis.tolerance`), and one on a pair: two effects that cancel each other,

    Σ λ_i/λ > MOST_UNDONE,

follow structure that neither of them is.
"""

from dataclasses import dataclass, replace

import numpy as np

from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.criteria import (
    LEFT_FALSE_ALARMS,
    MOST_UNDONE,
    PARTS_FALSE_ALARMS,
    PARTS_TOLERANCE,
    TOLERANCE,
    UNDONE_EXCESS,
)
from models.diagnosis.detection.likelihood_ratio import AlarmStatistic, largest_ratio
from models.diagnosis.detection.periodogram import lines
from models.diagnosis.detection.projected_fit import ProjectedFit, project_fit
from models.diagnosis.effects.fitted_effect import effect_rows
from models.diagnosis.pooled_fit.gram import gram_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import projections_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """The statistics of structure that is left, of parts that differ, and of lines that are left; `undoing` [-] how much
    more two effects are worth separately than together; `excess` [nats] by how much the worst is beyond what a template
    may leave (negative where all hold); the fit with all that was projected off it."""

    left: AlarmStatistic
    parts: AlarmStatistic
    lines: AlarmStatistic
    undoing: float
    excess: float
    projected: ProjectedFit

    @property
    def passed(self) -> bool:
        """Whether what is left looks like noise and the amplitude is one everywhere."""
        return self.excess <= 0


class Checks:
    """Checks of hypotheses, each made once: it consumes random numbers in the order in which they are asked for."""

    def __init__(self, problem: FitProblem, rng: np.random.Generator) -> None:
        self._problem, self._rng = problem, rng
        self._made: dict[tuple[str, ...], Check] = {}

    def __call__(self, hypothesis: Hypothesis) -> Check:
        if hypothesis.slugs not in self._made:
            self._made[hypothesis.slugs] = check(self._problem, hypothesis, self._rng)
        return self._made[hypothesis.slugs]

    def excess(self, hypothesis: Hypothesis) -> float:
        """By how much [nats] it failed its check, 0 where it passed or was not checked."""
        made = self._made.get(hypothesis.slugs)
        return max(made.excess, 0.0) if made is not None else 0.0


def check(problem: FitProblem, hypothesis: Hypothesis, rng: np.random.Generator) -> Check:
    """Check a fitted hypothesis. Raises ValueError where it was not fitted."""
    if hypothesis.fit is None:
        raise ValueError(f"a hypothesis must be fitted to be checked, got {hypothesis.slugs} without a fit")
    slack = hypothesis.tolerance
    uneven = PARTS_TOLERANCE / TOLERANCE * slack
    projected = project_fit(problem, hypothesis.fit)
    two_sided = np.zeros(len(projected.contrasts.axes))
    left = largest_ratio(projected.projections, projected.smooth, two_sided, LEFT_FALSE_ALARMS, rng)
    parts = largest_ratio(projected.projections, projected.inside, np.zeros(projected.parts), PARTS_FALSE_ALARMS, rng)
    line = lines(problem, hypothesis.fit.residual)
    undone = undoing(problem, hypothesis)
    excess = max(
        statistic.value - statistic.threshold - most
        for statistic, most in ((left, slack), (parts, uneven), (line, slack))
    )
    if undone > MOST_UNDONE:
        excess = max(excess, UNDONE_EXCESS * (1.0 + 0.5 * slack))
    return Check(left=left, parts=parts, lines=line, undoing=undone, excess=excess, projected=projected)


def undoing(problem: FitProblem, hypothesis: Hypothesis) -> float:
    """How much more two effects are worth separately than together, Σ λ_i/λ; 1 of one effect, or of less than a nat."""
    fitted = hypothesis.fit
    if fitted is None or len(fitted.effects) < 2:
        return 1.0
    changes = [effect_rows(problem.design, fitted.prediction, effect) for effect in fitted.effects]
    gram = gram_of(problem, replace(fitted, effects=()), np.stack(changes, axis=1))
    info = max(projections_of(gram, problem.noise), key=lambda projected: projected.evidence).info
    alone, both = 0.5 * float(np.trace(info)), 0.5 * float(info.sum())
    return alone / max(both, 1e-3 * alone) if alone > 1.0 else 1.0
