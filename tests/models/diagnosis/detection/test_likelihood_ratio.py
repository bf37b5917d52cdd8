"""Likelihood ratios see every effect that its campaign can show, whatever the units of its amplitude."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.detection.likelihood_ratio import largest_ratio, likelihood_ratios
from models.diagnosis.detection.projected_fit import project_fit
from models.diagnosis.effects.catalogue import CATALOGUE
from models.diagnosis.effects.grid import columns_of
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import study


@pytest.fixture(scope="module")
def view():
    given = study(campaign(3))
    return project_fit(given.problem, given.baseline.fit, columns_of(CATALOGUE, given.design.facts))


def test_a_unit_hides_nothing(view):
    """The same changes in units that differ by 10⁻⁹ to 10⁹ have the same likelihood ratios and the same threshold."""
    units = 10.0 ** np.random.default_rng(4).integers(-9, 10, len(view.columns))
    projected = view.likely
    scale = np.concatenate([units, np.ones(projected.score.size - units.size)])
    other = replace(
        projected,
        info=projected.info * scale[:, None] * scale,
        score=projected.score * scale,
        whole=projected.whole * scale**2,
    )
    two_sided = np.zeros(units.size)
    usual = likelihood_ratios([projected], view.effects, two_sided)
    np.testing.assert_allclose(likelihood_ratios([other], view.effects, two_sided), usual, rtol=1e-6, atol=1e-9)
    thresholds = [
        largest_ratio([scaled], view.effects, two_sided, 0.006, np.random.default_rng(1)).threshold
        for scaled in (projected, other)
    ]
    assert thresholds[0] == pytest.approx(thresholds[1], abs=0.05)


def test_every_effect_of_the_catalogue_is_looked_at(view):
    """Each has a shape with some chance of being seen: a pressure [Pa] beside an inertia [kg m²] as well."""
    ratios = likelihood_ratios([view.likely], view.effects, np.zeros(len(view.columns)))
    looked_at = {
        column.effect.slug for column, ratio in zip(view.columns, ratios.tolist(), strict=True) if ratio != 0.0
    }
    assert {column.effect.slug for column in view.columns} == looked_at
    assert {"pressure_offset", "inertia_torque"} <= looked_at
