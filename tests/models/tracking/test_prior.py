"""The prior as numbers, and what the weak one covers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from models.prognosis.first_passage import predict_first_passage
from models.tracking.filters.grid import Grid
from models.tracking.measurement import Measurement
from models.tracking.prior import Prior, weak
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    PRIOR,
    TYPICAL,
    series,
)


def test_a_prior_survives_its_array_and_checks_itself() -> None:
    assert Prior.from_array(PRIOR.to_array()) == PRIOR
    with pytest.raises(ValueError, match="change_sd must be positive"):
        replace(PRIOR, change_sd=0.0)
    with pytest.raises(ValueError, match="initial_mean must be finite"):
        replace(PRIOR, initial_mean=math.nan)
    with pytest.raises(ValueError, match="outlying_share must lie within"):
        replace(PRIOR, outlying_share=1.0)
    with pytest.raises(ValueError, match="law_share must lie within"):
        replace(PRIOR, law_share=0.0)


def test_the_weak_prior_scales_with_the_quantity() -> None:
    """The same clutch in another unit has the same life."""
    big = [replace(m, value=1e3 * m.value, variance=1e6 * m.variance) for m in CAMPAIGN]
    lives = []
    for measurements in (CAMPAIGN, big):
        state = Grid().from_history(weak(measurements[0], falling=True), measurements)
        passage = predict_first_passage(Grid().posterior(state, 500, np.random.default_rng(3)), fraction=0.5, as_of=0.0)
        lives.append(passage.end_of_life[0.5])
    assert lives[0] == pytest.approx(lives[1], rel=1e-6)


@pytest.mark.parametrize("life", [1e2, 1e4, 1e6])
def test_lives_of_any_length_are_tractable(life: float) -> None:
    """Measured to 90 % of its life, the end is found within 10 %, whatever the length of the life."""
    d = replace(TYPICAL, scale=life / 7.4)
    state = Grid().from_history(PRIOR, series(d, np.linspace(0.0, 0.9, 30) * life, 2e-4))
    passage = predict_first_passage(
        Grid().posterior(state, 1_000, np.random.default_rng(3)), fraction=0.5, as_of=0.9 * life, horizon=1e7
    )
    true_end = d.scale * ((1.0 - 0.067 / 0.1) ** (-1.0 / 0.7) - 1.0)
    assert passage.end_of_life[0.5] == pytest.approx(true_end, rel=0.1)


def test_the_weak_prior_is_what_it_says() -> None:
    prior = weak(Measurement(progress=0.0, value=0.2, variance=0.0), falling=True)
    assert (prior.initial_mean, prior.initial_sd) == (0.2, 0.1)
    assert (prior.change_mean, prior.change_sd) == (pytest.approx(-0.12), pytest.approx(0.08))
    assert (math.exp(prior.log_scale_mean), prior.log_scale_sd) == (pytest.approx(4_000.0), 2.3)
    assert (math.exp(prior.log_exponent_mean), prior.log_exponent_sd) == (pytest.approx(0.8), 0.7)
    assert (math.exp(prior.log_scatter_mean), prior.log_scatter_sd) == (pytest.approx(6e-4), 0.8)
    rising = weak(Measurement(progress=0.0, value=0.2, variance=0.0), falling=False)
    assert (rising.change_mean, rising.change_sd) == (0.0, pytest.approx(0.2))
