"""The memory of noise that outlasts the dwells, against noise whose memory is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.records.mean_deviation import Stretch, deviations
from models.records.slow_noise import slow_correlation

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
