"""The posterior: the same data, the same answer; what is planted leads, what nobody planted does not; ends of the list."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign
from models.diagnosis.criteria import ANYTHING_WRONG
from models.diagnosis.design.design import build_design
from models.diagnosis.effects.fitted_effect import Estimate
from models.diagnosis.explanations.decide import decide, explanations_of
from models.diagnosis.explanations.posterior import Posterior, Prior, posterior_of
from models.diagnosis.explanations.verdict import LINE, NOTHING, UNCATALOGUED, Alternative, Verdict, axis_of, is_axis
from models.diagnosis.pooled_fit.baseline_fit import Baseline, fit_baseline
from models.diagnosis.raw_records.evidence import FIXED_LINE, RawEvidence
from tests.models.diagnosis.campaigns import Where, campaign


def shift(at: Where) -> np.ndarray:
    """1.5 Nm from cycle 4000 on."""
    return np.full_like(at.velocity, 1.5 if at.cycles > 4000 else 0.0)


def baseline(given: Campaign) -> Baseline:
    return fit_baseline(build_design(given))


def shuffled(given: Campaign) -> Campaign:
    """The runs sent in another order, by other names."""
    renamed = [replace(run, run_id=f"other-{k}") for k, run in enumerate(given.stationary)]
    return replace(given, stationary=tuple(reversed(renamed)))


@pytest.fixture(scope="module")
def zero() -> Baseline:
    return baseline(campaign(7, shift, loops=False))


@pytest.fixture(scope="module")
def plain() -> Baseline:
    return baseline(campaign(7, loops=False))


def record(effect: str, evidence: float) -> RawEvidence:
    estimate = Estimate(name="amplitude", value=0.1, sd=0.01, unit="Nm")
    return RawEvidence(effect=effect, log_evidence=evidence, estimate=estimate, note="torque swings")


def test_other_names_and_another_order_of_runs_change_no_probability(zero: Baseline) -> None:
    first = posterior_of(zero, ()).probabilities
    again = posterior_of(baseline(shuffled(campaign(7, shift, loops=False))), ()).probabilities
    assert next(iter(first)) == next(iter(again)) == Alternative(("torque_zero_shift",))
    assert max(abs(first.get(h, 0.0) - again.get(h, 0.0)) for h in {*first, *again}) < 0.02


def test_a_cause_that_is_out_of_the_catalogue_is_not_on_the_list(zero: Baseline) -> None:
    left = posterior_of(zero, (), frozenset({"torque_zero_shift"}))
    assert left.probabilities[NOTHING] > posterior_of(zero, ()).probabilities[NOTHING]
    assert not any("torque_zero_shift" in alternative.causes for alternative in left.weights)


def test_probabilities_sum_to_one_and_exclude_each_other(zero: Baseline) -> None:
    found = posterior_of(zero, (record("shaft_ripple", 12.0),))
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    explanations = explanations_of(found)
    assert sum(each.probability for each in explanations) == pytest.approx(1.0)
    assert len({frozenset(each.effects) for each in explanations}) == len(explanations)
    assert set(decide(explanations)[1]) == {"torque_zero_shift", "shaft_ripple"}


def said(plain: Baseline, *records: RawEvidence) -> tuple[Verdict, tuple[str, ...]]:
    return decide(explanations_of(posterior_of(plain, records)))


def test_a_vibration_alone_is_a_cause_and_a_line_at_all_speeds_has_no_name(plain: Baseline) -> None:
    assert said(plain) == (Verdict.MODEL_ADEQUATE, ())
    assert said(plain, record("stick_slip", 30.0)) == (Verdict.CAUSE_NAMED, ("stick_slip",))
    assert said(plain, record(FIXED_LINE, 30.0)) == (Verdict.UNEXPLAINED_STRUCTURE, ())
    assert said(plain, record(FIXED_LINE, 2.0)) == (Verdict.MODEL_ADEQUATE, ())


def test_the_priors_of_one_thing_sum_to_what_may_be_wrong() -> None:
    prior = Prior(effects=15, unknowns=16)
    shares = 15 * np.exp(prior(Alternative(("e",)))) + 16 * np.exp(prior(Alternative((), "cycles")))
    assert shares == pytest.approx(ANYTHING_WRONG / (1 - ANYTHING_WRONG))
    pair = Alternative(("a", "b"))
    assert prior(pair) < prior(Alternative(("a",))) - 2.0


def test_the_list_knows_what_has_an_axis() -> None:
    assert is_axis("cycles")
    assert not is_axis(LINE)
    assert not is_axis("gain_with_life")
    assert axis_of("gain_with_life") == "cycles"
    assert Alternative(("a", "b")).and_effect("c") is None
    assert Alternative(("b",)).and_effect("a") == Alternative(("a", "b"))
    assert Alternative(("a",), "gain_with_life").without("gain_with_life") == Alternative(("a",))


def named(found: Posterior) -> frozenset[str]:
    return frozenset(slug for each in explanations_of(found) for slug in each.effects) - {UNCATALOGUED}


def test_an_empty_catalogue_names_nothing(zero: Baseline) -> None:
    everything = named(posterior_of(zero, ()))
    assert not named(posterior_of(zero, (), everything))
