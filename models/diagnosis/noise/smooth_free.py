"""Curves and loops freed of everything smooth: contrasts of their rows that low polynomials (low harmonics) do not reach.

What the model gets wrong is smooth along a curve; the contrasts do not see it, so it is not mistaken for noise.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.design.design import Design
from models.diagnosis.design.points import IntArray
from models.diagnosis.noise.criteria import SMOOTH_DEGREE, SMOOTH_HARMONICS

#: Longer curves are cut, for the basis of a piece costs its length cubed.
_LONGEST = 120


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Rows [n] of one curve or loop, and the contrasts [n, k], orthonormal, that are free of anything smooth. Pieces of one
    length (loops: of the same phases) share one array of contrasts."""

    rows: IntArray
    contrasts: FloatArray

    def remainder(self, residual: FloatArray) -> FloatArray:
        """What is left [n] Nm of residual [N] Nm on the piece's rows without its smooth part."""
        return np.asarray(self.contrasts @ (self.contrasts.T @ residual[self.rows]), dtype=np.float64)


def owners(design: Design) -> IntArray:
    """The number [N] of each row's curve or loop."""
    loops = design.curve.max(initial=0) + 1 + design.rows.loop
    return np.asarray(np.where(design.rows.steady, design.curve, loops), dtype=np.intp)


def pieces_of(design: Design, part: NDArray[np.bool_]) -> list[Piece]:
    """Curves and loops among the rows of `part` [N] that have rows enough, long ones cut."""
    owner = owners(design)
    pieces = []
    indices = np.flatnonzero(part)
    order = indices[np.argsort(owner[indices], kind="stable")]
    edges = np.flatnonzero(np.diff(owner[order])) + 1
    cache: dict[bytes, FloatArray] = {}
    for rows in np.split(order, edges) if order.size else []:
        for piece in np.array_split(rows, max(1, -(-rows.size // _LONGEST))):
            looping = bool(piece[0] >= design.plateaus)
            smooth_terms = 2 * SMOOTH_HARMONICS + 1 if looping else SMOOTH_DEGREE + 1
            if piece.size < smooth_terms + 3:
                continue
            phase = design.rows.phase[piece]
            key = phase.tobytes()  # all zeros for plateaus: their number alone counts
            if key not in cache:
                cache[key] = _contrasts(_harmonics(phase) if looping else _polynomials(piece.size))
            pieces.append(Piece(rows=piece, contrasts=cache[key]))
    return pieces


def _polynomials(count: int) -> FloatArray:
    return np.asarray(legvander(np.linspace(-1.0, 1.0, count), SMOOTH_DEGREE), dtype=np.float64)


def _harmonics(phase: FloatArray) -> FloatArray:
    angles = np.arange(1, SMOOTH_HARMONICS + 1) * phase[:, None]
    return np.column_stack([np.ones_like(phase), np.cos(angles), np.sin(angles)])


def _contrasts(smooth: FloatArray) -> FloatArray:
    """An orthonormal basis [n, n - k] of what is orthogonal to smooth [n, k]."""
    return np.linalg.qr(smooth, mode="complete")[0][:, smooth.shape[1] :]
