"""Sensor noise from within the data: what is left of the residual when everything smooth along a curve is taken off.

A curve's residual (a loop's) is projected off low polynomials (low harmonics), so that what the model gets wrong, which is
smooth, is not mistaken for noise. What is left gives, by restricted maximum likelihood, a variance

    σ_i² = (a² + b² M_i²)/n_i

(n_i samples in a row) and the correlation w ρ^{|i - j|} of neighbours. A deviation sent along is not trusted: rigs
misjudge it, and the data say it as well.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.optimize import nnls

from models.arrays import FloatArray
from models.diagnosis.design.autocorrelation import Correlation
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise

#: Where too little is left to estimate noise, so much of the torque is assumed.
ASSUMED = 0.01
#: Fewer free squares estimate nothing.
FEWEST = 12
#: Usual run-to-run scatter of the gain [-], until it is estimated.
USUAL_GAIN = 0.002
_DEGREE, _HARMONICS = 4, 5
_LONGEST = 120
_LEAST_REPEATED = 8
_SPIKE = 5.5
#: Rows that stand off their neighbours are spikes while they are fewer than this share.
_MOST_SPIKES = 0.02
_STEPS = (0.2, 0.35, 0.5, 0.65, 0.8, 0.9)
_SHARES = (0.15, 0.3, 0.5, 0.75, 1.0)
#: What a correlation must gain [nats] to be believed, and a power of the swell of slow noise by which it is held back: what
#: is slow was taken off with everything smooth, so the data say little about it.
_PRICE, _SWELL = 2.0, 2.0
#: ... the price where samples tell of it.
_PRICE_TOLD = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Piece:
    """Rows of one curve or loop and the contrasts [n, k] that are free of anything smooth."""

    rows: np.ndarray[tuple[int], np.dtype[np.intp]]
    contrasts: FloatArray


def first_noise(design: Design) -> Noise:
    """Before anything is fitted: the assumed share of the torque."""
    level = design.usual_torque
    deviation = (ASSUMED * np.abs(design.torque) + 0.2 * ASSUMED * level + 1e-12) / np.sqrt(
        np.minimum(design.samples, 30)
    )
    none = Correlation()
    return Noise(deviation=deviation, plateaus=none, loops=none, run_gain=USUAL_GAIN, curve_gain=0.0)


def estimate_noise(design: Design, residual: FloatArray, torque: FloatArray, before: Noise) -> tuple[Noise, bool]:
    """The noise in residual [N] Nm about torque [N] Nm; and whether it had to be assumed for plateaus (or loops)."""
    deviation = before.deviation.copy()
    correlations, assumed = [], False
    steady = np.arange(residual.size) < design.plateaus
    for part in (steady, ~steady):
        pieces = _pieces(design, part)
        free = sum(piece.contrasts.shape[1] for piece in pieces)
        if free < FEWEST:
            assumed = assumed or bool(part.any())
            correlations.append(Correlation())
            continue
        variance = _variance(pieces, residual, torque, design.samples)
        deviation[part] = np.sqrt(variance[part])
        told = design.bins_remember if part[-1] else None  # loops stand last
        correlation, scale = _correlation(pieces, residual, np.sqrt(variance), told, _repeated(design, variance, part))
        deviation[part] *= scale
        correlations.append(correlation)
    spiky = (np.abs(residual) > _SPIKE * deviation) & _isolated(design, residual, deviation)
    if spiky.mean() < _MOST_SPIKES:
        deviation = np.where(spiky, np.abs(residual), deviation)
    return replace(before, deviation=deviation, plateaus=correlations[0], loops=correlations[1]), assumed


def _repeated(
    design: Design, variance: FloatArray, part: np.ndarray[tuple[int], np.dtype[np.bool_]]
) -> list[FloatArray]:
    """What further periods of the loops differ by, in deviations [n] of a sample; nothing for plateaus."""
    return [
        differs / np.sqrt(variance[rows] * design.samples[rows])
        for rows, differs in design.repeats
        if rows.size >= _LEAST_REPEATED and part[rows[0]]
    ]


def _isolated(
    design: Design, residual: FloatArray, deviation: FloatArray
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Rows that stand off both neighbours in speed on the same curve (in phase on the same loop) as well, at its ends off
    the one that there is."""
    owner = _owners(design)
    order = np.lexsort((np.where(design.rows.steady, design.rows.velocity, design.rows.phase), owner))
    off, owner = residual[order], owner[order]
    step = np.abs(np.diff(off))
    step[owner[1:] != owner[:-1]] = np.inf  # the next one is on another curve
    aside = np.minimum(np.append(step, np.inf), np.append(np.inf, step))
    found = np.empty(order.size, dtype=np.bool_)
    found[order] = np.isfinite(aside) & (aside > _SPIKE * deviation[order])
    return found


def _owners(design: Design) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
    """The number [N] of each row's curve or loop."""
    loops = design.curve.max(initial=0) + 1 + design.rows.loop
    return np.asarray(np.where(design.rows.steady, design.curve, loops), dtype=np.intp)


def _pieces(design: Design, part: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> list[_Piece]:
    """Curves (loops) with rows enough, long ones cut."""
    owner = _owners(design)
    found = []
    indices = np.flatnonzero(part)
    order = indices[np.argsort(owner[indices], kind="stable")]
    edges = np.flatnonzero(np.diff(owner[order])) + 1
    cache: dict[bytes, FloatArray] = {}
    for rows in np.split(order, edges) if order.size else []:
        for piece in np.array_split(rows, max(1, -(-rows.size // _LONGEST))):
            looping = bool(piece[0] >= design.plateaus)
            smooth = 2 * _HARMONICS + 1 if looping else _DEGREE + 1
            if piece.size < smooth + 3:
                continue
            key = design.rows.phase[piece].tobytes()  # all zeros for plateaus: their number alone counts
            if key not in cache:
                x = np.linspace(-1.0, 1.0, piece.size)
                smooth_shapes = (
                    _swing(design.rows.phase[piece]) if looping else np.asarray(legvander(x, _DEGREE), dtype=np.float64)
                )
                cache[key] = _contrasts(smooth_shapes)
            found.append(_Piece(rows=piece, contrasts=cache[key]))
    return found


def _swing(phase: FloatArray) -> FloatArray:
    angles = np.arange(1, _HARMONICS + 1) * phase[:, None]
    return np.column_stack([np.ones_like(phase), np.cos(angles), np.sin(angles)])


def _contrasts(smooth: FloatArray) -> FloatArray:
    """An orthonormal basis [n, n - k] of what is orthogonal to smooth [n, k]."""
    return np.linalg.qr(smooth, mode="complete")[0][:, smooth.shape[1] :]


def _variance(pieces: list[_Piece], residual: FloatArray, torque: FloatArray, samples: FloatArray) -> FloatArray:
    """(a² + b² M²)/n [N] by iterated non-negative least squares on squared residuals, spikes cut."""
    rows = np.concatenate([piece.rows for piece in pieces])
    left = np.concatenate([piece.contrasts @ (piece.contrasts.T @ residual[piece.rows]) for piece in pieces])
    leverage = np.concatenate([(piece.contrasts**2).sum(axis=1) for piece in pieces])
    squares = left**2 / np.maximum(leverage, 0.05) * samples[rows]
    usual = max(float(np.median(squares)) / 0.455, 1e-30)
    level = max(float(np.mean(torque**2)), 1e-30)
    columns = np.stack([np.full(rows.size, 1.0), torque[rows] ** 2 / level], axis=1)
    fitted = np.full(rows.size, usual)
    for _ in range(4):
        cut = np.minimum(squares, 12.0 * fitted)
        found, _ = nnls(columns / fitted[:, None], cut / fitted)
        fitted = np.maximum(columns @ found, 1e-4 * usual)
    return np.asarray(np.maximum(found[0] + found[1] * torque**2 / level, 1e-4 * usual) / samples, dtype=np.float64)


def _correlation(
    pieces: list[_Piece],
    residual: FloatArray,
    deviation: FloatArray,
    told: tuple[float, float] | None,
    repeated: list[FloatArray],
) -> tuple[Correlation, float]:
    """(w, ρ) by restricted likelihood, averaged over a grid, and the factor by which the deviations are off.

    w ρ and w ρ², the correlations of the first and second neighbour, are averaged: a likelihood that is flat along a ridge
    must not choose its end. Where samples have `told` of both, that is believed unless the bins contradict.
    """
    groups: dict[int, tuple[FloatArray, list[FloatArray]]] = {}
    for piece in pieces:
        left = piece.contrasts @ (piece.contrasts.T @ residual[piece.rows]) / deviation[piece.rows]
        groups.setdefault(id(piece.contrasts), (piece.contrasts, []))[1].append(np.clip(left, -_SPIKE, _SPIKE))
    tried = [Correlation(), *(Correlation(share=w, step=r) for w in _SHARES for r in _STEPS)]
    usual, price = (Correlation(), _PRICE) if told is None else (Correlation.of_neighbours(*told), _PRICE_TOLD)
    if told is not None:
        tried = [usual, *tried]
    few = len(groups) > 40  # loops whose bins all differ: their correlation is not looked for
    whole = {size: np.eye(size) for size in {each.size for each in repeated}}
    for each in repeated:
        groups.setdefault(id(whole[each.size]), (whole[each.size], []))[1].append(np.clip(each, -_SPIKE, _SPIKE))
    logs, scales = [], []
    for correlation in tried[: 1 if few else None]:
        likelihood, scale = _restricted(correlation, groups)
        off = abs(float(np.log(_swell(correlation) / _swell(usual))))
        logs.append(likelihood - (0.0 if correlation is tried[0] else price) - _SWELL * off)
        scales.append(scale)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    steps = np.array([each.step for each in tried[: weights.size]])
    first = np.array([each.share for each in tried[: weights.size]]) * steps
    scale = float(np.sqrt(weights @ np.array(scales)))
    one, two = float(weights @ first), float(weights @ (first * steps))
    return Correlation.of_neighbours(one, two), scale


def _restricted(
    correlation: Correlation, groups: dict[int, tuple[FloatArray, list[FloatArray]]]
) -> tuple[float, float]:
    """Restricted log likelihood [nats] of a correlation at the variance that suits it best, and that variance."""
    squares, logdet, free = 0.0, 0.0, 0
    for contrasts, series in groups.values():
        distance = np.abs(np.subtract.outer(np.arange(contrasts.shape[0]), np.arange(contrasts.shape[0])))
        matrix = correlation.share * correlation.step**distance
        np.fill_diagonal(matrix, 1.0)
        factor = np.linalg.cholesky(contrasts.T @ matrix @ contrasts)
        white = np.linalg.solve(factor, contrasts.T @ np.stack(series, axis=1))
        squares += float((white**2).sum())
        logdet += len(series) * 2 * float(np.log(np.diag(factor)).sum())
        free += white.size
    scale = squares / free
    return -0.5 * (free * np.log(scale) + logdet), scale


def _swell(correlation: Correlation) -> float:
    """By how much slow noise is stronger than were neighbours independent: the spectral density at 0 over the variance."""
    return 1.0 + 2.0 * correlation.share * correlation.step / (1.0 - correlation.step)
