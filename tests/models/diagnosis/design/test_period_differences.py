"""Periods held against each other: by hand, as a rotation of the samples, and what they show of slow noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DynamicRun
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.design.loop_bins import BINS, period_differences
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.records.runs import Record

RPM = 2 * np.pi / 60
PERIOD, RATE, DEVIATION = 1.7, 100.0, 0.2


def test_three_periods_by_hand() -> None:
    """Bin 0 is met by two samples, by two and by one, which is too few; bin 1 in the first and last, bin 2 in the last."""
    torque = np.array([1.0, 3.0, 5.0, 6.0, 8.0, 70.0, 8.0, 9.0])
    bins = np.array([0, 0, 1, 0, 0, 0, 1, 2])
    turns = np.array([0.1, 0.2, 0.5, 1.1, 1.2, 2.1, 2.4, 2.9])
    found = period_differences(torque, bins, turns, 3)
    nan = np.nan
    expected = [[(7 - 2) / np.sqrt(1 / 2 + 1 / 2), nan, nan], [nan, (8 - 5) / np.sqrt(1 / 1 + 1 / 1), nan]]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert period_differences(torque[:3], bins[:3], turns[:3], 3).shape == (0, 3)


def test_white_samples_give_white_differences_and_a_loop_gives_none() -> None:
    """Linear in the samples, with rows that are orthonormal and blind to what every period has."""
    rng = np.random.default_rng(3)
    turns = np.arange(0.0, 4.3, 0.061)
    bins = np.floor(5 * np.mod(turns, 1)).astype(np.intp)
    rows = np.stack([period_differences(unit, bins, turns, 5).ravel() for unit in np.eye(turns.size)], axis=1)
    rows = rows[np.isfinite(rows).all(axis=1)]
    assert rows.shape[0] > 12
    np.testing.assert_allclose(rows @ rows.T, np.eye(rows.shape[0]), atol=1e-12)
    np.testing.assert_allclose(rows @ rng.standard_normal(5)[bins], 0.0, atol=1e-12)


def designed(seed: int, memory: float, noise: float) -> Design:
    """Four tests of five pressures, four periods each, two and a half of them settled; noise is autocorrelated over
    `memory` s."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(5 * 4 * PERIOD * RATE)) / RATE
    within = np.mod(time, 4 * PERIOD)
    speed = (1000 - 960 * np.cos(2 * np.pi * within / PERIOD)) * RPM
    runs = []
    for number in range(4):
        keep = np.exp(-1 / RATE / memory) if memory else 0.0
        slow = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(time.size))
        record = Record(
            time=time,
            pressure=np.repeat(np.linspace(4e5, 6e5, 5), time.size // 5),
            speed=speed,
            torque=np.asarray(20 + 0.003 * speed + noise * slow, dtype=np.float64),
        )
        runs.append(DynamicRun(run_id=f"d{number}", cycles=1000.0 * number, record=record))
    return build_design(Campaign(dynamic=tuple(runs)))


def estimated(design: Design, expected: FloatArray) -> tuple[float, float]:
    """The correlation of neighbouring bins, and the strength [Nm²] of noise that is slow, for a mean over bins."""
    noise, _ = estimate_noise(design, design.torque - expected, expected, first_noise(design))
    share, decay = noise.loops.share, noise.loops.decay
    variance = float(np.median(noise.deviation**2))
    return share * decay, variance * (1 + 2 * share * decay / (1 - decay))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_periods_show_slow_noise(seed: int) -> None:
    """It is autocorrelated over 0.3 s, ten bins: harmonics absorb most of that. Fewer than four samples fall into
    a bin each period, so samples do not show it either."""
    memory, expected = 0.3, designed(seed, 0.0, 0.0).torque
    design = designed(seed, memory, DEVIATION)
    assert design.bin_autocorrelation is None
    assert len(design.period_differences) == 2 * design.loops
    bin_time = PERIOD / BINS
    periods = float(np.median(design.samples)) / (RATE * bin_time)
    # a mean over time T of a process that forgets in `memory` has the variance 2 memory/T
    strength = DEVIATION**2 * 2 * memory / (bin_time * periods)
    neighbour, slow = estimated(design, expected)
    assert neighbour == pytest.approx(np.exp(-bin_time / memory), abs=0.03)
    assert 0.4 * strength < slow < 1.2 * strength  # the slowest that is tried has 0.9 a bin
    # the control: each loop alone
    neighbour, slow = estimated(replace(design, period_differences=()), expected)
    assert neighbour < 0.85
    assert slow < 0.2 * strength


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_periods_show_white_noise(seed: int) -> None:
    expected, design = designed(seed, 0.0, 0.0).torque, designed(seed, 0.0, DEVIATION)
    neighbour, slow = estimated(design, expected)
    assert neighbour < 0.05
    assert slow == pytest.approx(DEVIATION**2 / float(np.median(design.samples)), rel=0.2)
