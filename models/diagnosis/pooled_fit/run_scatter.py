"""The scatter of gains from run to run, estimated from all that a fit leaves, with its uncertainty.

    p(ln σ_g) ∝ p(residual | σ_g) p_0(ln σ_g)

The marginal likelihood is that of `pooled_fit.projection` (what is fitted is integrated out, so gains that the laws over
life absorb are no evidence of a small scatter), summed over the curves' scatter; p_0 is the prior of `criteria`. What the
data say beyond it is measured in nats,

    I = Σ p ln(p/p_0),

and where that is less than LEAST_SCATTER_INFORMATION the estimate is the prior, and said to be.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.criteria import LEAST_SCATTER_INFORMATION
from models.diagnosis.noise.covariance import by_curve, gains_of, whitened
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Projected, log_gain_prior

#: Points of the grid over ln σ_g (numerical: the spline is smooth between the gains that were projected).
_POINTS = 601
_LEVELS = (0.05, 0.5, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScatter:
    """Relative scatter of the runs' gains [-]: median, 90 % interval, and what data say of it beyond the prior [nats]."""

    median: float
    lower: float
    upper: float
    information: float

    @property
    def assumed(self) -> bool:
        """Whether it is the prior, for the data hardly say more."""
        return self.information < LEAST_SCATTER_INFORMATION


def run_scatter(projections: Sequence[Projected]) -> RunScatter:
    """The estimate from projections at every scatter that is considered (`projections_of`)."""
    gains = np.unique([projected.run_gain for projected in projections])
    by_gain = [
        float(logsumexp([projected.evidence for projected in projections if projected.run_gain == gain]))
        for gain in gains
    ]
    logs = np.linspace(np.log(gains[0]), np.log(gains[-1]), _POINTS)
    posterior = _normalised(CubicSpline(np.log(gains), by_gain)(logs))
    prior = _normalised(np.array([log_gain_prior(gain) for gain in np.exp(logs).tolist()]))
    lower, median, upper = np.exp(np.interp(_LEVELS, np.cumsum(np.exp(posterior)), logs)).tolist()
    information = float(np.exp(posterior) @ (posterior - prior))
    return RunScatter(median=median, lower=lower, upper=upper, information=information)


def _normalised(logs: FloatArray) -> FloatArray:
    return np.asarray(logs - logsumexp(logs), dtype=np.float64)


def without_likely_gains(problem: FitProblem, fitted: Fit) -> FloatArray:
    """The residual [N] Nm less what the likeliest gains of runs and curves make of it: r - M ĝ with the best linear
    prediction ĝ = σ_g² Mᵀ V⁻¹ r / (1 + σ_g² Mᵀ V⁻¹ M)."""
    design, noise = problem.design, problem.noise
    gains = gains_of(design, fitted.torque, noise)
    white = whitened(fitted.residual[:, None], design, noise)
    along = by_curve(white, gains)[:, 0]
    freed = 1 / (1 + noise.curve_gain**2 * gains.squares)
    squares, sums = gains.by_run(freed * gains.squares), gains.by_run(freed * along)
    of_run = (noise.run_gain**2 * sums / (1 + noise.run_gain**2 * squares))[gains.run_of_curve]
    of_curve = noise.curve_gain**2 * freed * (along - gains.squares * of_run)
    return np.asarray(fitted.residual - fitted.torque * (of_run + of_curve)[gains.curve], dtype=np.float64)
