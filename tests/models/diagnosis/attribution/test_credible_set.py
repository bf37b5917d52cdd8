"""Which hypotheses are credible: by their evidence, and pairs by more of it."""

from types import SimpleNamespace
from typing import cast

from models.diagnosis.attribution.check import Checks
from models.diagnosis.attribution.decide import credible_set
from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.attribution.posterior import PriorOdds
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.pooled_fit.gauss_newton import Fit
from tests.models.diagnosis.attribution.test_decide import passing


def candidate(*slugs: str, evidence: float) -> Hypothesis:
    effects = tuple(BY_SLUG[slug] for slug in slugs)
    fitted = cast(Fit, SimpleNamespace())
    return Hypothesis(effects=effects, evidence=evidence, drop=20.0, fit=fitted)


def credible(*given: Hypothesis) -> set[tuple[str, ...]]:
    """The credible set of usable hypotheses of equal prior odds that all pass their checks."""
    even = cast(PriorOdds, lambda _: 0.0)
    return {hypothesis.slugs for hypothesis in credible_set(given[0], given, even, cast(Checks, passing))}


def test_what_is_no_better_than_nothing_is_not_credible() -> None:
    best, close = candidate("oil_change", evidence=3.5), candidate("running_in", evidence=0.2)
    assert credible(best, close, candidate("inertia_torque", evidence=-0.1)) == {("oil_change",), ("running_in",)}


def test_candidates_are_credible_up_to_a_hundredth_of_its_weight() -> None:
    """4.6 nats are ln 100."""
    best = candidate("oil_change", evidence=20.0)
    assert len(credible(best, candidate("running_in", evidence=15.7))) == 2
    assert len(credible(best, candidate("running_in", evidence=15.2))) == 1


def test_pairs_must_be_closer_than_single_effects_to_be_credible() -> None:
    assert len(credible(candidate("oil_change", evidence=30.0), candidate("running_in", evidence=26.5))) == 2
    pair, rival = ("oil_change", "inertia_torque"), ("oil_change", "squeeze_film")
    assert len(credible(candidate(*pair, evidence=60.0), candidate(*rival, evidence=56.5))) == 1
    assert len(credible(candidate(*pair, evidence=60.0), candidate(*rival, evidence=57.5))) == 2
