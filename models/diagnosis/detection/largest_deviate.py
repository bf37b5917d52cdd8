"""The tail of the largest of correlated standard normals z_1 ... z_k, at which an alarm is raised.

    P(t) = P(max |z_i| > t) = k q E[1/S],     q = 2 Φ(-t),     S the number of |z_i| > t

where z is drawn given that one of them, each as likely, is beyond t (Owen, Maximov and Chertkov, Electron. J. Stat. 13,
2019, 231). The estimate is unbiased at every t, however far in the tail; independent normals (S = 1 mostly) and a single
one (S = k) are its ends.
"""

import numpy as np
from scipy.special import ndtr, ndtri

from models.arrays import FloatArray

#: Draws: the threshold then scatters by some 0.01 nats from seed to seed. Tried on 191 to 344 columns: 0.10 to 0.14 nats
#: with 400 plain draws extrapolated from the upper fifth, 0.04 with 4,000 and 0.015 with 20,000 of them, in 0.4 s.
DRAWS = 2000
#: Eigenvalues below this share of the largest are rounding.
_LEAST_EIGENVALUE = 1e-6
#: Rounds in which threshold and count of independent tests are made to agree; the count hardly hangs on the threshold.
_ROUNDS = 4


class LargestDeviate:
    """The tail for a correlation matrix [k, k] of unit diagonal; it draws from `rng` once."""

    def __init__(self, correlation: FloatArray, rng: np.random.Generator) -> None:
        values, vectors = np.linalg.eigh(correlation)
        strong = values > _LEAST_EIGENVALUE * values[-1]
        root = vectors[:, strong] * np.sqrt(values[strong])
        self._count = correlation.shape[0]
        beyond = np.arange(DRAWS) % self._count  # each as often
        free = root @ rng.standard_normal((int(strong.sum()), DRAWS))
        along = root @ root[beyond].T
        self._apart = free - along * free[beyond, np.arange(DRAWS)]  # independent of the one that is beyond
        self._along = along
        self._uniform = rng.uniform(size=DRAWS)

    def probability(self, deviate: float) -> float:
        """P(t) of the largest deviate t >= 0."""
        tail = 2 * float(ndtr(-deviate))
        if tail <= 0.0:
            return 0.0
        chosen = -ndtri(0.5 * tail * self._uniform)  # of a normal beyond t; its sign says nothing
        beyond = np.abs(self._apart + self._along * chosen) >= deviate * (1 - 1e-9)
        return float(min(1.0, self._count * tail * (1 / np.maximum(beyond.sum(axis=0), 1)).mean()))

    def threshold(self, share: float) -> float:
        """The t with P(t) = share in (0, 1)."""
        tests, deviate = float(self._count), 0.0
        for _ in range(_ROUNDS):
            deviate = -float(ndtri(-np.expm1(np.log1p(-share) / tests) / 2))
            tail = 2 * float(ndtr(-deviate))
            tests = max(1.0, float(np.log1p(-min(self.probability(deviate), 1 - 1e-12)) / np.log1p(-tail)))
        return deviate
