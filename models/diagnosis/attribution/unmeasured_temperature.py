"""What an oil temperature that nobody measured could have done: any slow course, another one in every test.

In a test of duration T the log of the viscosity may follow a_0 + Σ_k a_k cos(2πkt/T) + b_k sin(2πkt/T), k = 1 ... 4, with
normal coefficients whose deviations fall with k; in loops it is one number a test. The viscous term follows it. That
is many columns and no amplitude that could be told, so it is judged by its marginal likelihood alone,

    evidence = ½ sᵀ (I + Λ⁻¹)⁻¹ s - ½ ln det(1 + Λ I)        (s the score, I the information, Λ the prior variances)

averaged over how strongly temperature swings, from test to test and, by itself, within one, and over the gains' scatter, as
every other evidence is: what gains would do as well is no temperature's.
"""

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit, Priors
from models.diagnosis.pooled_fit.projection import Projected, each_projection, gram_of

#: Deviation of ln ν in a test that swings by some 3 K, and the factors on it that are considered from test to test and
#: within a test.
USUAL, BETWEEN, WITHIN = 0.06, (0.5, 1.5, 4.0), (0.0, 0.5, 1.5, 4.0)
_WAVES = 4


def temperature_evidence(design: Design, noise: Noise, priors: Priors, fitted: Fit) -> float:
    """Evidence [nats] of unmeasured courses of oil temperature over none."""
    columns, between, within = _courses(design, fitted)
    gram = gram_of(design, noise, priors, fitted, columns)
    told = [(each.evidence, _averaged(each, between, within)) for each in each_projection(gram, noise)]
    without, gained = np.array(told).T
    return float(logsumexp(without + gained) - logsumexp(without))


def _averaged(projected: Projected, between: FloatArray, within: FloatArray) -> float:
    """Over the strengths."""
    logs = [_marginal(projected, (USUAL * (b * between + w * within)) ** 2) for b in BETWEEN for w in WITHIN]
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


def with_unmeasured(probabilities: dict[str, float], unmeasured: float, best: float, slack: float) -> dict[str, float]:
    """The probabilities with an unmeasured oil temperature of evidence `unmeasured` [nats] beside the others;
    `best` is that of the best candidate, `slack` what its template may be wrong by."""
    share = float(1 / (1 + np.exp(-np.clip((unmeasured - best) / (1.0 + 0.5 * slack), -500, 500))))
    found = {slug: (1 - share) * each for slug, each in probabilities.items() if slug != "oil_temperature"}
    return dict(sorted({**found, "oil_temperature": share}.items(), key=lambda item: -item[1]))
