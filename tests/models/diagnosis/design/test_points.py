"""Loops in phase bins: what of a record belongs to the swing, and from when on friction follows it."""

from dataclasses import replace

import numpy as np
import pytest

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis import criteria
from models.diagnosis.baseline.prediction import lag_of
from models.diagnosis.campaign import Campaign, DynamicRun
from models.diagnosis.design.design import Design, Points, build_design, thinned
from models.diagnosis.design.loop_bins import BINS, PHASES, BinnedLoop, binned_loops
from models.friction.stribeck import GAMMA, StribeckParameters, torque
from models.loops.lag_laws import attractor_torque
from models.records.runs import Record
from tests.models.diagnosis.campaigns import campaign

GEOMETRY = Geometry()
RPM = 2 * np.pi / 60
RATE = 50.0
CURVE = StribeckParameters(static_torque=25.0, coulomb_ratio=0.75, stribeck_velocity=5.0, viscous_coefficient=1.3)


def torque_at(velocity: FloatArray) -> FloatArray:
    return np.asarray(21.0 + 0.8 * velocity - 0.11 * velocity**2, dtype=np.float64)


def speed_of(frequency: float, periods: float, held: float, back: float) -> FloatArray:
    """[rpm]: 1000 held, a sine of 960 about it, and brought back to 1000 in `back` seconds."""
    sine = 1000 + 960 * np.sin(2 * np.pi * frequency * np.arange(round(periods / frequency * RATE)) / RATE)
    way = np.linspace(0.0, 1.0, round(back * RATE))
    return np.concatenate([np.full(round(held * RATE), 1000.0), sine, sine[-1] + (1000 - sine[-1]) * way])


def missed(loop: BinnedLoop, expected: FloatArray) -> float:
    """The largest share by which a bin's torque is not what is expected [PHASES] Nm there."""
    used = loop.samples > 0
    return float(np.abs(loop.torque / expected.reshape(BINS, PHASES // BINS).mean(axis=1) - 1)[used].max())


@pytest.mark.parametrize(
    ("periods", "held", "back"), [(1.5, 0.0, 0.0), (2.1, 2.0, 0.8), (2.0, 5.0, 0.0), (1.3, 1.0, 0.5), (2.1, 3.0, 1.5)]
)
def test_only_the_swing_is_binned(periods: float, held: float, back: float) -> None:
    """A record of three pressures, between which speed is held and brought back, its samples in any order; torque hangs on
    speed alone."""
    speed = speed_of(0.1, periods, held, back)
    pressures = np.repeat([4e5, 5e5, 6e5], speed.size)
    rpm = np.tile(speed, 3)
    velocity = GEOMETRY.sliding_velocity(rpm * RPM)
    time, torque = np.arange(rpm.size) / RATE, torque_at(velocity) * pressures / 5e5
    record = Record(time=time, pressure=pressures, speed=rpm * RPM, torque=torque)
    loops, notes = binned_loops(record.take(np.random.default_rng(1).permutation(time.size)), GEOMETRY)
    assert [loop.pressure for loop in loops] == [4e5, 5e5, 6e5]
    assert not notes
    for loop in loops:
        assert loop.angular_frequency == pytest.approx(2 * np.pi * 0.1, rel=2e-3)
        # a bin is some 5 samples wide, and falls on them as it happens: 1 % where the curve is steep
        assert missed(loop, torque_at(loop.velocity) * loop.pressure / 5e5) < 0.01


def test_friction_has_settled_when_a_fast_swing_counts() -> None:
    """At 0.5 Hz a twentieth of a period is no time for friction that lags by a quarter of a second; four periods are."""
    speed = speed_of(0.5, 4.2, 2.0, 0.0)
    time = np.arange(speed.size) / RATE
    torque = attractor_torque(time, GEOMETRY.sliding_velocity(speed * RPM), CURVE, 100.0)
    record = Record(time=time, pressure=np.full(time.size, 5e5), speed=speed * RPM, torque=torque)
    (loop,), _ = binned_loops(record, GEOMETRY)
    turns = np.arange(0.0, 20.0, 1 / 600)
    swung = GEOMETRY.sliding_velocity((1000 + 960 * np.sin(np.pi * turns)) * RPM)
    rising = (turns > 17.5) & (turns < 18.5)
    settled = attractor_torque(turns, swung, CURVE, 100.0)[rising]
    faster = loop.acceleration > 0.3 * loop.acceleration.max()
    wanted = np.interp(loop.velocity[faster], swung[rising], settled)
    found = np.repeat(loop.torque, PHASES // BINS)[faster]
    assert np.abs(found / wanted - 1).max() < 0.005


def designed(time: FloatArray, speed: FloatArray, measured: FloatArray) -> Design:
    """Of one dynamic test at 5 bar, speed in rad/s."""
    record = Record(time=time, pressure=np.full(time.size, 5e5), speed=speed, torque=measured)
    return build_design(Campaign(dynamic=(DynamicRun(run_id="d", cycles=0.0, record=record),)))


def triangle(turns: FloatArray) -> FloatArray:
    """[rad/s] of ramps between rest, at whole turns, and 1900 rpm."""
    return np.asarray(1900 * RPM * (1 - np.abs(2 * np.mod(turns, 1) - 1)), dtype=np.float64)


def turned(points: Points, frequency: float, time: FloatArray) -> FloatArray:
    """Periods since time 0 at the points of a loop: phases count from about the middle of the record, and the clock of bins
    that were passed a whole number of times on the average says from where."""
    turns = points.phase / (2 * np.pi)
    middle = frequency * 0.5 * (time[0] + time[-1])
    off = frequency * points.clock - turns - middle
    off -= np.round(off)
    return np.asarray(turns + middle + np.median(off[np.abs(off) < 0.02]), dtype=np.float64)


@pytest.mark.parametrize(("attractor", "share"), [(30.0, 1e-4), (60.0, 1e-4), (250.0, 2e-4)])
@pytest.mark.parametrize(("frequency", "rate", "first"), [(0.05, 100.0, 0.0), (0.1, 50.0, 0.3), (0.2, 100.0, 0.25)])
def test_ramps_down_to_rest_are_what_the_lag_law_says(attractor, share, frequency, rate, first):
    """A permille was asked; corners that four harmonics round cost a percent, S as it is amid a phase's cusp 2e-4."""
    fine, before = 50, 2 / frequency  # two periods to settle in, 50 steps a sample
    time = np.arange(round((before + 1.6 / frequency) * rate) * fine) / (rate * fine) - before
    speed = triangle(first + frequency * time)
    lagged = attractor_torque(time, np.maximum(GEOMETRY.sliding_velocity(speed), 1e-7), CURVE, attractor)
    sent = slice(round(before * rate) * fine, None, fine)
    design = designed(time[sent], speed[sent], lagged[sent])
    points = design.points
    lag = lag_of(torque(points.velocity, CURVE)[None], np.array([[attractor]]), points.angular_frequency[:1])
    off = design.to_rows(lag.torque[0]) - design.torque
    assert np.abs(off).max() < share * np.abs(design.torque).max()
    width = np.linspace(-0.5, 0.5, 201)[:, None] / PHASES
    about = GEOMETRY.sliding_velocity(triangle(first + turned(points, frequency, time[sent]) + width))
    wanted = (about**GAMMA).mean(axis=0) ** (1 / GAMMA)
    assert np.abs(points.velocity - wanted).max() < 1e-3 * wanted.max()


@pytest.mark.parametrize(("attractor", "share"), [(40.0, 2e-4), (60.0, 1e-4), (140.0, 1e-4), (400.0, 1e-4)])
def test_the_reference_test_from_rest_is_what_the_lag_law_says(attractor, share, monkeypatch):
    """0 to 2,000 rpm at 0.1 Hz for 15 s from rest: off by at most a tenth of the noise of a rig of 0.1 %, against steps of
    0.1 ms."""
    time = np.arange(150_001) / 10_000
    speed = 1000 * RPM * (1 - np.cos(0.2 * np.pi * time))
    lagged = attractor_torque(time, np.maximum(GEOMETRY.sliding_velocity(speed), 1e-9), CURVE, attractor)

    def off() -> float:
        design = designed(time[::100], speed[::100], lagged[::100])
        curves, frequency = torque(design.points.velocity, CURVE)[None], design.points.angular_frequency[:1]
        left = design.torque - design.to_rows(lag_of(curves, np.array([[attractor]]), frequency).torque[0])
        return float(np.abs(left / design.torque).max())

    assert off() < share
    # the control: with a second to settle in, slow friction still remembers its start
    monkeypatch.setattr(criteria, "SETTLING_TIME", 1.0)
    assert (off() > 10 * share) == (attractor < 100)


def wave(phase: FloatArray) -> FloatArray:
    return np.asarray(20 + 3 * np.sin(phase) + np.cos(2 * phase + 0.5), dtype=np.float64)


@pytest.mark.parametrize(("rate", "samples"), [(100.0, 845), (60.0, 747), (120.0, 1012)])
def test_samples_beside_a_bins_middle_are_no_delay(rate: float, samples: int) -> None:
    """At a multiple of the swing's 0.5 Hz the samples of a bin lie beside its middle, period after period."""
    time = np.arange(samples) / rate
    design = designed(time, (1000 - 960 * np.cos(np.pi * time)) * RPM, wave(np.pi * time))
    phase = 2 * np.pi * turned(design.points, 0.5, time)
    known = wave(phase)
    turning = np.gradient(known, phase)

    def off(design: Design) -> tuple[float, float]:
        """The most [Nm], and the delay [s] that it looks like."""
        left, rise = design.torque - design.to_rows(known), design.to_rows(turning)
        return float(np.abs(left).max()), abs(float(left @ rise / (rise @ rise))) / np.pi

    most, delay = off(design)
    assert most < 0.005
    assert delay < 1e-5
    # the control: as if they lay in the middle
    most, delay = off(replace(design, bin_offset=0 * design.bin_offset))
    assert most > 0.04
    assert delay > 1e-3


@pytest.mark.parametrize("periods", [1.5, 2.4, 3.0])
def test_a_bin_was_measured_when_its_samples_were(periods: float) -> None:
    """A torque that only grows with the clock: however many periods a bin's samples are of."""
    speed = speed_of(0.1, periods, 0.0, 0.0)
    time = np.arange(speed.size) / RATE
    record = Record(time=time + 40.0, pressure=np.full_like(time, 5e5), speed=speed * RPM, torque=20.0 + 0.01 * time)
    loops, _ = binned_loops(record, GEOMETRY)
    assert len(loops) == 1
    loop = loops[0]
    assert loop.clock.max() - loop.clock.min() < 10.0 * periods
    clock = loop.clock.reshape(BINS, -1).mean(axis=1)
    used = loop.samples > 1
    assert np.abs(loop.torque - 20.0 - 0.01 * clock)[used].max() < 0.01 * 0.15  # half a bin is 0.1 s


def test_dynamic_tests_that_tell_nothing_are_counted() -> None:
    time = np.arange(750) / RATE
    swinging = speed_of(0.1, 1.5, 0.0, 0.0) * RPM
    pressure, torque = np.full(time.size, 5e5), np.full(time.size, 20.0)
    records = [
        Record(time=time, pressure=pressure, speed=speed, torque=torque) for speed in (swinging, 0.0 * swinging + 100.0)
    ]
    tests = [DynamicRun(run_id=f"d{k}", cycles=0.0, record=each) for k, each in enumerate(records)]

    def said(*some: DynamicRun) -> list[str]:
        return [note for note in build_design(Campaign(dynamic=some)).notes if note.startswith("Dynamic tests")]

    (sentence,) = said(*tests)
    assert "could not be evaluated and were left out: 1 of 2 (5 bar: The speed does not " in sentence
    assert not said(tests[0])


def test_of_a_campaign_that_is_too_large_states_are_used_evenly_from_the_first_to_the_last(monkeypatch) -> None:
    given = campaign(24, cycles=(0.0, 1.0, 2.0, 3.0, 4.0))
    size = sum(run.plateaus.torque.size for run in given.stationary) + 5 * 8 * BINS
    for limit, most, stationary, dynamic in (
        ("MOST_LOOP_STATES", 5, [0, 1, 2, 3, 4], [0, 1, 2, 3, 4]),
        ("MOST_LOOP_STATES", 3, [0, 1, 2, 3, 4], [0, 2, 4]),
        ("MOST_ROWS", size, [0, 1, 2, 3, 4], [0, 1, 2, 3, 4]),
        ("MOST_ROWS", 0.65 * size, [0, 2, 4], [0, 2, 4]),
        ("MOST_ROWS", 1, [0, 4], [0, 4]),
    ):
        notes: list[str] = []
        with monkeypatch.context() as patch:
            patch.setattr(criteria, limit, most)
            used = thinned(given, notes)
        assert [run.cycles for run in used.stationary] == stationary
        assert [run.cycles for run in used.dynamic] == dynamic
        assert len(notes) == (len(dynamic) < 5)
