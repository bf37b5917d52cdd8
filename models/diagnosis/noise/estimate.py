"""Sensor noise estimated within the data, from the residual once everything smooth along a curve is taken off.

The remainder of a curve (a loop) beyond low polynomials (low harmonics) gives, by restricted maximum likelihood, a variance

    σ_i² = (a² + b² M_i²)/n_i

(n_i samples in a row) and the correlation w ρ^{|i - j|} of neighbours, averaged over a grid: with A the contrasts of a
piece that nothing smooth reaches and R(w, ρ) the correlation of its rows,

    log L(w, ρ) = -½ (m ln s² + Σ_pieces ln |Aᵀ R A|),     s² = Σ xᵀ (Aᵀ R A)⁻¹ x/m,    x = Aᵀ residual,   m values in all

What the model gets wrong is smooth along a curve; the contrasts do not see it, so it is not mistaken for noise. What all
tests at one pressure and speed have in common, relative to their torque, is the law's and no noise, however sharp it is: its
median is taken off before. Where it is
sharp (traction that drops to nothing within a few rows at rest), short pieces of the curves show far less than whole ones:
then they are taken, without those that hold the drop. Curves of few speeds are no curves: the same point from state to state
is one there. A deviation sent along is not used: rigs misjudge it, and the data show it as well. How far repeated runs
scatter is estimated with the baseline (`pooled_fit.projection`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.optimize import nnls

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.design.autocorrelation import Correlation
from models.diagnosis.design.design import Design, IntArray
from models.diagnosis.noise.covariance import Noise

#: Longer curves are cut, for the basis of a piece costs its length cubed; short pieces have so many rows at most.
_LONGEST, _SHORT = 120, 15


@dataclass(frozen=True, slots=True, kw_only=True)
class ResidualPiece:
    """Rows [n] of one curve or loop, and the contrasts [n, k], orthonormal, that are free of anything smooth. Pieces of one
    length (loops: of the same phases) share one array of contrasts."""

    rows: IntArray
    contrasts: FloatArray

    def remainder(self, residual: FloatArray) -> FloatArray:
        """Residual [n] Nm on the piece's rows minus its smooth part, from the residual [N] Nm of all rows."""
        return np.asarray(self.contrasts @ (self.contrasts.T @ residual[self.rows]), dtype=np.float64)

    def mean_square(self, residual: FloatArray) -> float:
        """Mean square of the contrasts [Nm²], an estimate of the noise variance."""
        return float(np.mean((self.contrasts.T @ residual[self.rows]) ** 2))


def owners(design: Design) -> IntArray:
    """The index [N] of each row's curve or loop."""
    loops = design.curve.max(initial=0) + 1 + design.rows.loop
    return np.asarray(np.where(design.rows.steady, design.curve, loops), dtype=np.intp)


def pieces_across_curves(design: Design, part: NDArray[np.bool_]) -> list[ResidualPiece]:
    """Residual pieces for curves of too few speeds, among the rows of `part` [N]: rows of one speed over the pressures
    of a run. If there are too few pressures as well, rows of one speed and pressure over the states; there the scatter
    from run to run counts as noise."""
    indices, rows = np.flatnonzero(part), design.rows
    speed = np.round(rows.velocity / max(float(rows.velocity.max()), 1e-300), 2)
    pieces = list[ResidualPiece]()
    for across, fixed, degree in (
        (rows.pressure, rows.run, 2),
        (rows.cycles, design.level, criteria.SMOOTH_DEGREE),
    ):
        same = np.unique(np.stack([speed, fixed], axis=1), axis=0, return_inverse=True)[1]
        ordered = indices[np.argsort(across[indices], kind="stable")]
        pieces = (
            pieces
            if _degrees_of_freedom(pieces) >= criteria.FEWEST
            else _pieces(design, ordered, same, _LONGEST, degree)
        )
    return pieces


def _pieces(
    design: Design, indices: IntArray, owner: IntArray, longest: int, degree: int = criteria.SMOOTH_DEGREE
) -> list[ResidualPiece]:
    """Residual pieces of at most `longest` consecutive rows of one owner, among the rows `indices`, with contrasts to
    a smooth course: a polynomial of the degree for plateaus, harmonics of the phase for loops."""
    pieces = []
    order = indices[np.argsort(owner[indices], kind="stable")]
    edges = np.flatnonzero(np.diff(owner[order])) + 1
    cache: dict[bytes, FloatArray] = {}
    for rows in np.split(order, edges) if order.size else []:
        for piece in np.array_split(rows, max(1, -(-rows.size // longest))):
            looping = bool(piece[0] >= design.plateaus)
            smooth_terms = 2 * criteria.SMOOTH_HARMONICS + 1 if looping else degree + 1
            if piece.size < smooth_terms + 3:
                continue
            phase = design.rows.phase[piece]
            key = phase.tobytes()  # all zeros for plateaus: their number alone counts
            if key not in cache:
                smooth = legvander(np.linspace(-1.0, 1.0, piece.size), degree)
                if looping:
                    angles = np.arange(1, criteria.SMOOTH_HARMONICS + 1) * phase[:, None]
                    smooth = np.column_stack([np.ones_like(phase), np.cos(angles), np.sin(angles)])
                cache[key] = np.linalg.qr(smooth, mode="complete")[0][:, smooth.shape[1] :]
            pieces.append(ResidualPiece(rows=piece, contrasts=cache[key]))
    return pieces


def calm_pieces(design: Design, part: NDArray[np.bool_], residual: FloatArray) -> list[ResidualPiece]:
    """The pieces of `part` [N] whose remainder of residual [N] Nm is noise: whole curves, unless the median mean square
    of short pieces is less than a SHARP-th of theirs; then the short pieces below SHARP times their median."""
    rows, owner = np.flatnonzero(part), owners(design)
    whole_curves, short = (_pieces(design, rows, owner, longest) for longest in (_LONGEST, _SHORT))
    if not part[0] or not short:  # a loop's harmonics do not become fewer in a part of it
        return whole_curves
    of_whole, of_short = (
        np.array([piece.mean_square(residual) for piece in pieces]) for pieces in (whole_curves, short)
    )
    if criteria.SHARP * np.median(of_short) >= np.median(of_whole):
        return whole_curves
    typical = float(np.median(of_short))
    return [piece for piece, square in zip(short, of_short, strict=True) if square < criteria.SHARP * typical]


#: The grid of ρ and of w.
_DECAYS = (0.2, 0.35, 0.5, 0.65, 0.8, 0.9)
_SHARES = (0.15, 0.3, 0.5, 0.75, 1.0)


def estimate_correlation(
    pieces: Sequence[ResidualPiece],
    residual: FloatArray,
    deviation: FloatArray,
    from_samples: tuple[float, float] | None,
    period_differences: Sequence[FloatArray],
) -> tuple[Correlation, float]:
    """Correlation (w, ρ) of neighbouring rows in a residual [N] Nm with deviation [N] Nm, and the factor by which the
    deviations are to be scaled.

    w ρ and w ρ², the correlations of the first and second neighbour, are averaged over the grid: a likelihood that is flat
    along a ridge must not choose its end. Where samples show both (`from_samples`), these are used unless bins contradict.
    `period_differences` [n] each are further series of neighbouring bins in units of their deviation; the loop cancels in
    them.
    """
    groups: dict[int, tuple[FloatArray, list[FloatArray]]] = {}
    for piece in pieces:
        relative = piece.remainder(residual) / deviation[piece.rows]
        groups.setdefault(id(piece.contrasts), (piece.contrasts, []))[1].append(
            np.clip(relative, -criteria.SPIKE, criteria.SPIKE)
        )
    grid = [Correlation(), *(Correlation(share=share, decay=decay) for share in _SHARES for decay in _DECAYS)]
    expected, penalty = Correlation(), criteria.CORRELATION_PRICE
    if from_samples is not None:
        # [nats]; more than for bins alone, because a loop has many more samples than bins
        expected, penalty = Correlation.of_neighbours(*from_samples), 5.0
        grid = [expected, *grid]
    if len(groups) > 40:  # loops whose bins all differ: each would have a likelihood of its own to be factorised
        grid = grid[:1]
    unit = {size: np.eye(size) for size in {series.size for series in period_differences}}
    for series in period_differences:
        contrasts = unit[series.size]
        groups.setdefault(id(contrasts), (contrasts, []))[1].append(np.clip(series, -criteria.SPIKE, criteria.SPIKE))
    logs, variances = [], []
    for number, correlation in enumerate(grid):
        likelihood, variance = _restricted_likelihood(correlation, groups)
        mismatch = abs(float(np.log(correlation.variance_inflation / expected.variance_inflation)))
        # slow noise was taken off with everything smooth, so the data say little about it
        logs.append(likelihood - (0.0 if number == 0 else penalty) - 2.0 * mismatch)
        variances.append(variance)
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    decays = np.array([correlation.decay for correlation in grid])
    neighbours = np.array([correlation.share for correlation in grid]) * decays
    scale = float(np.sqrt(weights @ np.array(variances)))
    return Correlation.of_neighbours(float(weights @ neighbours), float(weights @ (neighbours * decays))), scale


def _restricted_likelihood(
    correlation: Correlation, groups: dict[int, tuple[FloatArray, list[FloatArray]]]
) -> tuple[float, float]:
    """Restricted log likelihood log L [nats] of a correlation, at its maximum over the variance s², and that
    variance."""
    squares, logdet, free = 0.0, 0.0, 0
    for contrasts, series in groups.values():
        distance = np.abs(np.subtract.outer(np.arange(contrasts.shape[0]), np.arange(contrasts.shape[0])))
        matrix = correlation.share * correlation.decay**distance
        np.fill_diagonal(matrix, 1.0)
        factor = np.linalg.cholesky(contrasts.T @ matrix @ contrasts)
        white = np.linalg.solve(factor, contrasts.T @ np.stack(series, axis=1))
        squares += float((white**2).sum())
        logdet += len(series) * 2 * float(np.log(np.diag(factor)).sum())
        free += white.size
    variance = squares / free
    return -0.5 * (free * np.log(variance) + logdet), variance


def first_noise(design: Design) -> Noise:
    """The noise assumed before anything is fitted: a fixed share of the torque, white."""
    of_sample = criteria.ASSUMED * np.abs(design.torque) + 0.2 * criteria.ASSUMED * design.usual_torque + 1e-12
    deviation, white = of_sample / np.sqrt(np.minimum(design.samples, 30)), Correlation()
    # some tenths of a percent are usual
    return Noise(deviation=deviation, plateaus=white, loops=white, run_gain=0.002, curve_gain=0.0)


def estimate_noise(design: Design, residual: FloatArray, torque: FloatArray, before: Noise) -> tuple[Noise, bool]:
    """Noise (deviation of each row, autocorrelation of plateaus and of loops) estimated from a residual [N] Nm about
    torque [N] Nm, and whether part of it was assumed as `before`, because plateaus or loops are too few."""
    deviation, residual = before.deviation.copy(), unlike(design, residual, torque)
    correlations, assumed = [], False
    steady = np.arange(residual.size) < design.plateaus
    for part in (steady, ~steady):
        pieces = calm_pieces(design, part, residual)
        along_curves = _degrees_of_freedom(pieces) >= criteria.FEWEST
        if not along_curves and part[0]:
            pieces = pieces_across_curves(design, part)
        if _degrees_of_freedom(pieces) < criteria.FEWEST:
            assumed = assumed or bool(part.any())
            correlations.append(Correlation())
            continue
        variance = _variance(pieces, residual, torque, design.samples)
        deviation[part] = np.sqrt(variance[part])
        if not along_curves:
            correlations.append(Correlation())
            continue
        from_samples = design.bin_autocorrelation if part[-1] else None  # loops are the last rows
        # what further periods of the loops differ by, in deviations of a sample
        differences = [
            series / np.sqrt(variance[rows] * design.samples[rows])
            for rows, series in design.period_differences
            if rows.size >= 8 and part[rows[0]]
        ]
        correlation, scale = estimate_correlation(pieces, residual, np.sqrt(variance), from_samples, differences)
        deviation[part] *= scale
        correlations.append(correlation)
    deviation = _widened_at_spikes(design, residual, deviation)
    return replace(before, deviation=deviation, plateaus=correlations[0], loops=correlations[1]), assumed


def _widened_at_spikes(design: Design, residual: FloatArray, deviation: FloatArray) -> FloatArray:
    """Deviations [N] Nm, at isolated spikes as large as the residual [N] itself; unchanged where 2 % of the rows or more
    look like spikes, for then they are noise."""
    spiky = (np.abs(residual) > criteria.SPIKE * deviation) & _isolated(design, residual, deviation)
    return np.where(spiky, np.abs(residual), deviation) if spiky.mean() < 0.02 else deviation


def unlike(design: Design, residual: FloatArray, torque: FloatArray) -> FloatArray:
    """Residual [N] Nm minus the median relative error of the tests at each pressure and speed, where there are
    LEAST_REPEATS or more; scaled so that pure noise keeps its variance."""
    rows = np.flatnonzero(design.closed & design.rows.steady & (np.abs(torque) > 0.0))
    if not rows.size:
        return residual
    speed = np.round(design.rows.velocity[rows] / max(float(design.rows.velocity.max()), 1e-300), 3)
    _, place, count = np.unique(
        np.stack([design.level[rows], speed], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    relative, order = residual[rows] / torque[rows], np.argsort(place, kind="stable")
    common = np.array([np.median(alike) for alike in np.split(relative[order], np.cumsum(count)[:-1])])
    repeats = count >= criteria.LEAST_REPEATS
    off = (relative - np.where(repeats, common, 0.0)[place]) * torque[rows]
    out = residual.copy()
    # a median of n normal values has π/(2n + 2.5) of their variance and 1/n in common with each: within 4 % of what is left
    left = np.where(repeats, 1.0 - 2.0 / count + np.pi / (2.0 * count + 2.5), 1.0)
    out[rows] = off / np.sqrt(left)[place]
    return out


def _degrees_of_freedom(pieces: Sequence[ResidualPiece]) -> int:
    """Degrees of freedom that are left for the noise: the number of contrasts of all pieces."""
    return sum(piece.contrasts.shape[1] for piece in pieces)


def _variance(
    pieces: Sequence[ResidualPiece], residual: FloatArray, torque: FloatArray, samples: FloatArray
) -> FloatArray:
    """Variance (a² + b² M²)/n [N] Nm² of each row, by iterated non-negative least squares on squared remainders, spikes
    cut."""
    rows = np.concatenate([piece.rows for piece in pieces])
    remainder = np.concatenate([piece.remainder(residual) for piece in pieces])
    leverage = np.concatenate([(piece.contrasts**2).sum(axis=1) for piece in pieces])
    squares = remainder**2 / np.maximum(leverage, 0.05) * samples[rows]
    usual = max(float(np.median(squares)) / 0.455, 1e-30)  # the median of a squared standard normal variable
    level = max(float(np.mean(torque**2)), 1e-30)
    columns = np.stack([np.full(rows.size, 1.0), torque[rows] ** 2 / level], axis=1)
    fitted = np.full(rows.size, usual)
    for _ in range(4):
        cut = np.minimum(squares, 12.0 * fitted)
        (constant, proportional), _ = nnls(columns / fitted[:, None], cut / fitted)
        fitted = np.maximum(columns @ np.array([constant, proportional]), 1e-4 * usual)
    return np.asarray(np.maximum(constant + proportional * torque**2 / level, 1e-4 * usual) / samples, dtype=np.float64)


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
    isolated[order] = np.isfinite(nearest) & (nearest > criteria.SPIKE * deviation[order])
    return isolated
