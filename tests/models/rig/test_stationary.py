"""The simulated stationary test: rows, noise and counts."""

import math

import numpy as np
import pytest

from models.clutch import Geometry
from models.records.runs import curves_by_pressure
from models.rig.stationary import NOISELESS, Sensor, stationary_test
from models.rig.truth import SimulatedClutch

RPM = 2 * math.pi / 60


BAR = 1e5


@pytest.fixture(scope="module")
def nominal():
    return SimulatedClutch()


class TestStationaryTest:
    def test_rows_stand_in_the_references_order(self, nominal):
        plateaus = stationary_test(nominal, 0, np.random.default_rng(0))
        assert plateaus.pressure.reshape(7, 40)[:, 0] / BAR == pytest.approx([4, 4.5, 5, 5.5, 6, 6.5, 7])
        assert np.ptp(plateaus.pressure.reshape(7, 40), axis=1).max() == 0
        assert plateaus.speed.reshape(7, 40)[3] / RPM == pytest.approx(np.arange(20, 1971, 50))
        assert len(curves_by_pressure(plateaus, Geometry())) == 7

    def test_noise_is_what_was_asked_for(self, nominal):
        exact = stationary_test(nominal, 0, np.random.default_rng(0), NOISELESS).torque
        sensor = Sensor(noise=0.01, floor=0.0, gain_scatter=0.05, torque_counts=0.0)
        ratios = np.array(
            [stationary_test(nominal, 0, np.random.default_rng(s), sensor).torque / exact for s in range(300)]
        )
        # 300 runs know a deviation to 4 % (one sigma), 84,000 plateaus to 0.25 %; four sigma each.
        assert ratios.mean(axis=1).std() == pytest.approx(0.05, rel=0.16)
        assert (ratios / ratios.mean(axis=1, keepdims=True)).std() == pytest.approx(0.01, rel=0.01)

    def test_the_floor_is_all_that_is_left_without_noise(self, nominal):
        exact = stationary_test(nominal, 0, np.random.default_rng(0), NOISELESS).torque
        sensor = Sensor(noise=0.0, floor=0.02, gain_scatter=0.0)
        left = np.concatenate(
            [stationary_test(nominal, 0, np.random.default_rng(s), sensor).torque - exact for s in range(20)]
        )
        assert left.std() == pytest.approx(0.02, rel=0.04)  # 5600 values, four sigma

    def test_torque_is_recorded_in_counts(self, nominal):
        recorded = stationary_test(nominal, 0, np.random.default_rng(0), Sensor(torque_counts=100.0)).torque
        assert np.array_equal(recorded, np.round(recorded, 2))

    def test_oil_temperature_is_recorded_and_does_not_act(self, nominal):
        for seed in range(20):
            plateaus = stationary_test(nominal, 0, np.random.default_rng(seed), NOISELESS)
            assert plateaus.oil_temperature.min() >= 273.15 + 80
            assert plateaus.oil_temperature.max() <= 273.15 + 90
            assert np.ptp(plateaus.oil_temperature) > 1
            assert np.array_equal(
                plateaus.torque, stationary_test(nominal, 0, np.random.default_rng(99), NOISELESS).torque
            )

    @pytest.mark.parametrize("setting", ["noise", "floor", "gain_scatter", "torque_counts", "temperature_counts"])
    def test_a_sensor_refuses_what_is_no_deviation(self, setting):
        with pytest.raises(ValueError, match=f"{setting} must be finite and not negative, got -1"):
            Sensor(**{setting: -1.0})
