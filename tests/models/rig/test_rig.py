"""The simulated rig against what the reference says of the real one, and against itself: same seed, same bits."""

import itertools
import math

import numpy as np
import pytest

from models.clutch import Geometry
from models.records.runs import curves_by_pressure
from models.rig.campaign import simulate, simulated_clutch
from models.rig.simulated_runs import RunKind, SimulatedRun
from models.rig.stationary import NOISELESS, Sensor, stationary_test
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch, draw

RPM = 2 * math.pi / 60
SPEEDS = np.arange(20, 1971, 50) * RPM
BAR = 1e5


@pytest.fixture(scope="module")
def nominal():
    return SimulatedClutch()


def curves(clutch, cycles):
    """Noiseless torque [40] at each pressure in bar, through the simulated test itself."""
    plateaus = stationary_test(clutch, cycles, np.random.default_rng(0), NOISELESS)
    return {c.pressure / BAR: c.torque for c in curves_by_pressure(plateaus, clutch.geometry)}


def by_hand(clutch, pressure, cycles, velocity):
    """Eq. 3 and eq. 6 written out again with `math`, in another order of operations."""

    def aged(course):
        return 1 + course.change - course.change / (1 + cycles / course.scale) ** course.exponent

    m_s = (clutch.static_torque.intercept + clutch.static_torque.slope * pressure) * aged(clutch.static_torque_course)
    fresh_ratio = clutch.coulomb_ratio.asymptote + clutch.coulomb_ratio.excess / math.exp(
        pressure / clutch.coulomb_ratio.decay
    )
    m_c = m_s * fresh_ratio * aged(clutch.coulomb_ratio_course)
    law, course = clutch.stribeck_velocity, clutch.stribeck_velocity_course
    share = math.exp(-(law.intercept + law.slope * pressure) * aged(course) / velocity)
    law, course = clutch.viscous_coefficient, clutch.viscous_coefficient_course
    viscous = (law.intercept + law.slope * pressure) * aged(course) * velocity**0.3
    return m_s * (1 - share) + m_c * share + viscous


@pytest.mark.parametrize("cycles", [0, 500, 15_000, 900_000])
def test_torque_agrees_with_the_equations_written_out_by_hand(nominal, cycles):
    measured = curves(nominal, cycles)
    for pressure, speed in itertools.product((4.0, 5.5, 7.0), (0, 7, 39)):
        velocity = SPEEDS[speed] * 0.058
        assert measured[pressure][speed] == pytest.approx(by_hand(nominal, pressure * BAR, cycles, velocity), rel=1e-9)


def test_mean_cof_is_the_mean_over_all_plateaus(nominal):
    # Pressure levels hold equally many rows, so the mean over rows is the mean over pressures of the means over speeds.
    geometry = Geometry()
    rows = [
        geometry.cof(by_hand(nominal, p, 7000, w * geometry.mean_radius), p)
        for p, w in itertools.product(PROTOCOL_PRESSURES, SPEEDS)
    ]
    assert nominal.mean_cof(7000) == pytest.approx(math.fsum(rows) / 280, rel=1e-9)


class TestFindingsOfTheReference:
    def test_fresh_clutch_gives_about_25_newton_metres_at_5_bar(self, nominal):
        at_1000_rpm = np.interp(1000 * RPM, SPEEDS, curves(nominal, 0)[5.0])
        assert at_1000_rpm == pytest.approx(25, abs=1)

    def test_fresh_engagement_at_8_bar_exceeds_the_motors_limit(self, nominal):
        # Section 2.3.1: the motor gives 20 Nm at most, and the engagement brings it to a standstill.
        torques = [by_hand(nominal, 8 * BAR, 0, w * 0.058) for w in np.linspace(20, 2000, 50) * RPM]
        assert min(torques) > 20

    def test_pressure_laws_have_the_shapes_of_fig_9(self, nominal):
        fresh = nominal.parameters(PROTOCOL_PRESSURES, 0)
        for rising in (fresh.static_torque, fresh.stribeck_velocity, fresh.viscous_coefficient):
            assert (np.diff(rising) > 0).all()
            assert np.ptp(np.diff(rising)) == pytest.approx(0, abs=1e-9 * np.max(rising))  # a straight line
        steps = np.diff(fresh.coulomb_ratio)
        assert (steps < 0).all()
        assert (np.diff(steps) > 0).all()  # ever flatter
        assert steps[1:] / steps[:-1] == pytest.approx(np.full(5, steps[1] / steps[0]))  # towards an asymptote
        assert np.all((fresh.coulomb_ratio > 0) & (fresh.coulomb_ratio < 1))

    def test_at_4_bar_the_fresh_curve_rises_slightly(self, nominal):
        curve = curves(nominal, 0)[4.0]
        assert (np.diff(curve) > 0).all()
        assert 0.02 < curve[-1] / curve[0] - 1 < 0.08

    @pytest.mark.parametrize("pressure", [5.0, 5.5, 6.0, 6.5, 7.0])
    def test_at_higher_pressure_the_fresh_curve_rises_then_falls(self, nominal, pressure):
        curve = curves(nominal, 0)[pressure]
        top = int(curve.argmax())
        assert 150 * RPM < SPEEDS[top] < 600 * RPM
        assert (np.diff(curve[: top + 1]) > 0).all()
        assert (np.diff(curve[top:]) < 0).all()
        assert curve[-1] < 0.95 * curve.max()

    def test_the_fresh_low_speed_slope_grows_with_pressure(self, nominal):
        fresh = curves(nominal, 0)
        slopes = np.array([curve[2] - curve[0] for curve in fresh.values()])  # 20 to 120 rpm
        assert (slopes > 0).all()
        assert (np.diff(slopes) > 0).all()

    def test_the_parameters_age_as_in_figs_10_and_11(self, nominal):
        for pressure in PROTOCOL_PRESSURES:
            life = nominal.parameters(pressure, np.array([0.0, 1000.0, 7000.0, 15_000.0]))
            for falling in (life.static_torque, life.coulomb_ratio, life.stribeck_velocity):
                assert (np.diff(falling) < 0).all()
                assert falling[-1] > 0
            assert (np.diff(life.viscous_coefficient) > 0).all()

    def test_the_whole_curve_sinks_at_every_pressure(self, nominal):
        stages = [curves(nominal, cycles) for cycles in (0, 1000, 7000, 15_000)]
        for earlier, later in itertools.pairwise(stages):
            assert all((later[p] < earlier[p]).all() for p in earlier)

    def test_the_anti_shudder_slope_is_lost(self, nominal):
        # Fig. 7(b), at 5 bar: the slope at low speed, here 20 to 220 rpm, turns and grows ever more negative.
        slopes = [(c := curves(nominal, cycles)[5.0])[4] - c[0] for cycles in (0, 1000, 7000, 15_000)]
        assert slopes[0] > 0
        assert (np.diff(slopes) < 0).all()
        assert slopes[-1] < -0.1 * curves(nominal, 15_000)[5.0].mean()
        assert all((c[4] - c[0]) < 0 for c in curves(nominal, 15_000).values())
        assert (np.diff(curves(nominal, 15_000)[5.0][:10]) < 0).all()

    def test_the_drop_is_drastic_then_saturates(self, nominal):
        cof = nominal.mean_cofs(np.array([0.0, 3000.0, 12_000.0, 15_000.0, 18_000.0]))
        assert cof[0] - cof[1] > 0.5 * (cof[0] - cof[3])  # half of the loss in the first fifth of the life
        assert cof[2] - cof[3] < (cof[0] - cof[1]) / 8  # an eighth of that over the last fifth
        assert cof[3] - cof[4] < cof[2] - cof[3]

    def test_mean_cof_is_halved_near_15_000_cycles(self, nominal):
        assert nominal.end_of_life() == pytest.approx(15_000, rel=0.02)


class TestEndOfLife:
    def test_is_where_mean_cof_crosses_on_a_dense_grid(self, nominal):
        cycles = np.arange(0.0, 40_000.0, 10.0)
        share = nominal.mean_cofs(cycles) / nominal.mean_cof(0)
        for fraction in (0.9, 0.5, 0.45):
            crossing = cycles[np.argmax(share <= fraction)]
            assert crossing - 10 <= nominal.end_of_life(fraction) <= crossing

    def test_is_none_where_the_loss_saturates_above_the_threshold(self, nominal):
        assert nominal.mean_cof(1e6) > 0.2 * nominal.mean_cof(0)
        assert nominal.end_of_life(0.2) is None

    @pytest.mark.parametrize("fraction", [0.0, 1.0, -1.0, math.nan])
    def test_refuses_a_fraction_that_is_none(self, nominal, fraction):
        with pytest.raises(ValueError, match="fraction must lie between 0 and 1"):
            nominal.end_of_life(fraction)

    def test_spreads_over_drawn_clutches_around_the_nominal_life(self):
        lives = [draw(np.random.default_rng(seed)).end_of_life() for seed in range(50)]
        assert None not in lives
        assert min(lives) > 8_000
        assert max(lives) < 32_000
        assert np.median(lives) == pytest.approx(15_000, rel=0.1)
        assert 0.12 < np.std(np.log(lives)) < 0.35


def test_drawn_clutches_differ_by_5_to_15_percent():
    drawn = [draw(np.random.default_rng(seed)).parameters(5 * BAR, 0) for seed in range(200)]
    for name in ("static_torque", "coulomb_ratio", "stribeck_velocity", "viscous_coefficient"):
        values = np.array([float(getattr(parameters, name)) for parameters in drawn])
        assert 0.03 < values.std() / values.mean() < 0.16, name  # 200 draws know a deviation to 5 %
        assert (values > 0).all()


def test_in_no_drawn_clutch_sliding_grips_more_than_rest():
    for seed in range(200):
        assert draw(np.random.default_rng(seed)).parameters(4 * BAR, 0).coulomb_ratio < 1


@pytest.mark.parametrize(
    ("pressure", "cycles", "rule"), [(0, 0, "pressure"), (5e5, -1, "cycles"), (5e5, math.nan, "cycles")]
)
def test_parameters_refuse_what_no_clutch_has(nominal, pressure, cycles, rule):
    with pytest.raises(ValueError, match=f"{rule} must be finite"):
        nominal.parameters(pressure, cycles)


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


def bits(run):
    columns = () if run.plateaus is None else (run.plateaus.torque.tobytes(), run.plateaus.oil_temperature.tobytes())
    return run.run_id, run.kind, run.cycles, run.duty, columns


class TestCampaign:
    def test_runs_come_in_rig_order(self):
        runs = list(itertools.islice(simulate(7), 8))
        assert [(run.run_id, run.kind.value, run.cycles) for run in runs] == [
            ("sim-7-run-in-00000", "run_in", 0),
            ("sim-7-stationary-00000", "stationary_stribeck", 0),
            ("sim-7-duty-00500", "duty_cycles", 500),
            ("sim-7-stationary-00500", "stationary_stribeck", 500),
            ("sim-7-duty-01000", "duty_cycles", 1000),
            ("sim-7-stationary-01000", "stationary_stribeck", 1000),
            ("sim-7-duty-02000", "duty_cycles", 2000),
            ("sim-7-stationary-02000", "stationary_stribeck", 2000),
        ]
        assert [run.duty.cycles for run in runs if run.duty] == [200, 500, 500, 1000]
        assert runs[0].duty.initial_speed == pytest.approx(1200 * RPM)
        assert runs[2].duty.initial_speed == pytest.approx(2000 * RPM)
        assert runs[2].duty.maximum_pressure == 8 * BAR

    def test_ends_with_the_first_test_below_the_stop(self):
        for seed in range(5):
            clutch = simulated_clutch(seed)
            tests = [run.cycles for run in simulate(seed) if run.kind is RunKind.STATIONARY_STRIBECK]
            share = clutch.mean_cofs(np.array(tests, dtype=float)) / clutch.mean_cof(0)
            assert (share[:-1] >= 0.45).all()
            assert share[-1] < 0.45 or len(tests) == 40
            assert clutch.end_of_life() < tests[-1]

    def test_ends_after_the_most_tests(self):
        tests = [run for run in simulate(7, most_tests=3) if run.plateaus is not None]
        assert [run.cycles for run in tests] == [0, 500, 1000]

    def test_the_same_seed_gives_the_same_bits_and_another_does_not(self):
        first, again, other = ([bits(run) for run in itertools.islice(simulate(seed), 12)] for seed in (7, 7, 8))
        assert first == again
        assert all(a[4] != b[4] for a, b in zip(first, other, strict=True) if a[4])
        assert len({run[4] for run in first if run[4]}) == 6  # no two tests share their noise

    def test_a_given_clutch_is_the_one_that_is_measured(self, nominal):
        run = next(run for run in simulate(3, clutch=nominal, sensor=NOISELESS) if run.plateaus is not None)
        assert np.array_equal(run.plateaus.torque, np.concatenate(list(curves(nominal, 0).values())))

    @pytest.mark.parametrize("wrong", [{"seed": -1}, {"stop_fraction": 1.0}, {"most_tests": 0}])
    def test_refuses_nonsense_before_the_first_run(self, wrong):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            simulate(**{"seed": 1, **wrong})

    def test_a_simulated_run_says_so_and_carries_one_thing(self):
        with pytest.raises(ValueError, match="must start with sim-"):
            SimulatedRun(run_id="bench-7", kind=RunKind.RUN_IN, cycles=0)
        with pytest.raises(ValueError, match="must carry plateaus"):
            SimulatedRun(run_id="sim-7", kind=RunKind.STATIONARY_STRIBECK, cycles=0)
