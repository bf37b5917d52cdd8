"""The simulated lining wears as figs. 4 and 5 of the reference show: smooth and flat at the end."""

import numpy as np
import pytest

from models.rig.campaign import simulated_clutch
from models.rig.surface import surface
from models.rig.truth import SimulatedClutch

CLUTCHES = (SimulatedClutch(), simulated_clutch(1))


@pytest.mark.parametrize("clutch", CLUTCHES, ids=["nominal", "drawn"])
def test_roughness_and_skewness_are_the_references_before_and_after_the_tests(clutch: SimulatedClutch) -> None:
    end = clutch.end_of_life()
    assert end is not None
    fresh, worn = surface(clutch, 0.0), surface(clutch, 2 * end)
    assert (fresh.roughness, fresh.skewness) == pytest.approx((9.52e-6, -0.87))
    assert (worn.roughness, worn.skewness) == pytest.approx((1.94e-6, -3.4))
    halved = surface(clutch, end)
    assert (halved.roughness, halved.skewness) == pytest.approx((1.94e-6, -3.4), rel=1e-6)


@pytest.mark.parametrize("clutch", CLUTCHES, ids=["nominal", "drawn"])
def test_the_lining_gets_smoother_and_flatter_all_its_life(clutch: SimulatedClutch) -> None:
    end = clutch.end_of_life()
    assert end is not None
    surfaces = [surface(clutch, float(cycles)) for cycles in np.linspace(0.0, 0.99 * end, 20)]
    assert (np.diff([state.roughness for state in surfaces]) < 0).all()
    assert (np.diff([state.skewness for state in surfaces]) < 0).all()


def test_wear_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="not negative"):
        surface(SimulatedClutch(), -1.0)
