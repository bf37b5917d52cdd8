"""The array type of the numerics, 64-bit floats throughout, the check of plain numbers beside arrays, and arrays as keys."""

import math
from collections.abc import Iterable
from typing import Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
Value = TypeVar("Value")


class Same(Generic[Value]):
    """A wrapper that compares by identity, as a cache key: results computed from an array are found without comparing
    its numbers. None may change it."""

    def __init__(self, value: Value) -> None:
        self.value = value

    def __hash__(self) -> int:
        return id(self.value)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Same) and self.value is other.value


def require_finite(owner: object, names: Iterable[str], *, positive: bool = False) -> None:
    """Raises ValueError where one of these numbers of a value is not finite or negative, or 0 where they must be `positive`;
    None is no number."""
    for name in names:
        number = getattr(owner, name)
        if number is not None and not (math.isfinite(number) and (number > 0 if positive else number >= 0)):
            raise ValueError(f"{name} must be finite and {'positive' if positive else 'not negative'}, got {number}")
