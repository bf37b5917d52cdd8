"""Rows whitened: noise along a run, and gains that scatter from run to run and from curve to curve.

    V = D R D + σ_c² Σ_curves m mᵀ + σ_g² Σ_runs m mᵀ

D holds the deviation of each row, R the correlation of neighbours in a run, w ρ^{|i - j|} off the diagonal, m is the
predicted torque on the curve's (run's) rows. R is an ARMA(1, 1) process, whitened by its recursive filter; the gains are
rank-one terms (Woodbury), whitened by shrinking along one direction.
"""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.diagnosis.design import Design, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Of neighbouring rows: `share` w [0, 1] of the variance is correlated, by `step` ρ [0, 1) a row."""

    share: float = 0.0
    step: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """deviation [N] Nm of each row; correlation along plateaus and along a loop's bins; relative gain scatter of runs and
    of curves [-]."""

    deviation: FloatArray
    plateaus: Correlation
    loops: Correlation
    run_gain: float
    curve_gain: float


def whitened(columns: FloatArray, design: Design, noise: Noise) -> FloatArray:
    """R^{-1/2} D^{-1} of columns [N, m]: everything but the gains."""
    out = columns / noise.deviation[:, None]
    for rows, correlation in _blocks(design, noise):
        out[rows] = _filtered(out[rows], correlation)
    return out


def _blocks(design: Design, noise: Noise) -> list[tuple[IntArray, Correlation]]:
    """Runs of plateaus and loops [b, n]: rows that follow each other, those of one length together; none where neighbours
    are independent."""
    owner = np.where(design.rows.steady, design.rows.run, design.rows.loop + len(design.runs))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(owner)) + 1, [owner.size]])
    starts, lengths = edges[:-1], np.diff(edges)
    found = []
    for correlation, mine in ((noise.plateaus, starts < design.plateaus), (noise.loops, starts >= design.plateaus)):
        if correlation.step == 0.0 or correlation.share == 0.0:
            continue
        for length in np.unique(lengths[mine & (lengths > 0)]):
            first = starts[mine & (lengths == length)]
            found.append((first[:, None] + np.arange(length), correlation))
    return found


def arma(correlation: Correlation) -> tuple[float, float]:
    """(θ, s): the process with unit variance is x_i - ρ x_{i-1} = s (e_i + θ e_{i-1}), |θ| < 1."""
    rho, share = correlation.step, correlation.share
    zero = 1 + rho * rho - 2 * share * rho * rho  # autocovariances of x_i - ρ x_{i-1}
    one = -rho * (1 - share)
    if abs(one) < 1e-12:
        return 0.0, float(np.sqrt(max(zero, 1e-12)))
    half = zero / (2 * one)
    theta = half - np.copysign(np.sqrt(max(half * half - 1, 0.0)), half)
    return float(theta), float(np.sqrt(max(one / theta, 1e-12)))


def _filtered(blocks: FloatArray, correlation: Correlation) -> FloatArray:
    """Blocks [b, n, m] whitened along n."""
    theta, scale = arma(correlation)
    out = np.empty_like(blocks)
    out[:, 0] = blocks[:, 0]
    first = scale * blocks[:, :1]  # as if the first innovation were all of x_0
    start = -correlation.step * blocks[:, :1] - theta * first
    out[:, 1:] = lfilter([1.0, -correlation.step], [1.0, theta], blocks[:, 1:], axis=1, zi=start)[0] / scale
    return out


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """Directions of the gains in whitened rows: torque [N], curve [N] and run_of_curve [c] indices, squares [c] = |m_c|²."""

    torque: FloatArray
    curve: IntArray
    run_of_curve: IntArray
    squares: FloatArray


def gains_of(design: Design, torque: FloatArray, noise: Noise) -> Gains:
    """For the predicted torque [N] Nm."""
    white = whitened(torque[:, None], design, noise)[:, 0]
    count = int(design.curve.max()) + 1
    run_of_curve = np.zeros(count, dtype=np.intp)
    run_of_curve[design.curve] = design.rows.run
    squares = np.asarray(np.bincount(design.curve, weights=white * white, minlength=count), dtype=np.float64)
    return Gains(torque=white, curve=design.curve, run_of_curve=run_of_curve, squares=squares)


def by_curve(columns: FloatArray, gains: Gains) -> FloatArray:
    """m_cᵀ X [c, m] for whitened columns X [N, m]."""
    order = np.argsort(gains.curve, kind="stable")
    starts = np.concatenate([[0], np.flatnonzero(np.diff(gains.curve[order])) + 1])
    return np.asarray(np.add.reduceat((gains.torque[:, None] * columns)[order], starts, axis=0), dtype=np.float64)


def without_gains(columns: FloatArray, gains: Gains, run_gain: float, curve_gain: float) -> FloatArray:
    """Whitened columns [N, m] with the gains' variance whitened as well (exact, curve by curve and then run by run)."""
    shrink_c = _shrink(curve_gain**2 * gains.squares)
    share = (shrink_c / np.maximum(gains.squares, 1e-300))[:, None] * by_curve(columns, gains)
    out = columns - gains.torque[:, None] * share[gains.curve]
    left = (1 - shrink_c)[gains.curve] * gains.torque
    runs = gains.run_of_curve[gains.curve]
    count = int(gains.run_of_curve.max()) + 1
    norm = np.bincount(runs, weights=left * left, minlength=count)
    along = np.stack([np.bincount(runs, weights=left * column, minlength=count) for column in out.T], axis=1)
    factor = _shrink(np.asarray(run_gain**2 * norm, dtype=np.float64)) / np.maximum(norm, 1e-300)
    return np.asarray(out - left[:, None] * (factor[:, None] * along)[runs], dtype=np.float64)


def _shrink(variance: FloatArray) -> FloatArray:
    """1 - 1/sqrt(1 + σ²|m|²): how much of the direction m is taken off."""
    return np.asarray(1 - 1 / np.sqrt(1 + variance), dtype=np.float64)
