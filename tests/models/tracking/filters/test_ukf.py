"""The unscented filters: domain, scatter, and starting anew."""

import math

import numpy as np
import pytest

from models.tracking.filters.sigma_points import scatter_learnt
from models.tracking.filters.ukf import Ukf
from models.tracking.measurement import Measurement
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    PRIOR,
    WEIRD,
    followed,
)


def test_the_ukf_stays_in_its_domain_and_definite() -> None:
    for measurements in WEIRD.values():
        state = followed(Ukf(), weak(measurements[0], falling=True), measurements)
        assert np.abs(state.mean).max() <= 6.0
        np.testing.assert_array_equal(state.covariance, np.swapaxes(state.covariance, 1, 2))
        assert np.linalg.eigvalsh(state.covariance).min() > 0.0


def test_the_ukf_learns_the_scatter_from_its_innovations() -> None:
    """Innovations of a scatter three times as large as believed, beside fits as uncertain as that belief: after 600
    the scatter is known to 15 % (their number alone leaves 6 %)."""
    believed, truth, rng = 3e-4, 9e-4, np.random.default_rng(0)
    scatter, unit = np.array([believed**2, 2.0]), PRIOR.initial_sd
    for _ in range(600):
        variance = (scatter[0] + believed**2) / unit**2
        off = rng.normal(0.0, math.hypot(truth, believed)) / unit
        scatter = scatter_learnt(PRIOR, scatter, off**2 / variance, variance, 1.0)
    assert math.sqrt(scatter[0]) == pytest.approx(truth, rel=0.15)
    assert scatter[1] == 602.0


def test_no_innovation_teaches_the_ukf_more_than_five_deviations_do() -> None:
    start = np.array([9e-8, 20.0])
    learnt = [
        float(scatter_learnt(PRIOR, start, surprise, 1.1 * 9e-8 / PRIOR.initial_sd**2, 1.0)[0])
        for surprise in (9.0, 25.0, 1e4)
    ]
    assert learnt[1] == learnt[2] > learnt[0] > 9e-8
    assert scatter_learnt(PRIOR, start, 1e4, 1.0, 0.0)[0] == start[0]


def test_a_lost_ukf_starts_anew_from_the_whole_history() -> None:
    """After runs that the filter cannot explain (a life that all at once falls twice as fast) it is where the grid is."""
    progress = np.concatenate([np.linspace(0.0, 9e3, 10), np.linspace(9.3e3, 1.6e4, 20)])
    values = [0.13 - 2e-6 * z - 6e-6 * max(0.0, z - 9e3) for z in progress]
    bent = [
        Measurement(progress=float(z), value=float(y), variance=1e-8) for z, y in zip(progress, values, strict=True)
    ]
    assert followed(Ukf(), PRIOR, CAMPAIGN[:11]).reference == CAMPAIGN[7].progress
    assert followed(Ukf(), PRIOR, bent).reference > 1e4
