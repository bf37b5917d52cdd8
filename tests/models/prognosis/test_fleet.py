"""A population of lives learned from others, and the mixture with the weak prior that it is used in."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from models.degradation.general_order import DegradationLaw, first_passage, value
from models.prognosis.criteria import FEWEST_TESTS_TO_LEARN
from models.prognosis.first_passage import ends_of_life
from models.prognosis.fleet import FleetPrior, pooled, population, taught
from models.tracking.courses import CourseForm, basis
from models.tracking.filters.ukf import Ukf
from models.tracking.measurement import Measurement
from models.tracking.posterior import TrackPosterior
from models.tracking.prior import weak
from tests.models.prognosis.sample_scores import crps_of_sample
from tests.models.tracking.tracked_series import draws_of, followed, on_grid, sent

UKF = Ukf()


def life(rng: np.random.Generator, scale: float) -> DegradationLaw:
    """A clutch of a population that is no normal one: uniform in Δ/ξ0 and in log φ, log ε."""
    initial = 0.13 * math.exp(rng.uniform(-0.1, 0.1))
    return DegradationLaw(
        initial=initial,
        change=-initial * rng.uniform(0.65, 0.85),
        scale=scale * math.exp(rng.uniform(-0.6, 0.6)),
        exponent=0.8 * math.exp(rng.uniform(-0.5, 0.5)),
    )


def measured(truth: DegradationLaw, last: float, tests: int, rng: np.random.Generator) -> list[Measurement]:
    zeta = np.linspace(0.0, last, tests)
    y = value(zeta, truth) + 0.003 * float(truth.initial) * rng.standard_normal(tests)
    return sent(zeta, y)


def fleet(count: int, seed: int, scale: float = 5000.0) -> FleetPrior:
    rng = np.random.default_rng(seed)
    return population([taught(measured(life(rng, scale), 3.0 * scale, 14, rng)) for _ in range(count)])


def test_the_population_is_found_and_a_small_fleet_has_little_say() -> None:
    found = fleet(12, 1)
    assert found.clutches == 12
    assert found.mean[0] == pytest.approx(-0.75, abs=0.06)
    assert found.mean[1] == pytest.approx(math.log(5000.0), abs=0.35)
    assert found.mean[2] == pytest.approx(math.log(0.8), abs=0.35)
    assert found.mean[3] == pytest.approx(math.log(0.003), abs=0.3)
    assert (np.sqrt(np.diag(found.scale)) < [0.16, 0.75, 0.6, 0.5]).all()
    # a small fleet stays vague and has little say
    small, large = fleet(3, 2), fleet(12, 2)
    assert small.share < large.share < 0.5
    deviations = [np.sqrt(np.diag(each.scale) * each.freedom / (each.freedom - 2)) for each in (small, large)]
    assert (deviations[0] > deviations[1]).all()


def test_a_fleet_survives_json_counts_in_other_units_and_needs_tests() -> None:
    found = fleet(3, 3)
    again = FleetPrior.from_dict(json.loads(json.dumps(found.to_dict())))
    assert again.to_dict() == found.to_dict()
    first = Measurement(progress=0.0, value=0.13, variance=0.0)
    shifted = found.in_unit(2.0).prior_for(first)
    assert math.exp(shifted.log_scale_mean) == pytest.approx(0.5 * math.exp(found.prior_for(first).log_scale_mean))
    # too few tests teach nothing
    rng = np.random.default_rng(4)
    with pytest.raises(ValueError, match=f"{FEWEST_TESTS_TO_LEARN} tests to teach"):
        taught(measured(life(rng, 5000.0), 9000.0, FEWEST_TESTS_TO_LEARN - 1, rng))
    with pytest.raises(ValueError, match=f"{FEWEST_TESTS_TO_LEARN} tests or more"):
        population([])


def test_a_population_has_converged() -> None:
    """Further rounds leave it where it is, and a single one does not reach it."""
    rng = np.random.default_rng(3)
    samples = [taught(measured(life(rng, 5000.0), 15_000.0, 14, rng)) for _ in range(3)]
    found, further, first = (population(samples, rounds) for rounds in (40, 80, 1))
    near = 0.01 * float(np.sqrt(np.diag(further.scale)).min())
    assert found.mean == pytest.approx(further.mean, abs=near)
    assert first.mean != pytest.approx(further.mean, abs=near)
    assert (population(samples).mean == found.mean).all()


def crps(posterior: TrackPosterior, truth: float) -> float:
    return crps_of_sample(np.minimum(ends_of_life(posterior, 0.5), 1e6), posterior.weight, truth)


def predicted(
    prior: FleetPrior, seen: list[Measurement], rng: np.random.Generator
) -> tuple[TrackPosterior, TrackPosterior]:
    """Under the weak prior alone, and under the mixture."""
    beliefs = weak(seen[0], falling=True), prior.prior_for(seen[0])
    under = [on_grid(seen, 1000, rng, each) for each in beliefs]
    return under[0], prior.together(under[0], under[1], seen[0])


def scored(prior: FleetPrior, seed: int, count: int) -> float:
    """The mixture's CRPS over the weak prior's, at a third of the lives of `scale` 5,000."""
    rng = np.random.default_rng(seed)
    scores = []
    for _ in range(count):
        truth = life(rng, 5000.0)
        end = float(first_passage(0.5 * truth.initial, truth))
        if end < 1e6:
            by_weak, by_both = predicted(prior, measured(truth, 0.3 * end, 8, rng), rng)
            scores.append((crps(by_weak, end) / end, crps(by_both, end) / end))
    both = np.array(scores).sum(axis=0)
    return float(both[1] / both[0])


@pytest.mark.slow
def test_a_fleet_of_the_same_kind_helps_and_another_kind_does_little_harm() -> None:
    ratio = {scale: scored(fleet(8, 5, scale), 6, 12) for scale in (5000.0, 40_000.0)}
    assert ratio[5000.0] < 0.75
    assert ratio[40_000.0] < 1.25


def test_the_mixture_is_that_of_importance_sampling() -> None:
    """The witness: 400,000 draws of the mixture itself, weighted by the closed form's evidence, after three tests."""
    rng = np.random.default_rng(7)
    prior = fleet(6, 8)
    truth = life(rng, 5000.0)
    seen = [replace(m, variance=(0.003 * m.value) ** 2) for m in measured(truth, 3000.0, 3, rng)]
    believed = replace(weak(seen[0], falling=True), outlying_share=0.0, law_share=1.0, eq_6_share=1.0)
    learned = replace(prior.prior_for(seen[0]), outlying_share=0.0, law_share=1.0, eq_6_share=1.0)
    under = [on_grid(seen, 4000, rng, each) for each in (believed, learned)]
    mixed = prior.together(under[0], under[1], seen[0])
    reference = _brute(prior, seen, rng)
    misfits = [_misfit(each, reference) for each in (mixed, *under)]
    assert misfits[0] < 0.1
    # the negative control: neither sample alone is that distribution
    assert min(misfits[1:]) > 0.15


def test_no_draw_of_an_unscented_filter_has_all_the_weight() -> None:
    """A life three times as long as those of its fleet, of another law: its normals reach where no prior has anything."""
    prior, rng = fleet(8, 5), np.random.default_rng(3)
    zeta = np.linspace(0.0, 30_000.0, 9)
    values = 0.13 * (1.0 - 0.5 * (zeta / 60_000.0) ** 1.5) * (1.0 + 0.003 * rng.standard_normal(9))
    seen = sent(zeta, values, 1.6e-7)
    for count in range(6, 10):
        beliefs = weak(seen[0], falling=True), prior.prior_for(seen[0])
        under = [UKF.posterior(followed(UKF, believed, seen[:count]), 500, rng) for believed in beliefs]
        assert prior.together(under[0], under[1], seen[0]).effective_draws > 60.0, count


def _misfit(found: TrackPosterior, reference: TrackPosterior) -> float:
    """The largest difference of means, in deviations, or of logarithms of deviations, over the coefficients."""
    worst = 0.0
    for name in ("scale", "exponent", "change"):
        (mean, sd), (other, spread) = (each.moments(np.log(np.abs(getattr(each, name)))) for each in (found, reference))
        worst = max(worst, abs(mean - other) / spread, abs(math.log(sd / spread)))
    return worst


def _brute(prior: FleetPrior, seen: list[Measurement], rng: np.random.Generator) -> TrackPosterior:
    """Draws of the mixture prior, with the likelihood as weights; all five coefficients are drawn."""
    count = 400_000
    first = weak(seen[0], falling=True)
    initial = rng.normal(first.initial_mean, 0.02 * first.initial_mean, count)
    root = np.linalg.cholesky(prior.scale)
    tail = np.sqrt(prior.freedom / rng.chisquare(prior.freedom, count))
    x = prior.mean + (rng.standard_normal((count, 4)) @ root.T) * tail[:, None]
    learned = rng.random(count) < prior.share
    change = np.where(learned, x[:, 0] * initial, rng.normal(first.change_mean, first.change_sd, count))
    scale = np.where(learned, x[:, 1], rng.normal(first.log_scale_mean, first.log_scale_sd, count))
    exponent = np.where(learned, x[:, 2], rng.normal(first.log_exponent_mean, first.log_exponent_sd, count))
    scatter = np.where(
        learned, x[:, 3] + np.log(initial), rng.normal(first.log_scatter_mean, first.log_scatter_sd, count)
    )
    log_weight = 0.5 * ((initial - first.initial_mean) / (0.02 * first.initial_mean)) ** 2
    log_weight -= 0.5 * ((initial - first.initial_mean) / first.initial_sd) ** 2
    for each in seen:
        b = basis(np.full(count, each.progress), scale, exponent, np.zeros(count, dtype=np.intp))
        variance = each.variance + np.exp(2.0 * scatter)
        log_weight += -0.5 * (np.log(variance) + (each.value - initial - change * b) ** 2 / variance)
    weight = np.exp(log_weight - log_weight.max())
    assert weight.sum() ** 2 / np.square(weight).sum() > 500
    law = {"initial": initial, "change": change, "scale": np.exp(scale), "exponent": np.exp(exponent)}
    return draws_of(count, **law, weight=weight / weight.sum(), scatter=np.exp(scatter))


def test_pooled_draws_have_half_of_the_weight_each() -> None:
    rng = np.random.default_rng(9)
    seen = measured(life(rng, 5000.0), 9000.0, 8, rng)
    one, other = (on_grid(seen, size, rng) for size in (300, 500))
    both = pooled(one, other)
    assert both.weight[:300].sum() == pytest.approx(0.5)
    at = np.array([0.0, 5000.0, 20_000.0])
    assert both.values(at)[:, :300] == pytest.approx(one.values(at))
    assert both.values(at)[:, 300:] == pytest.approx(other.values(at))


@pytest.mark.parametrize("log_exponent", [-0.2, -0.9, -1.3])
def test_a_fleet_has_no_say_in_courses_that_it_has_not_learned(log_exponent: float) -> None:
    """The odds among the other courses stay; eq. 6 loses at most what the fleet is trusted with."""
    rng = np.random.default_rng(3)
    progress = np.linspace(0.0, 7e3, 18)
    values = 0.1 * (1.0 - 0.6 * -np.expm1(-1.792 * progress / 1e4)) * (1.0 + 0.003 * rng.standard_normal(18))
    seen = sent(progress, values, 1e-8)
    scale = np.diag([0.15, 0.5, 0.17, 0.4]) ** 2
    mean = np.array([-0.6, math.log(4_000.0), log_exponent, math.log(0.003)])
    fleet = FleetPrior(clutches=20, mean=mean, scale=scale, freedom=20.0)
    alone, taught = (
        on_grid(seen, 2_000, np.random.default_rng(1), prior)
        for prior in (weak(seen[0], falling=True), fleet.prior_for(seen[0]))
    )
    together = fleet.together(alone, taught, seen[0])
    before, after = (np.bincount(p.course, weights=p.weight, minlength=len(CourseForm)) for p in (alone, together))
    odds_before, odds_after = before[1:] / before[1:].sum(), after[1:] / after[1:].sum()
    assert odds_after == pytest.approx(odds_before, abs=0.1)
    assert after[0] / after[1:].sum() > 0.7 * (1.0 - fleet.share) * before[0] / before[1:].sum()
