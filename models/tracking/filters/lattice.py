"""Where the grid lies, and how it closes in on the posterior's mass.

The axes are log τ = log φ - log ε, log ε and log s. The data determine the initial rate Δ/τ long before they
distinguish φ from ε, so along these axes the ridge of the posterior is nearly straight; the prior stays independent in
log φ and log ε. There is one such lattice for each kind of history: a form (a course and a size q of the discrepancy,
`courses`) and a set of outlying runs. Where a course ends, at |φ|, the first axis is log(|φ| - T) - log ε with T
the progress measured so far: what is left until then is what matters.

Each row of a lattice (one ε) spans its own interval of log τ, so that the lattice follows the curved ridge. As
the posterior shrinks a hundredfold over a life the lattice closes in on it: a coarse one over the prior's range finds
where the mass is, the next is laid there, until nothing shrinks any more. A coarse row could step over a narrow peak,
so every measurement is blurred on it by about what the model changes from node to node.

The first search may overlook sets of outlying runs: a run that is three deviations off is less far off a blurred course.
Once the lattices have closed in nothing is blurred any more: the gain of turning a run is computed again at nodes of the
leading kinds, and the sets with a sufficient gain get lattices where those kinds have theirs. A set that is overlooked would
not only lack its share of the posterior: it would also bias the scatter, which then has to explain the run.
"""

from dataclasses import dataclass, fields, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.courses import (
    FORM_COURSE,
    FORM_SIZE,
    CourseForm,
    basis,
    form_of,
    log_form_weight,
    log_scale_at,
    scatter_growth,
)
from models.tracking.criteria import DEPTH, MOST, OTHER_SIZES, REACH
from models.tracking.history import History
from models.tracking.linear_model import evidence, log_outlying, tabulated
from models.tracking.outlying_runs import NODES, TEMPER, Nodes, OutlierSearch, gains
from models.tracking.prior import TrackPrior

#: Nodes along log τ (the first time, and then), log ε and log s while closing in.
_FIRST, COARSE = 65, (11, 8, 7)
#: Of each form the one that stands for it on the first lattice, which is so blurred that the law of the scatter and smaller
#: differences of q hardly matter there: a larger q's mass lies no less wide.
_FIRST_SIZES = np.where(
    FORM_COURSE == CourseForm.EQ_6, FORM_SIZE, np.where(OTHER_SIZES[1] >= FORM_SIZE, OTHER_SIZES[1], OTHER_SIZES[-1])
)
_STANDS_FOR = form_of(FORM_COURSE, _FIRST_SIZES, np.zeros(FORM_SIZE.size, dtype=bool))
LAID_FIRST = np.unique(_STANDS_FOR)


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinds:
    """The k kinds of history on lattices: their form [k], whether each run is outlying [k, t] (0, 1), log prior
    probability [k]."""

    form: NDArray[np.intp]
    outlying: FloatArray
    log_weight: FloatArray

    @classmethod
    def of(cls, prior: TrackPrior, outlying: FloatArray, forms: NDArray[np.intp]) -> "Kinds":
        """All combinations of the `forms` that the prior allows with the sets of outlying runs [c, t]."""
        weight = log_form_weight(prior)
        possible = forms[np.isfinite(weight[forms])]
        sets = np.repeat(outlying, possible.size, axis=0)
        return cls(
            form=np.tile(possible, outlying.shape[0]),
            outlying=sets,
            log_weight=np.tile(weight[possible], outlying.shape[0]) + log_outlying(prior, sets.T),
        )

    @property
    def size(self) -> FloatArray:
        """The size q of the discrepancy of every kind [k]."""
        return FORM_SIZE[self.form]

    @property
    def course(self) -> NDArray[np.intp]:
        """The course of every kind [k]."""
        return FORM_COURSE[self.form]

    def taken(self, index: NDArray[np.intp]) -> "Kinds":
        """The kinds at `index`."""
        return Kinds(**{field.name: getattr(self, field.name)[index] for field in fields(self)})


def represented(prior: TrackPrior, laid: Kinds) -> tuple[Kinds, NDArray[np.intp]]:
    """All kinds, and for each the index of the kind of `laid` that represents it on the first lattice."""
    weight = log_form_weight(prior)
    groups = [np.flatnonzero((form == _STANDS_FOR) & np.isfinite(weight)) for form in laid.form.tolist()]
    index, form = np.repeat(np.arange(laid.form.size), [forms.size for forms in groups]), np.concatenate(groups)
    lean = weight[form] - weight[laid.form[index]]
    return Kinds(form=form, outlying=laid.outlying[index], log_weight=laid.log_weight[index] + lean), index


@dataclass(frozen=True, slots=True, kw_only=True)
class LatticeFrame:
    """The extent of each kind's lattice: rows of log ε [k, r] and levels of log s [k, l], equidistant, and each row's
    interval of log τ, [k, r]."""

    log_exponent: FloatArray
    log_scatter: FloatArray
    lower: FloatArray
    upper: FloatArray

    def resized(self, rows: int, levels: int) -> "LatticeFrame":
        """The frame with other numbers of rows and levels over the same regions; intervals are interpolated between
        rows."""
        log_exponent = _spaced(self.log_exponent[:, 0], self.log_exponent[:, -1], rows)
        return LatticeFrame(
            log_exponent=log_exponent,
            log_scatter=_spaced(self.log_scatter[:, 0], self.log_scatter[:, -1], levels),
            lower=self.at(log_exponent, self.lower),
            upper=self.at(log_exponent, self.upper),
        )

    def at(self, log_exponent: FloatArray, edge: FloatArray) -> FloatArray:
        """An edge [k, r] of the rows' intervals at other rows [k, n], linear between rows."""
        last = edge.shape[1] - 1
        step = (self.log_exponent[:, -1:] - self.log_exponent[:, :1]) / last
        place = np.clip((log_exponent - self.log_exponent[:, :1]) / step, 0.0, last)
        row = np.minimum(place.astype(np.intp), last - 1)
        below = np.take_along_axis(edge, row, axis=1)
        return np.asarray(below + (place - row) * (np.take_along_axis(edge, row + 1, axis=1) - below))

    def log_rate(self, nodes: int) -> FloatArray:
        """Nodes of log τ, [k, rows, nodes]."""
        return _spaced(self.lower, self.upper, nodes)

    def cells(self, nodes: int) -> FloatArray:
        """Volume of a lattice cell, [k, rows]."""
        steps = np.ptp(self.log_exponent, axis=1) * np.ptp(self.log_scatter, axis=1)
        return np.asarray((self.upper - self.lower) * steps[:, None] / (nodes - 1))

    def taken(self, index: NDArray[np.intp]) -> "LatticeFrame":
        """The frames of the kinds at `index`."""
        return LatticeFrame(**{field.name: getattr(self, field.name)[index] for field in fields(self)})


def whole(prior: TrackPrior) -> LatticeFrame:
    """The frame over the prior's whole range, for a single kind."""
    _, rows, levels = COARSE
    log_exponent = prior.log_exponent_mean + np.linspace(-REACH, REACH, rows) * prior.log_exponent_sd
    low = prior.log_scale_mean - REACH * prior.log_scale_sd
    high = prior.log_scale_mean + REACH * prior.log_scale_sd
    log_scatter = prior.log_scatter_mean + np.linspace(-REACH, REACH, levels) * prior.log_scatter_sd
    return LatticeFrame(
        log_exponent=log_exponent[None],
        log_scatter=log_scatter[None],
        lower=(low - log_exponent)[None],
        upper=(high - log_exponent)[None],
    )


def tabled(frame: LatticeFrame, nodes: int, history: History, course: NDArray[np.intp]) -> FloatArray:
    """Basis b [k, t, rows · nodes] of courses [k] at every measurement on all nodes; one frame serves all."""
    log_exponent, by_kind = frame.log_exponent[:, None, :, None], course[:, None, None, None]
    log_scale, _ = log_scale_at(frame.log_rate(nodes)[:, None] + log_exponent, by_kind, history.span)
    table = basis(history.progress[:, None, None], log_scale, log_exponent, by_kind)
    return table.reshape(course.size, history.progress.size, log_exponent.shape[2] * nodes)


def log_density(
    prior: TrackPrior,
    history: History,
    kinds: Kinds,
    frame: LatticeFrame,
    table: FloatArray,
    blur: FloatArray | float = 0.0,
    of: NDArray[np.intp] | None = None,
) -> FloatArray:
    """Log posterior density [k, levels, rows, nodes], up to a constant, of each kind at the lattice's values of scatter,
    exponent and scale. A frame of one kind serves all.

    `of` [k]: the index of each kind's table; kinds with one table share the variance of every measurement."""
    count, rows = kinds.form.size, frame.log_exponent.shape[1]
    levels = np.broadcast_to(frame.log_scatter, (count, frame.log_scatter.shape[1]))
    sums = tabulated(history, prior, table, levels, kinds.form, kinds.outlying.T, blur, of)
    log_exponent = frame.log_exponent[:, None, :, None]
    place, by_kind = frame.log_rate(table.shape[-1] // rows)[:, None] + log_exponent, kinds.course[:, None, None, None]
    log_scale, stretch = log_scale_at(place, by_kind, history.span)
    density = evidence(sums, prior).reshape(count, levels.shape[1], rows, -1)
    density += prior.log_density(log_scale, log_exponent, prior.log_scatter_mean) + stretch
    of_scatter = prior.log_density(prior.log_scale_mean, prior.log_exponent_mean, levels)
    density += (of_scatter + kinds.log_weight[:, None])[:, :, None, None]
    return density


def closed_in(prior: TrackPrior, history: History) -> tuple[Kinds, LatticeFrame, FloatArray]:
    """The kinds with non-negligible posterior mass, the lattice frames that cover it, found by repeatedly shrinking
    coarse lattices, and the log mass of each kind [k] on the last of these."""
    first = whole(prior)
    if history.value.size == 0:
        kinds = Kinds.of(prior, np.zeros((1, 0)), np.arange(FORM_SIZE.size))
        return kinds, first.taken(np.zeros(kinds.form.size, dtype=np.intp)), kinds.log_weight
    # for each e-fold of τ between nodes: off by half a step b is off by 0.18 at most, and most of that goes into ξ0 and
    # Δ
    share = 0.03 * float(np.ptp(history.value))
    courses = np.unique(FORM_COURSE[np.isfinite(log_form_weight(prior))])
    table = np.zeros((len(CourseForm), history.value.size, COARSE[1] * _FIRST))
    table[courses] = tabled(first, _FIRST, history, courses)
    blur = share * float((first.upper - first.lower).max()) / (_FIRST - 1)
    kinds, density = _likely_kinds(prior, history, first, table, blur)
    frame = shrunk(first.taken(np.zeros(kinds.form.size, dtype=np.intp)), density).resized(*COARSE[1:])
    log_mass = log_masses(density, first.cells(_FIRST)) - kinds.log_weight
    kinds, laid = represented(prior, kinds)
    log_mass = log_mass[laid] + kinds.log_weight
    likely_nodes = np.flatnonzero(log_mass > log_mass.max() - 10.0)  # the first lattice is blurred
    kinds, frame, log_mass = kinds.taken(likely_nodes), frame.taken(laid[likely_nodes]), log_mass[likely_nodes]
    shares, left = np.full(likely_nodes.size, share), np.ones(likely_nodes.size, dtype=bool)
    for _ in range(8):
        now = np.flatnonzero(left)
        if now.size == 0:
            break
        wide = frame.taken(now)
        closer, log_mass[now], blurs = _closer(prior, history, kinds.taken(now), wide, shares[now])
        settled = _shrinkage(wide, closer) > 0.7
        left[now] = ~(settled & (blurs < 0.5 * np.exp(closer.log_scatter.mean(axis=1))))
        shares[now] *= np.where(settled, 0.3, 1.0)  # one that did not shrink is less blurred
        for field in fields(LatticeFrame):
            getattr(frame, field.name)[now] = getattr(closer, field.name)
    log_mass[left] = log_mass.max()
    likely_nodes = np.flatnonzero(log_mass > log_mass.max() - 6.0)
    return kinds.taken(likely_nodes), frame.taken(likely_nodes), log_mass[likely_nodes]


def _closer(
    prior: TrackPrior, history: History, kinds: Kinds, frame: LatticeFrame, share: FloatArray
) -> tuple[LatticeFrame, FloatArray, FloatArray]:
    """The frame shrunk to the mass on a coarse lattice over `frame`, the log mass of each kind [k], and the blur used
    [k], in the quantity's unit: `share` [k] for each e-fold of τ between nodes."""
    nodes = COARSE[0]
    blurs = share * (frame.upper - frame.lower).max(axis=1) / (nodes - 1)
    density = log_density(prior, history, kinds, frame, tabled(frame, nodes, history, kinds.course), blurs)
    return shrunk(frame, density), log_masses(density, frame.cells(nodes)), blurs


def _likely_kinds(
    prior: TrackPrior, history: History, frame: LatticeFrame, table: FloatArray, blur: float
) -> tuple[Kinds, FloatArray]:
    """Kinds of every form with each likely set of outlying runs, as found by search, and their log posterior densities
    on the first coarse lattice."""
    search, densities = OutlierSearch.begun(prior, history), {}

    def looked_at(outlying: FloatArray) -> FloatArray:
        if outlying.tobytes() not in densities:
            kinds = Kinds.of(prior, outlying[None], LAID_FIRST)
            densities[outlying.tobytes()] = log_density(prior, history, kinds, frame, table, blur, kinds.course)
        return densities[outlying.tobytes()]

    while (outlying := search.next()) is not None:
        plain = looked_at(outlying) - log_outlying(prior, outlying) + np.log(frame.cells(_FIRST))[:, None, :, None]
        total = float(plain.max() + np.log(np.exp(plain - plain.max()).sum()))
        search.learn(outlying, total, *_chosen(prior, history, frame, table, plain - total, blur))
    sets = search.kept()
    return Kinds.of(prior, sets, LAID_FIRST), np.concatenate([looked_at(outlying) for outlying in sets])


def _chosen(
    prior: TrackPrior, history: History, frame: LatticeFrame, table: FloatArray, log_mass: FloatArray, blur: float
) -> tuple[Nodes, Nodes]:
    """NODES nodes of each level of s by tempered systematic sampling, and the best node of each level."""
    _, levels, rows, nodes = log_mass.shape
    by_level = np.moveaxis(log_mass, 1, 0).reshape(levels, -1)

    def at(cells: NDArray[np.intp], log_share: FloatArray | float) -> Nodes:
        level = np.repeat(np.arange(levels), cells.shape[1])
        kind, cell = np.divmod(cells.ravel(), rows * nodes)
        form = LAID_FIRST[np.isfinite(log_form_weight(prior)[LAID_FIRST])][kind]
        return Nodes(
            b=table[FORM_COURSE[form], :, cell],
            noise=scatter_growth(form, prior.relative_squared(history.value))
            * np.exp(2.0 * frame.log_scatter[0, level])[:, None]
            + blur**2,
            size=FORM_SIZE[form],
            log_weight=(np.take_along_axis(by_level, cells, axis=1) - log_share).ravel(),
        )

    return at(*_tempered(by_level, NODES)), at(by_level.argmax(axis=1)[:, None], 0.0)


def log_masses(density: FloatArray, cells: FloatArray) -> FloatArray:
    """Log mass of each kind [k], from densities on cells of volume [k, rows] or [1, rows]."""
    top = density.max(axis=(1, 2, 3))
    off = np.exp(density - top[:, None, None, None]).sum(axis=(1, 3))
    return np.asarray(top + np.log((off * cells).sum(axis=1)))


Part = TypeVar("Part", Kinds, LatticeFrame)


def joined(first: Part, second: Part) -> Part:
    """The kinds of both, or their frames, concatenated."""
    columns = {
        field.name: np.concatenate([getattr(part, field.name) for part in (first, second)]) for field in fields(first)
    }
    return replace(first, **columns)


def shrunk(frame: LatticeFrame, density: FloatArray) -> LatticeFrame:
    """The frame shrunk to the rows, levels and intervals that hold mass, with one node to spare on either side and the
    same numbers of rows and levels."""
    nodes = density.shape[3]
    by_row = density.max(axis=1)
    first, last = _held(by_row)
    step = (frame.upper - frame.lower) / (nodes - 1)
    lower, upper = frame.lower + first * step, frame.lower + last * step
    row_low, row_high = _held(by_row.max(axis=2))
    level_low, level_high = _held(density.max(axis=(2, 3)))
    kind = np.arange(density.shape[0])
    rows, levels = frame.log_exponent, frame.log_scatter
    within = LatticeFrame(log_exponent=rows, log_scatter=levels, lower=lower, upper=upper)
    log_exponent = _spaced(rows[kind, row_low], rows[kind, row_high], rows.shape[1])
    return LatticeFrame(
        log_exponent=log_exponent,
        log_scatter=_spaced(levels[kind, level_low], levels[kind, level_high], levels.shape[1]),
        lower=within.at(log_exponent, within.lower),
        upper=within.at(log_exponent, within.upper),
    )


def _held(density: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last index along the last axis with non-negligible density, with one node to spare on either side."""
    is_likely = density > density.max(axis=-1, keepdims=True) - DEPTH
    last = density.shape[-1] - 1
    return np.maximum(is_likely.argmax(axis=-1) - 1, 0), np.minimum(
        last - is_likely[..., ::-1].argmax(axis=-1) + 1, last
    )


def _shrinkage(wide: LatticeFrame, closer: LatticeFrame) -> FloatArray:
    """Ratio [k] of new to old width of the widest interval, of the rows or of the levels, whichever shrank most."""
    interval = (closer.upper - closer.lower).max(axis=1) / (wide.upper - wide.lower).max(axis=1)
    rows = np.ptp(closer.log_exponent, axis=1) / np.ptp(wide.log_exponent, axis=1)
    levels = np.ptp(closer.log_scatter, axis=1) / np.ptp(wide.log_scatter, axis=1)
    return np.asarray(np.minimum(interval, np.minimum(rows, levels)))


def _spaced(low: FloatArray, high: FloatArray, count: int) -> FloatArray:
    """`count` numbers from low to high [...], equidistant along a new last axis."""
    return np.asarray(low[..., None] + (high - low)[..., None] * (np.arange(count) / (count - 1)))


def completed(
    prior: TrackPrior, history: History, kinds: Kinds, frame: LatticeFrame, log_mass: FloatArray
) -> tuple[Kinds, LatticeFrame]:
    """The kinds and their frames, completed by overlooked sets of outlying runs: neighbours, by one run, of the three
    kinds of largest `log_mass` [k]."""
    if prior.outlying_share == 0.0 or history.value.size < 2:
        return kinds, frame
    leaders = np.argsort(-log_mass, kind="stable")[:3]  # the three that lead
    leading, where = kinds.taken(leaders), frame.taken(leaders)
    table = tabled(where, COARSE[0], history, leading.course)
    density = log_density(prior, history, leading, where, table)
    mass = density + np.log(where.cells(COARSE[0]))[:, None, :, None]
    mass -= log_masses(density, where.cells(COARSE[0])).max()
    laid = {_name(form, outlying) for form, outlying in zip(kinds.form, kinds.outlying, strict=True)}
    relative = prior.relative_squared(history.value)
    overlooked: dict[bytes, tuple[float, int, FloatArray]] = {}
    for leader in range(leaders.size):
        gain = gains(prior, history, leading.outlying[leader], _nodes(leading, where, table, mass, leader, relative))
        for run in np.flatnonzero(gain > -3.0).tolist():
            outlying = leading.outlying[leader].copy()
            outlying[run] = 1.0 - outlying[run]
            name = _name(leading.form[leader], outlying)
            if name not in laid and gain[run] > overlooked.get(name, (-np.inf,))[0]:
                overlooked[name] = (float(gain[run]), leader, outlying)
    if not overlooked:
        return kinds, frame
    best = sorted(overlooked.values(), key=lambda candidate: candidate[0], reverse=True)[:MOST]
    of, outlying = np.array([leader for _, leader, _ in best]), np.stack([runs for _, _, runs in best])
    weight = leading.log_weight[of] - log_outlying(prior, leading.outlying[of].T) + log_outlying(prior, outlying.T)
    more, places = Kinds(form=leading.form[of], outlying=outlying, log_weight=weight), where.taken(of)
    closer = shrunk(places, log_density(prior, history, more, places, table[of]))
    return joined(kinds, more), joined(frame, closer)


def _nodes(
    kinds: Kinds, frame: LatticeFrame, table: FloatArray, mass: FloatArray, kind: int, relative: FloatArray
) -> Nodes:
    """32 nodes of one kind by tempered systematic sampling of their mass."""
    drawn, log_share = _tempered(mass[kind].reshape(1, -1), 32)
    level, cell = np.divmod(drawn[0], mass.shape[2] * mass.shape[3])
    return Nodes(
        b=table[kind][:, cell].T,
        noise=np.exp(2.0 * frame.log_scatter[kind, level])[:, None] * scatter_growth(kinds.form[[kind]], relative),
        size=np.full(drawn.size, kinds.size[kind]),
        log_weight=mass[kind].ravel()[drawn[0]] - log_share[0],
    )


def _tempered(log_mass: FloatArray, count: int) -> tuple[NDArray[np.intp], FloatArray]:
    """Systematic draws [r, count] of nodes from mass^TEMPER in each row [r, n], and the log of each drawn node's
    expected number of draws [r, count]; the flattening keeps nodes that an outlying run makes look improbable."""
    chance = np.exp(TEMPER * (log_mass - log_mass.max(axis=1, keepdims=True)))
    edges = np.cumsum(chance, axis=1)
    places = (np.arange(count) + 0.5) / count
    drawn = np.stack([np.searchsorted(row, places * row[-1]) for row in edges])
    return drawn, np.log(count * np.take_along_axis(chance, drawn, axis=1) / edges[:, -1:])


def _name(form: int, outlying: FloatArray) -> bytes:
    """A form with its set of outlying runs, as a key."""
    return np.append(outlying, form).tobytes()
