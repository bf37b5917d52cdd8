"""The tail of the largest of correlated deviates: closed forms at both ends, plain simulation between, one for all seeds."""

import numpy as np
import pytest
from scipy.special import ndtr

from models.diagnosis.detection.largest_deviate import LargestDeviate

COUNT = 60
SHARE = 0.0025
CHAIN = 0.9 ** np.abs(np.subtract.outer(np.arange(COUNT), np.arange(COUNT)))


def tail(deviate: float) -> float:
    return 2 * float(ndtr(-deviate))


def independent(deviate: float) -> float:
    return 1 - (1 - tail(deviate)) ** COUNT


@pytest.mark.parametrize("deviate", [1.5, 2.5, 3.5, 5.0])
def test_independent_and_equal_deviates_have_their_closed_forms(deviate: float) -> None:
    """1 - (1 - q)^k and q, to some four deviations of an estimate from 2,000 draws."""
    apart = LargestDeviate(np.eye(COUNT), np.random.default_rng(1)).probability(deviate)
    assert apart == pytest.approx(independent(deviate), rel=0.03)
    alike = LargestDeviate(np.ones((COUNT, COUNT)), np.random.default_rng(1)).probability(deviate)
    assert alike == pytest.approx(tail(deviate), rel=1e-6)


def test_between_them_the_tail_is_that_of_a_plain_simulation() -> None:
    rng, root = np.random.default_rng(2), np.linalg.cholesky(CHAIN)
    largest = np.concatenate([np.abs(root @ rng.standard_normal((COUNT, 20_000))).max(axis=0) for _ in range(10)])
    found = LargestDeviate(CHAIN, np.random.default_rng(1))
    for deviate in (2.5, 3.2):
        counted = float((largest > deviate).mean())
        assert found.probability(deviate) == pytest.approx(counted, rel=0.05)
        assert counted < 0.75 * independent(deviate)  # taken for independent, it would be wrong


def test_no_seed_moves_a_threshold_by_a_tenth_of_a_nat() -> None:
    """Verdicts must not hang on what is drawn: 400 plain draws, extrapolated, scattered by 0.4 nats from seed to seed."""
    found = [LargestDeviate(CHAIN, np.random.default_rng(seed)) for seed in range(20)]
    thresholds = np.array([0.5 * each.threshold(SHARE) ** 2 for each in found])
    assert np.ptp(thresholds) < 0.1
    assert found[0].probability(found[1].threshold(SHARE)) == pytest.approx(SHARE, rel=0.05)
