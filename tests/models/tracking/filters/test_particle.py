"""The particles stay apart, and a measurement counts once however it is introduced."""

import numpy as np
import pytest

from models.tracking import linear_model
from models.tracking.courses import log_form_weight
from models.tracking.filters.particle import Particle, ParticleState
from models.tracking.measurement import Measurement
from models.tracking.posterior import SampleStatus
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    PRIOR,
    TYPICAL,
    followed,
    measured,
    series,
)


def test_particles_stay_apart_because_they_move() -> None:
    measurements = series(TYPICAL, np.linspace(0.0, 12_000.0, 25), 4e-4)
    distinct = {
        moves: np.unique(
            followed(Particle(particles=400, moves=moves), PRIOR, measurements).cloud.points, axis=0
        ).shape[0]
        for moves in (0, 8)
    }
    assert distinct[8] > 0.9 * 400
    assert distinct[0] < 0.2 * 400


def test_a_measurement_let_in_by_degrees_still_counts_once() -> None:
    """After starving measurements every particle's target is that of the whole history, taken at once."""
    state = followed(Particle(particles=200), PRIOR, measured([0.0, 1e3, 7e3, 15e3], [0.13, 0.115, 0.085, 0.068]))
    placed = state.cloud.placed()
    target = linear_model.evidence(linear_model.pointwise(state.history, PRIOR, placed)[0], PRIOR)
    target += PRIOR.log_density(*state.cloud.points.T) + linear_model.log_outlying(PRIOR, placed.outlying)
    target += log_form_weight(PRIOR)[state.cloud.form.astype(int)]
    np.testing.assert_allclose(state.cloud.log_target, target, rtol=1e-7, atol=1e-7)


def test_a_test_that_the_particles_cannot_follow_is_said_to_be_forced(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run far ahead and far off is taken in by two degrees; where only one is allowed the sample says so."""
    state, last = followed(Particle(particles=200), PRIOR, CAMPAIGN), CAMPAIGN[-1]
    odd = Measurement(progress=3.0 * last.progress, value=2.0 * last.value, variance=0.0)
    statuses = []
    for degrees in (1, 30):
        monkeypatch.setattr("models.tracking.filters.particle._DEGREES", degrees)
        updated = Particle(particles=200).update(state, odd, np.random.default_rng(0))
        again = ParticleState.from_arrays(updated.to_arrays())
        statuses.append(Particle().posterior(again, 200, np.random.default_rng(1)).status)
    assert statuses == [SampleStatus.FORCED, SampleStatus.SOUND]
