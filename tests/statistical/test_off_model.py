"""Lives that are not one eq. 6, through the prior that the service takes from the first test: where the prognosis fails.

The laws are written here, apart from `models`, in the share x of life at which COF has halved. Seeds are fixed and printed;
`-s` shows the table that stands in docs/science.md.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest

from models.prognosis import first_passage
from models.rig.truth import draw
from models.tracking.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import weak

STAGES = (0.2, 0.4, 0.6, 0.8)
TESTS, LIVES, SCATTER = 25, 60, 0.003

LAWS: dict[str, Callable[[float], float]] = {
    "one eq. 6 (Δ = -0.75, ε = 0.8)": lambda x: 1 - 0.75 * (1 - (1 + 2.948 * x) ** -0.8),
    "exponential to a floor": lambda x: 1 - 0.6 * (1 - math.exp(-1.792 * x)),
    "logarithm": lambda x: 1 - 0.5 * math.log1p(20 * x) / math.log(21),
    "straight line": lambda x: 1 - 0.5 * x,
    "two stages": lambda x: 1 - 0.25 * (1 - math.exp(-8 * x)) - 0.25 * max(0.0, x - 0.3) / 0.7,
}


def followed(course: Callable[[float], float], rng: np.random.Generator) -> list[tuple[bool, bool]]:
    """For each stage of a life that ends at 10,000 cycles: does the interval hold the end, does it begin after it?"""
    end, grid = 10_000.0, Grid()
    seen: list[Measurement] = []
    told = []
    for share in np.linspace(0.0, 0.8, TESTS).tolist():
        cof = 0.1 * course(share) * (1 + SCATTER * rng.standard_normal())
        seen.append(Measurement(progress=share * end, value=cof, variance=(0.001 * cof) ** 2))
        if any(abs(share - stage) < 0.4 * 0.8 / (TESTS - 1) for stage in STAGES):
            posterior = grid.posterior(grid.from_history(weak(seen[0], falling=True), seen), 1_000, rng)
            found = first_passage(posterior, fraction=0.5, as_of=share * end).end_of_life
            low, high = found[0.05] or math.inf, found[0.95] or math.inf
            told.append((low <= end <= high, low > end))
    return told


def shares(course: Callable[[float], float], seed: int) -> tuple[list[float], list[float]]:
    """Share of lives whose interval holds the truth, and whose interval begins after it, by stage."""
    told = np.array([followed(course, np.random.default_rng([seed, life])) for life in range(LIVES)])
    return told[:, :, 0].mean(axis=0).tolist(), told[:, :, 1].mean(axis=0).tolist()


def test_the_table_of_where_it_fails() -> None:
    """One eq. 6 is held; what is not one eq. 6 is not, and the documentation says so instead of this test hiding it."""
    print(f"\nseed 900, {LIVES} lives a law\n\n| law | holds the truth at 20/40/60/80 % of life | begins after it |")
    print("|---|---|---|")
    found = {}
    for name, course in LAWS.items():
        held, late = found[name] = shares(course, 900)
        print(
            f"| {name} | {'/'.join(f'{100 * h:.0f}' for h in held)} % | {'/'.join(f'{100 * one:.0f}' for one in late)} % |"
        )
        assert course(0.0) == pytest.approx(1.0)
        assert course(1.0) == pytest.approx(0.5, abs=2e-3)
    held, late = found["one eq. 6 (Δ = -0.75, ε = 0.8)"]
    assert min(held) > 0.85
    assert max(late) < 0.1


def test_the_rigs_own_lives_are_held_though_they_are_not_one_eq_6() -> None:
    """Mean COF of curves whose four parameters follow an eq. 6 each: 60 clutches leave a deviation of 4 points."""
    told = []
    for seed in range(LIVES):
        clutch = draw(np.random.default_rng([901, seed]))
        end = clutch.end_of_life()
        assert end is not None
        fresh = clutch.mean_cof(0.0)
        told.append(
            followed(lambda x, c=clutch, e=end, f=fresh: c.mean_cof(x * e) / f, np.random.default_rng([902, seed]))
        )  # type: ignore[misc]
    held, late = np.array(told).mean(axis=0).T.tolist()
    print(f"\nthe simulated rig's lives, seeds 901 and 902: held {held}, begins after the truth {late}")
    assert min(held) > 0.85
    assert max(late) < 0.1
