"""Refits: a model followed to its end with everything free, with effects or beside a pattern that has no name."""

from dataclasses import replace

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.pooled_fit.gauss_newton import Fit, FitStatus, fit
from models.diagnosis.pooled_fit.problem import FitProblem

#: Gauss-Newton steps at most: a refit is followed to its end. With 10, a running-in was 49 nats short of it and stood behind
#: what it was; 31 and 35 steps ended the longest two of 30 refits near the best (`make blind SEED=23 SIZE=0.03`).
STEPS = 40


def refit(problem: FitProblem, laws: Laws, effects: tuple[FittedEffect, ...]) -> Fit | None:
    """The fit from laws and effects; None where a one-sided effect is negative or nothing finite fits."""
    if any(effect.wrong_sign for effect in effects):
        return None
    fitted = fit(problem, laws, effects, steps=STEPS)
    return None if fitted.wrong_sign or fitted.status is FitStatus.NOT_FINITE else fitted


def refit_beside(problem: FitProblem, start: Fit, pattern: FloatArray) -> Fit | None:
    """The fit where a pattern [N] Nm of the rows is taken off what was measured, as a fit to what was measured: the baseline
    moves to where it leaves that pattern."""
    design = problem.design
    without = replace(problem, design=replace(design, torque=design.torque - pattern))
    fitted = refit(without, start.laws, start.effects)
    return None if fitted is None else replace(fitted, residual=fitted.residual + pattern)
