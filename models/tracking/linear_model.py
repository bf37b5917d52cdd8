"""The closed form that the filters share: the model is linear once φ, ε, the scatter s and the size q are given.

With y_t = ξ0 + Δ b_t + Σ_k w_k Z_tk + e_t, b by the course (`courses`) and e_t ~ N(0, d_t), d_t = v_t + s², normal priors
on ξ0, Δ and w (the discrepancy and the steps, `models.tracking.discrepancy`) lead to a normal posterior and to the
probability of the data with all of them integrated out. For an outlying run d_t has a further W². A few weighted sums
over the measurements are all that is needed, with weights r_t = 1/d_t and y_t taken from the prior mean of ξ0. The
further terms go first: with M = I + σZᵀRZσ = LLᵀ and N = L⁻¹ σZᵀR (1, y, b), each sum loses the product of its columns
of N.
"""

import itertools
import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.courses import FORM_COURSE, FORM_PROPORTIONAL, FORM_SIZE, basis, scatter_growth
from models.tracking.discrepancy import PAST, column_sds, columns, smooth
from models.tracking.history import History, later_epochs
from models.tracking.merged_tests import MergedHistory
from models.tracking.prior import TrackPrior

#: Which of N of the columns (1, y, b) each sum loses the product of.
_SUMS = ("r", "ry", "rb", "ryy", "rby", "rbb")
#: Tests up to which all points are taken at once, and points of a block beyond, or of one of few points. Chosen: at 1,000
#: tests and 2,000 points blocks of 64, 128, 256 and 512 points take 25, 22, 23 and 24 ms, all at once 41.
WHOLE, BLOCK, FEW = 128, 128, 64
_PRODUCTS = dict(zip(_SUMS, itertools.combinations_with_replacement(range(3), 2), strict=True))


@dataclass(frozen=True, slots=True, kw_only=True)
class Sums:
    """Weighted sums over the measurements: Σr, Σrb, Σrb², Σry, Σrby, Σry², and Σ log r - log|M|; shapes broadcast."""

    r: FloatArray
    rb: FloatArray
    rbb: FloatArray
    ry: FloatArray
    rby: FloatArray
    ryy: FloatArray
    log_r: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluationPoints:
    """Points at which the closed form is evaluated: log |φ|, log |ε|, log s and the form (`courses`), each [n], and
    whether each run is outlying [t, n]."""

    log_scale: FloatArray
    log_exponent: FloatArray
    log_scatter: FloatArray
    form: NDArray[np.intp]
    outlying: FloatArray | NDArray[np.bool_]

    @property
    def course(self) -> NDArray[np.intp]:
        """The course of every point [n]."""
        return FORM_COURSE[self.form]

    @property
    def size(self) -> FloatArray:
        """The size q of the discrepancy of every point [n]."""
        return FORM_SIZE[self.form]

    def basis(self, progress: FloatArray) -> FloatArray:
        """b at progress [t] of every point, [t, n]."""
        return basis(progress[:, None], self.log_scale, self.log_exponent, self.course)


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """Cholesky factors of the further terms at the points `where` [j]: prior deviations σ [p, j], and `rows`
    [p, p + 3, j] with Lᵀ in the upper triangle and N of the columns (1, y, b) beside it."""

    where: NDArray[np.intp]
    sd: FloatArray
    rows: FloatArray

    @property
    def cross(self) -> FloatArray:
        """N of the columns (1, y, b); [3, p, j]."""
        return np.swapaxes(self.rows[:, self.rows.shape[0] :], 0, 1)


def evidence(sums: Sums, prior: TrackPrior) -> FloatArray:
    """Log probability of the data given φ, ε, s and q, with ξ0, Δ and the further terms integrated out.

    -½ [Σ log(2π/r) + log|M| + log|A| + log(σ0² σΔ²) + Σ r y² + E[Δ]²/σΔ² - cᵀ A⁻¹ c], where A is the posterior precision of
    (ξ0, Δ) and c = (Σry, Σrby + E[Δ]/σΔ²). By elimination, so that the nearly singular A of a curve that has saturated keeps
    its digits.
    """
    pivot, pull = _eliminate(sums, prior)
    a00 = sums.r + prior.initial_sd**-2
    fixed = sums.log_r - np.log(a00) - sums.ryy + sums.ry**2 / a00
    fixed -= (prior.change_mean / prior.change_sd) ** 2 + 2.0 * math.log(prior.initial_sd * prior.change_sd)
    np.square(pull, out=pull)
    pull /= pivot
    np.log(pivot, out=pivot)
    pull -= pivot
    pull += fixed
    pull *= 0.5
    return pull


def drawn_pair(sums: Sums, prior: TrackPrior, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Posterior draws of (ξ0, Δ) given φ, ε, s and q, each [n], from standard normals [n, 2]."""
    pivot, pull = _eliminate(sums, prior)
    a00 = sums.r + prior.initial_sd**-2
    change_variance = 1.0 / pivot
    slope = sums.rb / a00
    change = pull * change_variance
    initial = prior.initial_mean + sums.ry / a00 - slope * change
    initial_sd = np.sqrt(np.maximum(1.0 / a00 + slope**2 * change_variance, 1e-300))
    lean = -slope * change_variance / initial_sd
    remaining_sd = np.sqrt(np.maximum(change_variance - lean**2, 0.0))
    return initial + initial_sd * normals[:, 0], change + (lean * normals[:, 0] + remaining_sd * normals[:, 1])


def linear_moments(
    solved: tuple[Sums, Terms], prior: TrackPrior, of_initial: FloatArray, of_change: FloatArray, of_terms: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Posterior mean [k, n] and factors F [i, k, n] of the covariance Σ_i F_i F_iᵀ, given φ, ε, s and q, of k combinations
    of ξ0, Δ and the further terms w with the coefficients [k], [k, n] and [k, p].

    With C = L⁻¹ σGᵀ a combination G of w is Cᵀ (N_y - ξ0 N_1 - Δ N_b + z), z standard normal.
    """
    sums, terms = solved
    pivot, pull = _eliminate(sums, prior)
    a00 = sums.r + prior.initial_sd**-2
    slope, change = sums.rb / a00, pull / pivot
    off_initial = sums.ry / a00 - slope * change
    of_offset, of_change = np.repeat(of_initial[:, None], pivot.size, axis=1), of_change.copy()
    mean = prior.initial_mean * of_offset
    own = np.zeros((terms.sd.shape[0], *of_change.shape))
    if terms.where.size:
        at, (n_1, n_y, n_b) = terms.where, terms.cross
        part = of_terms.T[:, :, None] * terms.sd[:, None, :]
        for j in range(part.shape[0]):
            part[j] /= terms.rows[j, j]
            part[j + 1 :] -= terms.rows[j, j + 1 : part.shape[0], None, :] * part[j]
        own[:, :, at] = part
        mean[:, at] += np.einsum("pkj,pj->kj", part, n_y)
        of_offset[:, at] -= np.einsum("pkj,pj->kj", part, n_1)
        of_change[:, at] -= np.einsum("pkj,pj->kj", part, n_b)
    mean += of_offset * off_initial + of_change * change
    # of two independent normals: Δ about its mean, and ξ0 about its mean given Δ
    about = np.stack([of_offset / np.sqrt(a00), (of_change - slope * of_offset) / np.sqrt(pivot)])
    return mean, np.concatenate([about, own])


def _eliminate(sums: Sums, prior: TrackPrior) -> tuple[FloatArray, FloatArray]:
    """Posterior precision of Δ with ξ0 eliminated, and the right-hand side of its normal equation; their ratio,
    right-hand side over precision, is the mean of Δ."""
    least = prior.change_sd**-2
    lean = sums.rb / (sums.r + prior.initial_sd**-2)
    pull = sums.rby - lean * sums.ry
    pull += prior.change_mean * least
    lean *= sums.rb
    pivot = np.subtract(sums.rbb, lean, out=lean)
    np.maximum(pivot, 0.0, out=pivot)
    pivot += least
    return pivot, pull


def log_outlying(prior: TrackPrior, outlying: FloatArray | NDArray[np.bool_]) -> FloatArray:
    """Log prior probability of a set of outlying runs, flags along the first axis of [t, ...]."""
    count = outlying.sum(axis=0)
    if prior.outlying_share == 0.0:
        return np.where(count > 0, -np.inf, 0.0)
    sound = outlying.shape[0] - count
    return np.asarray(count * math.log(prior.outlying_share) + sound * math.log1p(-prior.outlying_share))


def pointwise(
    history: History, prior: TrackPrior, points: EvaluationPoints, table: FloatArray | None = None
) -> tuple[Sums, Terms]:
    """Weighted sums at n points, each [n], with the further terms eliminated, and their Cholesky factors; `table` may
    hold the points' b [t, n]."""
    if history.value.size > WHOLE and table is None and not isinstance(history, MergedHistory):
        return _in_blocks(history, prior, points)
    b = points.basis(history.progress) if table is None else table
    scatter = np.ones((3, b.shape[1]))
    np.exp(2.0 * points.log_scatter, out=scatter[1])
    np.multiply(scatter[1], FORM_PROPORTIONAL[points.form], out=scatter[2])
    scatter[1] -= scatter[2]
    d = np.array([history.variance, np.ones(b.shape[0]), prior.relative_squared(history.value)]).T @ scatter
    flagged, test = np.divmod(np.flatnonzero(points.outlying.T), b.shape[0])
    d[test, flagged] += points.outlying[test, flagged] * (prior.outlying_size * prior.size) ** 2
    y = history.value - prior.initial_mean
    if isinstance(history, MergedHistory):
        log_r = -history.count @ np.log(d) - history.count.sum() * math.log(2.0 * math.pi)
        r = np.divide(1.0, d, out=d)
        within = history.within @ r
        r *= history.count[:, None]
    else:
        log_r = -_log_product(d) - b.shape[0] * math.log(2.0 * math.pi)
        r, within = np.divide(1.0, d, out=d), np.zeros(1)
    rb = r * b
    plain = np.array([np.ones(y.size), y, y**2])
    r_sum, ry, ryy = plain @ r
    rb_sum, rby = plain[:2] @ rb
    ryy += within
    sums = Sums(r=r_sum, rb=rb_sum, rbb=np.einsum("tn,tn->n", rb, b), ry=ry, rby=rby, ryy=ryy, log_r=log_r)
    z = columns(history)
    where, sd = _disturbed(prior, points.size, history)
    if where.size == 0:
        return sums, Terms(where=where, sd=sd, rows=np.zeros((0, 3, 0)))
    rows = _factors_of_terms(z, y, r.take(where, axis=1), rb.take(where, axis=1), sd)
    terms = Terms(where=where, sd=sd, rows=rows)
    return _without(sums, terms), terms


def _in_blocks(history: History, prior: TrackPrior, points: EvaluationPoints) -> tuple[Sums, Terms]:
    """`pointwise` for a long history, equal up to rounding, in blocks of points that fit the processor's cache.

    On one of the stretches of δ, within an epoch, the columns Z are parabolas of progress: Z = P A with P = (1, v, v²). So
    the sums over its tests follow from those of r v^m, r y v^m and r b v^m. Blocks are equally wide, the last one filled up:
    so a point's sums do not depend on the others.
    """
    order = np.argsort(history.progress, kind="stable")
    progress, variance = history.progress[order], history.variance[order]
    relative, y = prior.relative_squared(history.value[order]), history.value[order] - prior.initial_mean
    parts = _parabolas(progress, y, history.epoch[order], span=history.span)
    count, terms = points.form.size, parts[0].columns.shape[1]
    width = BLOCK if count > FEW else FEW
    filled = np.minimum(np.arange(-(-count // width) * width), count - 1)
    log_scale, log_exponent, course = points.log_scale[filled], points.log_exponent[filled], points.course[filled]
    squared = np.exp(2.0 * points.log_scatter[filled])
    proportional = np.where(FORM_PROPORTIONAL[points.form[filled]], squared, 0.0)
    of_test, of_point = np.array([variance, np.ones(y.size), relative]).T, np.ones((3, filled.size))
    of_point[1:] = squared - proportional, proportional
    flagged, test = np.divmod(np.flatnonzero(points.outlying.T.astype(bool, copy=False)), progress.size)
    test, further = np.argsort(order)[test], (prior.outlying_size * prior.size) ** 2
    rbb, log_r = np.empty(filled.size), np.empty(filled.size)
    of_r, of_rb = np.empty((len(parts), 9, filled.size)), np.empty((len(parts), 4, filled.size))
    r, rb = np.empty((2, progress.size, width))
    for start in range(0, filled.size, width):
        block = slice(start, start + width)
        of_block = slice(*np.searchsorted(flagged, [start, start + width]).tolist())
        np.matmul(of_test, of_point[:, block], out=r)
        r[test[of_block], flagged[of_block] - start] += further
        log_r[block] = -_log_product(r)
        np.divide(1.0, r, out=r)
        b = basis(progress[:, None], log_scale[block], log_exponent[block], course[block])
        np.multiply(r, b, out=rb)
        for part, own_r, own_rb in zip(parts, of_r, of_rb, strict=True):
            np.matmul(part.of_r, r[part.tests], out=own_r[:, block])
            np.matmul(part.of_rb, rb[part.tests], out=own_rb[:, block])
        np.einsum("tn,tn->n", rb, b, out=rbb[block])
    (r_sum, ry, ryy), (rb_sum, rby) = of_r[:, [0, 5, 8]].sum(axis=0), of_rb[:, [0, 3]].sum(axis=0)
    log_r -= progress.size * math.log(2.0 * math.pi)
    plain = {"r": r_sum, "rb": rb_sum, "rbb": rbb, "ry": ry, "rby": rby, "ryy": ryy, "log_r": log_r}
    sums = Sums(**{name: column[:count].copy() for name, column in plain.items()})
    where, sd = _disturbed(prior, points.size, history)
    if where.size == 0:
        return sums, Terms(where=where, sd=sd, rows=np.zeros((0, 3, 0)))
    rows = np.empty((terms, terms + 3, filled.size))
    columns_of_v = np.concatenate([part.columns for part in parts]).T
    low, high = np.triu_indices(terms)
    products = np.concatenate([part.products[low, high] for part in parts], axis=1)
    rows[low, high] = products @ of_r[:, :5].reshape(-1, filled.size)
    for column, of_v in enumerate((of_r[:, :3], of_r[:, 5:8], of_rb[:, :3])):
        rows[:, terms + column] = columns_of_v @ of_v.reshape(-1, filled.size)
    further_terms = Terms(where=where, sd=sd, rows=_factored(rows[:, :, where], sd))
    return _without(sums, further_terms), further_terms


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parabola:
    """A group of tests on which the columns Z are parabolas of v: coefficients `columns` [3, p], those of the products
    of two of them, `products` [p, p, 5], and the weights [9, k] and [4, k] of r and of r b in the sums."""

    tests: slice
    columns: FloatArray
    products: FloatArray
    of_r: FloatArray
    of_rb: FloatArray


def _parabolas(progress: FloatArray, y: FloatArray, epoch: FloatArray, *, span: float) -> list[_Parabola]:
    """Groups of tests, one for each stretch of δ in each epoch; the tests [t] are in ascending progress."""
    later = np.array(later_epochs(epoch))
    stretch = np.clip(np.floor(progress / span * PAST), 0, PAST - 1)
    begun = np.flatnonzero((np.diff(stretch) != 0) | (np.diff(epoch) != 0)) + 1
    parts = []
    for first, last in itertools.pairwise([0, *begun.tolist(), progress.size]):
        middle, half = (stretch[first] + 0.5) / PAST, 0.5 / PAST
        before, at, after = smooth((middle + half * np.array([-1.0, 0.0, 1.0])) * span, span, PAST)
        of_delta = np.stack([at, 0.5 * (after - before), 0.5 * (after + before) - at])
        steps = np.zeros((3, later.size))
        steps[0] = epoch[first] >= later
        columns = np.concatenate([of_delta, steps], axis=1)
        products = np.zeros((columns.shape[1], columns.shape[1], 5))
        for i, j in itertools.product(range(3), repeat=2):
            products[:, :, i + j] += np.outer(columns[i], columns[j])
        tests = slice(first, last)
        powers = ((progress[tests] / span - middle) / half) ** np.arange(5)[:, None]
        of_r = np.concatenate([powers, powers[:3] * y[tests], y[None, tests] ** 2])
        of_rb = np.concatenate([powers[:3], y[None, tests]])
        parts.append(_Parabola(tests=tests, columns=columns, products=products, of_r=of_r, of_rb=of_rb))
    return parts


def solve_again(
    history: History, prior: TrackPrior, points: EvaluationPoints, index: NDArray[np.intp], sums: Sums, terms: Terms
) -> None:
    """Recomputes `pointwise` for changed points [k] at `index` [k], whose sizes q are unchanged, and writes it into
    `sums` and `terms`."""
    own_sums, own_terms = pointwise(history, prior, points)
    for field in fields(Sums):
        getattr(sums, field.name)[index] = getattr(own_sums, field.name)
    if own_terms.where.size:
        terms.rows[:, :, np.searchsorted(terms.where, index[own_terms.where])] = own_terms.rows


def solved_at(solved: tuple[Sums, Terms], index: NDArray[np.intp]) -> tuple[Sums, Terms]:
    """`pointwise` at the points of `index`, selected from that of all points."""
    sums, terms = solved
    place = np.full(sums.r.size, -1)
    place[terms.where] = np.arange(terms.where.size)
    where = np.flatnonzero(place[index] >= 0)
    columns_at = place[index][where]
    taken = Sums(**{field.name: getattr(sums, field.name)[index] for field in fields(Sums)})
    return taken, Terms(where=where, sd=terms.sd[:, columns_at], rows=terms.rows[:, :, columns_at])


def last_outlying(
    history: History, prior: TrackPrior, points: EvaluationPoints, sums: Sums, terms: Terms, last: FloatArray
) -> Sums:
    """The sums with the last run, of basis `last` [n], made outlying at every point where it was not.

    It gets a further term of its own with the deviation W, which is eliminated after the others.
    """
    y, sd = float(history.value[-1]) - prior.initial_mean, prior.outlying_size * prior.size
    growth = scatter_growth(points.form, prior.relative_squared(history.value)[-1:])[:, 0]
    r = 1.0 / (history.variance[-1] + growth * np.exp(2.0 * points.log_scatter))
    pivot = 1.0 + sd**2 * r
    scaled = sd * r * np.stack([np.ones_like(last), np.full_like(last, y), last])
    if terms.where.size:
        at, rows = terms.where, terms.rows
        shared = terms.sd * columns(history)[-1][:, None] * (sd * r[at])
        for k in range(shared.shape[0]):
            shared[k] /= rows[k, k]
            shared[k + 1 :] -= rows[k, k + 1 : shared.shape[0]] * shared[k]
        pivot[at] -= np.square(shared).sum(axis=0)
        scaled[:, at] -= np.einsum("kj,ckj->cj", shared, terms.cross)
    scaled /= np.sqrt(pivot)
    lost = {name: scaled[i] * scaled[j] for name, (i, j) in _PRODUCTS.items()} | {"log_r": np.log(pivot)}
    return Sums(**{name: getattr(sums, name) - loss for name, loss in lost.items()})


def _log_product(d: FloatArray) -> FloatArray:
    """The logarithm of the product along the first axis of [t, ...], eight factors at a time: these neither overflow nor
    vanish where each lies within 1e±38."""
    whole = d.shape[0] // 8
    products = np.multiply.reduce(d[: 8 * whole].reshape(whole, 8, *d.shape[1:]), axis=1)
    left = np.multiply.reduce(d[8 * whole :], axis=0, keepdims=True)
    return np.asarray(np.log(np.concatenate([products, left]) if d.shape[0] % 8 else products).sum(axis=0))


def tabulated(
    history: History,
    prior: TrackPrior,
    table: FloatArray,
    log_scatter: FloatArray,
    form: NDArray[np.intp],
    outlying: FloatArray,
    blur: FloatArray | float = 0.0,
    of: NDArray[np.intp] | None = None,
) -> Sums:
    """Weighted sums of the linear model over all nodes of a grid, by matrix products: [k, l, g] for k kinds (a form of the
    course with a set of outlying runs), l levels of scatter and g cells of the grid; sums without the basis b are [k, l, 1].

    `table` holds the basis b at the tests, [t, g] or [k, t, g]; a kind has its own levels log_scatter [k, l], a form [k] and
    outlying runs [t, k]. `blur` is a further deviation of every measurement, one or [k]. `of` [k] says where kinds share a
    basis, and the variance of every measurement with it: the table is [c, t, g] then, and theirs is that at `of`.

    Kinds whose courses may be disturbed lose the products of N = L⁻¹ σZᵀR (1, y, b), as in `pointwise`.
    """
    first = np.arange(form.size)
    if of is not None:
        used, first, of = np.unique(of, return_index=True, return_inverse=True)
        table = table[used]
    further = (prior.outlying_size * prior.size) ** 2
    growth = scatter_growth(form[first], prior.relative_squared(history.value))
    fixed = history.variance + further * outlying.T[first] + (np.zeros(form.size) + blur)[first, None] ** 2
    r = 1.0 / (fixed[:, None, :] + growth[:, None, :] * np.exp(2.0 * log_scatter[first])[:, :, None])
    y, z, levels = history.value - prior.initial_mean, columns(history), r.shape[1]
    if isinstance(history, MergedHistory):
        log_r = np.log(r) @ history.count - history.count.sum() * math.log(2.0 * math.pi)
        within = r @ history.within
        r *= history.count
    else:
        log_r, within = np.log(r).sum(axis=2) - y.size * math.log(2.0 * math.pi), np.zeros(1)
    pull = r * y
    sums = {"r": r.sum(axis=2), "ry": pull.sum(axis=2), "ryy": pull @ y + within, "log_r": log_r}
    sums["rbb"] = r @ np.square(table)
    where, sd = _disturbed(prior, FORM_SIZE[form], history)
    terms = z.shape[1] if where.size else 0
    leaned = (r[:, :, None, :] * z.T[:terms]).reshape(first.size, levels * terms, y.size)
    sums["rb"], sums["rby"], of_z = np.split(
        np.concatenate([r, pull, leaned], axis=1) @ table, [levels, 2 * levels], axis=1
    )
    if of is not None:
        sums = {name: column[of] for name, column in sums.items()}
    if where.size:
        own = where if of is None else of[where]
        gram, of_1, of_y = (
            (leaned @ each).reshape(first.size, levels, terms, -1) for each in (z, np.ones((y.size, 1)), y[:, None])
        )
        sd = sd.T[:, None, :]
        root = np.linalg.cholesky(np.eye(terms) + sd[..., None] * gram[own] * sd[:, :, None, :])
        inverse = np.linalg.inv(root) * sd[:, :, None, :]
        n_1, n_y = inverse @ of_1[own], inverse @ of_y[own]
        n_b = inverse @ of_z.reshape(first.size, levels, terms, -1)[own]
        lost = np.swapaxes(np.concatenate([n_1, n_y], axis=3), 2, 3) @ n_b
        sums["rb"][where] -= lost[:, :, 0]
        sums["rby"][where] -= lost[:, :, 1]
        sums["rbb"][where] -= np.square(n_b, out=n_b).sum(axis=2)
        log_diagonal = 2.0 * np.log(np.diagonal(root, axis1=2, axis2=3))
        for name, loss in {"r": n_1**2, "ry": n_1 * n_y, "ryy": n_y**2, "log_r": log_diagonal}.items():
            sums[name][where] -= loss.reshape(where.size, levels, terms).sum(axis=2)
    return Sums(**{name: column[:, :, None] if column.ndim == 2 else column for name, column in sums.items()})


def drawn_terms(terms: Terms, off_initial: FloatArray, change: FloatArray, normals: FloatArray) -> FloatArray:
    """Posterior draws [n, p] of the further terms given ξ0 (minus its prior mean) and Δ, each [n], from normals [n, p].

    w = σ L⁻ᵀ (N_y - ξ0 N_1 - Δ N_b + z); zero where there are none.
    """
    drawn = np.zeros_like(normals)
    if terms.where.size:
        at, (n_1, n_y, n_b) = terms.where, terms.cross
        right = n_y - off_initial[at] * n_1 - change[at] * n_b + normals[at].T
        for k in reversed(range(right.shape[0])):
            right[k] /= terms.rows[k, k]
            right[:k] -= terms.rows[:k, k] * right[k]
        drawn[at] = (terms.sd * right).T
    return drawn


def _disturbed(prior: TrackPrior, size: FloatArray, history: History) -> tuple[NDArray[np.intp], FloatArray]:
    """Indices [j] of the points, of sizes q [n], that have further terms (δ or level steps), and the prior standard
    deviations σ [p, j] of those terms."""
    where = np.flatnonzero(size > 0.0) if history.steps.size == 0 else np.arange(size.size)
    return where, column_sds(prior, size[where], history).T


def _factors_of_terms(z: FloatArray, y: FloatArray, r: FloatArray, rb: FloatArray, sd: FloatArray) -> FloatArray:
    """Cholesky factors `Terms.rows` [p, p + 3, j] of the further terms, from their design matrix Z [t, p], the values y
    [t], the precisions r and r b [t, j] at j points, and the terms' prior deviations σ [p, j]."""
    terms = z.shape[1]
    rows = np.empty((terms, terms + 3, sd.shape[1]))
    for k in range(terms):
        np.matmul((z[:, k:] * z[:, k : k + 1]).T, r, out=rows[k, k:terms])
    rows[:, terms : terms + 2] = (
        (np.concatenate([z, z * y[:, None]], axis=1).T @ r).reshape(2, terms, -1).swapaxes(0, 1)
    )
    rows[:, terms + 2] = z.T @ rb
    return _factored(rows, sd)


def _factored(rows: FloatArray, sd: FloatArray) -> FloatArray:
    """Cholesky factors `Terms.rows` from ZᵀRZ (its upper triangle) with ZᵀR of (1, y, b) beside it [p, p + 3, j], and σ
    [p, j]; computed in place."""
    terms = rows.shape[0]
    for k in range(terms):  # M = I + σZᵀRZσ
        rows[k, k:terms] *= sd[k:]
        rows[k, k:terms] *= sd[k]
        rows[k, k] += 1.0
    rows[:, terms:] *= sd[:, None]
    for k in range(terms):  # Cholesky's elimination of all points at once is quicker than a factorisation of each
        rows[k, k:] /= np.sqrt(rows[k, k])
        for below in range(k + 1, terms):
            rows[below, below:] -= rows[k, below] * rows[k, below:]
    return rows


def _without(sums: Sums, terms: Terms) -> Sums:
    """The sums at the points minus the further terms' part, changed in place."""
    cross = terms.cross
    lost = {name: np.einsum("pj,pj->j", cross[i], cross[j]) for name, (i, j) in _PRODUCTS.items()}
    diagonal = np.einsum("kkj->kj", terms.rows[:, : terms.sd.shape[0]])
    for name, loss in (lost | {"log_r": 2.0 * np.log(diagonal).sum(axis=0)}).items():
        getattr(sums, name)[terms.where] -= loss
    return sums
