"""Rows whitened: noise along a run, and gains that scatter from run to run and from curve to curve.

    V = D R D + σ_c² Σ_curves m mᵀ + σ_g² Σ_runs m mᵀ

D holds the deviation of each row, R the correlation of neighbours in a run, w ρ^{|i - j|} off the diagonal, m is the
predicted torque on the curve's (run's) rows. R is an ARMA(1, 1) process, whitened by its recursive filter; the gains are
rank-one terms (Woodbury), whitened by shrinking along one direction.
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
    """Directions m_c of the gains of curves [c] in whitened rows [N]."""

    torque: FloatArray  # [N]
    curve: IntArray  # [N]
    run_of_curve: IntArray  # [c]
    squares: FloatArray  # [c] |m_c|²
    directions: csr_array  # [c, N]

    def by_run(self, of_curve: FloatArray) -> FloatArray:
        """Sums [r, ...] over the curves of each run."""
        out = np.zeros((int(self.run_of_curve.max()) + 1, *of_curve.shape[1:]))
        np.add.at(out, self.run_of_curve, of_curve)
        return out


def gains_of(design: Design, torque: FloatArray, noise: Noise) -> Gains:
    """The gains' directions for the predicted torque [N] Nm."""
    white = whitened(torque[:, None], design, noise)[:, 0]
    count = int(design.curve.max()) + 1
    run_of_curve = np.zeros(count, dtype=np.intp)
    run_of_curve[design.curve] = design.rows.run
    squares = np.asarray(np.bincount(design.curve, weights=white * white, minlength=count), dtype=np.float64)
    order = np.argsort(design.curve, kind="stable")
    ends = np.concatenate([[0], np.cumsum(np.bincount(design.curve, minlength=count))])
    return Gains(
        torque=white,
        curve=design.curve,
        run_of_curve=run_of_curve,
        squares=squares,
        directions=csr_array((white[order], order, ends), shape=(count, white.size)),
    )


def by_curve(columns: FloatArray, gains: Gains) -> FloatArray:
    """m_cᵀ X [c, m] for whitened columns X [N, m]."""
    return np.asarray(gains.directions @ columns, dtype=np.float64)


def without_gains(columns: FloatArray, gains: Gains, run_gain: float, curve_gain: float) -> FloatArray:
    """Whitened columns [N, m] with the scatter of the gains [-] whitened as well: exact, curve by curve and then run by
    run."""
    along = by_curve(columns, gains)
    removed = _shrink(curve_gain**2 * gains.squares)  # the share that is taken off along each m_c
    left = (1 - removed)[:, None]
    norm = gains.by_run(left[:, 0] ** 2 * gains.squares)
    factor = _shrink(run_gain**2 * norm) / np.maximum(norm, 1e-300)
    of_run = factor[:, None] * gains.by_run(left**2 * along)
    gains_along = (removed / np.maximum(gains.squares, 1e-300))[:, None] * along + left * of_run[gains.run_of_curve]
    return np.asarray(columns - gains.torque[:, None] * gains_along[gains.curve], dtype=np.float64)


def _shrink(variance: FloatArray) -> FloatArray:
    """1 - 1/sqrt(1 + σ²|m|²): how much of the direction m is taken off."""
    return np.asarray(1 - 1 / np.sqrt(1 + variance), dtype=np.float64)


def whitening(design: Design, torque: FloatArray, noise: Noise) -> Callable[[FloatArray], FloatArray]:
    """V^{-1/2} of columns [N, m], gains taken along a torque [N] Nm."""
    gains = gains_of(design, torque, noise)
    return lambda columns: without_gains(whitened(columns, design, noise), gains, noise.run_gain, noise.curve_gain)
