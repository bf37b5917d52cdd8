"""What `/degradation` says of a quantity that is not sure to follow eq. 6."""

import numpy as np
import pytest

from models.tracking.filters.grid import Grid
from models.tracking.prior import weak
from service.lives.assumptions import ALL_PRESSURES, MEAN_COF, Assumptions, Scale
from service.lives.history import Series
from service.lives.quantities.items import track_item
from service.lives.quantities.measured import QUANTITIES
from tests.models.prognosis.test_course_shares import accelerating
from tests.models.tracking.tracked_series import CAMPAIGN


@pytest.mark.parametrize(("follows", "measurements"), [(True, CAMPAIGN), (False, accelerating(0.8))])
def test_coefficients_are_those_of_eq_6_and_say_how_probable_it_is(follows: bool, measurements: list) -> None:
    """Means over courses of other signs of φ and ε would be of nothing."""
    posterior = Grid().posterior(
        Grid().from_history(weak(measurements[0], falling=True), measurements), 1_000, np.random.default_rng(1)
    )
    series = Series(
        quantity=MEAN_COF,
        pressure=ALL_PRESSURES,
        measurements=tuple(measurements),
        events=tuple(range(len(measurements))),
        scale=Scale(origin=0.0),
    )
    item = track_item(QUANTITIES[MEAN_COF], series, posterior, Assumptions())
    assert (item["eq6_probability"] > 0.5) is follows
    if item["coefficients"] is None:
        assert item["eq6_probability"] == 0.0
    else:
        size = measurements[0].value
        assert 0.0 < item["coefficients"]["initial"]["value"] < 2.0 * size
        assert -2.0 * size < item["coefficients"]["change"]["value"] < 0.0
        assert item["coefficients"]["scale_cycles"]["value"] > 0.0
        assert 0.0 < item["coefficients"]["exponent"]["value"] < 20.0
