"""Rows whitened: noise along a run, and gains that scatter from run to run and from curve to curve.

    V = D R D + σ_c² Σ_curves m mᵀ + σ_g² Σ_runs m mᵀ

D holds the deviation of each row, R the correlation of neighbours in a run, w ρ^{|i - j|} off the diagonal, m is the
predicted torque on the curve's (run's) rows. R is an ARMA(1, 1) process, whitened by its recursive filter; the gains
are a few directions a run (Woodbury).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from models.arrays import FloatArray
from models.diagnosis.design.autocorrelation import Correlation, arma
from models.diagnosis.design.design import Design, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """The covariance of the rows, as its parts."""

    deviation: FloatArray  # of each row [N] Nm
    plateaus: Correlation  # along plateaus
    loops: Correlation  # along a loop's bins
    run_gain: float  # relative gain scatter of runs, and of curves [-]
    curve_gain: float


def whitened(columns: FloatArray, design: Design, noise: Noise) -> FloatArray:
    """R^{-1/2} D^{-1} of columns [N, m]: everything but the gains."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Whitened torque of each curve of each run: R runs, k curves of a run at most. A curve reaches into the rows after it,
    as noise does: with whitened torque cut at its ends, gains of 0.25 % on a rig of 0.1 % of noise passed for structure."""

    curve: IntArray  # [N] of the row, among all R k
    directions: csr_array  # [R k, N]
    overlaps: FloatArray  # [R, k, k] their inner products

    def along(self, columns: FloatArray) -> FloatArray:
        """Inner products [R, k, m] with whitened columns [N, m]."""
        return np.reshape(self.directions @ columns, (*self.overlaps.shape[:2], -1))


def gains_of(design: Design, torque: FloatArray, noise: Noise) -> Gains:
    """The gains' directions for the predicted torque [N] Nm."""
    run = design.rows.run
    first = np.full(int(run.max()) + 1, design.curve.max())
    np.minimum.at(first, run, design.curve)
    place = design.curve - first[run]  # curves are numbered run by run
    count = int(place.max()) + 1
    white = whitened(np.where(place[:, None] == np.arange(count), torque[:, None], 0.0), design, noise)
    row, column = np.nonzero(white)
    directions = csr_array(
        (white[row, column], (run[row] * count + column, row)), shape=(first.size * count, torque.size)
    )
    overlaps = np.stack([white[run == number].T @ white[run == number] for number in range(first.size)])
    return Gains(curve=run * count + place, directions=directions, overlaps=overlaps)


def modes(overlaps: FloatArray, run_gain: float, curve_gain: float) -> tuple[FloatArray, FloatArray]:
    """Combinations T [R, k, j] of the curves' directions D that scatter independently of each other, and their sizes s
    [R, j]: with K = σ_c² + σ_g² 11ᵀ of a run's curves, D K Dᵀ = D T Tᵀ Dᵀ and Tᵀ DᵀD T = s."""
    count = overlaps.shape[-1]
    if curve_gain == 0.0:
        return np.full((*overlaps.shape[:2], 1), run_gain), run_gain**2 * overlaps.sum(axis=(1, 2))[:, None]
    alike = (np.hypot(curve_gain, np.sqrt(count) * run_gain) - curve_gain) / count
    root = curve_gain * np.eye(count) + alike
    sizes, vectors = np.linalg.eigh(root @ overlaps @ root)
    return root @ vectors, np.maximum(sizes, 0.0)


def without_gains(columns: FloatArray, gains: Gains, run_gain: float, curve_gain: float) -> FloatArray:
    """Whitened columns [N, m] with the scatter of the gains [-] whitened as well: (1 + U Uᵀ)^{-1/2} with U = D T."""
    combined, sizes = modes(gains.overlaps, run_gain, curve_gain)
    root = np.sqrt(1 + sizes)
    removed = combined @ ((combined.mT @ gains.along(columns)) / (root * (1 + root))[..., None])
    return np.asarray(columns - gains.directions.T @ removed.reshape(-1, columns.shape[1]), dtype=np.float64)


def whitening(design: Design, torque: FloatArray, noise: Noise) -> Callable[[FloatArray], FloatArray]:
    """V^{-1/2} of columns [N, m], gains taken along a torque [N] Nm."""
    gains = gains_of(design, torque, noise)
    return lambda columns: without_gains(whitened(columns, design, noise), gains, noise.run_gain, noise.curve_gain)
