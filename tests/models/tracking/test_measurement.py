"""Measurements check themselves."""

import math

import pytest

from models.tracking.measurement import Measurement


@pytest.mark.parametrize("numbers", [(-1.0, 0.1, 0.0), (0.0, math.nan, 0.0), (0.0, 0.1, -1e-9), (math.inf, 0.1, 0.0)])
def test_measurements_check_themselves(numbers: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        Measurement(progress=numbers[0], value=numbers[1], variance=numbers[2])
