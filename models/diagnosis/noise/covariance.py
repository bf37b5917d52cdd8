"""Rows whitened: noise along a run, and gains that scatter from run to run and from curve to curve.

    V = D R D + σ_c² Σ_curves m mᵀ + σ_g² Σ_runs m mᵀ + C T² Cᵀ

C T are the columns of the law's discrepancy, if there are any (`baseline.law_discrepancy`). D holds the deviation of each
row, R the correlation of neighbours in a run, w ρ^{|i - j|} off the diagonal, m is the predicted torque on the curve's
(run's) rows. R is an ARMA(1, 1) process, whitened by its recursive filter; the gains are a few directions a run (Woodbury).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_form import EXACT, LawSizes
from models.diagnosis.design.autocorrelation import Correlation, arma
from models.diagnosis.design.design import Design, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """The covariance of the rows, as its parts: deviations, correlations, scatter of gains and sizes of the law's
    discrepancy."""

    deviation: FloatArray  # of each row [N] Nm
    plateaus: Correlation  # along plateaus
    loops: Correlation  # along a loop's bins
    run_gain: float  # relative gain scatter of runs, and of curves [-]
    curve_gain: float
    law: LawSizes = EXACT  # of its discrepancy


def whitened(columns: FloatArray, design: Design, noise: Noise) -> FloatArray:
    """Columns [N, m] whitened by R^{-1/2} D^{-1}: deviations and correlation along a run, without the gains."""
    out = columns / noise.deviation[:, None]
    for rows in design.chains:
        first, last = int(rows[0, 0]), int(rows[-1, -1])
        correlation = noise.plateaus if first < design.plateaus else noise.loops
        if correlation.decay == 0.0 or correlation.share == 0.0:
            continue
        if last - first + 1 == rows.size:  # consecutive rows are filtered in place
            _filter(out[first : last + 1].reshape(*rows.shape, -1), correlation)
        else:
            blocks = out[rows]
            _filter(blocks, correlation)
            out[rows] = blocks
    return out


def _filter(blocks: FloatArray, correlation: Correlation) -> None:
    """Whiten blocks [b, n, m] along n, in place."""
    from scipy.signal import lfilter  # start-up time

    theta, scale = arma(correlation)
    first = blocks[:, :1]
    start = -correlation.decay / scale * first - theta * first  # as if the first innovation were all of x_0
    numerator = [1.0 / scale, -correlation.decay / scale]
    blocks[:, 1:] = lfilter(numerator, [1.0, theta], blocks[:, 1:], axis=1, zi=start)[0]


#: Turns columns [N, m] into their inner products [m, m].
Products: TypeAlias = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Whitened torque of each curve of each run: R runs, k curves of a run at most (neighbours share a gain beyond
    MOST_GAINS). A curve reaches into the rows after it,
    as noise does: with whitened torque cut at its ends, gains of 0.25 % on a rig of 0.1 % of noise passed for structure."""

    curve: IntArray  # [N] of the row, among all R k
    directions: csr_array  # [R k, N]
    overlaps: FloatArray  # [R, k, k] their inner products

    def along(self, columns: FloatArray) -> FloatArray:
        """Inner products [R, k, m] with whitened columns [N, m]."""
        return np.reshape(self.directions @ columns, (*self.overlaps.shape[:2], columns.shape[1]))


def gains_of(design: Design, torque: FloatArray, noise: Noise) -> Gains:
    """The whitened gain directions of runs and curves for the predicted torque [N] Nm."""
    run, runs = design.rows.run, int(design.rows.run.max()) + 1
    pairs = np.unique(np.stack([run, design.curve]), axis=1)[0]  # curves are numbered run by run, by pressure
    own = np.bincount(pairs, minlength=runs)
    place = design.curve - (np.cumsum(own) - own)[run]
    place = place * np.minimum(own, criteria.MOST_GAINS)[run] // own[run]
    count = int(place.max()) + 1
    white = whitened(np.where(place[:, None] == np.arange(count), torque[:, None], 0.0), design, noise)
    row, column = np.nonzero(white)
    directions = csr_array((white[row, column], (run[row] * count + column, row)), shape=(runs * count, torque.size))
    overlaps = np.stack([white[run == number].T @ white[run == number] for number in range(runs)])
    return Gains(curve=run * count + place, directions=directions, overlaps=overlaps)


def scatter_root(curves: int, run_gain: float, curve_gain: float) -> FloatArray:
    """Root [k, j] of the covariance K = σ_c² + σ_g² 11ᵀ of the gains of a run's k curves, with one column if there is
    no σ_c."""
    if curve_gain == 0.0:
        return np.full((curves, 1), run_gain)
    alike = (np.hypot(curve_gain, np.sqrt(curves) * run_gain) - curve_gain) / curves
    return np.asarray(curve_gain * np.eye(curves) + alike, dtype=np.float64)


def metric(design: Design, torque: FloatArray, noise: Noise, law: FloatArray | None = None) -> Products:
    """A function from columns X [N, m] Nm to their inner products Xᵀ V⁻¹ X [m, m], gains taken along a torque [N] Nm,
    with the columns C T [N, k] Nm of the law's discrepancy. By Woodbury's formula the gains' whitened directions are
    projected off, then the rest of the law's columns: no product with [N, m] is taken twice."""
    gains = gains_of(design, torque, noise)
    root = scatter_root(gains.overlaps.shape[-1], noise.run_gain, noise.curve_gain)
    by_gain = np.linalg.solve(np.linalg.cholesky(np.eye(root.shape[1]) + root.T @ gains.overlaps @ root), root.T)

    def parts(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened columns [N, m], and their projections [R j, m] on the gains' directions."""
        white = whitened(columns, design, noise)
        return white, np.concatenate(by_gain @ gains.along(white))

    laws, of_gains = parts(np.zeros((torque.size, 0)) if law is None else law)
    by_law = np.linalg.inv(np.linalg.cholesky(np.eye(laws.shape[1]) + laws.T @ laws - of_gains.T @ of_gains))

    def products(columns: FloatArray) -> FloatArray:
        white, removed = parts(columns)
        explained = by_law @ (laws.T @ white - of_gains.T @ removed)
        return np.asarray(white.T @ white - removed.T @ removed - explained.T @ explained, dtype=np.float64)

    return products
