"""The direction of the last change, by hand."""

import numpy as np
import pytest

from models.diagnosis.effects.faults import last_direction


@pytest.mark.parametrize(
    ("values", "breaks", "expected"),
    [
        ([1.0, 1.0, 2.0, 2.0, 2.001, 1.0, 1.0], [0], [0, 0, 1, 1, 1, -1, -1]),
        ([1.0, 2.0, 1.0, 1.0, 2.0], [0, 2], [0, 1, 0, 0, 1]),
        ([3.0], [0], [0]),
    ],
)
def test_the_direction_is_that_of_the_last_change(values: list[float], breaks: list[int], expected: list[int]) -> None:
    """A run begins at each of the breaks."""
    previous = np.arange(-1, len(values) - 1)
    previous[breaks] = -1
    assert last_direction(np.array(values), previous).tolist() == expected
