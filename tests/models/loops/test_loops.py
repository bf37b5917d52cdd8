"""Loops of dynamic tests against closed forms, on even and uneven samples, with what recorders do to them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.loops.lag_fit import LagStatus, StationaryCurve
from models.loops.loop_area import Direction, area_of, clean_samples
from models.loops.loops import evaluate_loops
from models.records.periods import fit_cycle
from models.records.runs import Record
from tests.lab.real.lag import MICRO_LOOPS, micro_loops
from tests.models.loops.dynamic_records import FALLING, GEOMETRY, SWING, attractor, curve, record, velocity

AMPLITUDE = GEOMETRY.mean_radius * SWING
EXACT = StationaryCurve(parameters=FALLING)
OMEGA = 2 * math.pi * 0.1
LAG = 0.04  # Nm s²/m


def lagging(t: np.ndarray) -> np.ndarray:
    """A single-valued cubic of v, and LAG v̇: its area is LAG ∮ v̇² dt, nothing else."""
    v = velocity(t)
    return 21.0 + 0.8 * v - 0.11 * v**2 + 0.004 * v**3 + LAG * AMPLITUDE * OMEGA * np.cos(OMEGA * t)


def on_the_curve(t: np.ndarray) -> np.ndarray:
    """Eq. 3, cusp at standstill and all, and LAG v̇."""
    return curve(velocity(t), FALLING) + LAG * AMPLITUDE * OMEGA * np.cos(OMEGA * t)


def closed_form(omega: float = OMEGA) -> float:
    return math.pi * LAG * AMPLITUDE**2 * omega


def only(found: tuple) -> object:
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize("torque", [lagging, on_the_curve])
@pytest.mark.parametrize("rate", [10.0, 37.3, 100.0, 2000.0])
def test_area_of_a_closed_form(rate, torque):
    # 1e-6 is asked. The cusp of eq. 3 makes harmonics that few samples a period alias: the fitted cusp takes them.
    loop = only(evaluate_loops(record([torque], [5e5], rate=rate), GEOMETRY, None))
    assert loop.area == pytest.approx(closed_form(), rel=1e-6)
    assert loop.frequency == pytest.approx(0.1, rel=1e-9)
    assert (loop.periods, loop.direction) == (1, Direction.HIGHER_ACCELERATING)
    assert loop.status is LagStatus.NO_CURVE


def test_fifteen_seconds_are_one_period():
    # the control: the same integral over all of the 15 s has another half loop, not closed
    whole = record([lagging], [5e5], rate=1000.0)
    naive = float(np.trapezoid(whole.torque, GEOMETRY.sliding_velocity(whole.speed)))
    loop = only(evaluate_loops(whole, GEOMETRY, None))
    assert loop.area == pytest.approx(closed_form(), rel=1e-6)
    assert abs(naive / closed_form() - 1) > 0.4
    three = only(evaluate_loops(record([lagging], [5e5], duration=34.0), GEOMETRY, None))
    assert three.periods == 3
    assert three.area == pytest.approx(closed_form(), rel=1e-6)  # a mean a period, not a sum


FULL = record([lagging], [5e5])


@pytest.mark.parametrize(
    "made",
    [
        record([lagging], [5e5], rng=np.random.default_rng(3), lost=0.2, jitter=0.9),
        FULL.take((FULL.time < 8.0) | (FULL.time > 8.6)),
        record([lambda t: lagging(t) + 0.05 * t], [5e5], duration=35.0),
    ],
    ids=["lost samples and jitter", "a gap", "a drift over periods"],
)
def test_area_keeps_with(made):
    assert only(evaluate_loops(made, GEOMETRY, None)).area == pytest.approx(closed_form(), rel=1e-6)


def test_direction_turns_with_the_lag():
    def leading(t: np.ndarray) -> np.ndarray:
        return 2 * curve(velocity(t), FALLING) - on_the_curve(t)

    def still(t: np.ndarray) -> np.ndarray:
        return curve(velocity(t), FALLING)

    rng = np.random.default_rng(5)
    pressures = [4e5, 5e5, 6e5]
    noisy = record([on_the_curve, still, leading], pressures, rate=500.0, noise=0.002, rng=rng)
    found = evaluate_loops(noisy, GEOMETRY, None)
    assert [loop.direction for loop in found] == [
        Direction.HIGHER_ACCELERATING,
        Direction.NONE,
        Direction.HIGHER_DECELERATING,
    ]


def test_spikes_are_left_out_and_said():
    clean = {"rate": 200.0, "noise": 0.01}
    spiked = record([lagging], [5e5], rng=np.random.default_rng(8), spikes=12, **clean)
    loop = only(evaluate_loops(spiked, GEOMETRY, None))
    assert abs(loop.area - closed_form()) < 3 * loop.area_sd
    assert "outlying samples were left out" in loop.message
    # the control: with the spikes the deviation would be larger than without by more than half
    untouched = only(evaluate_loops(record([lagging], [5e5], rng=np.random.default_rng(8), **clean), GEOMETRY, None))
    assert loop.area_sd == pytest.approx(untouched.area_sd, rel=0.2)
    assert "outlying" not in untouched.message


def test_pressures_in_any_order_with_ramps():
    pressures = [6e5, 4e5, 4.5e5, 7e5]
    many = record(
        [lagging] * 4, pressures, rng=np.random.default_rng(2), noise=0.005, ramp=1.5, lost=0.01, jitter=0.3, spikes=3
    )
    found = evaluate_loops(many, GEOMETRY, None)
    assert evaluate_loops(many.take(np.random.default_rng(3).permutation(many.time.size)), GEOMETRY, None) == found
    assert [loop.pressure for loop in found] == pressures
    for loop in found:
        assert loop.periods == 1
        assert abs(loop.area - closed_form()) < 4 * loop.area_sd


def test_deviation_follows_the_periods_where_they_differ():
    """A loop that breathes from period to period scatters more than its samples' noise says."""

    def breathing(t: np.ndarray) -> np.ndarray:
        size = np.random.default_rng(1).normal(1.0, 0.5, 20)[(t // 10).astype(int)]
        return lagging(t) + (size - 1) * LAG * AMPLITUDE * OMEGA * np.cos(OMEGA * t)

    steady = only(evaluate_loops(record([lagging], [5e5], duration=80.0), GEOMETRY, None))
    loop = only(evaluate_loops(record([breathing], [5e5], duration=80.0), GEOMETRY, None))
    assert loop.periods == 8
    assert loop.area_sd == pytest.approx(0.5 * closed_form() / math.sqrt(8), rel=0.5)
    assert steady.area_sd < 1e-6 * closed_form()


@pytest.mark.parametrize(("change", "words"), [({"duration": 9.5}, "No whole period"), ({"frequency": 0.001}, "")])
def test_nothing_closed_is_said(change, words):
    loop = only(evaluate_loops(record([lambda t: 20 + 0 * t], [5e5], **change), GEOMETRY, None))
    assert loop.status is LagStatus.NO_PERIOD
    assert loop.area is None
    assert words in loop.message
    assert loop.message


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_constant_speed_has_no_loop(noise):
    speed = 100 + noise * np.random.default_rng(0).standard_normal(1500)
    assert only(evaluate_loops(replace(FULL, speed=speed), GEOMETRY, None)).status is LagStatus.NO_PERIOD


def test_held_between_two_pressures_and_brought_back_is_left_out():
    swing = record([lagging], [5e5], duration=21.0)
    way = swing.speed[-1] + (SWING - swing.speed[-1]) * np.linspace(0, 1, 80)
    speed = np.concatenate([np.full(200, SWING), swing.speed, way])
    torque = np.concatenate([np.full(200, 24.0), swing.torque, np.full(80, 24.0)])
    held = Record(time=np.arange(speed.size) / 100, pressure=np.full(speed.size, 5e5), speed=speed, torque=torque)
    loop = only(evaluate_loops(held, GEOMETRY, None))
    assert loop.periods == 2
    assert loop.area == pytest.approx(closed_form(), rel=0.015)  # the end is blurred, and so are two periods' ends


def test_a_curve_of_another_pressure_or_of_no_torque_is_none() -> None:
    swing = record([attractor(FALLING, 100.0)], [5e5])
    assert only(evaluate_loops(swing, GEOMETRY, {5.5e5: EXACT})).status is LagStatus.NO_CURVE
    assert only(evaluate_loops(swing, GEOMETRY, {5.05e5: EXACT})).status is LagStatus.DETERMINED
    # a curve of no torque is none
    nothing = replace(FALLING, static_torque=0.0, viscous_coefficient=0.0)
    loop = only(evaluate_loops(record([lagging], [5e5]), GEOMETRY, {5e5: StationaryCurve(parameters=nothing)}))
    assert loop.status is LagStatus.NO_CURVE


def test_a_bent_swing():
    """A motor that does not follow a pure sine: the integral over its harmonics against a dense trapezoid rule."""
    fine = np.linspace(0, 10, 200_001)

    def bent(t: np.ndarray) -> np.ndarray:
        return velocity(t) + 0.3 * np.sin(2 * OMEGA * t + 0.4) + 0.1 * np.cos(3 * OMEGA * t) + 0.5

    def torque(t: np.ndarray) -> np.ndarray:
        return 20 + 0.5 * np.sin(bent(t)) + 0.1 * np.cos(2 * OMEGA * t) + 0.2 * np.cos(OMEGA * t)

    time = np.arange(1500) / 100
    cycle = fit_cycle(time, bent(time))
    expected = float(np.trapezoid(torque(fine), bent(fine)))
    assert area_of(cycle, clean_samples(cycle, time, torque(time))).area == pytest.approx(expected, rel=1e-6)
    # the control: a single harmonic of the speed misses it
    pure = replace(cycle, cosine=cycle.cosine[:1], sine=cycle.sine[:1], covariance=np.zeros((2, 2)))
    assert area_of(pure, clean_samples(pure, time, torque(time))).area != pytest.approx(expected, rel=1e-3)


def test_the_sense_of_rotation_does_not_matter_and_a_reversing_speed_has_no_law() -> None:
    swing = record([attractor(FALLING, 100.0)], [5e5])
    turned = replace(swing, speed=-swing.speed, torque=-swing.torque)
    here, there = (only(evaluate_loops(one, GEOMETRY, {5e5: EXACT})) for one in (swing, turned))
    assert there.area == pytest.approx(here.area, rel=1e-9)
    assert there.attractor == pytest.approx(here.attractor, rel=1e-9)
    # a reversing speed has area and no law
    swing = record([lagging], [5e5])
    back = replace(swing, speed=swing.speed - SWING)
    loop = only(evaluate_loops(back, GEOMETRY, {5e5: EXACT}))
    assert loop.status is LagStatus.REVERSES
    assert loop.area == pytest.approx(closed_form(), rel=1e-6)
    assert loop.attractor is None


@settings(max_examples=30, deadline=None)
@given(
    rate=st.floats(45.0, 400.0),
    frequency=st.floats(0.08, 0.8),
    periods=st.floats(1.02, 4.5),
    lost=st.floats(0.0, 0.1),
    seed=st.integers(0, 2**32 - 1),
)
def test_area_of_any_swing(rate, frequency, periods, lost, seed):
    def torque(t: np.ndarray) -> np.ndarray:
        v = velocity(t, frequency)
        rising = AMPLITUDE * 2 * math.pi * frequency * np.cos(2 * math.pi * frequency * t)
        return 21.0 + 0.8 * v - 0.11 * v**2 + 0.004 * v**3 + LAG * rising

    duration = max(periods / frequency, 3.0, 60 / rate)
    rng = np.random.default_rng(seed)
    made = record([torque], [5e5], rate=rate, frequency=frequency, duration=duration, rng=rng, lost=lost, jitter=0.5)
    loop = only(evaluate_loops(made, GEOMETRY, None))
    sampled = (made.time[-1] - made.time[0] + 1 / rate) * frequency
    assert abs(loop.periods - sampled + 0.5) <= 0.55  # the whole ones, give or take a lost sample at an end
    if loop.periods:
        assert loop.area == pytest.approx(closed_form(2 * math.pi * frequency), rel=1e-6)


@pytest.mark.skipif(not MICRO_LOOPS.is_file(), reason="the real measurements are not here")
def test_measured_loops_against_trapezoids():
    # 800 samples a cycle of a motion with corners: 16 harmonics and the raw sum agree within 1 %
    for row in micro_loops():
        assert row["∮F dv [N mm/s]"] == pytest.approx(row["∮F dv by trapezoids"], rel=0.02)
        assert row["∮F dx [mJ]"] == pytest.approx(row["∮F dx by trapezoids"], rel=0.003)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 300),
    st.sampled_from(["noise", "constant", "repeated times", "steps", "huge"]),
    st.integers(0, 2**32 - 1),
)
def test_any_record_has_an_answer(rows, kind, seed):
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0, 20, rows)) if kind != "repeated times" else np.full(rows, 3.0)
    scale = 1e12 if kind == "huge" else 1.0
    speed = np.zeros(rows) if kind == "constant" else scale * 100 * rng.standard_normal(rows)
    pressure = 5e5 + (1e5 * rng.integers(0, 3, rows) if kind == "steps" else 0.0 * time)
    torque = scale * 20 * rng.standard_normal(rows)
    for loop in evaluate_loops(
        Record(time=time, pressure=pressure, speed=speed, torque=torque), GEOMETRY, {5e5: EXACT}
    ):
        assert loop.message
        assert (loop.area is None) == (loop.status is LagStatus.NO_PERIOD)
