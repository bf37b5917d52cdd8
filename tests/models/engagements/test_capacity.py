"""What a clutch transfers, against eq. 3 at the measured pressures and the simulated clutch's own laws between them."""

import numpy as np
import pytest

from models.engagements.capacity import capacity_of
from models.friction.stribeck import StribeckParameters, torque
from models.rig.campaign import simulated_clutch
from models.rig.truth import PROTOCOL_PRESSURES

CLUTCH = simulated_clutch(3)


def at(pressure: float) -> StribeckParameters:
    return StribeckParameters.from_array(CLUTCH.parameters(pressure, 3_000.0).as_array())


def expected(pressure: float, velocity: float) -> float:
    return float(torque(np.array(velocity), at(pressure)))


@pytest.mark.parametrize("pressure", [4e5, 5.3e5, 7e5, 8e5])
@pytest.mark.parametrize("velocity", [0.0, 1.0, 12.0])
def test_pressure_laws_from_three_pressures_on(pressure: float, velocity: float) -> None:
    capacity = capacity_of({float(p): at(float(p)) for p in PROTOCOL_PRESSURES})
    assert capacity(pressure, velocity) == pytest.approx(expected(pressure, velocity), rel=2e-3)


def test_below_the_lowest_pressure_torque_goes_with_pressure() -> None:
    capacity = capacity_of({float(p): at(float(p)) for p in PROTOCOL_PRESSURES})
    assert capacity(1e5, 2.0) == pytest.approx(0.25 * capacity(4e5, 2.0), rel=1e-12)
    assert capacity(0.0, 2.0) == 0.0


def test_with_two_pressures_torque_goes_with_pressure_from_the_nearest() -> None:
    capacity = capacity_of({4e5: at(4e5), 6e5: at(6e5)})
    assert capacity(6e5, 3.0) == pytest.approx(expected(6e5, 3.0), rel=1e-12)
    assert capacity(5.5e5, 3.0) == pytest.approx(5.5 / 6 * expected(6e5, 3.0), rel=1e-12)
    assert capacity(4.5e5, 3.0) == pytest.approx(4.5 / 4 * expected(4e5, 3.0), rel=1e-12)
