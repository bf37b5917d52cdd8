"""What is visible of a change of torque once the baseline, the noise and the gains have had their say.

All columns (the baseline's sensitivities J, the changes g, the residual r) meet in one Gram matrix of whitened rows. For
any scatter of the gains, σ_g of the runs and σ_c of the curves, it follows by small corrections (Woodbury), and projecting
J off is one solve:

    info = Gᵀ V⁻¹ (1 - P) G,     score = Gᵀ V⁻¹ (1 - P) r

z = score/√info is standard normal where there is no effect; ½ info a² is λ, the expected log-likelihood ratio [nats] of
an effect of amplitude a.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.baseline.prediction import Prediction
from models.diagnosis.design.design import Design
from models.diagnosis.design.points import IntArray
from models.diagnosis.effects import amplitude_prior
from models.diagnosis.effects.template_discrepancy import BEND, bent_columns
from models.diagnosis.noise.covariance import Noise, by_curve, gains_of, whitened
from models.diagnosis.pooled_fit.gauss_newton import Fit, Priors, effect_columns, effect_precisions

#: Scatter of the gain that is considered [-], and its prior: log-normal about a usual one, narrower above it, for a rig that
#: repeats itself that badly would not be used; what swings by more from test to test is structure.
GAINS: FloatArray = np.geomspace(2e-4, 2e-2, 13)
_USUAL, _BELOW, _ABOVE = 2.5e-3, 1.0, 0.6
#: Scatter of the curves' gains within a run, and the size from which it is thought less and less likely [-].
CURVE_GAINS = (0.0, 4e-4, 1e-3, 2.5e-3, 6e-3)
_SMALL = 1e-3
#: What it must be likelier by [nats] than none to be looked at, and up to which multiple of it more are.
CLEARER, MORE = 0.5, 2.6


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Projected:
    """info [m, m], score [m] of the changes, and `whole` [m], what info's diagonal were if nothing of them was taken up;
    `miss` rᵀV⁻¹(1 - P)r; `evidence` [nats] of the gains' scatter (`run_gain`, `curve_gain`), and `profile`
    [nats] the same without the price of what is fitted."""

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


def gram_of(design: Design, noise: Noise, priors: Priors, fit: Fit, changes: FloatArray, *, held: bool = True) -> Gram:
    """The Gram matrix of a fit (its effects belong to the baseline then) and changes [N, m] at the rows; `held` whether the
    priors of the effects' amplitudes hold: what is left of a fit is not what a prior kept it from."""
    own = [effect_columns(design, fit.prediction, each) for each in fit.effects]
    bent = [bent_columns(design, fit.prediction, each) for each in fit.effects]
    jacobian = np.concatenate([fit.prediction.jacobian(design)[:, priors.free], *own, *bent], axis=1)
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
    for each, columns in zip(fit.effects, own, strict=True):
        precisions = effect_precisions(each)
        precisions[0] *= float(held)
        diagonal = np.arange(at, at + columns.shape[1])
        matrix[diagonal, diagonal] += precisions
        matrix[at, -1] -= precisions[0] * each.amplitude
        matrix[-1, at] -= precisions[0] * each.amplitude
        matrix[-1, -1] += 2.0 * float(held) * amplitude_prior.cost(each.effect, each.amplitude)
        at += columns.shape[1]
    diagonal = np.arange(at, base)
    matrix[diagonal, diagonal] += BEND**-2.0
    return Gram(
        matrix=matrix, along=by_curve(white, gains), squares=gains.squares, run_of_curve=gains.run_of_curve, base=base
    )


def projections_of(gram: Gram, noise: Noise) -> list[Projected]:
    """With every scatter of the gains that is considered, see `each_projection`."""
    return list(each_projection(gram, noise))


def each_projection(gram: Gram, noise: Noise) -> Iterator[Projected]:
    """One after the other: of the runs' gains, and of the curves' up to what the noise has or next above. Where the data ask
    for none of the latter without an effect, they do not with one."""
    curves = [each for each in CURVE_GAINS if each <= MORE * noise.curve_gain]
    return (project(gram, gain, curve) for curve in curves for gain in GAINS.tolist())


def likely_curve_gain(gram: Gram) -> float:
    """The likeliest scatter of the curves' gains; none where another is not clearly likelier."""
    best = [max(project(gram, gain, curve).evidence for gain in GAINS.tolist()) for curve in CURVE_GAINS]
    likeliest = int(np.argmax(best))
    return CURVE_GAINS[likeliest] if best[likeliest] > best[0] + CLEARER else 0.0


def project(gram: Gram, run_gain: float, curve_gain: float) -> Projected:
    """With the runs' gains scattering by `run_gain`, those of the curves by `curve_gain` besides."""
    full, swell = gram.with_gains(run_gain, curve_gain)
    base = gram.base
    corner = full[:base, :base]
    scale = 1 / np.sqrt(np.maximum(np.diag(corner), 1e-300))
    factor = _factor(corner * scale[:, None] * scale)
    half = np.linalg.solve(factor, full[:base, base:] * scale[:, None])
    left = full[base:, base:] - half.T @ half
    fitted = float(np.log(np.diag(factor)).sum() - np.log(scale).sum())
    miss = float(left[-1, -1])
    off = float(np.log(run_gain / _USUAL))
    prior = -0.5 * (off / (_BELOW if off < 0 else _ABOVE)) ** 2 - float(np.log1p((curve_gain / _SMALL) ** 2))
    profile = -0.5 * (miss + swell) + prior
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


def _factor(correlation: FloatArray) -> FloatArray:
    """The Cholesky factor of a correlation matrix that may be singular to rounding."""
    for jitter in (1e-11, 1e-8, 1e-5):
        try:
            return np.asarray(np.linalg.cholesky(correlation + jitter * np.eye(correlation.shape[0])))
        except np.linalg.LinAlgError:
            continue
    values, vectors = np.linalg.eigh(correlation)
    return np.asarray(np.linalg.cholesky((vectors * np.maximum(values, 1e-5)) @ vectors.T + 1e-7 * np.eye(values.size)))


def change_columns(design: Design, prediction: Prediction, changes: list[tuple[FloatArray, bool]]) -> FloatArray:
    """Changes at the points, each with whether it comes before the lag -> [N, m] at the rows."""
    out = np.zeros((design.torque.size, len(changes)))
    for before in (True, False):
        chosen = [i for i, (_, flag) in enumerate(changes) if flag is before]
        if chosen:
            stacked = np.stack([changes[i][0] for i in chosen], axis=1)
            out[:, chosen] = prediction.change_at_rows(design, stacked, before_lag=before)
    return out
