"""Equality of floats bit by bit."""

import numpy as np
from numpy.typing import NDArray


def bits(array: NDArray[np.float64]) -> NDArray[np.uint64]:
    return np.ascontiguousarray(array).view(np.uint64)


def same_bits(left: NDArray[np.float64], right: NDArray[np.float64]) -> bool:
    return left.dtype == right.dtype == np.float64 and np.array_equal(bits(left), bits(right))
