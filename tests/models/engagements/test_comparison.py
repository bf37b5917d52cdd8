"""An engagement beside another, and beside the model."""

import math

import numpy as np
import pytest

from models.clutch import Geometry
from models.engagements.comparison import SpeedCourse, compared, reference_of, same_duty
from models.engagements.discrepancy import EngagementDiscrepancy, discrepancy
from models.engagements.measured import EngagementIndicators, measured_engagement
from models.engagements.simulation import Capacity, engage
from models.engagements.slip import ValueWithError
from models.records.runs import Record
from models.rig.campaign import simulated_clutch
from models.rig.sampled import Recorder
from tests.models.engagements.closed_forms import FORMS, INERTIA, PER_PASCAL, constant, record
from tests.models.rig.exact import NOISELESS

# --- The three indicators of the sliding speed: nothing for the same engagement, known values for a longer one.


def straight(duration: float, points: int = 65) -> SpeedCourse:
    """A speed that falls evenly from 100 rad/s."""
    return SpeedCourse(
        duration=ValueWithError(value=duration, sd=0.0), speed=100.0 * np.linspace(1.0, 0.0, points), noise=0.0
    )


def test_the_same_engagement_is_no_distance_away_from_its_reference() -> None:
    found = compared(straight(1.0), reference_of([straight(1.0), straight(1.0)]))
    assert found.normalised_duration.value == pytest.approx(1.0)
    assert found.euclidean_distance.value == pytest.approx(0.0, abs=1e-9)
    assert found.spectral_angle.value == pytest.approx(0.0, abs=1e-6)
    # a reference needs an engagement and duties differ by more than a tenth
    with pytest.raises(ValueError, match="at least one"):
        reference_of([])
    assert same_duty(2100, 2000)
    assert not same_duty(1200, 2000)


@pytest.mark.parametrize("longer", [1.2, 2.0])
def test_a_longer_engagement_is_as_far_away_as_integrals_say(longer: float) -> None:
    """x = 1 - t/λ against r = 1 - t over t in 0 to 1: ∫(x-r)² = (1-1/λ)²/3, ∫r² = 1/3, ∫x² = 1 - 1/λ + 1/3λ²; sums over 50
    moments are within 3 % of that."""
    found = compared(straight(longer), reference_of([straight(1.0)]))
    square = 1 - 1 / longer + 1 / (3 * longer**2)
    product = 1 / 2 - 1 / (6 * longer)
    assert found.normalised_duration.value == pytest.approx(longer)
    assert found.euclidean_distance.value == pytest.approx(1 - 1 / longer, rel=0.03)
    assert found.spectral_angle.value == pytest.approx(math.acos(product / math.sqrt(square / 3)), rel=0.05)


def test_wear_shows_in_noisy_records_beyond_its_standard_error() -> None:
    def course(cof: float, seed: int) -> SpeedCourse:
        found = measured_engagement(record(constant(cof), 100.0, seed), Geometry())
        return found.course

    reference = reference_of([course(0.12, seed) for seed in range(3)])
    same, worn = compared(course(0.12, 3), reference), compared(course(0.10, 4), reference)
    assert abs(same.normalised_duration.value - 1) < 4 * same.normalised_duration.sd
    assert worn.normalised_duration.value == pytest.approx(1.2, rel=0.01)
    for name in ("euclidean_distance", "spectral_angle"):
        estimate, noise = getattr(worn, name), getattr(same, name)
        assert estimate.value > 8 * estimate.sd
        assert noise.value < 3 * noise.sd


# --- A measured engagement beside a model's: none where the model is right, as much as the model is wrong.

GEOMETRY = Geometry()


def coulomb(cof: float) -> Capacity:
    return lambda pressure, _velocity: cof * PER_PASCAL * pressure


def against(found_record: Record, capacity: Capacity) -> EngagementDiscrepancy:
    engagement = measured_engagement(found_record, GEOMETRY)
    assert isinstance(engagement, EngagementIndicators), engagement
    return discrepancy(engagement, capacity, GEOMETRY.mean_radius)


@pytest.mark.parametrize("name", ["constant", "ramp", "exponential"])
def test_the_right_model_has_no_discrepancy_but_noise(name: str) -> None:
    found = against(record(FORMS[name], 100.0), coulomb(0.12))
    assert found.drive.inertia == pytest.approx(INERTIA, rel=0.015)
    assert found.drive.limit == pytest.approx(0.0, abs=0.2)
    assert found.torque_share < 0.015
    assert abs(found.stop_time_difference.value) < 0.02


def test_a_model_that_is_too_strong_stops_too_early_and_one_that_is_too_weak_never() -> None:
    found = against(record(FORMS["constant"], 100.0), coulomb(0.132))
    stop = FORMS["constant"].stop
    assert found.stop_time_difference.value == pytest.approx(
        stop - stop / 1.1, rel=0.15
    )  # 1 % of the inertia is 11 % of it
    assert found.torque_share == pytest.approx(0.1, rel=0.1)
    # a model that is too weak to stop the shaft has no stop time
    found = against(record(FORMS["constant"], 100.0), coulomb(0.01))
    assert found.simulated_stop_time is None
    assert found.stop_time_difference is None
    assert found.torque_share == pytest.approx(11 / 12, rel=0.02)


def test_the_rig_of_the_reference_shows_its_motor_and_its_inertia() -> None:
    clutch = simulated_clutch(1)
    trace = engage(clutch.capacity(0.0), GEOMETRY.mean_radius)
    rng = np.random.default_rng(2)
    measured = Recorder().record(trace.time, trace.pressure, trace.speed, trace.torque, rng, NOISELESS)
    found = against(measured, clutch.capacity(0.0))
    assert found.drive.limit == pytest.approx(20.0, rel=0.03)  # less the open clutch's drag
    assert found.drive.inertia == pytest.approx(0.05, rel=0.03)
    assert found.torque_share < 0.02
    worn = against(measured, clutch.capacity(2000.0))
    assert worn.torque_share > 5 * found.torque_share
