"""Effects that the baseline absorbs are found where they are, and a search says how it ended."""

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from models.diagnosis.attribution.evidence import Hypothesis, HypothesisStatus, null_of, refitted
from models.diagnosis.attribution.refits import Refits
from models.diagnosis.attribution.screening import screen, screen_pairs
from models.diagnosis.attribution.search import SearchStatus, _better_null, added_by_raw, best_of, search
from models.diagnosis.criteria import CREDIBLE_MARGIN
from models.diagnosis.detection.projected_fit import ProjectedFit, project_fit
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.effects.grid import columns_of
from models.diagnosis.noise.estimate import first_noise
from models.diagnosis.pooled_fit.gauss_newton import _inside, fit
from models.diagnosis.pooled_fit.projection import Projected
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, study

CYCLES, ZEROS = [0.0, 1000.0, 3000.0, 6000.0, 10000.0, 15000.0], [0.0, -2.5, -3.2, -4.4, -4.6, -5.5]


@pytest.fixture(scope="module")
def wandering() -> Study:
    """A zero that wanders off by 5.5 Nm: eleven deviations of its prior, and most of it looks like eq. 6."""
    return study(campaign(5, lambda at: np.full_like(at.velocity, np.interp(at.cycles, CYCLES, ZEROS))))


def found(given: Study, slug: str) -> Hypothesis:
    projected = project_fit(given.problem, given.baseline.fit, columns_of(CATALOGUE, given.design.facts))
    result = search(given.baseline, projected, ())
    best = best_of(result.hypotheses)
    assert best is not None
    ran_out = best.status is HypothesisStatus.OUT_OF_STEPS
    assert result.status is (SearchStatus.OUT_OF_STEPS if ran_out else SearchStatus.FINISHED)
    return next(hypothesis for hypothesis in result.hypotheses if hypothesis.slugs == (slug,))


def test_a_search_among_nothing_has_no_candidate(wandering: Study) -> None:
    result = search(wandering.baseline, project_fit(wandering.problem, wandering.baseline.fit), ())
    assert result.hypotheses == ()
    assert result.status is SearchStatus.NO_CANDIDATE


def test_a_hypothesis_says_how_its_evidence_came_about(wandering: Study) -> None:
    """Screened only; refitted with a negative one-sided effect; stopped before its end; followed to it."""
    baseline, drag = wandering.baseline, BY_SLUG["hydrodynamic_drag"]
    null = null_of(wandering.problem, baseline.fit)

    def refit(amplitude: float, steps: int) -> Hypothesis:
        start = FittedEffect(effect=drag, amplitude=amplitude, shape=(1.0, 0.0, 0.0, 0.0))
        return refitted(wandering.problem, null, baseline.fit.laws, (start,), 0.0, (-1.0, 0.0), steps=steps)

    assert refit(-0.1, 5).status is HypothesisStatus.SCREENED
    assert refit(0.1, 0).status is HypothesisStatus.OUT_OF_STEPS
    ended = refit(0.1, 60)
    below = any(effect.amplitude < 0 for effect in ended.fit.effects) if ended.fit else False
    assert ended.status in ({HypothesisStatus.WRONG_SIGN} if below else {"converged", "stalled"})
    assert ended.usable != below


def test_a_zero_that_the_baseline_absorbed_is_found_with_its_sign(wandering: Study) -> None:
    zero = found(wandering, "torque_zero_shift")
    assert zero.fit is not None
    assert zero.fit.effects[0].amplitude < 0.0
    assert zero.evidence > 200.0


def test_no_effect_is_praised_for_a_valley_that_the_baseline_missed(wandering: Study) -> None:
    """A trifle beside the baseline in one valley, against the baseline in another: what that missed is taken off."""
    baseline, problem = wandering.baseline, wandering.problem
    rough = fit(problem.with_noise(first_noise(wandering.design)), baseline.start, steps=12)
    missed, better = sorted((baseline.fit, fit(problem, rough.laws)), key=lambda fitted: -fitted.cost)
    null = null_of(problem, missed)
    trifle = FittedEffect(effect=BY_SLUG["viscous_exponent"], amplitude=0.0, shape=())
    praised = refitted(problem, null, better.laws, (trifle,), 0.0, (0.0, 0.0))
    assert praised.evidence > 50.0
    refits = Refits(
        problem=problem, start=baseline.start, null=null, projected=cast(ProjectedFit, None),
        likely=cast(Projected, None),
    )  # fmt: skip
    again = _better_null(refits, praised)
    assert again is not None
    off = again.evidence - null.evidence, again.profile - null.profile
    assert praised.against(*off).evidence < 0.1 * praised.evidence


def test_what_plateaus_and_raw_records_both_show_counts_once() -> None:
    """Plateaus are means of the raw samples: 12 nats by them and 20 by the samples are 20, not 32; beside another effect the
    samples add 8; and what they show less of they do not add."""
    dwell, drag = BY_SLUG["unsettled_dwell"], BY_SLUG["hydrodynamic_drag"]
    alone = Hypothesis(effects=(dwell,), evidence=12.0, drop=15.0, fit=None)
    pair = Hypothesis(effects=(dwell, drag), evidence=30.0, drop=40.0, fit=None)
    estimate = Estimate(name="settling time constant", value=2.0, sd=0.3, unit="s")
    for nats, single, both in ((20.0, 20.0, 38.0), (5.0, 12.0, 30.0)):
        raw = RawEvidence(effect="unsettled_dwell", log_evidence=nats, estimate=estimate, note="")
        added = added_by_raw([raw], [alone, pair])
        assert (alone.with_raw(added).evidence, pair.with_raw(added).evidence) == (single, both)
    hidden = replace(alone, evidence=-np.inf)  # of the wrong sign by plateaus
    assert added_by_raw([raw], [hidden]) == {"unsettled_dwell": 5.0}


def test_a_refit_near_the_best_is_followed_to_its_end(wandering: Study) -> None:
    """Compared with others before its end, an effect that the baseline had absorbed stands far behind what it is."""
    projected = project_fit(wandering.problem, wandering.baseline.fit, columns_of(CATALOGUE, wandering.design.facts))
    usable = [each for each in search(wandering.baseline, projected, ()).hypotheses if each.usable]
    least = usable[0].evidence - CREDIBLE_MARGIN
    assert all(each.status is not HypothesisStatus.OUT_OF_STEPS for each in usable if each.evidence > least)


def test_a_shape_at_its_bound_is_held_while_the_rest_moves(wandering: Study) -> None:
    """The step solves the equations of what may move, not those of all with one entry struck out."""
    priors = wandering.problem.priors
    effect = BY_SLUG["hydrodynamic_drag"]
    at_bound = wandering.extended((effect.slug, 0.5, (0.5, 0.0, 1.0, 1.0)))
    state = replace(at_bound, effects=(replace(at_bound.effects[0], shape=(0.5, 0.0, 1.0, 1.0)),))
    size = int(priors.free.sum()) + 2
    root = np.random.default_rng(2).standard_normal((2 * size, size))
    matrix, gradient = root.T @ root, root.T @ np.ones(2 * size)
    free = np.linalg.solve(matrix, gradient)
    gradient -= matrix[:, -1] * (free[-1] + 1.0)  # now the power would go down, beyond its bound
    step = _inside(state, priors, matrix, gradient)
    assert step[-1] == 0.0
    np.testing.assert_allclose(matrix[:-1, :-1] @ step[:-1], gradient[:-1], rtol=1e-8, atol=1e-8)


def test_what_shows_nothing_is_no_half_of_a_pair() -> None:
    """Without loops nothing of a delay, of inertia or of a film is seen: beside what is there they would stand for free."""
    given = study(campaign(6, lambda at: np.full_like(at.velocity, 0.6 if at.cycles > 4000 else 0.0), loops=False))
    view = project_fit(given.problem, given.baseline.fit, columns_of(CATALOGUE, given.design.facts))
    found = {effect.slug for pair in screen_pairs(view.columns, view.projections) for effect in pair.effects}
    assert "torque_zero_shift" in found
    assert not found & {"channel_delay", "inertia_torque", "squeeze_film"}


def test_what_the_data_could_not_show_is_not_judged() -> None:
    """A film, a delay and a mass act in loops only."""
    given = study(campaign(2, loops=False))
    view = project_fit(given.problem, given.baseline.fit, columns_of(CATALOGUE, given.design.facts))
    judged = {each.effects[0].slug for each in screen(view.columns, view.projections)}
    assert not judged & {"squeeze_film", "channel_delay", "inertia_torque"}
    assert {"oil_temperature", "torque_zero_shift", "oil_change"} <= judged
