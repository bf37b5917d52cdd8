"""The resolution of values."""

import math

import pytest

from models.tracking.history import History
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    PRIOR,
)


def test_values_are_resolved_to_their_resolution_and_no_finer() -> None:
    history = History.of(CAMPAIGN[:1], PRIOR)
    resolution = 1e-6 * math.hypot(PRIOR.initial_sd, PRIOR.change_sd)
    assert history.variance[0] == pytest.approx(1e-8 + resolution**2, rel=1e-12)
    assert history.variance[0] > 1e-8
