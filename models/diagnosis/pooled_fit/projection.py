"""What is visible of a change of torque once the baseline, the noise and the gains have absorbed their part.

All columns (the baseline's sensitivities J, the changes g, the residual r) are in one Gram matrix (`pooled_fit.gram`). For
any scatter of the gains, projecting J off is one solve:

    info = Gᵀ V⁻¹ (1 - P) G,     score = Gᵀ V⁻¹ (1 - P) r

z = score/√info is standard normal where there is no effect; ½ info a² is λ, the expected log-likelihood ratio [nats] of
an effect of amplitude a.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.criteria import (
    CURVE_GAINS,
    GAIN_SD_ABOVE,
    GAIN_SD_BELOW,
    LEAST_CURVE_GAIN_EVIDENCE,
    LEAST_GAIN,
    MORE_CURVE_GAIN,
    MOST_GAIN,
    SMALL_CURVE_GAIN,
    USUAL_GAIN,
)
from models.diagnosis.effects.template_discrepancy import discrepancy_factors
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.pooled_fit.gram import Gram, gram_of
from models.diagnosis.pooled_fit.problem import FitProblem

#: Scatters of the runs' gains [g] that are considered [-].
GAINS: FloatArray = np.geomspace(LEAST_GAIN, MOST_GAIN, 13)


@dataclass(frozen=True, slots=True, kw_only=True)
class Projected:
    """info [m, m], score [m] of the changes, and `whole` [m], what info's diagonal would be if the baseline absorbed nothing
    of them; `miss` rᵀV⁻¹(1 - P)r; `evidence` [nats] of the gains' scatter (`run_gain`, `curve_gain`), and `profile`
    [nats] the same without the determinant of what is fitted."""

    info: FloatArray
    score: FloatArray
    whole: FloatArray
    miss: float
    evidence: float
    profile: float
    run_gain: float
    curve_gain: float

    def noise(self, noise: Noise) -> Noise:
        """The noise with this scatter of the gains."""
        return replace(noise, run_gain=self.run_gain, curve_gain=self.curve_gain)


def projections_of(gram: Gram, noise: Noise) -> Iterator[Projected]:
    """With every scatter of the gains that is considered, one after the other: of the runs' gains, and of the curves' up to
    what the noise has or next above. Where the data ask for none of the latter without an effect, they do not with one."""
    curves = [gain for gain in CURVE_GAINS if gain <= MORE_CURVE_GAIN * noise.curve_gain]
    return (project(gram, gain, curve) for curve in curves for gain in GAINS.tolist())


def likely_curve_gain(gram: Gram) -> float:
    """The likeliest scatter of the curves' gains; none where another is not clearly likelier."""
    best = [max(project(gram, gain, curve).evidence for gain in GAINS.tolist()) for curve in CURVE_GAINS]
    likeliest = int(np.argmax(best))
    return CURVE_GAINS[likeliest] if best[likeliest] > best[0] + LEAST_CURVE_GAIN_EVIDENCE else 0.0


def project(gram: Gram, run_gain: float, curve_gain: float) -> Projected:
    """With the runs' gains scattering by `run_gain`, those of the curves by `curve_gain` besides."""
    full, added = gram.with_gains(run_gain, curve_gain)
    base = gram.base
    corner = full[:base, :base]
    scale = 1 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
    factor = _factor(corner * scale[:, None] * scale)
    half = np.linalg.solve(factor, full[:base, base:] * scale[:, None])
    left = full[base:, base:] - half.T @ half
    fitted = float(np.log(np.diag(factor)).sum() - np.log(scale).sum())
    miss = float(left[-1, -1])
    prior = log_gain_prior(run_gain) - float(np.log1p((curve_gain / SMALL_CURVE_GAIN) ** 2))
    profile = -0.5 * (miss + added) + prior
    return Projected(
        info=left[:-1, :-1],
        score=left[:-1, -1],
        whole=np.diag(full)[base:-1],
        miss=miss,
        evidence=profile - fitted,
        profile=profile,
        run_gain=run_gain,
        curve_gain=curve_gain,
    )


def log_gain_prior(run_gain: float) -> float:
    """ln p_0 of ln σ_g [nats], up to a constant, for the runs' scatter σ_g > 0."""
    off = float(np.log(run_gain / USUAL_GAIN))
    return -0.5 * (off / (GAIN_SD_BELOW if off < 0 else GAIN_SD_ABOVE)) ** 2


def _factor(correlation: FloatArray) -> FloatArray:
    """The Cholesky factor of a correlation matrix that may be singular to rounding."""
    for jitter in (1e-11, 1e-8, 1e-5):
        try:
            return np.asarray(np.linalg.cholesky(correlation + jitter * np.eye(correlation.shape[0])))
        except np.linalg.LinAlgError:
            continue
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(np.linalg.cholesky((vectors * np.maximum(values, 1e-5)) @ vectors.T + 1e-7 * np.eye(values.size)))


def amplitude_deviations(problem: FitProblem, fitted: Fit) -> list[float]:
    """Standard deviations of the amplitudes of the fit's effects, everything else free."""
    gram = gram_of(problem, fitted)
    corner = gram.with_gains(problem.noise.run_gain, problem.noise.curve_gain)[0][: gram.base, : gram.base]
    scale = 1 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
    inverse = np.linalg.pinv(corner * scale[:, None] * scale, hermitian=True) * scale[:, None] * scale
    sizes = [1 + sum(shape.smooth for shape in effect.effect.shapes) for effect in fitted.effects]
    discrepancies = sum(discrepancy_factors(problem.design, effect.effect).shape[1] for effect in fitted.effects)
    places = gram.base - discrepancies - sum(sizes) + np.concatenate([[0], np.cumsum(sizes)])[: len(sizes)].astype(int)
    return [float(np.sqrt(max(inverse[place, place], 0.0))) for place in places]
