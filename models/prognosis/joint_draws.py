"""Joint draws of eq. 6 of several quantities whose measurements err together: the Stribeck parameters of one pressure.

The errors of a fit's four parameters are correlated: where M_s is estimated too large, C_v is estimated too small, and the
torque hardly changes. Tracks of each parameter alone lose that: their sum is then known worse than it was measured. Given
φ and ε of each, ξ0 and Δ of all are jointly normal (generalised least squares with the covariance of every fit), and the
evidence has a closed form; so draws of (φ, ε) from the quantities' own tracks, combined at random, are weighted by joint
evidence over the product of their own:

    y_t = ξ0 + Δ ∘ b_t(φ, ε) + e_t,   e_t ~ N(0, V_t + S)

Where a few combinations would take all weight, the weights are tempered until enough of them count. `paired` combines draws
of several pressures: a normal with the wanted correlation is drawn, and each column's draws are put into the order of its
ranks.

Source: R. L. Iman, W. J. Conover, Commun. Stat. Simul. Comput. 11 (1982) 311-334, for the pairing.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.tracking.courses import Course, basis
from models.tracking.posterior import Posterior
from models.tracking.sampling import systematic

#: Combinations that are tried, and how many must count in the end.
_TRIED, _FEWEST = 3_000, 60


def draw_jointly(
    progress: FloatArray,
    values: FloatArray,
    covariance: FloatArray,
    own: Sequence[Posterior],
    size: int,
    rng: np.random.Generator,
) -> list[Posterior]:
    """`size` equal draws of each of q quantities, row by row together, from their own tracks.

    `progress` [t] >= 0 and `values` [t, q] with `covariance` [t, q, q], positive definite: that of the fit and the scatter
    between tests. `own` are the quantities' own samples: of these only φ and ε are used.
    """
    quantities = values.shape[1]
    index = np.stack([systematic(track.weight, _TRIED, float(rng.random())) for track in own], axis=1)
    index = np.take_along_axis(index, np.argsort(rng.random(index.shape), axis=0), axis=0)
    scale = np.stack([np.log(track.scale[i]) for track, i in zip(own, index.T, strict=True)])
    exponent = np.stack([np.log(track.exponent[i]) for track, i in zip(own, index.T, strict=True)])
    b = basis(progress[:, None, None], scale, exponent, np.array(Course.EQ_6))  # [t, q, n]
    typical = np.maximum(np.abs(values).max(axis=0), 1e-300)
    scaled, spread = values / typical, covariance / np.outer(typical, typical)
    mean, root, evidence = _solved(b, scaled, np.asarray(np.linalg.inv(spread), dtype=np.float64))
    for column in range(quantities):
        alone = 1.0 / spread[:, column, column]
        evidence -= _solved(b[:, [column]], scaled[:, [column]], alone[:, None, None])[2]
    kept = systematic(_tempered(evidence), size, float(rng.random()))
    drawn = mean[kept] + np.linalg.solve(
        np.swapaxes(root[kept], 1, 2), rng.standard_normal((size, 2 * quantities, 1))
    ).squeeze(2)
    drawn = drawn.reshape(size, 2, quantities) * typical
    return [
        Posterior(
            weight=np.full(size, 1.0 / size),
            initial=drawn[:, 0, column],
            change=drawn[:, 1, column],
            scale=np.exp(scale[column, kept]),
            exponent=np.exp(exponent[column, kept]),
            scatter=own[column].scatter[index[kept, column]],
        )
        for column in range(quantities)
    ]


def _solved(b: FloatArray, values: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of (ξ0 [q], Δ [q]) given b [t, q, n]: mean [n, 2q], Cholesky root of the precision [n, 2q, 2q], log evidence [n]."""
    q, n = values.shape[1], b.shape[2]
    around = values[0]
    precision = np.empty((n, 2 * q, 2 * q))
    precision[:, :q, :q] = weight.sum(axis=0)
    precision[:, :q, q:] = np.einsum("tjk,tkn->njk", weight, b)
    precision[:, q:, :q] = np.swapaxes(precision[:, :q, q:], 1, 2)
    precision[:, q:, q:] = np.einsum("tjn,tjk,tkn->njk", b, weight, b, optimize=True)
    precision += np.diag(np.repeat([0.5**-2, 1.0**-2], q))  # of ξ0 and Δ, as weak as the prior of a single track
    pulled = np.einsum("tjk,tk->tj", weight, values - around)
    right = np.empty((n, 2 * q))
    right[:, :q] = pulled.sum(axis=0)
    right[:, q:] = np.einsum("tjn,tj->nj", b, pulled)
    root = np.linalg.cholesky(precision)
    half = np.linalg.solve(root, right[:, :, None])
    mean = np.linalg.solve(np.swapaxes(root, 1, 2), half).squeeze(2)
    mean[:, :q] += around
    log_root = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
    return mean, root, np.asarray(0.5 * np.square(half).sum(axis=(1, 2)) - log_root)


def _tempered(log_weight: FloatArray) -> FloatArray:
    """Weights [n] that sum to one, their logarithms shrunk until _FEWEST count."""
    off = log_weight - log_weight.max()
    while True:
        weight = np.exp(off)
        weight /= weight.sum()
        if 1.0 / np.square(weight).sum() >= min(_FEWEST, weight.size):
            return np.asarray(weight)
        off = 0.8 * off


def shrunk_correlation(residuals: FloatArray) -> FloatArray:
    """The correlation [k, k] of residuals [t, k] from test to test, shrunk towards none."""
    count, size = residuals.shape
    spread = residuals.std(axis=0) if count > 1 else np.zeros(size)
    if not (spread > 0.0).all():
        return np.eye(size)
    scaled = (residuals - residuals.mean(axis=0)) / spread
    share = count / (count + 5.0)  # no correlation is worth five tests
    return np.asarray(share * scaled.T @ scaled / count + (1.0 - share) * np.eye(size))


def paired(values: FloatArray, wanted: FloatArray, rng: np.random.Generator) -> NDArray[np.intp]:
    """Which draw of each column stands in each row [n, k], so that values [n, k] have about the correlation [k, k]."""
    n, k = values.shape
    roots, vectors = np.linalg.eigh(wanted)
    normals = rng.standard_normal((n, k)) @ (vectors * np.sqrt(np.maximum(roots, 0.0))).T
    order = np.argsort(values, axis=0, kind="stable")
    ranks = np.argsort(np.argsort(normals, axis=0, kind="stable"), axis=0, kind="stable")
    return np.asarray(np.take_along_axis(order, ranks, axis=0), dtype=np.intp)
