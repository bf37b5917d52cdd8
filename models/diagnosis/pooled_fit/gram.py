"""The Gram matrix of a fit: the baseline's sensitivities J, changes of torque g and the residual r, whitened, in one matrix.

For any scatter of the gains, σ_g of the runs and σ_c of the curves, the matrix follows by small corrections (Woodbury), so
the rows are whitened once.
"""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.criteria import DISCREPANCY_SD
from models.diagnosis.design.points import IntArray
from models.diagnosis.effects import amplitude_prior
from models.diagnosis.effects.fitted_effect import effect_columns, effect_precisions
from models.diagnosis.effects.template_discrepancy import discrepancy_columns
from models.diagnosis.noise.covariance import by_curve, gains_of, whitened
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.problem import FitProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class Gram:
    """matrix [m, m] without gains, directions q [c, m] of the curves, squares [c], run_of_curve [c]; the first `base`
    columns are the baseline's, the last is the residual."""

    matrix: FloatArray
    along: FloatArray
    squares: FloatArray
    run_of_curve: IntArray
    base: int

    def with_gains(self, run_gain: float, curve_gain: float) -> tuple[FloatArray, float]:
        """The matrix with gains that scatter so, and the log determinant of what they add [nats, twice]."""
        freed = 1 / (1 + curve_gain**2 * self.squares)  # of each curve's direction, what its own gain leaves
        member = np.zeros((int(self.run_of_curve.max()) + 1, self.run_of_curve.size))
        member[self.run_of_curve, np.arange(self.run_of_curve.size)] = freed
        along, squares = member @ self.along, member @ self.squares
        weight = run_gain**2 / (1 + run_gain**2 * squares)
        matrix = self.matrix - along.T @ (weight[:, None] * along)
        if curve_gain > 0.0:
            matrix -= self.along.T @ ((curve_gain**2 * freed)[:, None] * self.along)
        return matrix, float(np.log1p(run_gain**2 * squares).sum() - np.log(freed).sum())


def gram_of(problem: FitProblem, fit: Fit, changes: FloatArray | None = None, *, held: bool = True) -> Gram:
    """The Gram matrix of a fit (its effects belong to the baseline then) and changes [N, m] at the rows, none if None.

    `held`: whether the priors of the effects' amplitudes are included; they are not where the residual is examined, for a
    residual must not contain what only a prior prevented from being fitted.
    """
    design, noise, priors = problem.design, problem.noise, problem.priors
    changes = np.zeros((design.torque.size, 0)) if changes is None else changes
    own = [effect_columns(design, fit.prediction, effect) for effect in fit.effects]
    discrepancy = [discrepancy_columns(design, fit.prediction, effect) for effect in fit.effects]
    jacobian = np.concatenate([fit.prediction.jacobian(design)[:, priors.free], *own, *discrepancy], axis=1)
    white = whitened(np.column_stack([jacobian, changes, fit.residual]), design, noise)
    gains = gains_of(design, fit.torque, noise)
    matrix = white.T @ white
    free, base = int(priors.free.sum()), jacobian.shape[1]
    rows = priors.rows[:, priors.free]
    off = priors.means - priors.rows @ fit.laws.theta
    matrix[:free, :free] += rows.T @ rows
    matrix[:free, -1] += rows.T @ off
    matrix[-1, :free] += rows.T @ off
    matrix[-1, -1] += float(off @ off)
    at = free
    for effect, columns in zip(fit.effects, own, strict=True):
        precisions = effect_precisions(effect)
        precisions[0] *= float(held)
        diagonal = np.arange(at, at + columns.shape[1])
        matrix[diagonal, diagonal] += precisions
        matrix[at, -1] -= precisions[0] * effect.amplitude
        matrix[-1, at] -= precisions[0] * effect.amplitude
        matrix[-1, -1] += 2.0 * float(held) * amplitude_prior.cost(effect.effect, effect.amplitude)
        at += columns.shape[1]
    diagonal = np.arange(at, base)
    matrix[diagonal, diagonal] += DISCREPANCY_SD**-2.0
    return Gram(
        matrix=matrix, along=by_curve(white, gains), squares=gains.squares, run_of_curve=gains.run_of_curve, base=base
    )
