"""What every fit and every projection of a campaign is given: the rows, their noise, the priors of the baseline.

Priors are weak, scaled by the data, and rows of the least-squares problem like any other,

    ½ |R θ - m|²,     one row for each parameter, and one for each law whose two shares are expected to drift alike
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_discrepancy import LawDiscrepancy
from models.diagnosis.baseline.law_form import EXACT, LawSizes
from models.diagnosis.baseline.laws import ATTRACTOR, BLOCK, DRIFT, FALL, KAPPA, LOG_DECAY, OPEN_DRAG, SHARES, Frame
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise, Products, metric


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """Normal priors on linear combinations of θ, as rows (combination θ - mean)/sd of the least-squares problem."""

    rows: FloatArray  # [q, θ.size], divided by sd
    means: FloatArray  # [q] likewise
    free: NDArray[np.bool_]  # [θ.size] which entries are fitted at all


def priors_of(design: Design, start: FloatArray, frame: Frame) -> Priors:
    """Weak normal priors on θ, scaled by the campaign's torque, speeds and life; parameters that the campaign cannot
    determine at all are held fixed."""
    size = start.size
    level = design.usual_torque
    fastest = 2.0 * frame.reference_velocity
    sds, means = np.full(size, np.nan), start.copy()
    for block, spread in zip(range(0, LOG_DECAY, BLOCK), (10 * level, 3.0, 3 * fastest, 10 * level), strict=True):
        sds[block : block + BLOCK] = [spread, spread, 1.5, 1.5, 1.5, 0.7]
        means[block + 2 : block + BLOCK] = [0.0, 0.0, np.log(0.5 * design.facts.life), np.log(0.8)]
    sds[FALL], means[FALL] = (0.7, 1.2), (np.log(0.6 * frame.span), np.log(criteria.USUAL_CURVATURE))
    sds[DRIFT:ATTRACTOR], means[DRIFT:ATTRACTOR] = (0.6, 0.4, 0.3), 0.0
    # friction may follow at once: one wide prior, and a step of deviation 1 from pressure to pressure
    sds[KAPPA], means[KAPPA] = 1.0, 0.0
    sds[KAPPA.start], means[KAPPA.start] = 3.0, np.log(12 * level)
    sds[OPEN_DRAG], means[OPEN_DRAG] = criteria.DRAG_SD * level, 0.0
    rows = np.diag(1 / sds)
    nodes = np.arange(size)[KAPPA]
    rows[nodes[1:], nodes[:-1]] = -1.0
    alike = np.zeros((4, size))
    for k in range(4):
        alike[k, k * BLOCK :][SHARES] = 1 / criteria.ALIKE_SD, -1 / criteria.ALIKE_SD
    return Priors(
        rows=np.concatenate([rows, alike]),
        means=np.concatenate([means / sds, np.zeros(4)]),
        free=_free(design, size),
    )


def _free(design: Design, size: int) -> NDArray[np.bool_]:
    """Mask [size] of the parameters θ that the campaign's states, pressures and loops can determine; the others stay
    at their priors."""
    closed = design.closed
    states, levels = np.unique(design.rows.cycles[closed]).size, design.levels.size
    loop_states = np.unique(design.rows.cycles[design.plateaus :][closed[design.plateaus :]]).size
    free = np.ones(size, dtype=np.bool_)
    for block in range(0, LOG_DECAY, BLOCK):
        free[block + 1] = levels > 1
        free[block + 2 : block + 4] = states > 1, states > 1 and levels > 1
        free[block + 4 : block + 6] = states > 2
    free[FALL] = levels > 2, levels > 3
    free[DRIFT:ATTRACTOR] = loop_states > 1, loop_states > 2, loop_states > 1 and levels > 1
    free[OPEN_DRAG] = not closed.all()
    return free


@dataclass(frozen=True, slots=True)
class LawTerms:
    """The law's discrepancy at the rows of a design."""

    discrepancy: LawDiscrepancy
    columns: FloatArray  # [N, k] Nm per unit coefficient

    def scaled(self, sizes: LawSizes) -> FloatArray:
        """C T [N, k] Nm: the columns times the coefficients' deviations, without those that are 0."""
        deviations = self.discrepancy.form.deviations(sizes)
        return self.columns[:, deviations > 0.0] * deviations[deviations > 0.0]


@dataclass(frozen=True, slots=True, kw_only=True)
class FitProblem:
    """The least-squares problem of a campaign: rows, noise, priors and the law's discrepancy."""

    design: Design  # rows and measured torque
    noise: Noise  # their covariance
    priors: Priors
    fitted: FloatArray | None = None  # the torque [N] Nm of a fit, None before there is one
    law: LawTerms | None = None  # the law's discrepancy, None while eq. 3 is taken for exact

    @property
    def gained(self) -> FloatArray:
        """The torque [N] Nm that gains multiply. It is the same in all fits of a problem, so that their costs compare.

        Not the measured one where a fit is at hand: a gain of it shrinks its noise and all structure as well, and to gains
        that scatter by 2 % so much was worth 14 % less torque in every run.
        """
        return self.design.torque if self.fitted is None else self.fitted

    def with_noise(self, noise: Noise) -> "FitProblem":
        """The problem with its rows and priors under another noise."""
        return replace(self, noise=noise)

    @property
    def exact(self) -> "FitProblem":
        """The problem with the law taken for exact."""
        return replace(self, law=None, noise=replace(self.noise, law=EXACT))

    def metric(self, noise: Noise | None = None) -> Products:
        """The inner product under V⁻¹, of the problem's noise or of another one."""
        noise = noise or self.noise
        return metric(self.design, self.gained, noise, None if self.law is None else self.law.scaled(noise.law))
