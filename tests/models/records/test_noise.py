"""Noise in records: spikes, slow noise, and what thinning leaves."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.records.criteria import OUTLIER_SHARE
from models.records.decimation import extreme_rows
from models.records.mean_deviation import Stretch, deviations, slow_correlation
from models.records.outliers import beside, inliers, near

# --- Spikes are told from what a fit merely bends around.


def noisy(count: int = 400) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(np.random.default_rng(3).normal(0.0, 0.1, count), dtype=np.float64)


def test_a_spike_is_far_from_the_fit_and_from_its_neighbours() -> None:
    time = np.linspace(0, 1, 400)
    fit = 10 * np.sin(2 * np.pi * time)
    value = fit + noisy()
    value[[50, 51, 200]] += [8.0, 8.0, -6.0]
    assert np.flatnonzero(~inliers(value - fit, value)).tolist() == [50, 51, 200]
    # A narrow peak: far from the parabola that was fitted, near its neighbours.
    x = np.linspace(-1, 1, 401)
    value = 10 + 2 * np.exp(-((x / 0.1) ** 2)) + 0.1 * noisy(401)
    residual = value - np.polyval(np.polyfit(x, value, 2), x)
    assert np.sum(~near(residual, value)) > 10
    assert inliers(residual, value).all()
    # where nothing scatters a share of the largest value is near
    value = np.full(100, 40.0)
    residual = np.zeros(100)
    residual[[10, 20]] = [0.9 * OUTLIER_SHARE * 40.0, 1.1 * OUTLIER_SHARE * 40.0]
    assert np.flatnonzero(~near(residual, value)).tolist() == [20]


@pytest.mark.parametrize("off", [0.0, 5.0, -300.0])
def test_a_fit_that_is_off_as_a_whole_makes_no_outliers(off: float) -> None:
    assert near(noisy() + off, np.full(400, 10.0)).all()


@pytest.mark.parametrize("count", [1, 2, 4])
def test_few_samples_are_no_spikes(count: int) -> None:
    assert beside(np.arange(count, dtype=np.float64)).all()


# --- The memory of noise that outlasts the dwells, against noise whose memory is known.

SEED = 1971


def _dwells(rng: np.random.Generator, count: int, size: int, memory: float, white: float = 0.0) -> FloatArray:
    """AR(1) noise of variance 1 with coefficient `memory`, and white noise of variance `white` beside it [count, size]."""
    drawn = np.sqrt(1 - memory**2) * rng.standard_normal((count, size + 400))
    slow = lfilter([1], [1, -memory], drawn, axis=1)[:, 400:]
    return np.asarray(slow + np.sqrt(white) * rng.standard_normal(slow.shape), dtype=np.float64)


def _without_trend(dwells: FloatArray) -> list[FloatArray]:
    design = np.column_stack([np.ones(dwells.shape[1]), np.arange(dwells.shape[1])])
    return list(dwells - dwells @ design @ np.linalg.inv(design.T @ design) @ design.T)


@pytest.mark.parametrize(
    ("size", "memory", "white"), [(45, 0.8, 0.0), (45, 0.9, 1.0), (450, 0.98, 0.0), (450, 0.98, 2.0)]
)
def test_the_correlation_is_found_from_many_short_dwells(size: int, memory: float, white: float) -> None:
    rng = np.random.default_rng([SEED, size])
    found = slow_correlation(_without_trend(_dwells(rng, 200, size, memory, white)))
    true = memory ** np.arange(1, size) / (1 + white)
    assert float(np.abs(found[: size // 2] - true[: size // 2]).max()) < 0.1
    lag = np.arange(1, size)
    told, truth = (float(1 + 2 * ((1 - lag / size) * each).sum()) for each in (found, true))
    assert abs(told / truth - 1) < 0.25, "the variance of a mean, over that of white noise"


@pytest.mark.parametrize(("size", "memory"), [(45, 0.8), (45, 0.9), (450, 0.98)])
def test_means_miss_by_their_deviations_where_noise_outlasts_the_dwells(size: int, memory: float) -> None:
    """90 % within 1.645 deviations, of 200 dwells: three times 2.1 %. Deviations as of white noise hold far less."""
    rng = np.random.default_rng([SEED, size, int(100 * memory)])
    dwells = _dwells(rng, 200, size, memory)
    told = deviations([Stretch(time=np.arange(size) * 0.1, torque=one) for one in dwells])
    assert not told.resolved
    held = float((np.abs(dwells.mean(axis=1)) < 1.645 * told.mean).mean())
    assert abs(held - 0.9) < 0.064
    white = dwells.std(axis=1) / np.sqrt(size)
    assert float((np.abs(dwells.mean(axis=1)) < 1.645 * white).mean()) < 0.6


def test_dwells_too_short_to_tell_anything_tell_nothing() -> None:
    assert slow_correlation([np.zeros(50), np.ones(5)]).size == 0


# --- Fewer samples for a plot: no peak of any channel is lost, each row is a sample, and there are no more than asked
# for.


def plainly(columns: list[list[float]], points: int) -> list[int]:
    """The same by loops over bins and samples."""
    samples, count = len(columns[0]), len(columns)
    bins = max(1, (points - 2) // (2 * count))
    length = -(-samples // bins)
    kept = {0, samples - 1}
    for start in range(0, samples, length):
        rows = range(start, min(samples, start + length))
        for column in columns:
            kept |= {min(rows, key=lambda row: column[row]), max(rows, key=lambda row: column[row])}
    return sorted(kept)


@given(samples=st.integers(1, 200), count=st.integers(1, 4), points=st.integers(1, 120), seed=st.integers(0, 2**32 - 1))
def test_the_rows_are_those_that_loops_over_bins_find(samples: int, count: int, points: int, seed: int) -> None:
    columns = np.random.default_rng(seed).integers(-5, 5, (count, samples)).astype(float)
    rows = extreme_rows(columns, count, samples=samples, points=points)
    assert rows.tolist() == plainly(columns.tolist(), points)
    assert rows.size <= max(points, 2 * count + 2)


@pytest.mark.parametrize("points", [50, 500, 2000])
def test_one_sample_that_stands_out_is_never_lost(points: int) -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        columns = rng.standard_normal((3, 20_001))
        channel, row = rng.integers(3), rng.integers(20_001)
        columns[channel, row] = rng.choice([-40.0, 40.0])
        kept = extreme_rows(columns, 3, samples=20_001, points=points)
        assert row in kept
        assert {0, 20_000} <= set(kept)


def test_columns_are_gone_through_once() -> None:
    """As a generator gives them: one column is held at a time."""
    given_out = []

    def columns() -> Iterator[FloatArray]:
        for number in range(3):
            given_out.append(number)
            yield np.full(1000, float(number))

    assert extreme_rows(columns(), 3, samples=1000, points=20).tolist() == [0, 334, 668, 999]
    assert given_out == [0, 1, 2]
