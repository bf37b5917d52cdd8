"""The alarm: three statistics of what the baseline leaves, each against what chance makes of it.

The largest likelihood ratio over the catalogue's changes and their shape grids, the largest over the smooth contrasts, and
the highest line of a periodogram over the tests' clock. Each has its part of a total of about 1 % of false alarms.
"""

from dataclasses import dataclass

import numpy as np

from models.diagnosis.criteria import CONTRASTS_FALSE_ALARMS, EFFECTS_FALSE_ALARMS
from models.diagnosis.detection.likelihood_ratio import AlarmStatistic, largest_ratio
from models.diagnosis.detection.periodogram import lines
from models.diagnosis.detection.projected_fit import ProjectedFit
from models.diagnosis.pooled_fit.problem import FitProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarms:
    """The three statistics: effects of the catalogue, smooth contrasts, lines over the tests' clock."""

    effects: AlarmStatistic
    contrasts: AlarmStatistic
    lines: AlarmStatistic

    @property
    def raised(self) -> bool:
        """Whether any of them is beyond its threshold."""
        return self.effects.raised or self.contrasts.raised or self.lines.raised


def alarms_of(problem: FitProblem, projected: ProjectedFit, rng: np.random.Generator) -> Alarms:
    """The alarms of a baseline's fit, projected with the catalogue's columns."""
    one_sided = np.array([float(column.effect.positive) for column in projected.columns])
    two_sided = np.zeros(len(projected.contrasts.axes))
    return Alarms(
        effects=largest_ratio(projected.projections, projected.effects, one_sided, EFFECTS_FALSE_ALARMS, rng),
        contrasts=largest_ratio(projected.projections, projected.smooth, two_sided, CONTRASTS_FALSE_ALARMS, rng),
        lines=lines(problem, projected.fit.residual),
    )
