"""What a trial would show: how far candidates are apart on rows that are not measured yet.

If candidate a is true, a trial shows the torque that a predicts for it; what of the difference d of a's and b's torques
(over all rows, those measured and those to come) b cannot absorb is

    λ_ab = ½ dᵀ V⁻¹ (1 - P_[J_b, U_b]) d      [nats]

with J_b the baseline's sensitivities, those to the law's discrepancy among them, where b has it, U_b those of b's amplitude,
of its smooth shapes unless they are at a bound, and of its model discrepancy, each held by its prior. Rows to come have the
noise of those measured at their torque.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import numpy as np
from scipy.optimize import nnls

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.laws import OPEN_DRAG
from models.diagnosis.baseline.prediction import Prediction, predict
from models.diagnosis.design.design import Design
from models.diagnosis.effects.fitted_effect import factors_at, ranges_of
from models.diagnosis.pooled_fit.gauss_newton import PooledFit
from models.diagnosis.pooled_fit.problem import FitProblem, LawTerms
from models.diagnosis.pooled_fit.projection import Gram, gram_of, project


class CandidateDistances:
    """Distances λ [nats] between candidates, on the measured rows and with rows to come."""

    def __init__(self, problem: FitProblem, fits: tuple[PooledFit, ...]) -> None:
        free = problem.priors.free.copy()
        free[OPEN_DRAG] = True  # a trial with the clutch open brings a drag that no measurement has determined yet
        problem = replace(problem, priors=replace(problem.priors, free=free))
        self._problem, self._fits = problem, fits
        self._ranges = ranges_of(problem.design.rows)
        self._law = _noise_law(problem, fits[0].torque)
        self._measured = self._grams(problem, [fit.prediction for fit in fits])

    def grams_of(self, added: Design) -> list[Gram]:
        """Gram matrices of rows to come, one for each candidate as the alternative that has to imitate the others."""
        predictions = [predict(added, fit.laws) for fit in self._fits]
        # rows to come have the noise of those measured at their torque
        steady = np.arange(added.torque.size) < added.plateaus
        constant, share = np.where(steady[:, None], self._law[0], self._law[1]).T
        torque = _torque(added, predictions[0], self._fits[0])
        noise = replace(self._problem.noise, deviation=np.sqrt((constant + share * torque**2) / added.samples))
        priors = self._problem.priors  # they are in the measured rows already
        none = replace(priors, rows=priors.rows[:0], means=priors.means[:0])
        law = self._problem.law and LawTerms(
            self._problem.law.discrepancy, self._problem.law.discrepancy.columns(added)
        )
        return self._grams(FitProblem(design=added, noise=noise, priors=none, law=law), predictions)

    def distances(self, ahead: Sequence[list[Gram]]) -> FloatArray:
        """Distances λ [k, k] nats with runs to come: of each candidate (row), if it is true, from each other one
        (column)."""
        return self.with_freedom(ahead)[0]

    def with_freedom(self, ahead: Sequence[list[Gram]]) -> tuple[FloatArray, FloatArray]:
        """The distances [k, k] nats, and the complexity term -½ ln det [k] nats of each candidate's free parameters."""
        grams = self._measured
        for more in ahead:
            grams = [_joined(gram, added) for gram, added in zip(grams, more, strict=True)]
        noise = self._problem.noise
        projections = [project(gram, noise.run_gain, noise.curve_gain, noise.law) for gram in grams]
        columns = [0.5 * np.maximum(np.diag(projected.info), 0.0) for projected in projections]
        freedom = [projected.evidence - projected.profile for projected in projections]
        return np.stack(columns, axis=1), np.array(freedom)

    def size_left(self, ahead: Sequence[list[Gram]]) -> float:
        """Ratio of the standard deviation of the first effect's amplitude, in the first candidate, with runs to come to
        that without."""
        place = int(self._problem.priors.free.sum())
        gram, noise, deviations = self._measured[0], self._problem.noise, list[float]()
        for joined in (gram, reduce(_joined, [more[0] for more in ahead], gram)):
            variance = joined.covariance(noise)[place, place]
            deviations.append(float(np.sqrt(max(variance, 0.0))))
        return deviations[1] / max(deviations[0], 1e-300)

    def _grams(self, problem: FitProblem, predictions: Sequence[Prediction]) -> list[Gram]:
        """Gram matrices of the rows, one for each candidate: all candidates' differences from it, and the columns by
        which it can absorb them. Priors are left out for rows that are added to others, which have them already."""
        design, grams = problem.design, list[Gram]()
        torques = [_torque(design, at, fit) for at, fit in zip(predictions, self._fits, strict=True)]
        for fit, prediction, mine in zip(self._fits, predictions, torques, strict=True):
            own, precisions = [], []
            for effect in fit.effects:
                changes = effect.rows(design, prediction)
                discrepancy = changes[:, None] * factors_at(design.rows, effect.effect, self._ranges)
                free = effect.free
                own += [effect.columns(design, prediction)[:, free], discrepancy]
                precisions += [
                    *effect.precisions[free],
                    *[criteria.DISCREPANCY_SD**-2.0] * discrepancy.shape[1],
                ]
            apart = np.stack([torque - mine for torque in torques], axis=1)
            silent = replace(fit, prediction=prediction, torque=mine, residual=np.zeros(mine.size), effects=())
            gram = gram_of(problem, silent, np.concatenate([*own, apart], axis=1))
            if problem.priors.rows.size:
                diagonal = gram.base + np.arange(len(precisions))
                gram.matrix[diagonal, diagonal] += precisions
            grams.append(replace(gram, base=gram.base + len(precisions)))
        return grams


def _torque(design: Design, prediction: Prediction, fit: PooledFit) -> FloatArray:
    """Torque [N] Nm of a candidate at the rows."""
    changes = [effect.rows(design, prediction) for effect in fit.effects]
    return np.asarray(prediction.torque + sum(changes, np.zeros_like(prediction.torque)), dtype=np.float64)


def _joined(first: Gram, second: Gram) -> Gram:
    """The Gram matrix of both designs' rows together: runs are independent."""
    most = max(first.along.shape[1], second.along.shape[1])
    missing = [((0, 0), (0, most - gram.along.shape[1]), (0, 0)) for gram in (first, second)]
    along = [np.pad(gram.along, pad) for gram, pad in zip((first, second), missing, strict=True)]
    overlaps = [np.pad(gram.overlaps, (*pad[:2], pad[1])) for gram, pad in zip((first, second), missing, strict=True)]
    return replace(
        first,
        matrix=first.matrix + second.matrix,
        along=np.concatenate(along),
        overlaps=np.concatenate(overlaps),
    )


def _noise_law(problem: FitProblem, torque: FloatArray) -> FloatArray:
    """Noise coefficients (a², b²) [2, 2] of plateaus and of loops in σ² = (a² + b² M²)/n (`noise.estimate`); a² is at
    least that of noise at a fifth of the usual torque."""
    design = problem.design
    steady = np.arange(design.torque.size) < design.plateaus
    variance = problem.noise.deviation**2 * design.samples
    laws = []
    for part in (steady, ~steady):
        part = part if part.any() else ~part
        columns = np.stack([np.ones(int(part.sum())), torque[part] ** 2], axis=1) / variance[part, None]
        scale = columns.mean(axis=0)
        law = nnls(columns / scale, np.ones(columns.shape[0]))[0] / scale
        # data under torque hardly determine the noise at zero
        laws.append([max(law[0], 0.2**2 * float(np.median(variance[part]))), law[1]])
    return np.array(laws)
