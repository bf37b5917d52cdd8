"""The array type of the numerics, 64-bit floats throughout, and the check of the plain numbers beside arrays."""

import math
from collections.abc import Iterable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]


def require_finite(owner: object, names: Iterable[str], *, positive: bool = False) -> None:
    """Raises ValueError where one of these numbers of a value is not finite or negative, or 0 where they must be `positive`;
    None is no number."""
    for name in names:
        number = getattr(owner, name)
        if number is not None and not (math.isfinite(number) and (number > 0 if positive else number >= 0)):
            raise ValueError(f"{name} must be finite and {'positive' if positive else 'not negative'}, got {number}")
