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

The coefficients of the law's discrepancy are integrated out in the same way, with priors of any sizes τ (`LawSizes`): all
else that is free is projected off first, once for each scatter of the gains, and of each size only the k columns of the law
are projected off what is left. What remains of a change's information beside the law, as a share of what there is of it
beside the exact law, is its isolability

    ι = info(τ)/info(0).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg.lapack import dtrtri
from scipy.special import log_softmax, logsumexp

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_discrepancy import LawDiscrepancy, sizes_considered
from models.diagnosis.baseline.law_form import EXACT, LawSizes, LearnedLaw
from models.diagnosis.noise.covariance import Noise, gains_of, scatter_root, whitened
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, prior_gram, sensitivities
from models.diagnosis.pooled_fit.problem import FitProblem
from models.gaussian_evidence import independent, log_sum


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossed:
    """Inner products of columns [s] that are only screened, one by one: with the other columns, with themselves and
    along the gains."""

    cross: FloatArray  # [m, s]
    squares: FloatArray  # [s]
    along: FloatArray  # [R, k, s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gram:
    """Inner products of whitened columns [m]: first the `laws` columns of the law's discrepancy, then the baseline's
    other free columns (`base` counts both), then changes; the last is the residual."""

    matrix: FloatArray  # [m, m] without gains
    along: FloatArray  # [R, k, m] along the directions of the curves of each run (`noise.covariance.Gains`)
    overlaps: FloatArray  # [R, k, k]
    base: int
    law: LawDiscrepancy | None = None
    laws: int = 0
    screened: Crossed | None = None

    def reduced(self, run_gain: float, curve_gain: float) -> "Reduced":
        """The Gram matrix with the gains (runs' scatter `run_gain`, curves' `curve_gain`) integrated out and the
        baseline's free columns, except the law's, projected off."""
        root = scatter_root(self.overlaps.shape[-1], run_gain, curve_gain)
        factor = np.linalg.cholesky(np.eye(root.shape[1]) + root.T @ self.overlaps @ root)
        removed = np.linalg.solve(factor, root.T @ self.along).reshape(-1, self.matrix.shape[1])
        full = self.matrix - removed.T @ removed
        free = slice(self.laws, self.base)
        left = np.r_[0 : self.laws, self.base : full.shape[0]]
        factored = _Factored.of(full[free, free], 1e-11)
        half = factored.solve(full[free][:, left])
        reduced = Reduced(
            gram=self,
            matrix=full[np.ix_(left, left)] - half.T @ half,
            whole=np.diag(full)[self.base : -1],
            constant=-float(np.log(np.diagonal(factor, axis1=1, axis2=2)).sum()),
            freedom=-0.5 * factored.log_determinant,
            run_gain=run_gain,
            curve_gain=curve_gain,
        )
        if (screened := self.screened) is None:
            return reduced
        of_screened = np.linalg.solve(factor, root.T @ screened.along).reshape(-1, screened.squares.size)
        cross = screened.cross - removed.T @ of_screened
        squares = screened.squares - np.square(of_screened).sum(axis=0)
        own = factored.solve(cross[free])
        return replace(
            reduced,
            cross=cross[left] - half.T @ own,
            squares=squares - np.square(own).sum(axis=0),
            screened_whole=squares,
        )

    def covariance(self, noise: Noise, *, exact: bool = False) -> FloatArray:
        """Covariance [base - laws, base - laws] of the baseline's free parameters beside the law's discrepancy, under a
        noise's gains and sizes of the law, or under the `exact` law."""
        sizes = EXACT if exact else noise.law
        given = replace(self, base=self.laws, screened=None).reduced(noise.run_gain, noise.curve_gain)
        count = self.base - self.laws
        corner = given.beside_law(sizes).info[:count, :count]
        scale = 1 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
        inverse = np.linalg.pinv(corner * scale[:, None] * scale, hermitian=True)
        return np.asarray(inverse * scale[:, None] * scale, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class _Factored:
    """The inverse of a Cholesky factor of a positive matrix [b, b] that was scaled to ones on its diagonal: its products
    with many columns take a tenth of the time of solving for them."""

    inverse: FloatArray
    scale: FloatArray

    @classmethod
    def of(cls, matrix: FloatArray, ridge: float) -> "_Factored":
        """The inverse factor of a matrix [b, b] with a `ridge` on its scaled diagonal: a correlation matrix may be
        singular to rounding, and more of a ridge than rounding would change determinants."""
        scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        factor = np.linalg.cholesky(matrix * scale[:, None] * scale + ridge * np.eye(scale.size))
        return cls(np.asarray(dtrtri(factor, lower=True)[0] if scale.size else factor, dtype=np.float64), scale)

    def solve(self, columns: FloatArray) -> FloatArray:
        """L⁻¹ of columns [b, n]."""
        return np.asarray(self.inverse @ (columns * self.scale[:, None]), dtype=np.float64)

    @property
    def log_determinant(self) -> float:
        """ln det of the matrix [nats]."""
        return -2.0 * float(np.log(np.diag(self.inverse)).sum() + np.log(self.scale).sum())


def gram_of(
    problem: FitProblem,
    fit: PooledFit,
    changes: FloatArray | None = None,
    *,
    screened: FloatArray | None = None,
    exact: bool = True,
) -> Gram:
    """The Gram matrix of a fit, with changes [N, m] at the rows (none if None) and columns [N, s] that are only
    `screened`. The fit's effects count as baseline; where their templates are not `exact`, so do the templates'
    discrepancies."""
    design, noise = problem.design, problem.noise
    nothing = np.zeros((design.torque.size, 0))
    law = nothing if problem.law is None else problem.law.columns
    jacobian = sensitivities(problem, fit)
    off = [] if exact else [effect.discrepancy_columns(design, fit.prediction) for effect in fit.effects]
    columns = [law, jacobian, *off, nothing if changes is None else changes, fit.residual]
    white = whitened(np.column_stack(columns), design, noise)
    gains = gains_of(design, fit.torque, noise)
    matrix, laws = white.T @ white, law.shape[1]
    effect_parts = np.append(laws + np.arange(jacobian.shape[1]), -1)
    matrix[np.ix_(effect_parts, effect_parts)] += prior_gram(problem.priors, fit)
    loose = laws + jacobian.shape[1] + np.arange(sum(columns.shape[1] for columns in off))
    matrix[loose, loose] += criteria.DISCREPANCY_SD**-2.0
    crossed = None
    if screened is not None:
        seen = whitened(screened, design, noise)
        squares = np.einsum("ns,ns->s", seen, seen)
        crossed = Crossed(cross=white.T @ seen, squares=squares, along=gains.along(seen))
    return Gram(
        matrix=matrix,
        along=gains.along(white),
        overlaps=gains.overlaps,
        base=laws + jacobian.shape[1] + loose.size,
        law=None if problem.law is None else problem.law.discrepancy,
        laws=laws,
        screened=crossed,
    )


#: Scatters of the runs' gains [g] that are considered [-].
GAINS: FloatArray = np.geomspace(criteria.LEAST_GAIN, criteria.MOST_GAIN, 13)


@dataclass(frozen=True, slots=True, kw_only=True)
class Screened:
    """Information and score of columns [s] that are screened one by one."""

    info: FloatArray  # [s]
    score: FloatArray  # [s]
    whole: FloatArray  # [s] what info would be if the baseline absorbed nothing of them


@dataclass(frozen=True, slots=True, kw_only=True)
class Projected:
    """Information, score and evidence of changes [m] with the baseline and the law's discrepancy projected off, at one
    scatter of the gains and one size of the discrepancy."""

    info: FloatArray  # [m, m]
    score: FloatArray  # [m]
    whole: FloatArray  # [m] what info's diagonal would be if the baseline absorbed nothing of them
    miss: float  # rᵀV⁻¹(1 - P)r
    evidence: float  # of the gains' scatter and of the law's sizes [nats]
    profile: float  # the same without the determinant of what is fitted
    run_gain: float
    curve_gain: float
    sizes: LawSizes
    log_weight: float  # of the sizes' prior [nats]
    screened: Screened | None = None

    def noise(self, noise: Noise) -> Noise:
        """The noise with this scatter of the gains and these sizes."""
        return replace(noise, run_gain=self.run_gain, curve_gain=self.curve_gain, law=self.sizes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reduced:
    """Gram matrix of the law's columns [k], the changes [m] and the residual at one scatter of the gains, with the
    baseline except the law projected off; and the same of screened columns [s]."""

    gram: Gram
    matrix: FloatArray  # [k + m + 1, k + m + 1]
    whole: FloatArray  # [m]
    constant: float  # -½ ln det of what gains add [nats]
    freedom: float  # -½ ln det of what is fitted [nats]
    run_gain: float
    curve_gain: float
    cross: FloatArray | None = None  # [k + m + 1, s]
    squares: FloatArray | None = None  # [s]
    screened_whole: FloatArray | None = None  # [s]

    def beside_law(self, sizes: LawSizes, log_weight: float = 0.0) -> Projected:
        """The projection with the law's discrepancy of these sizes, of log prior `log_weight`, integrated out."""
        gram, laws = self.gram, self.gram.laws
        deviations = gram.law.form.deviations(sizes) if gram.law is not None else np.zeros(0)
        used = np.flatnonzero(deviations > 0.0)
        scaled = self.matrix[used] * deviations[used, None]
        law = scaled[:, used] * deviations[used]
        factored = _Factored.of(law + np.eye(used.size), 0.0)
        half = factored.solve(scaled[:, laws:])
        left = self.matrix[laws:, laws:] - half.T @ half
        miss = float(left[-1, -1])
        # a controller that comes back to 0.005 bar makes 0.1 %
        prior = log_gain_prior(self.run_gain) - float(np.log1p((self.curve_gain / 1e-3) ** 2)) + log_weight
        profile = -0.5 * (miss + factored.log_determinant) + self.constant + prior
        screened = None
        if self.cross is not None and self.squares is not None and self.screened_whole is not None:
            own = factored.solve(self.cross[used] * deviations[used, None])
            screened = Screened(
                info=np.maximum(self.squares - np.square(own).sum(axis=0), 0.0),
                score=self.cross[-1] - half[:, -1] @ own,
                whole=self.screened_whole,
            )
        return Projected(
            info=left[:-1, :-1],
            score=left[:-1, -1],
            whole=self.whole,
            miss=miss,
            evidence=profile + self.freedom,
            profile=profile,
            run_gain=self.run_gain,
            curve_gain=self.curve_gain,
            sizes=sizes,
            log_weight=log_weight,
            screened=screened,
        )

    def law_coefficients(self, sizes: LawSizes) -> tuple[FloatArray, FloatArray]:
        """Posterior mean [k] and root [k, j] of the covariance of the law's coefficients, all other free parameters
        integrated out."""
        laws = self.gram.laws
        deviations = self.gram.law.form.deviations(sizes) if self.gram.law is not None else np.zeros(0)
        values, vectors = independent(deviations[:, None] * self.matrix[:laws, :laws] * deviations)
        root = deviations[:, None] * vectors / np.sqrt(1.0 + values)
        return root @ (root.T @ self.matrix[:laws, -1]), root


def likely_law_sizes(reduced: Reduced) -> dict[LawSizes, float]:
    """Sizes τ of the law's discrepancy with their log priors [nats], likeliest first: those with more than
    NEGLIGIBLE_SIZES of the posterior at this scatter of the gains.

    Of each component of τ, every value is kept with the likeliest of the others, because it may be likelier beside a
    change."""
    if reduced.gram.law is None:
        return {EXACT: 0.0}
    alone = np.r_[0 : reduced.gram.laws, -1]
    bare = replace(reduced, matrix=reduced.matrix[np.ix_(alone, alone)], whole=np.zeros(0), cross=None)
    known = sizes_considered()
    logs = np.array([bare.beside_law(sizes, log_weight).evidence for sizes, log_weight in known])
    ranked = [known[place] for place in np.argsort(-logs, kind="stable")]
    likely = int(np.count_nonzero(logs > log_sum(logs) + np.log(criteria.NEGLIGIBLE_SIZES)))
    kept = dict(ranked[: max(likely, 1)])
    for axis in range(len(EXACT)):
        seen = {sizes[axis] for sizes in kept}
        for sizes, log_weight in ranked:
            if sizes[axis] not in seen:
                kept[sizes] = log_weight
                seen.add(sizes[axis])
    return kept


def projections_of(gram: Gram, noise: Noise, gains: FloatArray | None = None) -> list[Projected]:
    """Projections at every scatter of the runs' gains in `gains` [g] (GAINS if None), at every scatter of the curves'
    gains up to the next above the noise's, and at the law's likely sizes.

    Where the data ask for no scatter of the curves without an effect, they do not with one: then none is considered."""
    place = int(np.searchsorted(criteria.CURVE_GAINS, noise.curve_gain))  # 0 for none
    curves = criteria.CURVE_GAINS[: place + 2 if place else 1]
    return _projections_on_grid(gram, noise.law, GAINS if gains is None else gains, curves)


def coarse_projections(gram: Gram, noise: Noise) -> list[Projected]:
    """Projections on a coarse grid, for the many refits of a search: at every second of GAINS, at the noise's scatter of
    the curves' gains and at none, and at the law's likely sizes.

    None is considered because an effect may be the reason for the scatter that was estimated without it."""
    return _projections_on_grid(gram, noise.law, GAINS[::2], sorted({noise.curve_gain, 0.0}))


def _projections_on_grid(
    gram: Gram, usual: LawSizes, run_gains: FloatArray, curve_gains: Sequence[float]
) -> list[Projected]:
    """Projections at each scatter of the runs' and of the curves' gains and each of the law's sizes that are likely at
    the best of these scatters beside the sizes `usual`."""
    reduced = [gram.reduced(run_gain, curve_gain) for curve_gain in curve_gains for run_gain in run_gains.tolist()]
    best = max(reduced, key=lambda one: one.beside_law(usual).evidence)
    sizes = likely_law_sizes(best)
    return [one.beside_law(size, log_weight) for size, log_weight in sizes.items() for one in reduced]


def likely_curve_gain(gram: Gram, sizes: LawSizes) -> float:
    """The scatter of the curves' gains [-] of highest evidence beside the law's sizes; 0 unless it is clearly
    likelier."""
    best = [
        max(project(gram, gain, curve, sizes).evidence for gain in GAINS.tolist()) for curve in criteria.CURVE_GAINS
    ]
    likeliest = int(np.argmax(best))
    return criteria.CURVE_GAINS[likeliest] if best[likeliest] > best[0] + criteria.LEAST_CURVE_GAIN_EVIDENCE else 0.0


def project(gram: Gram, run_gain: float, curve_gain: float, sizes: LawSizes = EXACT) -> Projected:
    """The projection at scatter `run_gain` of the runs' gains, `curve_gain` of the curves', and these sizes of the
    law's discrepancy."""
    return gram.reduced(run_gain, curve_gain).beside_law(sizes)


def isolability(problem: FitProblem, fit: PooledFit, changes: FloatArray, sizes: LawSizes) -> FloatArray:
    """Isolability ι [m] of changes [N, m] beside a law's discrepancy of these sizes, at the noise's scatter of the
    gains."""
    reduced = gram_of(problem, fit, screened=changes).reduced(problem.noise.run_gain, problem.noise.curve_gain)
    beside, exact = (reduced.beside_law(size).screened for size in (sizes, EXACT))
    if beside is None or exact is None:
        raise AssertionError("columns that were given are screened")
    shown = exact.info > 1e-9 * exact.whole  # the rest is rounding
    return np.where(shown, beside.info / np.where(shown, exact.info, 1.0), 0.0)


def log_gain_prior(run_gain: float) -> float:
    """ln p_0 of ln σ_g [nats], up to a constant, for the runs' scatter σ_g > 0."""
    off = float(np.log(run_gain / criteria.USUAL_GAIN))
    return -0.5 * (off / (criteria.GAIN_SD_BELOW if off < 0 else criteria.GAIN_SD_ABOVE)) ** 2


def amplitude_deviations(problem: FitProblem, fitted: PooledFit) -> list[float]:
    """Standard deviations of the amplitudes of the fit's effects, all other parameters free."""
    inverse = gram_of(problem, fitted, exact=False).covariance(problem.noise)
    sizes = [0, *(effect.precisions.size for effect in fitted.effects[:-1])]
    places = int(problem.priors.free.sum()) + np.cumsum(sizes)[: len(fitted.effects)]
    return [float(np.sqrt(max(inverse[place, place], 0.0))) for place in places]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunScatter:
    """Relative scatter of the runs' gains [-]: posterior median and 90 % interval, and the information that the data
    add to the prior [nats]."""

    median: float
    lower: float
    upper: float
    information: float

    @property
    def assumed(self) -> bool:
        """Whether the estimate is in effect the prior, because the data add too little information."""
        return self.information < criteria.LEAST_SCATTER_INFORMATION


def run_scatter(projections: Sequence[Projected]) -> RunScatter:
    """Posterior of the runs' gain scatter from projections at every scatter considered (`projections_of`)."""
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


def without_likely_gains(problem: FitProblem, fitted: PooledFit) -> FloatArray:
    """Residual [N] Nm minus the best linear prediction of the gains of runs and curves, r - M ĝ with ĝ = K Mᵀ V⁻¹ r,
    the law taken for exact."""
    noise = problem.noise
    gains = gains_of(problem.design, fitted.torque, noise)
    white = whitened(fitted.residual[:, None], problem.design, noise)
    root = scatter_root(gains.overlaps.shape[-1], noise.run_gain, noise.curve_gain)
    scattered = np.eye(root.shape[1]) + root.T @ gains.overlaps @ root
    likeliest = root @ np.linalg.solve(scattered, root.T @ gains.along(white))
    return np.asarray(fitted.residual - fitted.torque * likeliest.ravel()[gains.curve], dtype=np.float64)


def learned_law(problem: FitProblem, fitted: PooledFit) -> LearnedLaw | None:
    """The posterior mean of the law's discrepancy from a fit's residual r, at the noise's sizes: T (1 + Bᵀ B)⁻¹ Bᵀ
    V^{-1/2} r with B the columns C T whitened beside noise and gains; None where the law is exact."""
    if problem.law is None or problem.noise.law == EXACT:
        return None
    deviations = problem.law.discrepancy.form.deviations(problem.noise.law)
    columns = np.column_stack([problem.law.columns * deviations, fitted.residual])
    products = problem.metric(replace(problem.noise, law=EXACT))(columns)
    coefficients = np.linalg.solve(np.eye(deviations.size) + products[:-1, :-1], products[:-1, -1])
    return LearnedLaw(form=problem.law.discrepancy.form, coefficients=deviations * coefficients)


def law_torque(problem: FitProblem, fitted: PooledFit) -> FloatArray:
    """Torque [N] Nm at the rows of the law's posterior mean discrepancy."""
    learned = learned_law(problem, fitted)
    if learned is None or problem.law is None:
        return np.zeros(fitted.residual.size)
    return np.asarray(problem.law.columns @ learned.coefficients, dtype=np.float64)


def left_over(problem: FitProblem, fitted: PooledFit) -> FloatArray:
    """Residual [N] Nm minus the torque of the law's posterior mean discrepancy and of the likeliest gains."""
    return without_likely_gains(problem, replace(fitted, residual=fitted.residual - law_torque(problem, fitted)))
