"""The marginal likelihood against the density of the data themselves, and what must not pass for it."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from models.gaussian_evidence import log_gain, log_gain_alone


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.standard_normal((12, 3)), rng.standard_normal(12) * 2.0, np.array([0.3, 1.0, 4.0])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_it_is_the_ratio_of_the_densities_with_and_without_the_coefficients(seed: int) -> None:
    columns, data, sd = drawn(seed)
    covariance = np.eye(12) + columns @ np.diag(sd**2) @ columns.T
    expected = multivariate_normal(cov=covariance).logpdf(data) - multivariate_normal(cov=np.eye(12)).logpdf(data)
    assert log_gain(columns.T @ columns, columns.T @ data, sd) == pytest.approx(expected, abs=1e-9)  # rounding
    assert log_gain(columns.T @ columns, columns.T @ data, 2 * sd) != pytest.approx(expected, abs=1e-3)


def test_coefficients_alone_are_those_of_one_column_each_and_rounding_below_zero_counts_as_nothing() -> None:
    columns, data, sd = drawn(4)
    info, score = columns.T @ columns, columns.T @ data
    alone = [log_gain(info[k : k + 1, k : k + 1], score[k : k + 1], sd[k]) for k in range(3)]
    np.testing.assert_allclose(log_gain_alone(np.diag(info), score, sd), alone)
    assert log_gain(np.zeros((0, 0)), np.zeros(0), 1.0) == 0.0
    # what rounding leaves below zero counts as nothing
    with_nothing = np.pad(info, (0, 1)), np.append(score, 0.0), np.append(sd, 1e4)
    assert log_gain(*with_nothing) == pytest.approx(log_gain(info, score, sd))
    with_nothing[0][-1, -1] = -1e-7  # 1 + sd² info is negative
    assert log_gain(*with_nothing) == pytest.approx(log_gain(info, score, sd))
