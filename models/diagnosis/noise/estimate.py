"""Sensor noise estimated within the data, from the residual once everything smooth along a curve is taken off.

The remainder of a curve (a loop) beyond low polynomials (low harmonics) gives, by restricted maximum likelihood, a variance

    σ_i² = (a² + b² M_i²)/n_i

(n_i samples in a row) and the correlation w ρ^{|i - j|} of neighbours. A deviation sent along is not used: rigs misjudge it,
and the data show it as well. How far repeated runs scatter is estimated with the baseline (`pooled_fit.projection`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from models.arrays import FloatArray
from models.diagnosis.design.autocorrelation import Correlation
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.noise.criteria import ASSUMED, FEWEST, LEAST_COMPARED_BINS, MOST_SPIKES, SPIKE, USUAL_GAIN
from models.diagnosis.noise.row_correlation import estimate_correlation
from models.diagnosis.noise.smooth_free import Piece, owners, pieces_of

#: The median of a squared standard normal variable.
_MEDIAN_SQUARE = 0.455
#: Rounds of reweighted least squares, and the multiple of the fitted variance at which squares are cut there.
_ROUNDS, _LARGEST_SQUARE = 4, 12.0


def first_noise(design: Design) -> Noise:
    """Before anything is fitted: the assumed share of the torque."""
    level = design.usual_torque
    deviation = (ASSUMED * np.abs(design.torque) + 0.2 * ASSUMED * level + 1e-12) / np.sqrt(
        np.minimum(design.samples, 30)
    )
    white = Correlation()
    return Noise(deviation=deviation, plateaus=white, loops=white, run_gain=USUAL_GAIN, curve_gain=0.0)


def estimate_noise(design: Design, residual: FloatArray, torque: FloatArray, before: Noise) -> tuple[Noise, bool]:
    """The noise in residual [N] Nm about torque [N] Nm, and whether it had to be assumed for plateaus or for loops."""
    deviation = before.deviation.copy()
    correlations, assumed = [], False
    steady = np.arange(residual.size) < design.plateaus
    for part in (steady, ~steady):
        pieces = pieces_of(design, part)
        free = sum(piece.contrasts.shape[1] for piece in pieces)
        if free < FEWEST:
            assumed = assumed or bool(part.any())
            correlations.append(Correlation())
            continue
        variance = _variance(pieces, residual, torque, design.samples)
        deviation[part] = np.sqrt(variance[part])
        from_samples = design.bin_autocorrelation if part[-1] else None  # loops are the last rows
        differences = _relative_differences(design, variance, part)
        correlation, scale = estimate_correlation(pieces, residual, np.sqrt(variance), from_samples, differences)
        deviation[part] *= scale
        correlations.append(correlation)
    spiky = (np.abs(residual) > SPIKE * deviation) & _isolated(design, residual, deviation)
    if spiky.mean() < MOST_SPIKES:
        deviation = np.where(spiky, np.abs(residual), deviation)
    return replace(before, deviation=deviation, plateaus=correlations[0], loops=correlations[1]), assumed


def _variance(pieces: Sequence[Piece], residual: FloatArray, torque: FloatArray, samples: FloatArray) -> FloatArray:
    """(a² + b² M²)/n [N] by iterated non-negative least squares on squared remainders, spikes cut."""
    rows = np.concatenate([piece.rows for piece in pieces])
    remainder = np.concatenate([piece.remainder(residual) for piece in pieces])
    leverage = np.concatenate([(piece.contrasts**2).sum(axis=1) for piece in pieces])
    squares = remainder**2 / np.maximum(leverage, 0.05) * samples[rows]
    usual = max(float(np.median(squares)) / _MEDIAN_SQUARE, 1e-30)
    level = max(float(np.mean(torque**2)), 1e-30)
    columns = np.stack([np.full(rows.size, 1.0), torque[rows] ** 2 / level], axis=1)
    fitted = np.full(rows.size, usual)
    for _ in range(_ROUNDS):
        cut = np.minimum(squares, _LARGEST_SQUARE * fitted)
        (constant, proportional), _ = nnls(columns / fitted[:, None], cut / fitted)
        fitted = np.maximum(columns @ np.array([constant, proportional]), 1e-4 * usual)
    return np.asarray(np.maximum(constant + proportional * torque**2 / level, 1e-4 * usual) / samples, dtype=np.float64)


def _relative_differences(design: Design, variance: FloatArray, part: NDArray[np.bool_]) -> list[FloatArray]:
    """What further periods of the loops differ by, in deviations [n] of a sample; nothing for plateaus."""
    return [
        differences / np.sqrt(variance[rows] * design.samples[rows])
        for rows, differences in design.period_differences
        if rows.size >= LEAST_COMPARED_BINS and part[rows[0]]
    ]


def _isolated(design: Design, residual: FloatArray, deviation: FloatArray) -> NDArray[np.bool_]:
    """Rows whose residual differs from both neighbours' in speed on the same curve (in phase on the same loop) by more than
    SPIKE deviations; at a curve's end from the one neighbour that there is."""
    owner = owners(design)
    order = np.lexsort((np.where(design.rows.steady, design.rows.velocity, design.rows.phase), owner))
    ordered, owner = residual[order], owner[order]
    step = np.abs(np.diff(ordered))
    step[owner[1:] != owner[:-1]] = np.inf  # the next row is on another curve
    nearest = np.minimum(np.append(step, np.inf), np.append(np.inf, step))
    isolated = np.empty(order.size, dtype=np.bool_)
    isolated[order] = np.isfinite(nearest) & (nearest > SPIKE * deviation[order])
    return isolated
