"""What is visible of a change of torque once the baseline, the noise and the gains have absorbed their part.

The baseline's sensitivities J, changes of torque g and the residual r are whitened once, in one Gram matrix. For any scatter
of the gains, σ_g of the runs and σ_c of the curves, it follows by small corrections (Woodbury), and projecting J off is one
solve:

    info = Gᵀ V⁻¹ (1 - P) G,     score = Gᵀ V⁻¹ (1 - P) r

z = score/√info is standard normal where there is no effect; ½ info a² is λ, the expected log-likelihood ratio [nats] of
an effect of amplitude a. The marginal likelihood of σ_g (what is fitted is integrated out, so gains that the laws over life
absorb are no evidence of a small scatter), summed over σ_c, gives the scatter of gains from run to run with its uncertainty,

    p(ln σ_g) ∝ p(residual | σ_g) p_0(ln σ_g)

with p_0 the prior of `criteria`. What data say beyond it is I = Σ p ln(p/p_0) nats; where that is less than
LEAST_SCATTER_INFORMATION the estimate is the prior, and said to be.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import log_softmax, logsumexp

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.noise.covariance import Noise, gains_of, scatter_root, whitened
from models.diagnosis.pooled_fit.gauss_newton import Fit, prior_gram, sensitivities
from models.diagnosis.pooled_fit.problem import FitProblem


@dataclass(frozen=True, slots=True, kw_only=True)
class Gram:
    """Inner products of whitened columns [m], the first `base` of them the baseline's, the last the residual."""

    matrix: FloatArray  # [m, m] without gains
    along: FloatArray  # [R, k, m] along the directions of the curves of each run (`noise.covariance.Gains`)
    overlaps: FloatArray  # [R, k, k]
    base: int

    def with_gains(self, run_gain: float, curve_gain: float) -> tuple[FloatArray, float]:
        """The matrix with gains that scatter so, and the log determinant of what they add [nats, twice]."""
        root = scatter_root(self.overlaps.shape[-1], run_gain, curve_gain)
        factor = np.linalg.cholesky(np.eye(root.shape[1]) + root.T @ self.overlaps @ root)
        removed = np.linalg.solve(factor, root.T @ self.along).reshape(-1, self.matrix.shape[1])
        added = 2.0 * np.log(np.diagonal(factor, axis1=1, axis2=2)).sum()
        return self.matrix - removed.T @ removed, float(added)

    def covariance(self, run_gain: float, curve_gain: float) -> FloatArray:
        """[base, base] of all that the baseline has free, with gains that scatter so."""
        corner = self.with_gains(run_gain, curve_gain)[0][: self.base, : self.base]
        scale = 1 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
        inverse = np.linalg.pinv(corner * scale[:, None] * scale, hermitian=True)
        return np.asarray(inverse * scale[:, None] * scale, dtype=np.float64)


def gram_of(problem: FitProblem, fit: Fit, changes: FloatArray | None = None, *, exact: bool = True) -> Gram:
    """The Gram matrix of a fit (its effects belong to the baseline then) and changes [N, m] at the rows, none if None.
    Where templates are not `exact` their discrepancies belong to the baseline too."""
    design, noise = problem.design, problem.noise
    changes = np.zeros((design.torque.size, 0)) if changes is None else changes
    jacobian = sensitivities(problem, fit)
    off = [] if exact else [effect.discrepancy_columns(design, fit.prediction) for effect in fit.effects]
    white = whitened(np.column_stack([jacobian, *off, changes, fit.residual]), design, noise)
    gains = gains_of(design, fit.torque, noise)
    matrix = white.T @ white
    effect_parts = np.append(np.arange(jacobian.shape[1]), -1)
    matrix[np.ix_(effect_parts, effect_parts)] += prior_gram(problem.priors, fit)
    loose = jacobian.shape[1] + np.arange(sum(columns.shape[1] for columns in off))
    matrix[loose, loose] += criteria.DISCREPANCY_SD**-2.0
    return Gram(
        matrix=matrix,
        along=gains.along(white),
        overlaps=gains.overlaps,
        base=jacobian.shape[1] + loose.size,
    )


#: Scatters of the runs' gains [g] that are considered [-].
GAINS: FloatArray = np.geomspace(criteria.LEAST_GAIN, criteria.MOST_GAIN, 13)


@dataclass(frozen=True, slots=True, kw_only=True)
class Projected:
    """What is left of changes [m] once the baseline is projected off, at one scatter of the gains."""

    info: FloatArray  # [m, m]
    score: FloatArray  # [m]
    whole: FloatArray  # [m] what info's diagonal would be if the baseline absorbed nothing of them
    miss: float  # rᵀV⁻¹(1 - P)r
    evidence: float  # of the gains' scatter [nats]
    profile: float  # the same without the determinant of what is fitted
    run_gain: float
    curve_gain: float

    def noise(self, noise: Noise) -> Noise:
        """The noise with this scatter of the gains."""
        return replace(noise, run_gain=self.run_gain, curve_gain=self.curve_gain)


def projections_of(gram: Gram, noise: Noise) -> Iterator[Projected]:
    """With every scatter of the gains that is considered, one after the other: of the runs' gains, and of the curves' up to
    what the noise has or next above. Where the data ask for none of the latter without an effect, they do not with one."""
    place = int(np.searchsorted(criteria.CURVE_GAINS, noise.curve_gain))  # 0 for none
    curves = criteria.CURVE_GAINS[: place + 2 if place else 1]
    return (project(gram, gain, curve) for curve in curves for gain in GAINS.tolist())


def likely_curve_gain(gram: Gram) -> float:
    """The likeliest scatter of the curves' gains; none where another is not clearly likelier."""
    best = [max(project(gram, gain, curve).evidence for gain in GAINS.tolist()) for curve in criteria.CURVE_GAINS]
    likeliest = int(np.argmax(best))
    return criteria.CURVE_GAINS[likeliest] if best[likeliest] > best[0] + criteria.LEAST_CURVE_GAIN_EVIDENCE else 0.0


def project(gram: Gram, run_gain: float, curve_gain: float) -> Projected:
    """With the runs' gains scattering by `run_gain`, those of the curves by `curve_gain` besides."""
    full, added = gram.with_gains(run_gain, curve_gain)
    base = gram.base
    corner = full[:base, :base]
    scale = 1 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
    # a correlation matrix may be singular to rounding: where it is none more would change determinants unseen
    factor = np.linalg.cholesky(corner * scale[:, None] * scale + 1e-11 * np.eye(base))
    half = np.linalg.solve(factor, full[:base, base:] * scale[:, None])
    left = full[base:, base:] - half.T @ half
    fitted = float(np.log(np.diag(factor)).sum() - np.log(scale).sum())
    miss = float(left[-1, -1])
    # a controller that comes back to 0.005 bar makes 0.1 %
    prior = log_gain_prior(run_gain) - float(np.log1p((curve_gain / 1e-3) ** 2))
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
    off = float(np.log(run_gain / criteria.USUAL_GAIN))
    return -0.5 * (off / (criteria.GAIN_SD_BELOW if off < 0 else criteria.GAIN_SD_ABOVE)) ** 2


def amplitude_deviations(problem: FitProblem, fitted: Fit) -> list[float]:
    """Standard deviations of the amplitudes of the fit's effects, everything else free."""
    gram = gram_of(problem, fitted, exact=False)
    inverse = gram.covariance(problem.noise.run_gain, problem.noise.curve_gain)
    sizes = [0, *(effect.precisions.size for effect in fitted.effects[:-1])]
    places = int(problem.priors.free.sum()) + np.cumsum(sizes)[: len(fitted.effects)]
    return [float(np.sqrt(max(inverse[place, place], 0.0))) for place in places]


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
        return self.information < criteria.LEAST_SCATTER_INFORMATION


def run_scatter(projections: Sequence[Projected]) -> RunScatter:
    """The estimate from projections at every scatter that is considered (`projections_of`)."""
    gains = np.unique([projected.run_gain for projected in projections])
    by_gain = [
        float(logsumexp([projected.evidence for projected in projections if projected.run_gain == gain]))
        for gain in gains
    ]
    logs = np.linspace(np.log(gains[0]), np.log(gains[-1]), 601)
    posterior = log_softmax(CubicSpline(np.log(gains), by_gain)(logs))
    prior = log_softmax(np.array([log_gain_prior(gain) for gain in np.exp(logs).tolist()]))
    lower, median, upper = np.exp(np.interp((0.05, 0.5, 0.95), np.cumsum(np.exp(posterior)), logs)).tolist()
    information = float(np.exp(posterior) @ (posterior - prior))
    return RunScatter(median=median, lower=lower, upper=upper, information=information)


def without_likely_gains(problem: FitProblem, fitted: Fit) -> FloatArray:
    """The residual [N] Nm less what the likeliest gains of runs and curves make of it: r - M ĝ with the best linear
    prediction ĝ = K Mᵀ V⁻¹ r."""
    noise = problem.noise
    gains = gains_of(problem.design, fitted.torque, noise)
    white = whitened(fitted.residual[:, None], problem.design, noise)
    root = scatter_root(gains.overlaps.shape[-1], noise.run_gain, noise.curve_gain)
    scattered = np.eye(root.shape[1]) + root.T @ gains.overlaps @ root
    likeliest = root @ np.linalg.solve(scattered, root.T @ gains.along(white))
    return np.asarray(fitted.residual - fitted.torque * likeliest.ravel()[gains.curve], dtype=np.float64)
