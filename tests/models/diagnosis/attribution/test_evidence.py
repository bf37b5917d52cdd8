"""Evidence of refitted candidates: a shape at its bound, which candidates that holds back; two that undo each other."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.attribution import decide
from models.diagnosis.attribution.evidence import Hypothesis, undoing
from models.diagnosis.diagnose import diagnose
from models.diagnosis.effects.catalogue import BY_SLUG
from tests.models.diagnosis.campaigns import Where, campaign
from tests.models.diagnosis.fitted import study


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


@pytest.mark.parametrize(("drag", "mostly"), [(2.0, False), (-2.0, True)])
def test_two_effects_that_undo_each_other_do_not_close(drag: float, mostly: bool) -> None:
    """A larger exponent and a drag do the same at high speed: one way they add up, the other little is left."""
    given = study(campaign(4, loops=False))
    found = given.extended(("viscous_exponent", 0.1, ()), ("hydrodynamic_drag", 0.5, (1.0, 0.0, 0.0, 0.0)))
    sizes = (0.3, drag)
    found = replace(
        found, effects=tuple(replace(one, amplitude=size) for one, size in zip(found.effects, sizes, strict=True))
    )
    both = Hypothesis(
        effects=(BY_SLUG["viscous_exponent"], BY_SLUG["hydrodynamic_drag"]), evidence=50.0, drop=60.0, fit=found
    )
    known = given.baseline
    assert (undoing(given.design, known.noise, known.priors, both) > decide.MOST_UNDONE) == mostly
    closing = decide.close(given.design, known.noise, known.priors, both, np.random.default_rng(1))
    assert closing.closed != mostly
    one = replace(found, effects=found.effects[:1])
    assert undoing(given.design, known.noise, known.priors, replace(both, effects=both.effects[:1], fit=one)) == 1.0
