"""Evidence of an oil temperature that was not measured: any slow course, a different one in every test.

In a test of duration T the log of the viscosity may follow a_0 + Σ_k a_k cos(2πkt/T) + b_k sin(2πkt/T), k = 1 ... 4, with
normal coefficients whose deviations fall with k; in loops it is one number a test. The viscous term follows it. That
is many columns and no single amplitude to estimate, so it is judged by its marginal likelihood alone,

    evidence = ½ sᵀ (I + Λ⁻¹)⁻¹ s - ½ ln det(1 + Λ I)        (s the score, I the information, Λ the prior variances)

averaged over how strongly temperature varies, from test to test and separately within a test, and over the gains'
scatter, as every other evidence is: what gains explain as well is no evidence of a temperature.
"""

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.criteria import CHANGES_BETWEEN_TESTS, CHANGES_WITHIN_TESTS, USUAL_VISCOSITY_CHANGE
from models.diagnosis.design.design import Design
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.gram import gram_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Projected, projections_of

#: Harmonics of a test's duration.
_WAVES = 4


def temperature_evidence(problem: FitProblem, fitted: Fit) -> float:
    """Evidence [nats] of unmeasured courses of oil temperature over none."""
    columns, between, within = _courses(problem.design, fitted)
    gram = gram_of(problem, fitted, columns)
    evidences = [
        (projected.evidence, _averaged(projected, between, within)) for projected in projections_of(gram, problem.noise)
    ]
    without, gained = np.array(evidences).T
    return float(logsumexp(without + gained) - logsumexp(without))


def _averaged(projected: Projected, between: FloatArray, within: FloatArray) -> float:
    """Over the strengths."""
    logs = [
        _marginal(projected, (USUAL_VISCOSITY_CHANGE * (b * between + w * within)) ** 2)
        for b in CHANGES_BETWEEN_TESTS
        for w in CHANGES_WITHIN_TESTS
    ]
    return float(logsumexp(logs) - np.log(len(logs)))


def _courses(design: Design, fitted: Fit) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns [N, m] of torque and their relative deviations [m] from test to test and within a test."""
    viscous = fitted.prediction.change_at_rows(design, fitted.prediction.scene.viscous, before_lag=True)
    columns, relative = [], []
    for run in np.unique(design.rows.run):
        here = design.rows.run == run
        own = np.where(here, viscous, 0.0)
        columns.append(own)
        relative.append(0.0)
        if not design.rows.steady[here].all():
            continue
        turn = 2 * np.pi * design.rows.clock / max(float(np.ptp(design.rows.clock[here])), 1e-9)
        for k in range(1, _WAVES + 1):
            columns += [own * np.cos(k * turn), own * np.sin(k * turn)]
            relative += [1.0 / k, 1.0 / k]
    within = np.array(relative)
    return np.stack(columns, axis=1), np.where(within == 0, 1.0, 0.0), within


def _marginal(projected: Projected, variances: FloatArray) -> float:
    """The formula above."""
    root = np.sqrt(variances)
    unit = root[:, None] * projected.info * root
    score = root * projected.score
    factor = np.linalg.cholesky(np.eye(root.size) + 0.5 * (unit + unit.T))
    half = solve_triangular(factor, score, lower=True)
    return float(0.5 * (half**2).sum() - np.log(np.diag(factor)).sum())
