"""Round numbers: more probable than their neighbours, and all together as probable as without."""

import numpy as np
import pytest

from models.plausibility.pace import roundness


@pytest.mark.parametrize("scale", [2500.0, 1e5])
def test_round_numbers_take_their_share_from_the_others(scale: float) -> None:
    """Over all multiples of the largest grain the mean is 1."""
    cycles = np.arange(1.0, 1e5 + 1)
    assert roundness(cycles, np.full(cycles.shape, scale)).mean() == pytest.approx(1.0)


def test_a_number_is_as_round_as_the_grains_that_divide_it() -> None:
    """Of 730 those of 1 to 500, of which 1, 2, 2.5, 5, 10 divide it; of 12.7 none."""
    assert roundness(730.0, 730.0) == pytest.approx(0.5 + 0.5 * (1 + 2 + 2.5 + 5 + 10) / 12)
    assert roundness(12.7, 12.7) == 0.5
