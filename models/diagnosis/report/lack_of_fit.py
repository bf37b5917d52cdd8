"""How well a fit does: its error against the noise alone.

The scatter of gains is no misfit: each run's gain, and in the same way each curve's, is taken out of its residual at its
best linear prediction,

    r - M ĝ,     ĝ = σ_g² Mᵀ V⁻¹ r / (1 + σ_g² Mᵀ V⁻¹ M)

and rows weigh by their precision, so that a loop's bin of a hundred samples weighs more than one plateau's reading.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.diagnosis.explanations.verdict import Where
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.run_scatter import without_likely_gains


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How well a model fits: rmse and noise [Nm], the share of the variance beyond noise, and the axes of the structure."""

    rmse: float
    noise: float
    unexplained_share: float
    where: tuple[Where, ...] = ()


def misfit_of(problem: FitProblem, fitted: Fit, where: Sequence[Where] = ()) -> Misfit:
    """The misfit of a fit: rmse and noise [Nm], the gains taken out."""
    left = without_likely_gains(problem, fitted) / problem.noise.deviation
    actual = float((left**2).mean())
    unit = float(np.sqrt((problem.noise.deviation**-2.0).mean()))
    return Misfit(
        rmse=float(np.sqrt(actual)) / unit,
        noise=1.0 / unit,
        unexplained_share=max(0.0, 1 - 1 / actual) if actual > 0 else 0.0,
        where=tuple(where),
    )
