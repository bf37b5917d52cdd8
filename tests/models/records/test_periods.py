"""Swings with corners: harmonics enough for ramps and few for a sine, cut where the swing begins and ends."""

import math
import re

import numpy as np
import pytest

from models.arrays import FloatArray
from models.records.criteria import CORNERS, SPEED_HARMONICS
from models.records.periods import Cycle, fit_cycle

RATE, AMPLITUDE = 100.0, 0.5


def triangle(turns: FloatArray) -> FloatArray:
    """Between 0 and 1, 0 at whole turns."""
    return np.asarray(1 - np.abs(2 * np.mod(turns, 1) - 1), dtype=np.float64)


def ramps(turns: FloatArray) -> FloatArray:
    """Trapezoids: the highest tenth of the triangle is held."""
    return np.minimum(triangle(turns), 0.9)


def fitted(time: FloatArray, value: FloatArray) -> Cycle:
    cycle = fit_cycle(time, value)
    assert isinstance(cycle, Cycle), cycle
    return cycle


@pytest.mark.parametrize("shape", [triangle, ramps])
@pytest.mark.parametrize(("frequency", "first", "periods"), [(0.1, 0.0, 1.5), (0.1, 0.3, 2.1), (0.2, 0.25, 3.0)])
def test_ramps_are_followed_into_their_corners(shape, frequency, first, periods):
    time = np.arange(round(periods / frequency * RATE)) / RATE
    cycle = fitted(time, shape(first + frequency * time))
    assert cycle.cosine.size == CORNERS[-1]
    assert cycle.frequency == pytest.approx(frequency, rel=1e-4)
    # 32 harmonics of a triangle leave 4/(π² 33) to its corner; four leave nine times as much
    off = cycle.value(cycle.phase(time)) - shape(first + frequency * time)
    assert np.abs(off).max() < 0.015 * AMPLITUDE
    assert (cycle.begin, cycle.stop) == pytest.approx((0.0, time[-1] + 0.5 / RATE), abs=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.002, 0.01, 0.05])
def test_a_sine_has_no_corners_however_noisy(noise: float) -> None:
    time = np.arange(2500) / RATE
    for seed in range(5):
        sine = 1 + AMPLITUDE * np.sin(2 * np.pi * 0.1 * time)
        cycle = fitted(time, sine + noise * AMPLITUDE * np.random.default_rng(seed).standard_normal(time.size))
        assert cycle.cosine.size == SPEED_HARMONICS


@pytest.mark.parametrize(
    ("first", "before", "after"), [(0.25, 2.0, 0.0), (0.25, 0.5, 1.0), (0.25, 3.0, 3.0), (0.0, 3.0, 3.0)]
)
@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_ramps_between_holds_are_cut_at_their_ends(first: float, before: float, after: float, noise: float) -> None:
    """Held before and after, in the middle of the ramps or at rest: what is cut too much is a hundredth of a period."""
    frequency, periods = 0.1, 1.5
    turns = first + frequency * np.arange(round(periods / frequency * RATE)) / RATE
    ends = np.full(round(before * RATE), first), np.full(round(after * RATE), first + periods)
    value = triangle(np.concatenate([ends[0], turns, ends[1]]))
    time = np.arange(value.size) / RATE
    cycle = fitted(time, value + noise * np.random.default_rng(1).standard_normal(value.size))
    assert before <= cycle.begin + 1e-9 < before + 0.15
    assert cycle.periods == math.floor(periods)
    assert before + periods / frequency - 0.15 < cycle.stop < before + periods / frequency + 1e-9
    within = np.linspace(before, before + periods / frequency, 4001)
    off = cycle.value(cycle.phase(within)) - triangle(first + frequency * (within - before))
    assert np.abs(off).max() < 0.015 * AMPLITUDE


@pytest.mark.parametrize("first", [0.0, 0.25, 0.4])
def test_holds_of_a_fiftieth_of_a_period_are_seen_once_the_corners_are(first: float) -> None:
    """To four harmonics they look like the corners that those miss."""
    turns, held = first + 0.1 * np.arange(1500) / RATE, np.full(20, 1.0)
    value = triangle(np.concatenate([first * held, turns, (first + 1.5) * held]))
    cycle = fitted(np.arange(value.size) / RATE, value)
    assert cycle.begin == pytest.approx(0.2, abs=0.05)
    assert cycle.stop == pytest.approx(15.2, abs=0.05)


def test_a_speed_that_does_not_swing_is_refused_for_the_limit_that_it_passes() -> None:
    time, rng = np.arange(2500) / RATE, np.random.default_rng(1)
    sine = 1 + AMPLITUDE * np.sin(2 * np.pi * 0.1 * time)
    noisy = fit_cycle(time, sine + 0.3 * AMPLITUDE * rng.standard_normal(time.size))
    assert re.search(r"misses it by (29|30|31)\S* % of its amplitude \(RMS; 15 % is the limit\)", str(noisy))
    spoiled = sine + np.where(rng.random(time.size) < 0.3, 0.1, 0.0) * rng.choice([-1, 1], time.size)
    assert re.search(r": 2\d\S* % of the samples lie off the periodic curve \(20 % ", str(fit_cycle(time, spoiled)))
