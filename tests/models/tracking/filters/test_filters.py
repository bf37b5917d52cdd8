"""What each of the three filters must do on any series, and where they must agree. Large comparisons: tests/statistical."""

from typing import Any

import numpy as np
import pytest

from models.prognosis.first_passage import predict_first_passage
from models.tracking.criteria import EQ_6_SHARE, KNEE_HAZARD, PROPORTIONAL_SHARE
from models.tracking.filters.grid import Grid, GridState
from models.tracking.filters.particle import Particle, ParticleState
from models.tracking.filters.ukf import Ukf, UkfState
from models.tracking.prior import weak
from tests.models.tracking.tracked_series import (
    CAMPAIGN,
    COLUMNS,
    FILTERS,
    NAMES,
    PRIOR,
    WEIRD,
    followed,
    same,
)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
@pytest.mark.parametrize("falling", [True, False])
@pytest.mark.parametrize("case", WEIRD)
def test_any_series_leaves_finite_numbers(tracker: Any, state_type: Any, falling: bool, case: str) -> None:
    measurements = WEIRD[case]
    prior = weak(measurements[0], falling=falling)
    state = followed(tracker, prior, measurements)
    posterior = tracker.posterior(state, 400, np.random.default_rng(1))
    for name in COLUMNS:
        column = getattr(posterior, name)
        assert column.shape == (400,)
        assert np.isfinite(column).all(), name
    assert np.isfinite(posterior.values(np.array([0.0, 1e3, 1e6]))).all()
    assert posterior.weight.sum() == pytest.approx(1.0)
    assert min(np.abs(posterior.scale).min(), np.abs(posterior.exponent).min(), posterior.scatter.min()) > 0.0
    predict_first_passage(posterior, fraction=0.5, as_of=measurements[-1].progress)
    assert isinstance(state, state_type)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
def test_a_seed_gives_the_same_answer_twice(tracker: Any, state_type: Any) -> None:
    first, second = (followed(tracker, PRIOR, CAMPAIGN, seed=5) for _ in range(2))
    assert same(first, second)
    draws = [tracker.posterior(first, 500, np.random.default_rng(2)) for _ in range(2)]
    assert all(np.array_equal(getattr(draws[0], n), getattr(draws[1], n)) for n in COLUMNS)
    places = np.array([0.0, 6e3, 5e4])
    assert np.array_equal(draws[0].values(places), draws[1].values(places))
    assert isinstance(first, state_type)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
def test_a_state_survives_its_arrays_exactly(tracker: Any, state_type: Any) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN[:7], seed=5)
    arrays = state.to_arrays()
    assert all(column.dtype == np.float64 for column in arrays.values())
    again = state_type.from_arrays({name: column.copy() for name, column in reversed(arrays.items())})
    assert list(again.to_arrays()) == list(arrays)
    assert same(state, again)
    steps = [tracker.update(s, CAMPAIGN[7], np.random.default_rng(9)) for s in (state, again)]
    assert same(*steps)


@pytest.mark.parametrize(("tracker", "state_type"), FILTERS, ids=NAMES)
def test_an_update_leaves_the_old_state_alone(tracker: Any, state_type: Any) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN[:7], seed=5)
    before = {name: column.copy() for name, column in state.to_arrays().items()}
    tracker.update(state, CAMPAIGN[7], np.random.default_rng(1))
    assert same(state, state_type.from_arrays(before))


def test_particle_and_grid_agree_on_the_coefficients() -> None:
    """Means within 0.2 deviations: 2,000 particles that count as 500 leave 0.045; four times that is allowed."""
    posteriors = [
        tracker.posterior(followed(tracker, PRIOR, CAMPAIGN), 2_000, np.random.default_rng(1))
        for tracker in (Particle(), Grid())
    ]
    for name in ("initial", "change", "scale", "exponent", "scatter"):
        (particle, _), (grid, sd) = (p.moments(np.log(np.abs(getattr(p, name)))) for p in posteriors)
        assert abs(particle - grid) < 0.2 * sd, name


SERIES = {"prior", "progress", "value", "variance", "epoch"}


STORED_NAMES = {
    "grid": SERIES,
    "particle": SERIES | {"points", "form", "spoiled", "log_weight", "log_target", "forced"},
    "ukf": SERIES | {"place", "form", "log_weight", "mean", "covariance", "scatter"},
}


@pytest.mark.parametrize(
    ("tracker", "state_type"), [(Grid(), GridState), (Particle(particles=50), ParticleState), (Ukf(), UkfState)]
)
def test_stored_arrays_have_the_names_of_this_version(tracker, state_type) -> None:
    state = followed(tracker, PRIOR, CAMPAIGN)
    arrays = state.to_arrays()
    assert arrays.keys() == STORED_NAMES[tracker.name]
    # in the order of the fields of Prior, of which 0.05 is the share of outlying runs and 0.1 their size
    assert arrays["prior"].tolist()[10:] == [0.05, 0.1, 0.95, 0.05, EQ_6_SHARE, PROPORTIONAL_SHARE, KNEE_HAZARD]
    again = state_type.from_arrays({name: np.array(column) for name, column in arrays.items()}).to_arrays()
    assert all((again[name] == column).all() for name, column in arrays.items())


def test_the_flags_of_outlying_runs_are_read_from_their_stored_name() -> None:
    state = followed(Particle(particles=50), PRIOR, CAMPAIGN)
    arrays = state.to_arrays() | {"spoiled": np.ones_like(state.cloud.outlying)}
    assert (ParticleState.from_arrays(arrays).cloud.outlying == 1.0).all()
