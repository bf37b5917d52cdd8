"""The exact posterior of eq. 6's family on a grid: the reference of the other filters, and quick enough to be one itself.

ξ0, Δ, the discrepancy and the steps are integrated out in closed form at every node (`tracking.linear_model`), for all
scatter levels at once by matrix products; the grid lies where the mass is (`tracking.filters.lattice`). The integrand is
smooth and vanishes at the edges (or the prior ends there, at four deviations), where equidistant nodes converge
geometrically. Draws are spread evenly within their cells and weighted by the exact density, so that quantiles do not
show the grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from models.arrays import FloatArray
from models.tracking.courses import log_scale_at
from models.tracking.filters import lattice
from models.tracking.filters.lattice import Kinds, LatticeFrame, completed
from models.tracking.history import History
from models.tracking.linear_model import EvaluationPoints, Sums, Terms, evidence, pointwise
from models.tracking.measurement import Measurement
from models.tracking.merged_tests import merged
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import TrackPrior
from models.tracking.sampling import spread_points, systematic, thinned, with_linear_terms

#: A row cannot resolve a ridge whose width depends on a scatter still unknown; draws are cheap then, and made up to
#: this many times over and thinned, while there are fewer than MANY measurements.
OVERSAMPLING, MANY = 4, 12
#: The share of a cell's mass that counts for its neighbour along an axis when cells are drawn.
BLEND = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class GridState:
    """The state of the grid filter, all measurements: the posterior is computed again over the whole history, so
    nothing else is carried on."""

    prior: TrackPrior
    history: History

    def to_arrays(self) -> dict[str, FloatArray]:
        """The state as named arrays; `from_arrays` gives it back exactly."""
        return {"prior": self.prior.to_array()} | self.history.to_arrays()

    @classmethod
    def from_arrays(cls, arrays: dict[str, FloatArray]) -> "GridState":
        """The inverse of `to_arrays`."""
        return cls(prior=TrackPrior.from_array(arrays["prior"]), history=History.from_arrays(arrays))


@dataclass(frozen=True, slots=True, kw_only=True)
class Laid:
    """The posterior on its grid: the kinds of history of non-negligible mass, the grid's frame, and the posterior's
    mass [kinds, levels, rows, nodes] on it, summing to one. `log_evidence` is the log probability of everything
    measured, up to a constant of the prior."""

    kinds: Kinds
    frame: LatticeFrame
    mass: FloatArray
    log_evidence: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """The exact filter on a grid: `nodes` of log τ on each of `rows` of log ε, at `levels` of log s; each at least 2.

    An update only stores the measurement: the discrepancy is expressed in shares of the progress measured so far, so that
    all sums over the history change with every test. The grid is computed when draws are requested.
    """

    name: ClassVar[str] = "grid"
    nodes: int = 21
    rows: int = 21
    levels: int = 11

    def start(self, prior: TrackPrior) -> GridState:
        """The state without measurements."""
        return self.from_history(prior, ())

    def update(self, state: GridState, measurement: Measurement, rng: np.random.Generator | None = None) -> GridState:  # noqa: ARG002
        """The state after one more measurement; exact, so `rng` is not used."""
        return GridState(prior=state.prior, history=state.history.append(measurement, state.prior))

    @staticmethod
    def from_history(prior: TrackPrior, measurements: Sequence[Measurement]) -> GridState:
        """The state after all measurements at once: the same as `update` with one after another, bit for bit."""
        return GridState(prior=prior, history=History.of(measurements, prior))

    @staticmethod
    def from_merged(prior: TrackPrior, measurements: Sequence[Measurement]) -> GridState:
        """The state after all measurements at once, the older ones of a long history merged: nearly the same posterior
        at a cost that does not grow with their number (`tracking.merged_tests`)."""
        return GridState(prior=prior, history=merged(History.of(measurements, prior), prior))

    def laid(self, state: GridState) -> Laid:
        """The posterior of all measurements on its grid."""
        prior, history = state.prior, state.history
        kinds, frame = completed(prior, history, *lattice.closed_in(prior, history))
        frame = frame.resized(self.rows, self.levels)
        table = lattice.tabled(frame, self.nodes, history, kinds.course)
        density = lattice.log_density(prior, history, kinds, frame, table)
        top = density.max()
        mass = np.exp(density - top) * frame.cells(self.nodes)[:, None, :, None]
        total = mass.sum()
        return Laid(kinds=kinds, frame=frame, mass=mass / total, log_evidence=float(top + np.log(total)))

    def posterior(self, state: GridState, size: int, rng: np.random.Generator) -> TrackPosterior:
        """`size` draws: systematic over the cells, evenly spread within them, weighted by the exact density."""
        return self.drawn(state, self.laid(state), size, rng)

    def drawn(self, state: GridState, laid: Laid, size: int, rng: np.random.Generator) -> TrackPosterior:
        """Draws from a posterior that has been computed on its grid."""
        prior, history = state.prior, state.history
        offset = rng.random(7)
        count = size * min(max(MANY // max(history.progress.size, 1), 1), OVERSAMPLING)
        uniform = spread_points(count, offset[:5])
        points, weight, solved = self.points(state, laid, uniform[:, :3], float(offset[5]))
        sample = with_linear_terms(history, prior, points, solved, weight, ndtri(uniform[:, 3:]), rng)
        return sample if count == size else thinned(sample, size, float(offset[6]))

    def points(
        self, state: GridState, laid: Laid, uniform: FloatArray, offset: float
    ) -> tuple[EvaluationPoints, FloatArray, tuple[Sums, Terms]]:
        """Points, placed within their cells by uniform numbers [n, 3], their weights [n], which sum to one, and the closed
        form at each (`linear_model.pointwise`)."""
        prior, history = state.prior, state.history
        chance = _blended(laid.mass)
        cell = np.unravel_index(systematic(chance.ravel(), len(uniform), offset), chance.shape)
        points, volume = _placed(laid, cell, uniform, history.span)
        solved = pointwise(history, prior, points)
        density = evidence(solved[0], prior) + prior.log_density(
            points.log_scale, points.log_exponent, points.log_scatter
        )
        density += laid.kinds.log_weight[cell[0]]
        weight = np.exp(density - density.max()) * volume / chance[cell]
        return points, weight / weight.sum(), solved


def _blended(mass: FloatArray) -> FloatArray:
    """Sampling probability of each cell: its mass blended with its neighbours', [kinds, levels, rows, nodes].

    A ridge narrower than a cell may run past the nodes of a row; such a cell has too little mass for what it holds, and
    one draw out of it would outweigh hundreds of others.
    """
    blended = mass
    for axis in (1, 2, 3):
        along = np.moveaxis(blended, axis, -1)
        sides = np.zeros_like(along)
        sides[..., 1:] += along[..., :-1]
        sides[..., :-1] += along[..., 1:]
        blended = np.moveaxis((1.0 - 2.0 * BLEND) * along + BLEND * sides, -1, axis)
    return np.ascontiguousarray(blended)


def _placed(
    laid: Laid, cell: tuple[NDArray[np.intp], ...], uniform: FloatArray, span: float
) -> tuple[EvaluationPoints, FloatArray]:
    """Points placed within their cells by uniform numbers [n, 3], and the volume of (log φ, log ε, log s) that each
    represents [n]."""
    frame, (kind, level, row, node) = laid.frame, cell
    log_scatter = _within(frame.log_scatter, kind, level, uniform[:, 0])
    log_exponent = _within(frame.log_exponent, kind, row, uniform[:, 1])
    kind_frame = frame.taken(kind)
    lower, upper = (kind_frame.at(log_exponent[:, None], edge)[:, 0] for edge in (kind_frame.lower, kind_frame.upper))
    nodes = laid.mass.shape[3]
    steps = np.ptp(frame.log_exponent, axis=1) * np.ptp(frame.log_scatter, axis=1)
    log_rate = lower + (upper - lower) * (node + uniform[:, 2] - 0.5) / (nodes - 1)
    log_scale, stretch = log_scale_at(log_rate + log_exponent, laid.kinds.course[kind], span)
    points = EvaluationPoints(
        log_scale=log_scale,
        log_exponent=log_exponent,
        log_scatter=log_scatter,
        form=laid.kinds.form[kind],
        outlying=laid.kinds.outlying[kind].T,
    )
    return points, (upper - lower) * steps[kind] * np.exp(stretch)


def _within(axis: FloatArray, kind: NDArray[np.intp], index: NDArray[np.intp], place: FloatArray) -> FloatArray:
    """Coordinates at relative positions in [0, 1) within the cells around nodes of an equidistant axis [k, nodes]."""
    return np.asarray(axis[kind, index] + (place - 0.5) * (axis[kind, 1] - axis[kind, 0]))
