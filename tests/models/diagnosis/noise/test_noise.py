"""Noise from within the data: right where it is white or autocorrelated, and blind to what is smooth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.campaign import Campaign, DynamicRun
from models.diagnosis.design.autocorrelation import (
    Correlation,
    SampleAutocorrelation,
    arma,
    bin_autocorrelation,
    sample_autocorrelation,
)
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.design.loop_bins import BINS, period_differences
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.noise import estimate
from models.diagnosis.noise.covariance import Noise, gains_of, metric
from models.diagnosis.noise.estimate import estimate_noise, first_noise, unlike
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from models.records.runs import Record
from tests.models.diagnosis.campaigns import PRESSURES, altered, campaign, look

SEED = 20


def followed(white: FloatArray, memory: float) -> FloatArray:
    """White noise of unit variance, autocorrelated by so much from one to the next."""
    return np.asarray(lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], white), dtype=np.float64)


@pytest.fixture(scope="module")
def design() -> Design:
    return build_design(campaign(1))


@pytest.mark.parametrize("memory", [0.0, 0.5])
def test_noise_is_found_beside_something_smooth(design: Design, memory: float) -> None:
    rng = np.random.default_rng(SEED)
    white = rng.standard_normal(design.torque.size)
    autocorrelated = followed(white, memory)
    smooth = 0.03 * design.torque * np.sin(design.rows.velocity / 3)
    residual = smooth + 0.01 * design.torque * autocorrelated / np.sqrt(design.samples)
    noise, assumed = estimate_noise(design, residual, design.torque, first_noise(design))
    steady = slice(0, design.plateaus)
    share = np.median(noise.deviation[steady] / design.torque[steady])
    assert not assumed
    assert abs(share - 0.01) < 0.0012  # some 600 rows, and the correlation is estimated from few
    next_row = noise.plateaus.share * noise.plateaus.decay
    assert abs(next_row - memory) < 0.15


@pytest.mark.parametrize("states", [3, 4, 6, 10])
def test_what_tests_have_in_common_is_no_noise_however_sharp(states: int) -> None:
    """A tooth over speed and pressure in every test, four times the noise: from LEAST_REPEATS tests on it is the law's, and
    noise alone stays as large as it is."""
    design = build_design(campaign(1, cycles=tuple(np.linspace(0.0, 9000.0, states)), loops=False))
    rng = np.random.default_rng(SEED)
    tooth = 0.04 * np.where(np.arange(design.torque.size // states) % 2, 1.0, -1.0)
    tooth *= rng.random(tooth.size) > 0.5
    white = 0.01 * np.stack([rng.standard_normal(design.torque.size) for _ in range(8)])
    deviations = []
    for each in white:
        left = unlike(design, (np.tile(tooth, states) + each) * design.torque, design.torque) / design.torque
        deviations.append(float(np.std(left)))
    assert (np.mean(deviations) == pytest.approx(0.01, rel=0.03)) == (states >= criteria.LEAST_REPEATS)
    # a median is no mean: one test that is off by far leaves the others alone
    alone = unlike(design, np.where(design.rows.run == 0, design.torque, 0.0), design.torque)
    if states >= criteria.LEAST_REPEATS:
        assert np.abs(alone[design.rows.run != 0]).max() == 0.0


def test_loops_alone_have_no_tests_in_common() -> None:
    design = designed(0, 0.0, DEVIATION)
    np.testing.assert_array_equal(unlike(design, design.torque, design.torque), design.torque)


def test_a_sharp_drop_is_no_noise(design: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    """As traction does near rest, within three readings."""
    monkeypatch.setattr(estimate, "_SHORT", 8)  # curves of 24 readings here: a third of the pieces holds the drop
    white = np.random.default_rng(SEED).standard_normal(design.torque.size)
    dropping = design.rows.steady & (design.rows.velocity < np.unique(design.rows.velocity[: design.plateaus])[3])
    residual = 0.01 * design.torque * white / np.sqrt(design.samples) - np.where(dropping, design.torque, 0.0)
    noise, assumed = estimate_noise(design, residual, design.torque, first_noise(design))
    calm = np.flatnonzero(~dropping[: design.plateaus])
    assert not assumed
    assert 0.007 < np.median(noise.deviation[calm] / design.torque[calm]) < 0.015


def test_a_flat_likelihood_does_not_choose_persistent_noise(design: Design) -> None:
    """Neighbours correlated by 0.3 in 20 draws: slow noise, of which curves freed of all that is smooth show little, must
    not be taken for much stronger than it is (1.86 times that of independent neighbours) in any of them."""
    inflations = []
    for seed in range(20):
        white = np.random.default_rng([SEED, seed]).standard_normal(design.torque.size)
        autocorrelated = followed(white, 0.3)
        residual = 0.01 * design.torque * autocorrelated / np.sqrt(design.samples)
        found = estimate_noise(design, residual, design.torque, first_noise(design))[0].plateaus
        inflations.append(1 + 2 * found.share * found.decay / (1 - found.decay))
    assert 1.4 < np.median(inflations) < 2.4
    assert max(inflations) < 4.0


@pytest.mark.parametrize("share", [1.0, 1.0 - 1e-12, 1.0 - 1e-9, 1.0 - 1e-6, 0.998, 0.5, 1e-6])
@pytest.mark.parametrize("step", [0.2, 0.9, 0.95])
def test_an_arma_process_has_the_correlations_that_it_was_made_for(share: float, step: float) -> None:
    theta, scale = arma(Correlation(share=share, decay=step))
    assert abs(theta) < 1
    # x_i = ρ x_{i-1} + s (e_i + θ e_{i-1}): its variance, and its covariance with the neighbour
    variance = scale**2 * (1 + theta**2 + 2 * step * theta) / (1 - step**2)
    assert variance == pytest.approx(1.0, rel=1e-6)
    assert step * variance + scale**2 * theta == pytest.approx(share * step, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("sigma", "lost"), [(2.0, 0), (2.0, 1), (0.02, 0)])
def test_the_metric_is_the_inverse_of_the_covariance(sigma: float, lost: int) -> None:
    """Also where a run that lost a plateau lies between runs that are alike."""
    first, second, *later = campaign(1).stationary
    shorter = replace(second, plateaus=second.plateaus.take(np.arange(second.plateaus.torque.size - lost)))
    design = build_design(Campaign(stationary=(first, shorter, *later)))
    correlation = Correlation(share=0.7, decay=0.6)
    noise = Noise(
        deviation=np.full(design.torque.size, sigma),
        plateaus=correlation,
        loops=Correlation(),
        run_gain=0.004,
        curve_gain=0.002,
    )
    rows = np.flatnonzero(design.rows.run == 0)
    distance = np.abs(np.subtract.outer(rows, rows))
    covariance = sigma**2 * np.where(distance == 0, 1.0, 0.7 * 0.6**distance)
    torque = design.torque[rows]
    covariance += 0.004**2 * np.outer(torque, torque)
    same = np.equal.outer(design.curve[rows], design.curve[rows])
    covariance += 0.002**2 * np.outer(torque, torque) * same
    rng = np.random.default_rng(SEED)
    own = rng.standard_normal(int(design.curve.max()) + 1)  # noise alone, and a gain of each curve alone
    probe = np.zeros((design.torque.size, 2))
    probe[rows] = np.stack([rng.standard_normal(rows.size), torque * 0.002 * own[design.curve[rows]]], axis=1)
    products = metric(design, design.torque, noise)(probe)
    expected = probe[rows].T @ np.linalg.solve(covariance, probe[rows])
    # the filter starts from a row's own past that is not known: a part in hundred
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(products / np.outer(scale, scale), expected / np.outer(scale, scale), atol=0.02)


def test_beyond_so_many_pressures_neighbours_share_a_gain(design: Design, monkeypatch: pytest.MonkeyPatch) -> None:
    noise = Noise(
        deviation=np.ones(design.torque.size),
        plateaus=Correlation(share=0.7, decay=0.6),
        loops=Correlation(),
        run_gain=0.0,
        curve_gain=0.0,
    )
    own = gains_of(design, design.torque, noise)
    monkeypatch.setattr(criteria, "MOST_GAINS", 2)
    shared = gains_of(design, design.torque, noise)
    assert own.overlaps.shape[1] > shared.overlaps.shape[1] == 2
    np.testing.assert_allclose(shared.overlaps.sum(axis=(1, 2)), own.overlaps.sum(axis=(1, 2)))
    first = design.rows.run == 0
    lower, upper = (design.level[first & (shared.curve == place)] for place in (0, 1))
    assert lower.max() < upper.min()


def scattered(given: Campaign, scatter: float) -> Campaign:
    """Each pressure of each test with a gain of its own."""
    rng = np.random.default_rng(SEED)

    def gains(pressure: FloatArray) -> FloatArray:
        each = 1 + scatter * rng.standard_normal(PRESSURES.size)
        return each[np.abs(pressure[:, None] - PRESSURES).argmin(axis=1)]

    return altered(
        given,
        lambda run: {"torque": run.plateaus.torque * gains(run.plateaus.pressure)},
        lambda run: {"torque": run.record.torque * gains(run.record.pressure)},
    )


@pytest.mark.slow
@pytest.mark.parametrize(("scatter", "least", "most"), [(0.0, 0.0, 4e-4), (0.001, 4e-4, 2.5e-3), (0.004, 2.5e-3, 6e-3)])
def test_gains_that_scatter_from_pressure_to_pressure_are_no_structure(scatter, least, most):
    given = scattered(campaign(3), scatter)
    assert least <= fit_baseline(build_design(given)).problem.noise.curve_gain <= most
    assert look(given, 0).verdict is Verdict.MODEL_ADEQUATE


@pytest.mark.parametrize("order", ["rising speed", "random"])
@pytest.mark.parametrize("place", ["first", "middle", "last"])
def test_a_spike_weighs_nothing_wherever_it_stands_on_its_curve(order: str, place: str) -> None:
    """It is 40 deviations; everything around it is off by a fifth of a spike, as where it has distorted the fit."""
    given = campaign(1, loops=False)
    if order == "random":
        shuffle = np.random.default_rng(SEED).permutation(given.stationary[0].plateaus.torque.size)
        runs = [replace(run, plateaus=run.plateaus.take(shuffle)) for run in given.stationary]
        given = replace(given, stationary=tuple(runs))
    design = build_design(given)
    deviation = 0.01 * design.torque
    residual = deviation * np.random.default_rng(SEED).standard_normal(design.torque.size)
    curve = np.flatnonzero(design.curve == 7)
    curve = curve[np.argsort(design.rows.velocity[curve])]
    residual[curve] += 8 * deviation[curve]
    spike = curve[{"first": 0, "middle": 9, "last": -1}[place]]
    residual[spike] -= 48 * deviation[spike]
    noise, _ = estimate_noise(design, residual, design.torque, first_noise(design))
    lighter = np.flatnonzero(noise.deviation > 3 * 0.01 * np.abs(design.torque))
    assert lighter.tolist() == [spike]
    # but for the fifth of a spike that is the median of six tests there, and what a median takes of noise
    assert noise.deviation[spike] == pytest.approx(abs(residual[spike]), rel=0.1)


# --- Autocorrelation of samples, and of bins as it follows from that: against noise that was made so.


def autocorrelated(share: float, step: float, size: int, seed: int = SEED) -> FloatArray:
    """Noise of unit variance, partly white."""
    slow, white = np.random.default_rng(seed).standard_normal((2, size))
    return np.sqrt(share) * followed(slow, step) + np.sqrt(1 - share) * white


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
        found.append((estimate.first, estimate.second))
    np.testing.assert_allclose(np.mean(found, axis=0), [0.48, 0.288], atol=0.02)


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_a_loops_course_is_not_taken_for_autocorrelated_noise(seed: int) -> None:
    """Independent noise of 0.3 %: the loop turns sharply next to standstill, three times as far off its low harmonics."""
    estimate = build_design(campaign(seed, noise=0.003)).bin_autocorrelation
    assert max(estimate) < 0.05


def test_times_that_repeat_do_no_harm() -> None:
    floored = altered(campaign(1), moving=lambda run: {"time": np.floor(10 * run.record.time) / 10})
    estimate = build_design(floored).bin_autocorrelation
    assert max(estimate) < 0.05


def test_loops_sampled_otherwise_do_not_mix_and_too_few_samples_give_no_estimate() -> None:
    """The same noise, autocorrelated over 50 ms, in bins of 0.16 s sampled at 40 and at 1000 a second."""

    def sampled(rate: float) -> SampleAutocorrelation:
        return SampleAutocorrelation(first=np.exp(-20 / rate), second=np.exp(-40 / rate), per_bin=0.16 * rate)

    alone = [sampled(rate).of_bins()[0] for rate in (40.0, 1000.0)]
    both = bin_autocorrelation([sampled(40.0), sampled(1000.0)])
    assert both[0] == pytest.approx(np.mean(alone))
    assert alone[0] == pytest.approx(alone[1], abs=0.05)
    # too few samples give no estimate
    phase = np.linspace(0.0, 2 * np.pi, 3000)
    everything = np.ones(phase.size, dtype=np.bool_)
    assert sample_autocorrelation(np.sin(phase), phase, everything, 2.0) is None
    assert sample_autocorrelation(np.sin(phase[:100]), phase[:100], everything[:100], 25.0) is None
    assert sample_autocorrelation(np.zeros(phase.size), phase, everything, 25.0) is None
    known = SampleAutocorrelation(first=0.5, second=0.3, per_bin=10.0)
    assert bin_autocorrelation([known, None]) is None
    assert bin_autocorrelation([]) is None
    assert bin_autocorrelation([known, known, None]) == pytest.approx(known.of_bins())


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


def test_differences_of_periods_by_hand_and_of_white_samples() -> None:
    """Bin 0 is met by two samples, by two and by one, which is too few; bin 1 in the first and last, bin 2 in the last."""
    torque = np.array([1.0, 3.0, 5.0, 6.0, 8.0, 70.0, 8.0, 9.0])
    bins = np.array([0, 0, 1, 0, 0, 0, 1, 2])
    turns = np.array([0.1, 0.2, 0.5, 1.1, 1.2, 2.1, 2.4, 2.9])
    found = period_differences(torque, bins, turns, 3)
    nan = np.nan
    expected = [[(7 - 2) / np.sqrt(1 / 2 + 1 / 2), nan, nan], [nan, (8 - 5) / np.sqrt(1 / 1 + 1 / 1), nan]]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    assert period_differences(torque[:3], bins[:3], turns[:3], 3).shape == (0, 3)
    # Linear in the samples, with rows that are orthonormal and blind to what every period has.
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
        slow = followed(rng.standard_normal(time.size), keep)
        record = Record(
            time=time,
            pressure=np.repeat(np.linspace(4e5, 6e5, 5), time.size // 5),
            speed=speed,
            torque=20 + 0.003 * speed + noise * slow,
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
def test_periods_show_slow_noise_and_white_noise(seed: int) -> None:
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
    # periods show white noise
    design = designed(seed, 0.0, DEVIATION)
    neighbour, slow = estimated(design, expected)
    assert neighbour < 0.05
    assert slow == pytest.approx(DEVIATION**2 / float(np.median(design.samples)), rel=0.2)
