"""A measured engagement beside a model's: none where the model is right, as much as the model is wrong."""

import numpy as np
import pytest

from models.clutch import Geometry
from models.engagements.capacity import Capacity
from models.engagements.discrepancy import Discrepancy, discrepancy
from models.engagements.measured import MeasuredEngagement, measured_engagement
from models.engagements.simulation import engage
from models.records.runs import Record
from models.rig.campaign import simulated_clutch
from models.rig.recorder import Recorder
from models.rig.stationary import NOISELESS
from tests.models.engagements.closed_forms import FORMS, INERTIA, PER_PASCAL, record

GEOMETRY = Geometry()


def coulomb(cof: float) -> Capacity:
    return lambda pressure, _velocity: cof * PER_PASCAL * pressure


def against(found_record: Record, capacity: Capacity) -> Discrepancy:
    engagement = measured_engagement(found_record, GEOMETRY)
    assert isinstance(engagement, MeasuredEngagement), engagement
    found = discrepancy(engagement, capacity, GEOMETRY.mean_radius)
    assert found is not None
    return found


@pytest.mark.parametrize("name", ["constant", "ramp", "exponential"])
def test_the_right_model_has_no_discrepancy_but_noise(name: str) -> None:
    found = against(record(FORMS[name], 100.0), coulomb(0.12))
    assert found.drive.inertia == pytest.approx(INERTIA, rel=0.015)
    assert found.drive.limit == pytest.approx(0.0, abs=0.2)
    assert found.torque_share < 0.015
    assert found.stop_time_difference is not None
    assert abs(found.stop_time_difference.value) < 0.02


def test_a_model_that_is_ten_percent_too_strong_stops_a_tenth_too_early() -> None:
    found = against(record(FORMS["constant"], 100.0), coulomb(0.132))
    stop = FORMS["constant"].stop
    assert found.stop_time_difference is not None
    assert found.stop_time_difference.value == pytest.approx(
        stop - stop / 1.1, rel=0.15
    )  # 1 % of the inertia is 11 % of it
    assert found.torque_share == pytest.approx(0.1, rel=0.1)


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


def test_a_model_that_is_too_weak_to_stop_the_shaft_has_no_stop_time() -> None:
    found = against(record(FORMS["constant"], 100.0), coulomb(0.01))
    assert found.simulated_stop_time is None
    assert found.stop_time_difference is None
    assert found.torque_share == pytest.approx(11 / 12, rel=0.02)
