"""Evidence of refitted candidates: a shape at its bound, and which candidates that holds back."""

import numpy as np
import pytest

from models.diagnosis.diagnose import diagnose
from tests.models.diagnosis.campaigns import Where, campaign


@pytest.mark.parametrize("seed", [31, 33])
def test_inertia_is_not_taken_for_a_film_that_is_the_same_at_all_speeds(seed: int) -> None:
    """At one frequency a film in the corner of its shapes, beside another lag of friction, fits inertia as well as inertia
    does: but the data would have it beyond that corner, where no film is."""

    def inertia(at: Where) -> np.ndarray:
        return 0.0003 * at.acceleration / 0.058

    report = diagnose(campaign(seed, inertia), rng=np.random.default_rng(0))
    probability = {each.effect: each.probability for each in report.candidates}
    assert probability["inertia_torque"] > 0.75
    assert probability.get("squeeze_film", 0.0) < 0.2
