"""Where pressure stands: loops whose pressure moves slowly between levels, against the same loops with steps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.clutch import Geometry
from models.loops.loops import evaluate_loops
from models.records.criteria import LEVEL_GAP
from models.records.pressure_levels import level_width, levels_of, pressure_stretches
from models.records.runs import Plateaus, Record, curves_by_pressure
from models.rig.sampled import DynamicTest, Recorder
from models.rig.stationary import Sensor
from models.rig.truth import PROTOCOL_PRESSURES, SimulatedClutch
from tests.models.rig.exact import EXACT

CLUTCH = SimulatedClutch()
NO_SCATTER = Sensor(gain_scatter=0.0)


def recorded(step: float, *, paused: bool, recorder: Recorder = EXACT) -> Record:
    """A dynamic test with `step` s from level to level, in which the speed swings on or waits at its mean."""
    test = DynamicTest(step=step, recorder=recorder)
    time, pressure, speed = test.course()
    if paused:
        block = test.duration + step
        turn = np.minimum((time / block).astype(int), PROTOCOL_PRESSURES.size - 1)
        swung = turn * test.duration + np.clip(time - turn * block, 0, test.duration)
        speed = test.offset + test.amplitude * np.sin(2 * math.pi * test.frequency * swung)
    torque = CLUTCH.moving_torque(time, CLUTCH.geometry.sliding_velocity(speed), pressure, 0.0)
    rng = np.random.default_rng(4)
    return replace(recorder, memory=0.0).record(time, pressure, speed, torque, rng, NO_SCATTER)


def areas(record: Record) -> np.ndarray:
    found = evaluate_loops(record, CLUTCH.geometry, None)
    assert [loop.pressure for loop in found] == PROTOCOL_PRESSURES.tolist()
    return np.array([loop.area for loop in found])


@pytest.fixture(scope="module")
def stepped() -> np.ndarray:
    """The areas where pressure comes to its next level within two samples."""
    return areas(recorded(0.02, paused=False))


@pytest.mark.parametrize("step", [0.5, 3.0, 10.0, 30.0])
@pytest.mark.parametrize("paused", [False, True])
def test_areas_do_not_depend_on_how_slowly_pressure_moves(step, paused, stepped):
    found = areas(recorded(step, paused=paused))
    assert np.abs(found / stepped - 1).max() < 0.035


def test_a_recorder_with_noise(stepped):
    record = recorded(3.0, paused=False, recorder=Recorder(torque_noise=0.01))
    assert np.abs(areas(record) / stepped - 1).max() < 0.05
    # the control: with all that lies within a level's gap, the areas would be off by a fifth and more
    t, p = record.time, record.pressure
    worst = 0.0
    for stretch, area in zip(pressure_stretches(t, p), stepped, strict=True):
        wide = np.flatnonzero(np.abs(p - stretch.pressure) < LEVEL_GAP)
        all_of_it = record.take(np.arange(wide[0], wide[-1] + 1))
        all_of_it = replace(all_of_it, pressure=np.full(all_of_it.time.size, stretch.pressure))
        worst = max(worst, abs(evaluate_loops(all_of_it, CLUTCH.geometry, None)[0].area / area - 1))
    assert worst > 0.2


@pytest.mark.parametrize("step", [0.02e5, 0.03e5, 0.05e5, 0.1e5])
@pytest.mark.parametrize("count", [5, 7])
def test_levels_closer_than_a_gap_are_cut_without_harm(step: float, count: int) -> None:
    """Some merge, some are taken for a ramp; none reaches beyond the record or is empty."""
    pressure = np.repeat(0.4e5 + step * np.arange(count), 2001)
    found = list(pressure_stretches(np.arange(pressure.size) / 60, pressure))
    assert all(0 <= each.start < each.stop <= pressure.size for each in found)


def test_pressure_stands_between_ramps_however_it_wanders() -> None:
    time = np.arange(4000) / 100
    pressure = np.concatenate([np.full(1500, 4e5), np.linspace(4e5, 4.5e5, 200), np.full(2300, 4.5e5)])
    pressure = pressure + 2e3 * np.random.default_rng(0).standard_normal(4000)
    found = list(pressure_stretches(time, pressure))
    assert [round(s.pressure / 1e5, 1) for s in found] == [4.0, 4.5]
    assert abs(found[0].stop - 1500) < 60
    assert abs(found[1].start - 1700) < 60
    assert (found[0].start, found[1].stop) == (0, 4000)
    # A ripple of 0.03 bar all through, counts of 0.05 bar: nothing is cut off, nothing is split.
    time = np.arange(1500) / 100
    rng = np.random.default_rng(5)
    for pressure in (
        5e5 + 3e3 * np.sin(2 * math.pi * 0.1 * time) + 500 * rng.standard_normal(1500),
        np.round((5e5 + 2e3 * rng.standard_normal(1500)) / 5e3) * 5e3,
    ):
        (found,) = pressure_stretches(time, pressure)
        assert found.start < 5
        assert found.stop > 1495
    # But for what the record's end leaves of it, which is too little to be told from a level that drifts.
    time = np.arange(6000) / 100
    longest = max((s.stop - s.start for s in pressure_stretches(time, np.linspace(4e5, 5e5, 6000))), default=0)
    assert longest < 500
    # the control: as long, and standing
    (standing,) = pressure_stretches(time, np.full(6000, 4e5))
    assert standing.stop - standing.start == 6000


# --- Levels of pressure among nominal and among scattered pressures.

NOMINAL = np.repeat(np.arange(4.0, 7.01, 0.5) * 1e5, 40)


@pytest.mark.parametrize(("pressure", "width"), [(4e5, LEVEL_GAP), (8e5, 0.2e5)])
def test_a_level_is_as_wide_as_the_gap_or_its_share_of_the_pressure(pressure, width):
    assert level_width(pressure) == pytest.approx(width)


@pytest.mark.parametrize(
    ("pressure", "levels"),
    [
        (NOMINAL + np.random.default_rng(1).normal(0.0, 0.02e5, NOMINAL.size), NOMINAL),
        ([5.00e5] * 3 + [5.05e5] * 3, [5.00e5] * 3 + [5.05e5] * 3),
        ([4.99e5] * 4 + [5.00e5] * 5 + [5.01e5] * 3, [5e5] * 12),
        ([9.97e5, 9.977e5, 9.985e5], [10e5] * 3),
        ([4.975e5, 4.976e5, 4.977e5], [4.976e5] * 3),
        ([5.01e5], [5e5]),
    ],
    ids=[
        "scattered about steps of 0.5 bar",
        "close but repeated",
        "counts of one sensor",
        "a gauge's error at 10 bar",
        "far from a step",
        "one row",
    ],
)
def test_pressures_find_their_level(pressure, levels):
    np.testing.assert_allclose(levels_of(np.asarray(pressure)), levels, rtol=1e-12)


@given(st.permutations(range(28)))
def test_the_order_of_rows_does_not_matter(order):
    measured = np.repeat(np.arange(4.0, 7.01, 0.5) * 1e5, 4)
    measured = measured + np.random.default_rng(2).normal(0.0, 0.02e5, measured.size)
    np.testing.assert_array_equal(levels_of(measured[order]), levels_of(measured)[order])


# --- Plateaus check themselves, and a curve holds the rows of its pressure level.


def plateaus(pressure, /, **changes):
    n = len(pressure)
    columns = {"speed": np.linspace(2, 206, n), "torque": np.full(n, 20.0)}
    return Plateaus(**({"pressure": np.asarray(pressure)} | columns | changes))


def test_curves_hold_their_rows_in_order():
    sd = np.linspace(0.1, 0.2, 280)
    curves = curves_by_pressure(plateaus(NOMINAL[::-1] + 100.0, torque_sd=sd), Geometry())
    assert [round(c.pressure) for c in curves] == [400000, 450000, 500000, 550000, 600000, 650000, 700000]
    assert curves[0].mean_pressure == pytest.approx(400100.0)
    np.testing.assert_array_equal(curves[0].torque_sd, sd[-40:])
    np.testing.assert_allclose(curves[0].velocity, np.linspace(2, 206, 280)[-40:] * 0.058)
    assert sum(c.velocity.size for c in curves) == 280


@pytest.mark.parametrize("name", ["pressure", "speed", "torque", "torque_sd", "oil_temperature"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_value_that_is_not_finite_is_refused(name, bad):
    column = np.full(6, 3.0)
    column[4] = bad
    with pytest.raises(ValueError, match=f"{name} must be finite"):
        plateaus(np.full(6, 5e5), **{name: column})


def test_unequal_lengths_and_no_rows_are_refused():
    with pytest.raises(ValueError, match=r"speed must have the shape of torque \(6,\), got \(5,\)"):
        plateaus(np.full(6, 5e5), speed=np.ones(5))
    with pytest.raises(ValueError, match="at least one row"):
        plateaus(np.array([]))
    with pytest.raises(ValueError, match="at least one row"):
        plateaus(np.full(6, 5e5), torque=np.ones((2, 3)))
