"""The simulated rig's sampled records, its lag and its ageing by energy: against closed forms and against itself."""

import itertools
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
from models.rig.campaign import end_of_life, simulate, simulated_clutch
from models.rig.hysteresis import NO_LAG, FrictionLag
from models.rig.programme import CYCLE_ENERGY, WHOLE, Ageing, Programme
from models.rig.recorder import EXACT, Recorder
from models.rig.sampled import DynamicTest, RawTest, sampled_test
from models.rig.simulated_runs import DutyBlock, RunKind, SimulatedRun
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


class TestRecorder:
    def test_noise_is_what_was_asked_for_and_remembers(self) -> None:
        count = 200_000
        still = np.full(count, 20.0)
        recorder = Recorder(torque_noise=0.3, memory=0.02, torque_counts=0.0, speed_noise=0.2, speed_counts=0.0)
        record = recorder.record(np.arange(count) / 1000, still * 1e4, still, still, rng(), Sensor(gain_scatter=0.0))
        noise = record.torque - 20
        # autocorrelation time 20 samples: 200,000 of them know a deviation to 1 % (one sigma)
        assert noise.std() == pytest.approx(0.3, rel=0.05)
        assert np.corrcoef(noise[:-20], noise[20:])[0, 1] == pytest.approx(np.exp(-1), abs=0.05)
        assert record.speed.std() == pytest.approx(0.2, rel=0.01)

    def test_counts_losses_and_spikes(self) -> None:
        count = 60_000
        still = np.full(count, 20.0)
        recorder = Recorder(torque_counts=200.0, lost=0.1, spikes_per_minute=30.0, torque_noise=0.01)
        record = recorder.record(np.arange(count) / 100, still * 1e4, still, still, rng(), Sensor())
        assert np.array_equal(record.torque, np.round(record.torque * 200) / 200)
        assert record.time.size == pytest.approx(0.9 * count, rel=0.01)
        assert (np.diff(record.time) > 0).all()
        assert 200 < (np.abs(record.torque - 20) > 4).sum() < 330  # 300 in ten minutes, a tenth of them lost

    @pytest.mark.parametrize("name", Recorder.__slots__)
    def test_refuses_what_is_no_deviation(self, name: str) -> None:
        with pytest.raises(ValueError, match=f"{name} must be finite and not negative, got -1"):
            Recorder(**{name: -1.0})


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


class TestCampaign:
    def test_the_whole_of_fig_2_in_its_order(self) -> None:
        runs = list(simulate(7, programme=WHOLE, most_tests=2))
        assert [(run.run_id, run.kind.value, run.cycles) for run in runs] == [
            ("sim-7-run-in-00000", "run_in", 0),
            ("sim-7-stationary-00000", "stationary_stribeck", 0),
            ("sim-7-dynamic-00000", "dynamic_stribeck", 0),
            ("sim-7-duty-00500", "duty_cycles", 500),
            ("sim-7-stationary-00500", "stationary_stribeck", 500),
            ("sim-7-dynamic-00500", "dynamic_stribeck", 500),
        ]
        for run in (runs[0], runs[3]):
            assert run.record.pressure.max() == pytest.approx(8e5, rel=0.01)
            assert run.record.speed[:50].mean() == pytest.approx(run.duty.initial_speed, rel=0.01)

    def test_what_is_added_does_not_change_the_stationary_tests(self) -> None:
        quick, whole = (
            [run for run in simulate(3, programme=programme, most_tests=2) if run.plateaus is not None]
            for programme in (Programme(), WHOLE)
        )
        assert [run.plateaus.torque.tobytes() for run in quick] == [run.plateaus.torque.tobytes() for run in whole]

    def test_the_same_seed_gives_the_same_bits(self) -> None:
        programme = replace(WHOLE, raw=COARSE_RAW, ageing=Ageing.ENERGY)
        first, again, other = (
            [run.record.torque.tobytes() for run in simulate(seed, programme=programme, most_tests=1)]
            for seed in (7, 7, 8)
        )
        assert first == again
        assert all(a != b for a, b in zip(first, other, strict=True))

    def test_the_energy_of_a_block_is_that_of_its_engagement(self) -> None:
        """Witness: the trace's own ∫ M ω dt, which knows nothing of the integrator's sum."""
        runs = [run for run in simulate(7, programme=Programme(engagements=True), most_tests=3) if run.duty]
        for run in runs:
            by_trace = float(np.trapezoid(run.record.torque * run.record.speed, run.record.time))
            assert run.duty.energy_per_cycle == pytest.approx(by_trace, rel=0.02)
        assert len({run.duty.energy_per_cycle for run in runs}) == 3

    def test_energy_ages_the_clutch_by_what_blocks_and_tests_dissipate(self) -> None:
        programme = Programme(engagements=True, ageing=Ageing.ENERGY)
        runs = list(simulate(7, programme=programme, most_tests=3))
        for before, run in itertools.pairwise(runs):
            assert run.wear - before.wear == pytest.approx(run.dissipated() / CYCLE_ENERGY)
        test = stationary_test(simulated_clutch(7), runs[2].wear, rng(), NOISELESS)
        assert runs[3].plateaus.torque.mean() == pytest.approx(test.torque.mean(), rel=0.01)
        fresh = stationary_test(simulated_clutch(7), 500, rng(), NOISELESS)  # were it by cycles
        assert runs[3].plateaus.torque.mean() < 0.97 * fresh.torque.mean()
        assert 2e6 < runs[1].dissipated() < 6e6  # 1,400 s of sliding at about 25 Nm

    def test_the_end_of_life_is_where_wear_gets_there(self) -> None:
        clutch = simulated_clutch(7)
        by_cycles = [(run.wear, run.cycles) for run in simulate(7)]
        assert end_of_life(by_cycles, clutch) == pytest.approx(clutch.end_of_life())
        assert end_of_life([(2 * wear, cycles) for wear, cycles in by_cycles], clutch) == pytest.approx(
            clutch.end_of_life() / 2
        )
        assert end_of_life(by_cycles[:5], clutch) is None

    def test_energy_needs_engagements(self) -> None:
        with pytest.raises(ValueError, match="needs engagements"):
            Programme(ageing=Ageing.ENERGY)

    def test_a_run_carries_what_its_kind_has(self) -> None:
        duty = DutyBlock(cycles=1, energy_per_cycle=1.0, initial_speed=1.0, maximum_pressure=1.0)
        with pytest.raises(ValueError, match="a dynamic_stribeck run must carry a record"):
            SimulatedRun(run_id="sim-1", kind=RunKind.DYNAMIC_STRIBECK, cycles=0, duty=duty)
        with pytest.raises(ValueError, match="a run_in run must carry a duty block"):
            SimulatedRun(run_id="sim-1", kind=RunKind.RUN_IN, cycles=0)


def test_the_clutch_transfers_what_its_curve_says_and_less_below_its_lowest_pressure() -> None:
    capacity = CLUTCH.capacity(2000.0)
    at = float(torque(np.array(3.0), CLUTCH.parameters(6e5, 2000.0)))
    lowest = float(torque(np.array(3.0), CLUTCH.parameters(4e5, 2000.0)))
    assert capacity(6e5, 3.0) == pytest.approx(at)
    assert capacity(1e5, 3.0) == pytest.approx(lowest / 4)
