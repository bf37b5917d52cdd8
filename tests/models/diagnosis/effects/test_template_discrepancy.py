"""Model discrepancy of templates, structure that has more evidence than any effect, and noise that does not vanish."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.criteria import DISCREPANCY_SD
from models.diagnosis.diagnose import diagnose
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.effect import Discrepancy
from models.diagnosis.effects.fitted_effect import FittedEffect, discrepancy_columns, discrepancy_factors, effect_rows
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from models.diagnosis.pooled_fit.projection import gram_of, project
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import study


@pytest.fixture(scope="module")
def given():
    return study(campaign(3))


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda each: each.slug)
def test_discrepancy_factors_stay_within_one_and_are_independent(given, effect):
    """Each φ lies within ±1, and no two of an effect are one."""
    columns = discrepancy_factors(given.design, effect)
    assert columns.shape[0] == given.design.torque.size
    assert np.abs(columns).max(initial=0.0) <= 1.0
    rank = np.linalg.matrix_rank(columns - columns.mean(axis=0)) if columns.shape[1] else 0
    assert rank == columns.shape[1]


def test_an_exact_law_has_no_discrepancy(given):
    """J dω/dt has no form to be uncertain of; a zero adds the same torque at every speed, a drag does not."""
    assert discrepancy_factors(given.design, BY_SLUG["inertia_torque"]).shape[1] == 0
    assert Discrepancy.SPEED not in BY_SLUG["torque_zero_shift"].discrepancies
    assert Discrepancy.SPEED in BY_SLUG["hydrodynamic_drag"].discrepancies


def test_a_discrepancy_absorbs_what_a_template_misses_as_far_as_its_prior_allows(given):
    """Whitened squares that are left of a truth off by one deviation of the prior, with discrepancy and without; a truth
    that is off by ten deviations keeps most of its misfit."""
    drag = BY_SLUG["hydrodynamic_drag"]
    fitted = FittedEffect(effect=drag, amplitude=1.5, shape=(1.0, 0.0, 0.0, 0.0))
    baseline = given.baseline
    change = effect_rows(given.design, baseline.fit.prediction, fitted)
    extra = discrepancy_columns(given.design, baseline.fit.prediction, fitted)[:, :1].sum(axis=1)
    stiff = replace(fitted, effect=replace(drag, discrepancies=()))

    def left(each: FittedEffect, by: float) -> float:
        residual = baseline.fit.residual * 0 + by * DISCREPANCY_SD * extra
        model = replace(baseline.fit, effects=(each,), torque=baseline.fit.torque + change, residual=residual)
        return project(gram_of(given.problem, model), 1e-3, 0.0).miss

    nothing = left(fitted, 0.0)
    assert left(stiff, 1.0) - left(stiff, 0.0) > 100.0
    assert left(fitted, 1.0) - nothing < 1.1  # one deviation costs what its prior asks for it
    assert left(fitted, 10.0) - nothing > 50.0


@pytest.mark.slow
def test_a_bump_in_speed_is_no_drag():
    """Friction is higher in a band of speeds: the drag that fits it best has less evidence than structure over speed."""
    bump = campaign(5, lambda at: 1.2 * np.exp(-0.5 * ((at.velocity - 6.0) / 1.5) ** 2))
    report = diagnose(bump, rng=np.random.default_rng(1))
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert report.baseline is not None
    assert report.baseline.where[0].axis == "speed_rpm"
    assert all(each.probability < 0.5 for each in report.candidates)


def test_noise_does_not_vanish_where_a_fit_is_far_off(given):
    """A residual with an offset of hundreds of deviations on each curve holds the same noise as one without."""
    design, rng = given.design, np.random.default_rng(2)
    noise = 0.1 * rng.standard_normal(design.torque.size) / np.sqrt(design.samples)
    start = first_noise(design)
    plain, _ = estimate_noise(design, noise, design.torque, start)
    offset, _ = estimate_noise(design, noise + 40.0, design.torque, start)
    assert np.median(offset.deviation / plain.deviation) == pytest.approx(1.0, rel=0.05)
    assert fit_baseline(design).problem.noise.deviation.min() > 0
