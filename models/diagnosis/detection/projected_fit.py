"""A fit and everything projected off it: the catalogue's changes, the smooth contrasts, parts of the fit's own effects."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.design.design import Design
from models.diagnosis.detection.contrasts import Contrasts, contrasts_of
from models.diagnosis.effects.fitted_effect import effect_columns
from models.diagnosis.effects.grid import Column, columns_at_rows
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.gram import Gram, gram_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Projected, projections_of


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectedFit:
    """The columns of `projections`: the grid's first, then the contrasts, then the parts of the fit's effects."""

    fit: Fit
    columns: list[Column]
    contrasts: Contrasts
    parts: int
    gram: Gram
    projections: list[Projected]

    @property
    def effects(self) -> slice:
        """The grid's columns."""
        return slice(0, len(self.columns))

    @property
    def smooth(self) -> slice:
        """The contrasts."""
        return slice(len(self.columns), len(self.columns) + len(self.contrasts.axes))

    @property
    def inside(self) -> slice:
        """The parts of the fit's effects."""
        return slice(self.smooth.stop, self.smooth.stop + self.parts)

    @property
    def likely(self) -> Projected:
        """At the most likely scatter of the gains."""
        return max(self.projections, key=lambda projected: projected.evidence)


def project_fit(problem: FitProblem, fitted: Fit, columns: Sequence[Column] = ()) -> ProjectedFit:
    """Project the catalogue's columns, the contrasts and the effects' parts off a fit."""
    design = problem.design
    changes = columns_at_rows(design, fitted.prediction, columns)
    contrasts = contrasts_of(design, fitted.prediction)
    parts = parts_of(design, fitted)
    gram = gram_of(problem, fitted, np.column_stack([changes, contrasts.columns, parts]), held=False)
    return ProjectedFit(
        fit=fitted,
        columns=list(columns),
        contrasts=contrasts,
        parts=parts.shape[1],
        gram=gram,
        projections=list(projections_of(gram, problem.noise)),
    )


def parts_of(design: Design, fitted: Fit) -> FloatArray:
    """Each effect's change [N, m] on one part of the rows, to first order in its amplitude: if the cause is right, no part
    asks for another amplitude.

    Parts: dynamic tests, the upper half of pressures, of speeds, of life, of the test's clock, accelerating rows.
    """
    rows = design.rows
    parts = [~rows.steady, rows.acceleration > 0]
    parts += [values > np.median(values) for values in (rows.pressure, rows.velocity, rows.cycles, rows.clock)]
    tangents = [(effect.amplitude, effect_columns(design, fitted.prediction, effect)) for effect in fitted.effects]
    changes = [amplitude * columns[:, 0] for amplitude, columns in tangents]
    columns = [np.where(part, change, 0.0) for change in changes for part in parts]
    return np.stack(columns, axis=1) if columns else np.zeros((rows.run.size, 0))
