"""The noise of samples and periods, as it is estimated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DynamicRun
from models.diagnosis.design.autocorrelation import SampleAutocorrelation, bin_autocorrelation, sample_autocorrelation
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.design.loop_bins import BINS, period_differences
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.records.runs import Record
from tests.models.diagnosis.campaigns import campaign

# --- Autocorrelation of samples, and of bins as it follows from that: against noise that was made so.

SEED = 20


def autocorrelated(share: float, step: float, size: int, seed: int = SEED) -> FloatArray:
    """Noise of unit variance, partly white."""
    slow, white = np.random.default_rng(seed).standard_normal((2, size))
    slow = lfilter([np.sqrt(1 - step**2)], [1.0, -step], slow)
    return np.asarray(np.sqrt(share) * slow + np.sqrt(1 - share) * white, dtype=np.float64)


@pytest.mark.parametrize(("share", "step"), [(1.0, 0.7), (0.6, 0.95), (0.3, 0.5)])
def test_means_of_samples_are_autocorrelated_as_predicted(share: float, step: float) -> None:
    bins = autocorrelated(share, step, 4_000_000).reshape(-1, 20).mean(axis=1)
    one, two = SampleAutocorrelation(first=share * step, second=share * step**2, per_bin=20.0).of_bins()
    assert one == pytest.approx(float(np.corrcoef(bins[1:], bins[:-1])[0, 1]), abs=0.01)
    assert two == pytest.approx(float(np.corrcoef(bins[2:], bins[:-2])[0, 1]), abs=0.01)
    assert one > 0.01


def test_autocorrelation_is_found_beside_a_loop_and_over_gaps() -> None:
    phase = np.linspace(0.0, 4 * np.pi, 3000)
    used = np.ones(phase.size, dtype=np.bool_)
    used[np.random.default_rng(1).random(phase.size) < 0.1] = False
    found = []
    for seed in range(10):
        torque = 40 + 5 * np.sin(phase) + 2 * np.cos(3 * phase) + 0.3 * autocorrelated(0.8, 0.6, phase.size, seed)
        torque[~used] = 1e3
        estimate = sample_autocorrelation(torque, phase, used, 25.0)
        assert estimate is not None
        found.append((estimate.first, estimate.second))
    np.testing.assert_allclose(np.mean(found, axis=0), [0.48, 0.288], atol=0.02)


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_a_loops_course_is_not_taken_for_autocorrelated_noise(seed: int) -> None:
    """Independent noise of 0.3 %: the loop turns sharply next to standstill, three times as far off its low harmonics."""
    estimate = build_design(campaign(seed, noise=0.003)).bin_autocorrelation
    assert estimate is not None
    assert max(estimate) < 0.05


def test_times_that_repeat_do_no_harm() -> None:
    given = campaign(1)
    floored = [
        replace(run, record=replace(run.record, time=np.floor(10 * run.record.time) / 10)) for run in given.dynamic
    ]
    estimate = build_design(replace(given, dynamic=tuple(floored))).bin_autocorrelation
    assert estimate is not None
    assert max(estimate) < 0.05


def test_loops_sampled_otherwise_do_not_mix() -> None:
    """The same noise, autocorrelated over 50 ms, in bins of 0.16 s sampled at 40 and at 1000 a second."""

    def sampled(rate: float) -> SampleAutocorrelation:
        return SampleAutocorrelation(first=np.exp(-20 / rate), second=np.exp(-40 / rate), per_bin=0.16 * rate)

    alone = [sampled(rate).of_bins()[0] for rate in (40.0, 1000.0)]
    both = bin_autocorrelation([sampled(40.0), sampled(1000.0)])
    assert both is not None
    assert both[0] == pytest.approx(np.mean(alone))
    assert alone[0] == pytest.approx(alone[1], abs=0.05)


def test_too_few_samples_give_no_estimate() -> None:
    phase = np.linspace(0.0, 2 * np.pi, 3000)
    everything = np.ones(phase.size, dtype=np.bool_)
    assert sample_autocorrelation(np.sin(phase), phase, everything, 2.0) is None
    assert sample_autocorrelation(np.sin(phase[:100]), phase[:100], everything[:100], 25.0) is None
    assert sample_autocorrelation(np.zeros(phase.size), phase, everything, 25.0) is None
    known = SampleAutocorrelation(first=0.5, second=0.3, per_bin=10.0)
    assert bin_autocorrelation([known, None]) is None
    assert bin_autocorrelation([]) is None
    assert bin_autocorrelation([known, known, None]) == pytest.approx(known.of_bins())


@pytest.fixture(scope="module")
def design() -> Design:
    return build_design(campaign(1))


def inflations(design: Design, memory: float, from_samples: tuple[float, float] | None) -> list[float]:
    """Variance inflation of noise that is autocorrelated from bin to bin, in ten draws."""
    given, found = replace(design, bin_autocorrelation=from_samples, period_differences=()), []
    for seed in range(10):
        noise = autocorrelated(1.0, memory, design.torque.size, seed)
        residual = 0.01 * design.torque * noise / np.sqrt(design.samples)
        loops = estimate_noise(given, residual, design.torque, first_noise(design))[0].loops
        found.append(1 + 2 * loops.share * loops.decay / (1 - loops.decay))
    return found


def test_what_samples_show_is_used_unless_bins_contradict(design: Design) -> None:
    assert design.bin_autocorrelation is not None  # the fixture's loops have samples enough
    assert max(inflations(design, 0.0, (0.0, 0.0))) < 1.3
    assert max(inflations(design, 0.0, None)) > max(inflations(design, 0.0, (0.0, 0.0)))
    assert min(inflations(design, 0.6, (0.0, 0.0))) > 2.5  # truly 4: something slow that samples do not show


# --- Periods held against each other: by hand, as a rotation of the samples, and what they show of slow noise.

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
