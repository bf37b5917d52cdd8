"""A fit and everything projected off it: the catalogue's changes, the smooth contrasts, blocks of the fit's own effects."""

from dataclasses import dataclass
from itertools import groupby

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.attribution.screening import Column
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import Design
from models.diagnosis.detection.contrasts import Contrasts, contrasts_of
from models.diagnosis.effects.effect import unit_changes
from models.diagnosis.effects.template_discrepancy import bends
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit, Priors, effect_columns
from models.diagnosis.pooled_fit.projection import Gram, Projected, change_columns, gram_of, projections_of


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The columns of `projections`: the grid's first, then the contrasts, then the blocks of the fit's effects."""

    fit: Fit
    columns: list[Column]
    contrasts: Contrasts
    blocks: int
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
        """The blocks."""
        return slice(self.smooth.stop, self.smooth.stop + self.blocks)

    @property
    def likely(self) -> Projected:
        """At the most likely scatter of the gains."""
        return max(self.projections, key=lambda each: each.evidence)


def view_of(design: Design, noise: Noise, priors: Priors, fitted: Fit, columns: list[Column]) -> View:
    """Project the catalogue's columns, the contrasts and the effects' blocks off a fit."""
    changes = columns_at_rows(design, fitted.prediction, columns)
    contrasts = contrasts_of(design, fitted.prediction)
    blocks = blocks_of(design, fitted)
    gram = gram_of(design, noise, priors, fitted, np.column_stack([changes, contrasts.columns, blocks]), held=False)
    return View(
        fit=fitted,
        columns=columns,
        contrasts=contrasts,
        blocks=blocks.shape[1],
        gram=gram,
        projections=projections_of(gram, noise),
    )


def columns_at_rows(design: Design, prediction: Prediction, columns: list[Column]) -> FloatArray:
    """The changes [N, m] of small amplitudes, per unit, at the rows."""
    changes = list[tuple[FloatArray, bool]]()
    for _, alike in groupby(columns, key=lambda each: each.effect.slug):
        mine = list(alike)
        told = unit_changes(mine[0].effect, prediction.scene, [each.shape for each in mine])
        changes += [(told[:, i], each.effect.lags(each.shape)) for i, each in enumerate(mine)]
    return change_columns(design, prediction, changes)


def blocks_of(design: Design, fitted: Fit) -> FloatArray:
    """Each effect's change [N, m] on one part of the rows, to first order in its amplitude: were the cause right, no part
    would want another amplitude.

    Parts: dynamic tests, the upper half of pressures, of speeds, of life, of the test's clock, accelerating rows.
    """
    rows = design.rows
    parts = [~rows.steady, rows.acceleration > 0]
    parts += [values > np.median(values) for values in (rows.pressure, rows.velocity, rows.cycles, rows.clock)]
    tangents = [(each.amplitude, effect_columns(design, fitted.prediction, each)) for each in fitted.effects]
    changes = [amplitude * columns[:, 0] for amplitude, columns in tangents]
    columns = [np.where(part, change, 0.0) for change in changes for part in parts]
    return np.stack(columns, axis=1) if columns else np.zeros((rows.run.size, 0))


def amplitude_deviations(design: Design, noise: Noise, priors: Priors, fitted: Fit) -> list[float]:
    """Standard deviations of the amplitudes of the fit's effects, everything else free."""
    gram = gram_of(design, noise, priors, fitted, np.zeros((design.torque.size, 0)))
    corner = gram.with_gains(noise.run_gain, noise.curve_gain)[0][: gram.base, : gram.base]
    scale = 1 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
    inverse = np.linalg.pinv(corner * scale[:, None] * scale, hermitian=True) * scale[:, None] * scale
    sizes = [1 + sum(shape.smooth for shape in each.effect.shapes) for each in fitted.effects]
    bent = sum(bends(design, each.effect).shape[1] for each in fitted.effects)
    places = gram.base - bent - sum(sizes) + np.concatenate([[0], np.cumsum(sizes)])[: len(sizes)].astype(int)
    return [float(np.sqrt(max(inverse[place, place], 0.0))) for place in places]
