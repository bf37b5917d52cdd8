"""The closed form that the filters share: the model is linear once φ, ε, the scatter s and the size q are given.

With y_t = ξ0 + Δ b_t + Σ_k w_k Z_tk + e_t, b by the course (`courses`) and e_t ~ N(0, d_t), d_t = v_t + s², normal priors
on ξ0, Δ and w (the discrepancy and the steps, `models.tracking.discrepancy`) lead to a normal posterior and to the
probability of the data with all of them integrated out. For an outlying run d_t has a further W². A few weighted sums
over the measurements are all that is needed, with weights r_t = 1/d_t and y_t taken from the prior mean of ξ0. The
further terms go first: with M = I + σZᵀRZσ = LLᵀ and N = L⁻¹ σZᵀR (1, y, b), each sum loses the product of its columns
of N.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.courses import FORM_COURSE, FORM_SIZE, basis, scatter_growth
from models.tracking.discrepancy import column_sds, columns
from models.tracking.history import History
from models.tracking.prior import Prior


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
class Conditional:
    """The normal posterior of (ξ0, Δ) given φ, ε, s and q: means, variances and covariance, equal shapes."""

    initial: FloatArray
    change: FloatArray
    initial_variance: FloatArray
    change_variance: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Where the closed form is taken: log |φ|, log |ε|, log s, the form (`courses`) [n]; which runs are outlying [t, n]."""

    log_scale: FloatArray
    log_exponent: FloatArray
    log_scatter: FloatArray
    form: NDArray[np.intp]
    outlying: FloatArray

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
    """The further terms of the points `where` [j] after elimination: their prior deviations σ [p, j], and by row Lᵀ (in the
    upper triangle) with N of the columns (1, y, b) beside it, [p, p + 3, j]."""

    where: NDArray[np.intp]
    sd: FloatArray
    rows: FloatArray

    @property
    def cross(self) -> FloatArray:
        """N of the columns (1, y, b); [3, p, j]."""
        return np.swapaxes(self.rows[:, self.rows.shape[0] :], 0, 1)


def evidence(sums: Sums, prior: Prior) -> FloatArray:
    """Log probability of the data given φ, ε, s and q, with ξ0, Δ and the further terms integrated out.

    -½ [Σ log(2π/r) + log|M| + log|A| + log(σ0² σΔ²) + Σ r z² - cᵀ A⁻¹ c], where z = y - E[ξ0] - E[Δ] b, c = (Σrz, Σrbz)
    and A is the posterior precision. By elimination, so that the nearly singular A of a curve that has saturated keeps
    its digits.
    """
    a00, _, c0, pivot, d1 = _eliminate(sums, prior)
    mean = prior.change_mean
    misfit = sums.ryy - 2.0 * mean * sums.rby + mean**2 * sums.rbb
    quadratic = c0**2 / a00 + d1**2 / pivot
    spread = math.log(prior.initial_sd) + math.log(prior.change_sd)
    return np.asarray(0.5 * (sums.log_r - np.log(a00 * pivot) - misfit + quadratic) - spread)


def conditional(sums: Sums, prior: Prior) -> Conditional:
    """The posterior of (ξ0, Δ) given φ, ε, s and q."""
    a00, a01, c0, pivot, d1 = _eliminate(sums, prior)
    change_variance = 1.0 / pivot
    slope = a01 / a00
    shift = d1 * change_variance
    return Conditional(
        initial=prior.initial_mean + c0 / a00 - slope * shift,
        change=prior.change_mean + shift,
        initial_variance=1.0 / a00 + slope**2 * change_variance,
        change_variance=change_variance,
        covariance=-slope * change_variance,
    )


def _eliminate(sums: Sums, prior: Prior) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    a00 = sums.r + prior.initial_sd**-2
    c0 = sums.ry - prior.change_mean * sums.rb
    c1 = sums.rby - prior.change_mean * sums.rbb
    slope = sums.rb / a00
    floor = prior.change_sd**-2
    pivot = floor + np.maximum(sums.rbb - sums.rb * slope, 0.0)
    return a00, sums.rb, c0, pivot, c1 - slope * c0


def log_outlying(prior: Prior, outlying: FloatArray) -> FloatArray:
    """Log prior probability of which runs are outlying, along the first axis of [t, ...]."""
    count = outlying.sum(axis=0)
    if prior.outlying_share == 0.0:
        return np.where(count > 0, -np.inf, 0.0)
    sound = outlying.shape[0] - count
    return np.asarray(count * math.log(prior.outlying_share) + sound * math.log1p(-prior.outlying_share))


def pointwise(history: History, prior: Prior, points: Points, table: FloatArray | None = None) -> tuple[Sums, Terms]:
    """The sums at n points, each [n], and the further terms after elimination; `table` may hold their b [t, n]."""
    b = points.basis(history.progress) if table is None else table
    d = np.multiply(points.outlying, (prior.outlying_size * prior.size) ** 2, out=np.empty(b.shape))
    d += history.variance[:, None]
    d += scatter_growth(points.form, history.relative(prior)).T * np.exp(2.0 * points.log_scatter)
    log_r = -_log_product(d) - b.shape[0] * math.log(2.0 * math.pi)
    r = np.divide(1.0, d, out=d)
    y = history.value - prior.initial_mean
    rb = r * b
    sums = Sums(
        r=r.sum(axis=0),
        rb=rb.sum(axis=0),
        rbb=np.einsum("tn,tn->n", rb, b),
        ry=y @ r,
        rby=y @ rb,
        ryy=y**2 @ r,
        log_r=log_r,
    )
    z = columns(history)
    sd = column_sds(prior, points.size, history.steps.size)
    where = np.flatnonzero(sd.any(axis=1))
    if where.size == 0:
        return sums, Terms(where=where, sd=sd[:0].T, rows=np.zeros((0, 3, 0)))
    terms = Terms(where=where, sd=sd[where].T, rows=_eliminated(z, y, r[:, where], rb[:, where], sd[where].T))
    return _without(sums, terms), terms


def last_outlying(history: History, prior: Prior, points: Points, sums: Sums, terms: Terms, last: FloatArray) -> Sums:
    """The sums and where the last run, whose b is `last` [n], is taken to be outlying and was not before.

    It gets a further term of its own with the deviation W, which is eliminated after the others.
    """
    y, sd = float(history.value[-1]) - prior.initial_mean, prior.outlying_size * prior.size
    growth = scatter_growth(points.form, history.relative(prior)[-1:])[:, 0]
    r = 1.0 / (history.variance[-1] + growth * np.exp(2.0 * points.log_scatter))
    pivot = 1.0 + sd**2 * r
    own = sd * r * np.stack([np.ones_like(last), np.full_like(last, y), last])
    if terms.where.size:
        at, rows = terms.where, terms.rows
        shared = terms.sd * columns(history)[-1][:, None] * (sd * r[at])
        for k in range(shared.shape[0]):
            shared[k] /= rows[k, k]
            shared[k + 1 :] -= rows[k, k + 1 : shared.shape[0]] * shared[k]
        pivot[at] -= np.square(shared).sum(axis=0)
        own[:, at] -= np.einsum("kj,ckj->cj", shared, terms.cross)
    own /= np.sqrt(pivot)
    lost = _products(own) | {"log_r": np.log(pivot)}
    return Sums(**{name: getattr(sums, name) - loss for name, loss in lost.items()})


def _log_product(d: FloatArray) -> FloatArray:
    """The logarithm of the product along the first axis of [t, ...], eight factors at a time: these neither overflow nor
    vanish where each lies within 1e±38."""
    blocks = [np.log(np.multiply.reduce(d[start : start + 8], axis=0)) for start in range(0, d.shape[0], 8)]
    return np.asarray(np.sum(blocks, axis=0)) if blocks else np.zeros(d.shape[1:])


def tabulated(
    history: History,
    prior: Prior,
    table: FloatArray,
    log_scatter: FloatArray,
    form: NDArray[np.intp],
    outlying: FloatArray,
    blur: FloatArray | float = 0.0,
) -> Sums:
    """The sums of k kinds by scatter levels by cells, by matrix products; [k, l, g], those without b [k, l, 1].

    `table` holds b, [t, g] or [k, t, g]; a kind has its own levels log_scatter [k, l], a form [k] and outlying runs
    [t, k]. `blur` is a further deviation of every measurement, one or [k].
    """
    further, growth = (prior.outlying_size * prior.size) ** 2, scatter_growth(form, history.relative(prior))
    fixed = history.variance + further * outlying.T + (np.zeros(form.size) + blur)[:, None] ** 2
    r = 1.0 / (fixed[:, None, :] + growth[:, None, :] * np.exp(2.0 * log_scatter)[:, :, None])
    y = history.value - prior.initial_mean
    rb, rby = np.split(np.concatenate([r, r * y], axis=1) @ table, 2, axis=1)
    sums = Sums(
        r=r.sum(axis=2)[:, :, None],
        rb=rb,
        rbb=r @ np.square(table),
        ry=(r @ y)[:, :, None],
        rby=rby,
        ryy=(r @ y**2)[:, :, None],
        log_r=(np.log(r).sum(axis=2) - y.size * math.log(2.0 * math.pi))[:, :, None],
    )
    z = columns(history)
    sd = column_sds(prior, FORM_SIZE[form], history.steps.size)
    where = np.flatnonzero(sd.any(axis=1))
    if where.size == 0:
        return sums
    sd = sd[where, None, :]
    weighted = (r[where, :, None, :] * z.T) * sd[..., None]
    root = np.linalg.cholesky(np.eye(z.shape[1]) + (weighted @ z) * sd[:, :, None, :])
    left = np.linalg.inv(root) @ weighted
    n_1, n_y = left.sum(axis=3), left @ y
    flat = left.reshape(where.size, n_y.shape[1] * n_y.shape[2], y.size)
    n_b = (flat @ (table if table.ndim == 2 else table[where])).reshape(*n_y.shape, -1)
    lost = {
        "r": np.square(n_1).sum(axis=2)[:, :, None],
        "rb": (n_1[:, :, None, :] @ n_b)[:, :, 0],
        "rbb": np.einsum("klpg,klpg->klg", n_b, n_b),
        "ry": (n_1 * n_y).sum(axis=2)[:, :, None],
        "rby": (n_y[:, :, None, :] @ n_b)[:, :, 0],
        "ryy": np.square(n_y).sum(axis=2)[:, :, None],
        "log_r": 2.0 * np.log(np.diagonal(root, axis1=2, axis2=3)).sum(axis=2)[:, :, None],
    }
    return _less(sums, lost, where)


def drawn_terms(terms: Terms, off_initial: FloatArray, change: FloatArray, normals: FloatArray) -> FloatArray:
    """Draws of the further terms given ξ0 (less its prior mean) and Δ, each [n], from normals [n, p]; [n, p].

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


def _eliminated(z: FloatArray, y: FloatArray, r: FloatArray, rb: FloatArray, sd: FloatArray) -> FloatArray:
    """`Terms.rows` from Z [t, p], y [t], r and r b [t, j], and σ [p, j]: Cholesky's elimination of all points at once, which
    is quicker than a factorisation of each."""
    terms = z.shape[1]
    rows = np.empty((terms, terms + 3, sd.shape[1]))
    sides = (r, r * y[:, None], rb)
    for k in range(terms):
        rows[k, k:terms] = (z[:, k:] * z[:, k : k + 1]).T @ r
        rows[k, k:terms] *= sd[k:]
        rows[k, terms:] = [z[:, k] @ side for side in sides]
        rows[k, k:] *= sd[k]
        rows[k, k] += 1.0
    for k in range(terms):
        rows[k, k:] /= np.sqrt(rows[k, k])
        for below in range(k + 1, terms):
            rows[below, below:] -= rows[k, below] * rows[k, below:]
    return rows


def _without(sums: Sums, terms: Terms) -> Sums:
    lost = {name: product.sum(axis=0) for name, product in _products(terms.cross).items()}
    diagonal = np.einsum("kkj->kj", terms.rows[:, : terms.sd.shape[0]])
    return _less(sums, lost | {"log_r": 2.0 * np.log(diagonal).sum(axis=0)}, terms.where)


def _products(n: FloatArray) -> dict[str, FloatArray]:
    """What the sums lose to terms whose N of the columns (1, y, b) is n [3, ...]."""
    n_1, n_y, n_b = n
    return {"r": n_1**2, "rb": n_1 * n_b, "rbb": n_b**2, "ry": n_1 * n_y, "rby": n_y * n_b, "ryy": n_y**2}


def _less(sums: Sums, lost: dict[str, FloatArray], where: NDArray[np.intp]) -> Sums:
    for name, loss in lost.items():
        getattr(sums, name)[where] -= loss
    return Sums(**{name: getattr(sums, name) for name in lost})
