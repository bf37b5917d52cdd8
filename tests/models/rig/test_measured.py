"""What the simulated rig measures: sensors, plateaus, sampled records and their lag, against independent witnesses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from models.arrays import FloatArray
from models.friction.identification import StribeckFit, fit_curves
from models.friction.pressure_laws import LinearPressureLaw
from models.friction.speed_protocol import REFERENCE_SPEEDS, RPM
from models.friction.stribeck import torque
from models.loops.lag_fit import StationaryCurve
from models.loops.lag_laws import attractor_torque
from models.loops.loops import evaluate_loops
from models.records.plateaus import cut_plateaus
from models.records.runs import curves_by_pressure
from models.rig.campaign import simulated_clutch
from models.rig.hysteresis import ATTRACTOR, NO_LAG, FrictionLag
from models.rig.sampled import DynamicTest, RawTest, Recorder, sampled_test
from models.rig.stationary import SHARP, Sensor, stationary_test
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch
from tests.models.rig.exact import EXACT, NOISELESS

# --- The simulated stationary test: rows, noise and counts.

BAR = 1e5
CLUTCH = SimulatedClutch()
GEOMETRY = CLUTCH.geometry


def rng(seed: int = 2) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_rows_stand_in_the_references_order_and_oil_does_not_act() -> None:
    plateaus = stationary_test(CLUTCH, 0, np.random.default_rng(0))
    assert plateaus.pressure.reshape(7, 40)[:, 0] / BAR == pytest.approx([4, 4.5, 5, 5.5, 6, 6.5, 7])
    assert np.ptp(plateaus.pressure.reshape(7, 40), axis=1).max() == 0
    assert plateaus.speed.reshape(7, 40)[3] / RPM == pytest.approx(np.arange(20, 1971, 50))
    assert len(curves_by_pressure(plateaus, GEOMETRY)) == 7
    # oil temperature is recorded and does not act
    for seed in range(20):
        plateaus = stationary_test(CLUTCH, 0, rng(seed), NOISELESS)
        assert plateaus.oil_temperature.min() >= 273.15 + 80
        assert plateaus.oil_temperature.max() <= 273.15 + 90
        assert np.ptp(plateaus.oil_temperature) > 1
        assert np.array_equal(plateaus.torque, torque_by(NOISELESS, 99))


def torque_by(sensor: Sensor, seed: int = 0) -> FloatArray:
    return stationary_test(CLUTCH, 0, rng(seed), sensor).torque


def test_noise_floor_and_counts_are_what_was_asked_for():
    exact = torque_by(NOISELESS)
    sensor = Sensor(noise=0.01, floor=0.0, gain_scatter=0.05, torque_counts=0.0)
    ratios = np.array([torque_by(sensor, seed) / exact for seed in range(300)])
    # 300 runs know a deviation to 4 % (one sigma), 84,000 plateaus to 0.25 %; four sigma each.
    assert ratios.mean(axis=1).std() == pytest.approx(0.05, rel=0.16)
    assert (ratios / ratios.mean(axis=1, keepdims=True)).std() == pytest.approx(0.01, rel=0.01)
    still = Sensor(noise=0.0, floor=0.02, gain_scatter=0.0)
    left = [torque_by(still, seed) - exact for seed in range(20)]
    assert np.std(left) == pytest.approx(0.02, rel=0.04)  # 5600 values, four sigma
    recorded = torque_by(Sensor(torque_counts=100.0))
    assert np.array_equal(recorded, np.round(recorded, 2))


# --- The simulated recorder: noise, counts, losses and spikes.


def test_noise_is_what_was_asked_for_and_autocorrelated() -> None:
    count = 200_000
    still = np.full(count, 20.0)
    recorder = Recorder(torque_noise=0.3, memory=0.02, torque_counts=0.0, speed_noise=0.2, speed_counts=0.0)
    record = recorder.record(np.arange(count) / 1000, still * 1e4, still, still, rng(), Sensor(gain_scatter=0.0))
    noise = record.torque - 20
    # autocorrelation time 20 samples: 200,000 of them know a deviation to 1 % (one sigma)
    assert noise.std() == pytest.approx(0.3, rel=0.05)
    assert np.corrcoef(noise[:-20], noise[20:])[0, 1] == pytest.approx(np.exp(-1), abs=0.05)
    assert record.speed.std() == pytest.approx(0.2, rel=0.01)


def test_a_recorder_counts_loses_and_spikes() -> None:
    count = 60_000
    still = np.full(count, 20.0)
    recorder = Recorder(torque_counts=200.0, lost=0.1, spikes_per_minute=30.0, torque_noise=0.01)
    record = recorder.record(np.arange(count) / 100, still * 1e4, still, still, rng(), Sensor())
    assert np.array_equal(record.torque, np.round(record.torque * 200) / 200)
    assert record.time.size == pytest.approx(0.9 * count, rel=0.01)
    assert (np.diff(record.time) > 0).all()
    assert 200 < (np.abs(record.torque - 20) > 4).sum() < 330  # 300 in ten minutes, a tenth of them lost


# --- The simulated sampled records and their lag, against closed forms and an integrator.

SILENT = DynamicTest(recorder=EXACT)


def test_a_dynamic_test_has_the_references_course() -> None:
    record = sampled_test(CLUTCH, 0, SILENT, rng(), NOISELESS)
    for turn, pressure in enumerate(PROTOCOL_PRESSURES):
        rows = (record.time >= 15.1 * turn) & (record.time < 15.1 * turn + 15)
        assert rows.sum() == 1500
        assert record.pressure[rows] == pytest.approx(pressure)
    assert record.speed.min() == pytest.approx(0, abs=1e-6)
    assert record.speed.max() == pytest.approx(2000 * RPM)
    risings = np.flatnonzero((record.speed[:-1] < 1000 * RPM) & (record.speed[1:] >= 1000 * RPM))
    assert np.diff(record.time[risings]) == pytest.approx(10.0, abs=0.011)


def test_torque_follows_the_film_as_an_integrator_finds_it() -> None:
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


def test_a_lag_is_its_law_and_lost_with_use() -> None:
    # the film time is lost with use the more the higher the pressure
    lag = FrictionLag(film_time=0.2, loss=LinearPressureLaw(intercept=-2.0, slope=0.5e-5), scale=1000.0, exponent=1.0)
    found = lag.film_time_at(np.array([3e5, 5e5, 7e5]), 1000.0)
    assert found == pytest.approx(0.2 * np.exp([-0.0, -0.25, -0.75]))
    # a lag of an attractor alone is the attractor law
    clutch = replace(CLUTCH, lag=replace(NO_LAG, attractor=150.0))
    record = sampled_test(clutch, 1000, SILENT, rng(), NOISELESS)
    rows = record.time < 15
    velocity = clutch.geometry.sliding_velocity(record.speed[rows])
    law = attractor_torque(record.time[rows], velocity, clutch.parameters(4e5, 1000), 150.0)
    assert record.torque[rows] == pytest.approx(law, abs=1e-9)
    # without lag it is the stationary curve
    record = sampled_test(replace(CLUTCH, lag=NO_LAG), 0, SILENT, rng(), NOISELESS)
    at = CLUTCH.parameters(record.pressure, 0)
    assert record.torque == pytest.approx(torque(CLUTCH.geometry.sliding_velocity(record.speed), at), rel=1e-12)


def test_torque_settles_after_each_step_of_a_raw_test() -> None:
    record = sampled_test(CLUTCH, 0, RawTest(rate=50.0, recorder=EXACT), rng(), NOISELESS)
    dwells = record.torque.reshape(280, 250)
    true = stationary_test(CLUTCH, 0, rng(), NOISELESS).torque
    assert np.abs(dwells[1:, 0] - true[1:]).max() > 1.0
    assert np.abs(dwells[:, -1] - true).max() < 0.05
    assert record.speed.reshape(280, 250)[:, -1] == pytest.approx(np.tile(REFERENCE_SPEEDS, 7))


# --- The sensor of the reference's fit errors: plateaus and raw records of one clutch agree, and both laws of lag are
# seen.


def fits_of(clutch: SimulatedClutch, sensor: Sensor) -> tuple[StribeckFit, ...]:
    return fit_curves(curves_by_pressure(stationary_test(clutch, 0, rng(7), sensor), GEOMETRY))


def test_fresh_curves_are_fitted_as_well_as_the_references() -> None:
    """1.74 % on average and 3.61 % at most there; some drawn clutches' curves at 4 bar are flatter and have more."""
    clutches = [simulated_clutch(seed) for seed in range(12)]
    sharp, usual = (
        np.array([[fit.mse_percent for fit in fits_of(clutch, sensor)] for clutch in clutches])
        for sensor in (SHARP, Sensor())
    )
    assert 1.0 < sharp.mean() < 2.0
    assert np.median(sharp) < sharp.mean()
    assert (sharp < 3.61).mean() > 0.85
    # the control: a sensor of 1 % gives errors ten times as large
    assert usual.mean() > 10


@pytest.mark.parametrize("cycles", [0, 8000])
def test_plateaus_of_a_raw_record_are_as_exact_as_plateaus(cycles: int) -> None:
    clutch = simulated_clutch(7)
    still = replace(SHARP, gain_scatter=0.0)
    # the control last: plateaus of the usual sensor are four times as noisy
    true, plateaus, usual = (
        stationary_test(clutch, cycles, rng(7), sensor).torque
        for sensor in (NOISELESS, still, replace(Sensor(), gain_scatter=0.0))
    )
    raw = cut_plateaus(sampled_test(clutch, cycles, RawTest(rate=100.0), rng(7), still)).plateaus.torque
    assert raw.size == true.size
    errors = [float(np.std(torque / true - 1)) for torque in (plateaus, raw)]
    assert errors[1] == pytest.approx(errors[0], rel=0.4)
    assert max(errors) < 0.004
    assert np.std(usual / true - 1) > 2.5 * max(errors)


def test_a_film_beside_an_attractor_shows_both_laws_when_fresh() -> None:
    """By a film alone no fresh loop tells the attractor: torque lags against what that law can give."""
    film_alone = simulated_clutch(7)
    both = replace(film_alone, lag=replace(film_alone.lag, attractor=ATTRACTOR))
    determined = []
    for clutch in (film_alone, both):
        curves = {fit.pressure: StationaryCurve.of(fit) for fit in fits_of(clutch, SHARP)}
        loops = evaluate_loops(sampled_test(clutch, 0, DynamicTest(rate=50.0), rng(7), SHARP), GEOMETRY, curves)
        assert len(loops) == 7
        assert sum(loop.film_time is not None for loop in loops) >= 6
        assert sum(loop.better_law is not None for loop in loops) >= 6
        assert all(loop.area is not None and loop.area > 0 for loop in loops)
        determined.append(sum(loop.attractor is not None for loop in loops))
    assert determined[0] == 0
    assert determined[1] >= 3


@pytest.mark.parametrize(
    ("made", "name", "value", "rule"),
    [
        *((Sensor, name, -1.0, " must be finite and not negative, got -1") for name in Sensor.__slots__),
        *((Recorder, name, -1.0, " must be finite and not negative, got -1") for name in Recorder.__slots__),
        *(
            (DynamicTest, name, value, "")
            for name, value in (("rate", 0.0), ("amplitude", 2000.0), ("step", -1.0), ("frequency", np.nan))
        ),
        (RawTest, "rate", 0.0, " must be finite and positive, got 0"),
    ],
)
def test_what_no_rig_has_is_refused(made: type, name: str, value: float, rule: str) -> None:
    with pytest.raises(ValueError, match=f"{name}{rule}"):
        made(**{name: value})
