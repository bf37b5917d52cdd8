"""The names of the arrays in stored states: a database of an earlier version must stay readable."""

import numpy as np
import pytest

from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.particle import Particle, ParticleState
from models.tracking.filters.ukf import Ukf, UkfState
from tests.models.tracking.tracked_series import CAMPAIGN, PRIOR, followed

SERIES = {"prior", "progress", "value", "variance", "epoch"}
NAMES = {
    "grid": SERIES,
    "particle": SERIES | {"points", "size", "spoiled", "log_weight", "log_target"},
    "ukf": SERIES | {"place", "size", "log_weight", "mean", "covariance", "scatter"},
}


@pytest.mark.parametrize(
    ("tracker", "state_type"), [(Grid(), GridState), (Particle(particles=50), ParticleState), (Ukf(), UkfState)]
)
def test_stored_arrays_have_the_names_that_they_have_always_had(tracker, state_type) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN)
    arrays = state.to_arrays()
    assert arrays.keys() == NAMES[tracker.name]
    # in the order of the fields of Prior, of which 0.05 is the share of outlying runs and 0.1 their size
    assert arrays["prior"].tolist()[10:] == [0.05, 0.1, 0.95, 0.05]
    again = state_type.from_arrays({name: np.array(column) for name, column in arrays.items()}).to_arrays()
    assert all((again[name] == column).all() for name, column in arrays.items())


def test_the_flags_of_outlying_runs_are_read_from_their_stored_name() -> None:
    state = followed(Particle(particles=50), PRIOR, CAMPAIGN)
    arrays = state.to_arrays() | {"spoiled": np.ones_like(state.cloud.outlying)}
    assert (ParticleState.from_arrays(arrays).cloud.outlying == 1.0).all()
