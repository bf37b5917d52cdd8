"""Laws of degradation that are not eq. 6, in the share x of life at which COF has halved; written apart from `models`."""

import math
from collections.abc import Callable

import numpy as np

from models.tracking.measurement import Measurement

TESTS, SCATTER = 25, 0.003

LAWS: dict[str, Callable[[float], float]] = {
    "one eq. 6 (Δ = -0.75, ε = 0.8)": lambda x: 1 - 0.75 * (1 - (1 + 2.948 * x) ** -0.8),
    "exponential to a floor": lambda x: 1 - 0.6 * (1 - math.exp(-1.792 * x)),
    "logarithm": lambda x: 1 - 0.5 * math.log1p(20 * x) / math.log(21),
    "straight line": lambda x: 1 - 0.5 * x,
    "accelerating (n = -1)": lambda x: 1 - 0.75 * (1 - math.sqrt(1 - x / 1.125)),
    "exponential growth": lambda x: 1 - 0.5 * math.expm1(3 * x) / math.expm1(3),
    "two stages": lambda x: 1 - 0.25 * (1 - math.exp(-8 * x)) - 0.25 * max(0.0, x - 0.3) / 0.7,
}


def observed(course: Callable[[float], float], rng: np.random.Generator, end: float) -> list[Measurement]:
    """Tests up to 80 % of a life."""
    seen = []
    for share in np.linspace(0.0, 0.8, TESTS).tolist():
        cof = 0.1 * course(share) * (1 + SCATTER * rng.standard_normal())
        seen.append(Measurement(progress=share * end, value=cof, variance=(0.001 * cof) ** 2))
    return seen
