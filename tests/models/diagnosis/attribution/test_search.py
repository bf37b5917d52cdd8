"""Effects that the baseline swallows are found where they are, and what stands beside the best is not nothing."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from models.diagnosis.attribution import decide, search
from models.diagnosis.attribution.evidence import Hypothesis, null_of, refitted
from models.diagnosis.attribution.screening import columns_of, screen, screen_pairs
from models.diagnosis.attribution.search import hypotheses_of
from models.diagnosis.detection.view import View, view_of
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.noise.estimate import first_noise
from models.diagnosis.pooled_fit.gauss_newton import Fitted, _inside, fit
from models.diagnosis.pooled_fit.projection import Projected
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, study

CYCLES, ZEROS = [0.0, 1000.0, 3000.0, 6000.0, 10000.0, 15000.0], [0.0, -2.5, -3.2, -4.4, -4.6, -5.5]


@pytest.fixture(scope="module")
def wandering() -> Study:
    """A zero that wanders off by 5.5 Nm: eleven deviations of its prior, and most of it looks like eq. 6."""
    return study(campaign(5, lambda at: np.full_like(at.velocity, np.interp(at.cycles, CYCLES, ZEROS))))


def found(given: Study, slug: str) -> Hypothesis:
    known = given.baseline
    columns = columns_of(list(CATALOGUE), [effect.grid(given.design.facts) for effect in CATALOGUE])
    view = view_of(given.design, known.noise, known.priors, known.fit, columns)
    hypotheses = hypotheses_of(given.design, known.noise, known.priors, known.start, known.fit, view, ()).hypotheses
    return next(each for each in hypotheses if each.slugs == (slug,))


def test_a_zero_that_the_baseline_swallowed_is_found_with_its_sign(wandering: Study) -> None:
    zero = found(wandering, "torque_zero_shift")
    assert zero.fit is not None
    assert zero.fit.effects[0].amplitude < 0.0
    assert zero.evidence > 200.0


def test_no_effect_is_praised_for_a_valley_that_the_baseline_missed(wandering: Study) -> None:
    """A trifle beside the baseline in one valley, against the baseline in another: what that missed is taken off."""
    known, design = wandering.baseline, wandering.design
    given = design, known.noise, known.priors
    other = fit(*given[:2], fit(design, first_noise(design), known.start, known.priors, steps=12).laws, known.priors)
    missed, better = sorted((known.fit, other), key=lambda each: -each.cost)
    null = null_of(*given, missed)
    trifle = Fitted(effect=BY_SLUG["viscous_exponent"], amplitude=0.0, shape=())
    praised = refitted(*given, null, better.laws, (trifle,), 0.0, (0.0, 0.0))
    assert praised.evidence > 50.0
    searching = search._Search(
        design=design, noise=known.noise, priors=known.priors, start=known.start, null=null,
        view=cast(View, None), projected=cast(Projected, None),
    )  # fmt: skip
    assert praised.less(*searching.better_by(searching.better_null([praised]))).evidence < 0.1 * praised.evidence


def test_a_shape_at_its_bound_is_held_while_the_rest_moves(wandering: Study) -> None:
    """The step solves the equations of what may move, not those of all with one entry struck out."""
    known = wandering.baseline
    effect = BY_SLUG["hydrodynamic_drag"]
    at_bound = wandering.extended((effect.slug, 0.5, (0.5, 0.0, 1.0, 1.0)))
    state = replace(at_bound, effects=(replace(at_bound.effects[0], shape=(0.5, 0.0, 1.0, 1.0)),))
    size = int(known.priors.free.sum()) + 2
    root = np.random.default_rng(2).standard_normal((2 * size, size))
    matrix, gradient = root.T @ root, root.T @ np.ones(2 * size)
    free = np.linalg.solve(matrix, gradient)
    gradient -= matrix[:, -1] * (free[-1] + 1.0)  # now the power would go down, beyond its bound
    step = _inside(state, known.priors, matrix, gradient)
    assert step[-1] == 0.0
    np.testing.assert_allclose(matrix[:-1, :-1] @ step[:-1], gradient[:-1], rtol=1e-8, atol=1e-8)


def candidate(*slugs: str, evidence: float) -> Hypothesis:
    return Hypothesis(effects=tuple(BY_SLUG[slug] for slug in slugs), evidence=evidence, drop=20.0, fit=None)


def standing(*given: Hypothesis) -> set[tuple[str, ...]]:
    singles = [each for each in given if len(each.effects) == 1]
    closes = SimpleNamespace(closed=True, excess=-1.0)
    stood = decide._standing(given[0], list(given), singles, lambda _: 0.0, lambda _: closes)  # type: ignore[arg-type]
    return {each.slugs for each in stood}


def test_what_is_no_better_than_nothing_does_not_stand_beside_the_best() -> None:
    best, close = candidate("oil_change", evidence=3.5), candidate("running_in", evidence=0.2)
    assert standing(best, close, candidate("inertia_torque", evidence=-0.1)) == {("oil_change",), ("running_in",)}


def test_candidates_stand_beside_the_best_up_to_a_hundredth_of_its_weight() -> None:
    """4.6 nats are ln 100."""
    best = candidate("oil_change", evidence=20.0)
    assert len(standing(best, candidate("running_in", evidence=15.7))) == 2
    assert len(standing(best, candidate("running_in", evidence=15.2))) == 1


def test_pairs_must_be_closer_than_single_effects_to_stand_beside_the_best() -> None:
    assert len(standing(candidate("oil_change", evidence=30.0), candidate("running_in", evidence=26.5))) == 2
    pair, rival = ("oil_change", "inertia_torque"), ("oil_change", "squeeze_film")
    assert len(standing(candidate(*pair, evidence=60.0), candidate(*rival, evidence=56.5))) == 1
    assert len(standing(candidate(*pair, evidence=60.0), candidate(*rival, evidence=57.5))) == 2


def test_what_shows_nothing_is_no_half_of_a_pair() -> None:
    """Without loops nothing of a delay, of inertia or of a film is seen: beside what is there they would stand for free."""
    given = study(campaign(6, lambda at: np.full_like(at.velocity, 0.6 if at.cycles > 4000 else 0.0), loops=False))
    known = given.baseline
    columns = columns_of(list(CATALOGUE), [effect.grid(given.design.facts) for effect in CATALOGUE])
    view = view_of(given.design, known.noise, known.priors, known.fit, columns)
    found = {effect.slug for pair in screen_pairs(view.columns, view.projections) for effect in pair.effects}
    assert "torque_zero_shift" in found
    assert not found & {"channel_delay", "inertia_torque", "squeeze_film"}


def test_what_the_data_could_not_show_is_not_judged() -> None:
    """A film, a delay and a mass act in loops only."""
    given = study(campaign(2, loops=False))
    known, design = given.baseline, given.design
    columns = columns_of(list(CATALOGUE), [effect.grid(design.facts) for effect in CATALOGUE])
    view = view_of(design, known.noise, known.priors, known.fit, columns)
    judged = {each.effects[0].slug for each in screen(view.columns, view.projections)}
    assert not judged & {"squeeze_film", "channel_delay", "inertia_torque"}
    assert {"oil_temperature", "torque_zero_shift", "oil_change"} <= judged
