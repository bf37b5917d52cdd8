"""Spikes are told from what a fit merely bends around."""

import numpy as np
import pytest

from models.records.criteria import OUTLIER_SHARE
from models.records.outliers import beside, inliers, near


def noisy(count: int = 400) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(np.random.default_rng(3).normal(0.0, 0.1, count), dtype=np.float64)


def test_a_spike_is_far_from_the_fit_and_from_its_neighbours() -> None:
    time = np.linspace(0, 1, 400)
    fit = 10 * np.sin(2 * np.pi * time)
    value = fit + noisy()
    value[[50, 51, 200]] += [8.0, 8.0, -6.0]
    assert np.flatnonzero(~inliers(value - fit, value)).tolist() == [50, 51, 200]


def test_what_a_fit_bends_around_stays() -> None:
    """A narrow peak: far from the parabola that was fitted, near its neighbours."""
    x = np.linspace(-1, 1, 401)
    value = 10 + 2 * np.exp(-((x / 0.1) ** 2)) + 0.1 * noisy(401)
    residual = value - np.polyval(np.polyfit(x, value, 2), x)
    assert np.sum(~near(residual, value)) > 10
    assert inliers(residual, value).all()


@pytest.mark.parametrize("off", [0.0, 5.0, -300.0])
def test_a_fit_that_is_off_as_a_whole_makes_no_outliers(off: float) -> None:
    assert near(noisy() + off, np.full(400, 10.0)).all()


def test_where_nothing_scatters_a_share_of_the_largest_value_is_near() -> None:
    value = np.full(100, 40.0)
    residual = np.zeros(100)
    residual[[10, 20]] = [0.9 * OUTLIER_SHARE * 40.0, 1.1 * OUTLIER_SHARE * 40.0]
    assert np.flatnonzero(~near(residual, value)).tolist() == [20]


@pytest.mark.parametrize("count", [1, 2, 4])
def test_few_samples_are_no_spikes(count: int) -> None:
    assert beside(np.arange(count, dtype=np.float64)).all()
