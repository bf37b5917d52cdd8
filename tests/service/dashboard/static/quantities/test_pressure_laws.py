"""The band of a pressure law as it is drawn, against the service's own laws and their derivatives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from models.friction.pressure_laws import AsymptoticLaw, LinearLaw
from tests.browser.modules import Module

pytestmark = pytest.mark.browser

LINEAR = {"intercept": 2.0, "slope_per_bar": 3.0, "covariance": [[0.04, -0.006], [-0.006, 0.0016]]}
FALLING = {
    "asymptote": 0.6, "excess": 4.0, "decay_bar": 1.6,
    "covariance": [[0.01, -0.02, 0.003], [-0.02, 0.09, -0.01], [0.003, -0.01, 0.005]],
}  # fmt: skip


@pytest.mark.parametrize(
    ("drawn", "law"),
    [(LINEAR, LinearLaw(intercept=2.0, slope=3.0)), (FALLING, AsymptoticLaw(asymptote=0.6, excess=4.0, decay=1.6))],
    ids=["linear", "falling"],
)
def test_a_law_is_drawn_with_the_band_of_its_covariance(
    loaded: Callable[[str], Module], drawn: dict[str, Any], law: LinearLaw | AsymptoticLaw
) -> None:
    laws = loaded("quantities/pressure_laws.js")
    for pressure in (4.0, 5.5, 7.0):
        at = np.array([pressure])
        (gradient,) = law.gradient(at)
        point = laws("lawAt", drawn, pressure)
        assert point["value"] == pytest.approx(law(at)[0])
        assert point["sd"] == pytest.approx(np.sqrt(gradient @ np.array(drawn["covariance"]) @ gradient))
        assert point["sd"] != pytest.approx(
            np.sqrt(np.trace(np.array(drawn["covariance"]) * np.outer(gradient, gradient)))
        )
