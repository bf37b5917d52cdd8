"""Cholesky's elimination of many small systems at once, a few rows of columns of thousands of numbers.

The systems are those of the further terms of the closed form (`linear_model`): with j points or nodes, p terms and the
precision M = I + σZᵀRZσ of each, an operation on columns of j numbers takes far less time than j factorisations of p by p.
"""

import numpy as np

from models.arrays import FloatArray


def with_gram(z: FloatArray, r: FloatArray, sd: FloatArray, beside: int) -> FloatArray:
    """M = I + σZᵀRZσ in the upper triangles of rows [p, p + beside, j], from Z [t, p], r [t, j] and σ [p, j]."""
    terms = z.shape[1]
    rows = np.empty((terms, terms + beside, sd.shape[1]))
    for k in range(terms):
        np.matmul((z[:, k:] * z[:, k : k + 1]).T, r, out=rows[k, k:terms])
        rows[k, k:terms] *= sd[k:]
        rows[k, k:terms] *= sd[k]
        rows[k, k] += 1.0
    return rows


def factor(rows: FloatArray) -> None:
    """Cholesky's elimination of all points at once, which is quicker than a factorisation of each: M in the upper triangles
    of rows [p, p + m, j] becomes Lᵀ, and the m columns beside it become L⁻¹ times them."""
    terms = rows.shape[0]
    for k in range(terms):
        rows[k, k:] /= np.sqrt(rows[k, k])
        for below in range(k + 1, terms):
            rows[below, below:] -= rows[k, below] * rows[k, below:]
