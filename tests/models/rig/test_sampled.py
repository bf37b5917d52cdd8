"""The simulated sampled records and their lag, against closed forms and an integrator."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from models.friction.identification import fit_curves
from models.friction.pressure_laws import LinearLaw
from models.friction.speed_protocol import REFERENCE_SPEEDS, RPM
from models.friction.stribeck import torque
from models.loops.attractor import attractor_torque
from models.records.plateaus import cut_plateaus
from models.records.runs import curves_by_pressure
from models.rig.hysteresis import NO_LAG, FrictionLag
from models.rig.recorder import EXACT
from models.rig.sampled import DynamicTest, RawTest, sampled_test
from models.rig.stationary import NOISELESS, Sensor, stationary_test
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch

CLUTCH = SimulatedClutch()


SILENT = DynamicTest(recorder=EXACT)


COARSE_RAW = RawTest(rate=50.0)


def rng(seed: int = 2) -> np.random.Generator:
    return np.random.default_rng(seed)


class TestDynamicTest:
    def test_has_the_references_course(self) -> None:
        record = sampled_test(CLUTCH, 0, SILENT, rng(), NOISELESS)
        for turn, pressure in enumerate(PROTOCOL_PRESSURES):
            rows = (record.time >= 15.1 * turn) & (record.time < 15.1 * turn + 15)
            assert rows.sum() == 1500
            assert record.pressure[rows] == pytest.approx(pressure)
        assert record.speed.min() == pytest.approx(0, abs=1e-6)
        assert record.speed.max() == pytest.approx(2000 * RPM)
        risings = np.flatnonzero((record.speed[:-1] < 1000 * RPM) & (record.speed[1:] >= 1000 * RPM))
        assert np.diff(record.time[risings]) == pytest.approx(10.0, abs=0.011)

    def test_torque_follows_the_film_as_an_integrator_finds_it(self) -> None:
        """Witness: dw/dt = (v - w) w^1.4/τ itself, by another algorithm, at the first pressure."""
        record = sampled_test(CLUTCH, 7000, SILENT, rng(), NOISELESS)
        rows = record.time < 15
        film_time = 0.1 * np.exp(-(0.7 * 4 - 2.75) * (1 - 1 / 1.7**2))  # what is left of it at 4 bar
        swing = CLUTCH.geometry.mean_radius * 1000 * RPM

        def lagging(time: float, film: np.ndarray) -> np.ndarray:
            return (swing * (1 + np.sin(2 * np.pi * 0.1 * time)) - film) * film**1.4 / film_time

        found = solve_ivp(lagging, (0, 15), [swing], method="LSODA", rtol=1e-9, atol=1e-10, t_eval=record.time[rows])
        w, v = found.y[0], CLUTCH.geometry.sliding_velocity(record.speed[rows])
        at = CLUTCH.parameters(4e5, 7000)
        dry = at.static_torque * (1 + (at.coulomb_ratio - 1) * np.exp(-at.stribeck_velocity / w))
        by_hand = dry + at.viscous_coefficient * v / w**0.7
        assert np.abs(record.torque[rows] - by_hand).max() < 0.01
        assert np.abs(torque(v, at) - by_hand).max() > 0.5  # without the lag it would be far off

    def test_the_film_time_is_lost_with_use_the_more_the_higher_the_pressure(self) -> None:
        lag = FrictionLag(film_time=0.2, loss=LinearLaw(intercept=-2.0, slope=0.5e-5), scale=1000.0, exponent=1.0)
        found = lag.film_time_at(np.array([3e5, 5e5, 7e5]), 1000.0)
        assert found == pytest.approx(0.2 * np.exp([-0.0, -0.25, -0.75]))

    def test_an_attractor_alone_is_the_attractor_law(self) -> None:
        clutch = replace(CLUTCH, lag=replace(NO_LAG, attractor=150.0))
        record = sampled_test(clutch, 1000, SILENT, rng(), NOISELESS)
        rows = record.time < 15
        velocity = clutch.geometry.sliding_velocity(record.speed[rows])
        law = attractor_torque(record.time[rows], velocity, clutch.parameters(4e5, 1000), 150.0)
        assert record.torque[rows] == pytest.approx(law, abs=1e-9)

    def test_without_lag_it_is_the_stationary_curve(self) -> None:
        record = sampled_test(replace(CLUTCH, lag=NO_LAG), 0, SILENT, rng(), NOISELESS)
        at = CLUTCH.parameters(record.pressure, 0)
        assert record.torque == pytest.approx(torque(CLUTCH.geometry.sliding_velocity(record.speed), at), rel=1e-12)

    @pytest.mark.parametrize("wrong", [{"rate": 0.0}, {"amplitude": 2000.0}, {"step": -1.0}, {"frequency": np.nan}])
    def test_refuses_what_is_no_test(self, wrong: dict[str, float]) -> None:
        with pytest.raises(ValueError, match=next(iter(wrong))):
            DynamicTest(**wrong)


class TestRawTest:
    def test_gives_the_fits_of_its_plateaus_within_their_deviations(self) -> None:
        clutch = replace(CLUTCH, lag=replace(CLUTCH.lag, film_time=0.01))  # so that all plateaus settle
        record = sampled_test(clutch, 3000, COARSE_RAW, rng(), Sensor(gain_scatter=0.0))
        cut = cut_plateaus(record)
        assert cut.plateaus.torque.size == 280
        exact = stationary_test(clutch, 3000, rng(), NOISELESS)
        raw, plain = (fit_curves(curves_by_pressure(p, clutch.geometry)) for p in (cut.plateaus, exact))
        for fit, true in zip(raw, plain, strict=True):
            off = (fit.parameters.as_array() - true.parameters.as_array()) / fit.standard_errors
            assert np.abs(off).max() < 4.5
        gain = replace(exact, torque=1.05 * exact.torque)
        wrong = fit_curves(curves_by_pressure(gain, clutch.geometry))
        assert (
            np.abs((raw[3].parameters.as_array() - wrong[3].parameters.as_array()) / raw[3].standard_errors).max() > 5
        )

    def test_settles_after_each_step(self) -> None:
        test = replace(COARSE_RAW, recorder=EXACT)
        record = sampled_test(CLUTCH, 0, test, rng(), NOISELESS)
        dwells = record.torque.reshape(280, 250)
        true = stationary_test(CLUTCH, 0, rng(), NOISELESS).torque
        assert np.abs(dwells[1:, 0] - true[1:]).max() > 1.0
        assert np.abs(dwells[:, -1] - true).max() < 0.05
        assert record.speed.reshape(280, 250)[:, -1] == pytest.approx(np.tile(REFERENCE_SPEEDS, 7))

    def test_refuses_what_is_no_test(self) -> None:
        with pytest.raises(ValueError, match="rate must be finite and positive, got 0"):
            RawTest(rate=0.0)
