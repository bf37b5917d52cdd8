"""The exact posterior of eq. 6 on a grid: the witness of the other filters, and quick enough to be one itself.

The axes are log τ = log φ - log ε, log ε and log s. The data speak of the initial rate Δ/τ long before they tell φ
from ε, so along these axes the ridge of the posterior is nearly straight; the prior stays independent in log φ and
log ε. ξ0 and Δ are integrated out in closed form at every node (`models.tracking.linear`), for all scatter levels at
once by matrix products.

Each row of the grid (one ε) spans its own interval of log τ, so that the grid follows the ridge where it bends. As
the posterior shrinks a hundredfold over a life the grid closes in on it: a coarse grid over the prior's range finds
where the mass is, the next is laid there, until nothing shrinks any more; the full grid comes last. A coarse row
could step over a narrow peak, so every measurement is blurred on it by about what the model changes from node to
node.

The integrand is smooth and vanishes at the edges (or the prior ends there, at four deviations), where equidistant
nodes converge geometrically. Draws are spread evenly within their cells and weighted by the exact density, so that
quantiles do not show the grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from models.arrays import FloatArray
from models.tracking.linear import History, basis, conditional, evidence, pointwise, resolved, tabulated
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior
from models.tracking.protocol import Posterior
from models.tracking.sampling import correlated_pair, spread_points, systematic, thinned

#: The prior's range in deviations to either side.
REACH = 4.0
#: A node belongs to the mass where its log density is less than this below the highest: 4.2 deviations of a normal.
DEPTH = 9.0
#: Blur of a coarse grid for each e-fold of τ between nodes, as a share of the observed change. A node off by half a
#: step changes b by 0.18 at most, and most of that goes into ξ0 and Δ.
BLUR = 0.03
#: Nodes along log τ (the first time, and then), log ε and log s while closing in; how often; what shrinking is worth
#: it.
FIRST, COARSE = 65, (11, 8, 7)
CLOSINGS = 8
WORTHWHILE = 0.7
#: A row cannot resolve a ridge whose width depends on a scatter still unknown; draws are cheap then, and made up to
#: this many times over and thinned, while there are fewer than MANY measurements.
OVERSAMPLING, MANY = 8, 24


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Where a grid lies: rows of log ε and levels of log s, equidistant, and each row's interval of log τ."""

    log_exponent: FloatArray
    log_scatter: FloatArray
    lower: FloatArray
    upper: FloatArray

    def resized(self, rows: int, levels: int) -> "Frame":
        """The same region with other numbers of rows and levels; intervals are interpolated between rows."""
        log_exponent = np.linspace(self.log_exponent[0], self.log_exponent[-1], rows)
        return Frame(
            log_exponent=log_exponent,
            log_scatter=np.linspace(self.log_scatter[0], self.log_scatter[-1], levels),
            lower=np.interp(log_exponent, self.log_exponent, self.lower),
            upper=np.interp(log_exponent, self.log_exponent, self.upper),
        )

    def log_rate(self, nodes: int) -> FloatArray:
        """Nodes of log τ, [rows, nodes]."""
        return np.asarray(self.lower[:, None] + (self.upper - self.lower)[:, None] * np.linspace(0.0, 1.0, nodes))


@dataclass(frozen=True, slots=True, kw_only=True)
class GridState:
    """Everything measured, the grid's frame, and the posterior's mass [levels, rows, nodes] on it, summing to one."""

    prior: Prior
    history: History
    frame: Frame
    mass: FloatArray

    def to_arrays(self) -> dict[str, FloatArray]:
        """The state as named arrays; `from_arrays` gives it back exactly."""
        frame = {name: getattr(self.frame, name) for name in Frame.__slots__}
        return {"prior": self.prior.to_array(), "mass": self.mass} | frame | self.history.to_arrays()

    @classmethod
    def from_arrays(cls, arrays: dict[str, FloatArray]) -> "GridState":
        """The inverse of `to_arrays`."""
        return cls(
            prior=Prior.from_array(arrays["prior"]),
            history=History.from_arrays(arrays),
            frame=Frame(**{name: arrays[name] for name in Frame.__slots__}),
            mass=arrays["mass"],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """The filter: `nodes` of log τ on each of `rows` of log ε, at `levels` of log s; each at least 2."""

    nodes: int = 21
    rows: int = 21
    levels: int = 11

    @property
    def name(self) -> str:
        """`grid`."""
        return "grid"

    def start(self, prior: Prior) -> GridState:
        """The prior on its own range."""
        return self.from_history(prior, ())

    def update(self, state: GridState, measurement: Measurement, rng: np.random.Generator | None = None) -> GridState:  # noqa: ARG002
        """The posterior with one more measurement, laid anew over the whole history; exact, so chance is not used."""
        return self.laid_over(state.prior, state.history.append(resolved(measurement, state.prior)))

    def from_history(
        self, prior: Prior, measurements: Sequence[Measurement], table: FloatArray | None = None
    ) -> GridState:
        """The posterior of all measurements at once: the same as `update` with one after another, bit for bit.

        `table` may hold `basis(prior, progress)`, to be shared by series that have φ, ε and the progress in common.
        """
        return self.laid_over(prior, History.of([resolved(m, prior) for m in measurements]), table)

    @staticmethod
    def basis(prior: Prior, progress: FloatArray) -> FloatArray:
        """The first coarse grid's table of b, [t, cells], at progress [t]; it depends on the prior of φ and ε
        alone."""
        return _table(_whole(prior), FIRST, progress)

    def laid_over(self, prior: Prior, history: History, table: FloatArray | None = None) -> GridState:
        """`from_history` for measurements that are columns already."""
        frame = _closed_in(prior, history, table).resized(self.rows, self.levels)
        density = _log_density(prior, history, frame, _table(frame, self.nodes, history.progress), 0.0)
        mass = np.exp(density - density.max()) * (frame.upper - frame.lower)[:, None]
        return GridState(prior=prior, history=history, frame=frame, mass=mass / mass.sum())

    def posterior(self, state: GridState, size: int, rng: np.random.Generator) -> Posterior:
        """`size` draws: systematic over the cells, evenly spread within them, weighted by the exact density."""
        prior, frame = state.prior, state.frame
        offset = rng.random(7)
        count = size * min(max(MANY // max(state.history.progress.size, 1), 1), OVERSAMPLING)
        points = spread_points(count, offset[:5])
        cell = np.unravel_index(systematic(state.mass.ravel(), count, float(offset[5])), state.mass.shape)
        log_scatter = _within(frame.log_scatter, cell[0], points[:, 0])
        log_exponent = _within(frame.log_exponent, cell[1], points[:, 1])
        lower = np.interp(log_exponent, frame.log_exponent, frame.lower)
        width = np.interp(log_exponent, frame.log_exponent, frame.upper) - lower
        place = _within(np.linspace(0.0, 1.0, state.mass.shape[2]), cell[2], points[:, 2])
        log_scale = np.asarray(lower + width * place) + log_exponent
        sums = pointwise(state.history, prior, log_scale, log_exponent, log_scatter)
        density = evidence(sums, prior) + prior.log_density(log_scale, log_exponent, log_scatter)
        weight = np.exp(density - density.max()) * width / state.mass[cell]
        given = conditional(sums, prior)
        pair = correlated_pair(ndtri(points[:, 3:]), given.initial_variance, given.change_variance, given.covariance)
        drawn = Posterior(
            weight=weight / weight.sum(),
            initial=given.initial + pair[:, 0],
            change=given.change + pair[:, 1],
            scale=np.exp(log_scale),
            exponent=np.exp(log_exponent),
            scatter=np.exp(log_scatter),
        )
        return drawn if count == size else thinned(drawn, size, float(offset[6]))


def _within(axis: FloatArray, index: NDArray[np.intp], place: FloatArray) -> FloatArray:
    """A place in [0, 1) within the cell around each node of an equidistant axis."""
    return np.asarray(axis[index] + (place - 0.5) * (axis[1] - axis[0]))


def _whole(prior: Prior) -> Frame:
    _, rows, levels = COARSE
    log_exponent = prior.log_exponent_mean + np.linspace(-REACH, REACH, rows) * prior.log_exponent_sd
    low = prior.log_scale_mean - REACH * prior.log_scale_sd
    high = prior.log_scale_mean + REACH * prior.log_scale_sd
    log_scatter = prior.log_scatter_mean + np.linspace(-REACH, REACH, levels) * prior.log_scatter_sd
    return Frame(
        log_exponent=log_exponent, log_scatter=log_scatter, lower=low - log_exponent, upper=high - log_exponent
    )


def _closed_in(prior: Prior, history: History, table: FloatArray | None) -> Frame:
    """The region that holds the posterior's mass, found by coarse grids each laid over what the last one left."""
    frame = _whole(prior)
    if history.value.size == 0:
        return frame
    nodes, rows, levels = COARSE
    table = _table(frame, FIRST, history.progress) if table is None else table
    share = BLUR * float(np.ptp(history.value))
    narrower = float((frame.upper - frame.lower).max())
    for _ in range(CLOSINGS):
        blur, widest = share * narrower / (table.shape[1] / rows - 1), narrower
        density = _log_density(prior, history, frame, table, blur)
        closer = _shrunk(frame, density)
        narrower = float((closer.upper - closer.lower).max())
        shrunk = (
            narrower / widest,
            np.ptp(closer.log_exponent) / np.ptp(frame.log_exponent),
            np.ptp(closer.log_scatter) / np.ptp(frame.log_scatter),
        )
        frame = closer.resized(rows, levels)
        if min(shrunk) > WORTHWHILE:
            if blur < 0.5 * np.exp(closer.log_scatter.mean()):
                break
            share *= 0.3
        table = _table(frame, nodes, history.progress)
    return frame


def _shrunk(frame: Frame, density: FloatArray) -> Frame:
    """The rows, levels and intervals that hold mass, with a node to spare on either side."""
    nodes = density.shape[2]
    by_row = density.max(axis=0)
    held = by_row > by_row.max(axis=1, keepdims=True) - DEPTH
    first = np.maximum(held.argmax(axis=1) - 1, 0)
    last = np.minimum(nodes - held[:, ::-1].argmax(axis=1), nodes - 1)
    step = (frame.upper - frame.lower) / (nodes - 1)
    closer = replace(frame, lower=frame.lower + first * step, upper=frame.lower + last * step)
    rows = _held(by_row.max(axis=1))
    levels = _held(density.max(axis=(1, 2)))
    return Frame(
        log_exponent=closer.log_exponent[rows],
        log_scatter=closer.log_scatter[levels],
        lower=closer.lower[rows],
        upper=closer.upper[rows],
    )


def _held(density: FloatArray) -> slice:
    held = np.flatnonzero(density > density.max() - DEPTH)
    return slice(max(int(held[0]) - 1, 0), int(held[-1]) + 2)


def _table(frame: Frame, nodes: int, progress: FloatArray) -> FloatArray:
    """b at progress [t] on the cells of all rows, [t, rows · nodes]."""
    log_exponent = frame.log_exponent[:, None]
    table = basis(progress[:, None, None], frame.log_rate(nodes) + log_exponent, log_exponent)
    return table.reshape(progress.size, log_exponent.size * nodes)


def _log_density(prior: Prior, history: History, frame: Frame, table: FloatArray, blur: float) -> FloatArray:
    """Log posterior density up to a constant, [levels, rows, nodes]."""
    rows, levels = frame.log_exponent.size, frame.log_scatter.size
    log_exponent = frame.log_exponent[:, None]
    log_scale = frame.log_rate(table.shape[1] // rows) + log_exponent
    flat = prior.log_density(log_scale, log_exponent, frame.log_scatter[:, None, None])
    return np.asarray(
        evidence(tabulated(history, prior, table, frame.log_scatter, blur), prior).reshape(levels, rows, -1) + flat
    )
