"""Engagements: energy balance, the stall of the motor, and the reference's finding that they grow longer with wear."""

import numpy as np
import pytest

from models.engagements.simulation import Drive, PressureProfile, capacity_of, engage
from models.friction.stribeck import StribeckParameters, torque
from models.rig.campaign import simulated_clutch
from models.rig.truth import PROTOCOL_PRESSURES

RADIUS = 0.058


def test_a_constant_torque_stops_the_shaft_as_in_the_textbook_unless_it_is_too_weak() -> None:
    """With T = μ p and no motor limit left over the shaft decelerates at (T - T_max)/J: closed form against integration."""
    profile = PressureProfile(contact=0.4, full=0.4 + 1e-6)
    drive = Drive(drag=0.0)
    found = engage(lambda pressure, _v: 45.0 * pressure / 8e5, RADIUS, profile=profile, drive=drive)
    assert found.duration == pytest.approx(drive.speed * drive.inertia / (45.0 - drive.limit), rel=0.01)
    # the clutch turns into heat what the shaft held and what the motor gave meanwhile
    given = drive.limit * drive.speed * found.duration / 2
    assert found.energy == pytest.approx(0.5 * drive.inertia * drive.speed**2 + given, rel=0.01)
    # a clutch that is too weak slips on
    found = engage(lambda pressure, _v: 15.0 * pressure / 8e5, RADIUS)
    assert found.duration is None
    assert found.speed[-1] > 0


def test_before_the_discs_touch_nothing_is_transferred_and_a_standing_clutch_carries_what_the_motor_gives() -> None:
    found = engage(simulated_clutch(1).capacity(0.0), RADIUS)
    filling = found.time < PressureProfile().contact
    assert found.torque[filling].max() < 1.0
    assert found.speed[filling].min() > 0.99 * Drive().speed
    assert found.motor_torque.max() <= 20.0
    assert found.speed[-1] == 0.0
    assert found.torque[-1] == found.motor_torque[-1] == 20.0


@pytest.mark.parametrize("seed", range(5))
def test_engagements_grow_longer_as_friction_falls(seed: int) -> None:
    clutch = simulated_clutch(seed)
    durations = [engage(clutch.capacity(cycles), RADIUS).duration for cycles in (0.0, 1000.0, 3000.0)]
    ended = [duration for duration in durations if duration is not None]
    assert len(ended) >= 2
    assert durations[: len(ended)] == sorted(ended)  # once it slips on, it goes on slipping


def test_the_profile_is_that_of_fig_3() -> None:
    profile = PressureProfile()
    at = profile(np.array([0.05, 0.2, 0.3, 0.9, 2.0]))
    assert at == pytest.approx([0.0, 2.5e5, 1.0e5, 4.5e5, 8.0e5])
    with pytest.raises(ValueError, match="times must increase"):
        PressureProfile(fill=0.5)
    with pytest.raises(ValueError, match="plateau < pulse"):
        PressureProfile(plateau=3e5)


# --- What a clutch transfers, against eq. 3 at the measured pressures and the simulated clutch's own laws between
# them.

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
    # below the lowest pressure torque goes with pressure
    assert capacity(1e5, velocity) == pytest.approx(0.25 * capacity(4e5, velocity), rel=1e-12)
    assert capacity(0.0, velocity) == 0.0


def test_with_two_pressures_torque_goes_with_pressure_from_the_nearest() -> None:
    capacity = capacity_of({4e5: at(4e5), 6e5: at(6e5)})
    assert capacity(6e5, 3.0) == pytest.approx(expected(6e5, 3.0), rel=1e-12)
    assert capacity(5.5e5, 3.0) == pytest.approx(5.5 / 6 * expected(6e5, 3.0), rel=1e-12)
    assert capacity(4.5e5, 3.0) == pytest.approx(4.5 / 4 * expected(4e5, 3.0), rel=1e-12)
