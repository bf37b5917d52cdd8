"""What a trial would tell: how far candidates are apart on rows that are not measured yet.

Were candidate a true, a trial would show the torque that a foretells for it; what of the difference d of a's and b's torques
(over all rows, those measured and those to come) b cannot take up is

    λ_ab = ½ dᵀ V⁻¹ (1 - P_[J_b, U_b]) d      [nats]

with J_b the baseline's sensitivities where b has it, U_b those of b's amplitude, of its smooth shapes unless they are at a
bound, and of what it may be bent by, each held by its prior. Rows to come have the noise of those measured at their torque.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.optimize import nnls

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import OPEN_DRAG
from models.diagnosis.baseline.prediction import Prediction, predict
from models.diagnosis.design.design import Design
from models.diagnosis.design.points import Points
from models.diagnosis.effects.template_discrepancy import BEND, bends
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import (
    Fit,
    Fitted,
    Priors,
    effect_columns,
    effect_precisions,
    effect_rows,
    free_shapes,
)
from models.diagnosis.pooled_fit.projection import Gram, gram_of, project

#: Noise without torque is at least this share of the usual: what was measured under torque only says little of it.
LEAST_NOISE = 0.2
_RANGES = ("velocity", "cycles", "clock")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """What is foretold for some rows: each candidate's prediction and torque [N] Nm, and the noise [N] Nm."""

    design: Design
    predictions: tuple[Prediction, ...]
    torques: tuple[FloatArray, ...]
    deviation: FloatArray


class Foretold:
    """Distances of candidates, on what was measured and with rows to come."""

    def __init__(self, design: Design, noise: Noise, priors: Priors, fits: tuple[Fit, ...]) -> None:
        free = priors.free.copy()
        free[OPEN_DRAG] = True  # a trial with the clutch open brings a drag that nobody knows yet
        priors = replace(priors, free=free)
        self._design, self._noise, self._priors, self._fits = design, noise, priors, fits
        view = _Rows(
            design=design,
            predictions=tuple(fit.prediction for fit in fits),
            torques=tuple(_torque(design, fit.prediction, fit) for fit in fits),
            deviation=noise.deviation,
        )
        self._law = _noise_law(design, noise, fits[0].torque)
        self._known = [self._gram(view, k, priors) for k in range(len(fits))]

    def ahead(self, added: Design) -> list[Gram]:
        """What rows to come would tell, candidate by candidate as the one to be told from."""
        predictions = tuple(predict(added, fit.laws) for fit in self._fits)
        torques = tuple(_torque(added, at, fit) for at, fit in zip(predictions, self._fits, strict=True))
        deviation = _usual_deviation(self._law, added, torques[0])
        view = _Rows(design=added, predictions=predictions, torques=torques, deviation=deviation)
        none = replace(self._priors, rows=self._priors.rows[:0], means=self._priors.means[:0])
        return [self._gram(view, k, none) for k in range(len(self._fits))]

    def distances(self, ahead: Sequence[list[Gram]]) -> FloatArray:
        """λ [k, k] nats of each candidate (row), were it true, against each other one (column), with runs to come."""
        return self.told(ahead)[0]

    def told(self, ahead: Sequence[list[Gram]]) -> tuple[FloatArray, FloatArray]:
        """The same, and [k] nats of what the freedom of each candidate is worth: -½ ln det of all that it has free."""
        grams = self._known
        for more in ahead:
            grams = [_joined(gram, each) for gram, each in zip(grams, more, strict=True)]
        found = [project(gram, self._noise.run_gain, self._noise.curve_gain) for gram in grams]
        columns = [0.5 * np.maximum(np.diag(each.info), 0.0) for each in found]
        return np.stack(columns, axis=1), np.array([each.evidence - each.profile for each in found])

    def _gram(self, view: _Rows, rival: int, priors: Priors) -> Gram:
        """What rows tell of all candidates' differences from a rival, and of what that one can take up; without priors
        where they are added to others, which have them already."""
        fit, prediction = self._fits[rival], view.predictions[rival]
        own, precisions = [], []
        for each in fit.effects:
            changes = effect_rows(view.design, prediction, each)
            bent = changes[:, None] * _bends(self._design, view.design, each)
            free = free_shapes(each)
            own += [effect_columns(view.design, prediction, each)[:, free], bent]
            precisions += [*effect_precisions(each)[free], *[BEND**-2.0] * bent.shape[1]]
        apart = np.stack([torque - view.torques[rival] for torque in view.torques], axis=1)
        silent = replace(
            fit, prediction=prediction, torque=view.torques[rival], residual=np.zeros(apart.shape[0]), effects=()
        )
        columns = np.nan_to_num(np.concatenate([*own, apart], axis=1))
        gram = gram_of(view.design, replace(self._noise, deviation=view.deviation), priors, silent, columns)
        if priors.rows.size:
            diagonal = gram.base + np.arange(len(precisions))
            gram.matrix[diagonal, diagonal] += precisions
        return replace(gram, base=gram.base + len(precisions))


def _torque(design: Design, prediction: Prediction, fit: Fit) -> FloatArray:
    """[N] Nm of a candidate at the rows."""
    changes = [np.nan_to_num(effect_rows(design, prediction, each)) for each in fit.effects]
    return np.asarray(prediction.torque + sum(changes, np.zeros_like(prediction.torque)), dtype=np.float64)


def _bends(known: Design, rows: Design, fitted: Fitted) -> FloatArray:
    """What an effect may be bent by [N, k] at rows, over the ranges of the known ones: beyond them as at their ends."""
    if rows is known:
        return bends(known, fitted.effect)
    count = rows.torque.size
    ends = {name: (getattr(known.rows, name).min(), getattr(known.rows, name).max()) for name in _RANGES}
    cut = replace(rows.rows, **{name: np.clip(getattr(rows.rows, name), *each) for name, each in ends.items()})
    joined = {
        each.name: np.concatenate([getattr(known.rows, each.name), getattr(cut, each.name)]) for each in fields(Points)
    }
    return bends(replace(known, rows=Points(**joined)), fitted.effect)[-count:]


def _joined(first: Gram, second: Gram) -> Gram:
    """Of both designs' rows: runs are independent."""
    runs = int(first.run_of_curve.max()) + 1
    return replace(
        first,
        matrix=first.matrix + second.matrix,
        along=np.concatenate([first.along, second.along]),
        squares=np.concatenate([first.squares, second.squares]),
        run_of_curve=np.concatenate([first.run_of_curve, second.run_of_curve + runs]),
    )


def _noise_law(design: Design, noise: Noise, torque: FloatArray) -> FloatArray:
    """(a², b²) [2, 2] of plateaus and of loops, σ² = (a² + b² M²)/n as `noise.estimate` has it; a² is no less than
    LEAST_NOISE has it."""
    steady = np.arange(design.torque.size) < design.plateaus
    variance = noise.deviation**2 * design.samples
    found = []
    for part in (steady, ~steady):
        part = part if part.any() else ~part
        columns = np.stack([np.ones(int(part.sum())), torque[part] ** 2], axis=1) / variance[part, None]
        scale = columns.mean(axis=0)
        law = nnls(columns / scale, np.ones(columns.shape[0]))[0] / scale
        found.append([max(law[0], LEAST_NOISE**2 * float(np.median(variance[part]))), law[1]])
    return np.array(found)


def _usual_deviation(law: FloatArray, added: Design, torque: FloatArray) -> FloatArray:
    """The noise [n] Nm that rows to come will have."""
    steady = np.arange(added.torque.size) < added.plateaus
    constant, share = np.where(steady[:, None], law[0], law[1]).T
    return np.asarray(np.sqrt((constant + share * torque**2) / added.samples), dtype=np.float64)
