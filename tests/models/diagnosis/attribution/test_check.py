"""The check of a case: two effects that cancel each other follow structure that neither of them is."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.attribution.check import check, undoing
from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.criteria import MOST_UNDONE
from models.diagnosis.effects.catalogue import BY_SLUG
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import study


@pytest.mark.parametrize(("drag", "mostly"), [(2.0, False), (-2.0, True)])
def test_two_effects_that_cancel_each_other_fail_the_check(drag: float, mostly: bool) -> None:
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
    assert (undoing(given.problem, both) > MOST_UNDONE) == mostly
    assert check(given.problem, both, np.random.default_rng(1)).passed != mostly
    one = replace(found, effects=found.effects[:1])
    assert undoing(given.problem, replace(both, effects=both.effects[:1], fit=one)) == 1.0


def test_a_hypothesis_without_a_fit_cannot_be_checked():
    given = study(campaign(4, loops=False, cycles=(0.0, 3000.0)))
    screened = Hypothesis(effects=(BY_SLUG["viscous_exponent"],), evidence=5.0, drop=0.0, fit=None)
    with pytest.raises(ValueError, match="viscous_exponent"):
        check(given.problem, screened, np.random.default_rng(1))
