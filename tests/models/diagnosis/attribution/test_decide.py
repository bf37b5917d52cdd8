"""What is decided on evidence: structure without a name, a remainder that is an oddity, a probability, vibrations, gains."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from models.arrays import FloatArray
from models.diagnosis.attribution.check import Check, Checks
from models.diagnosis.attribution.decide import (
    credible_set,
    judge,
    like_temperature,
    revise,
    with_vibrations,
)
from models.diagnosis.attribution.evidence import Hypothesis, null_of, refitted
from models.diagnosis.attribution.explanations import explanations_of
from models.diagnosis.attribution.posterior import PriorOdds
from models.diagnosis.attribution.verdict import UNCATALOGUED, Comparison, HeldOut, Judgement, Proposal, Verdict
from models.diagnosis.criteria import (
    AXES_LOG_ODDS,
    CREDIBLE_MARGIN,
    CREDIBLE_MARGIN_PAIRS,
    LEAST_NAMED,
    LEAST_REMAINDER_P_VALUE,
    MOST_WORSE,
    PAIR_LOG_ODDS,
    STRUCTURE_FROM,
    STRUCTURE_SHARE,
)
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.pooled_fit.gauss_newton import FitStatus
from models.diagnosis.pooled_fit.gram import gram_of
from models.diagnosis.pooled_fit.projection import GAINS, project
from tests.models.diagnosis.campaigns import Where, campaign
from tests.models.diagnosis.fitted import Study, study
from tests.models.diagnosis.test_diagnose import late

Judge = Callable[..., Judgement]


def little(at: Where) -> FloatArray:
    """A share of the plateau before, a third of what the engine's own tests plant."""
    return np.asarray(late(at) / 3, dtype=np.float64)


@pytest.fixture(scope="module")
def given() -> Study:
    return study(campaign(4, little))


@pytest.fixture(scope="module")
def best(given: Study) -> Hypothesis:
    """The planted effect alone, refitted."""
    baseline = given.baseline
    null = null_of(given.problem, baseline.fit)
    effects = given.extended(("unsettled_dwell", 0.05, (0.0, 0.5))).effects
    return refitted(given.problem, null, baseline.fit.laws, effects, 0.0, (0.0, 0.0))


def checks_of(given: Study) -> Checks:
    return Checks(given.problem, np.random.default_rng(1))


class Odd(Checks):
    """Checks with other p-values."""

    def __init__(self, given: Study, left: float, parts: float | None = None) -> None:
        super().__init__(given.problem, np.random.default_rng(1))
        self._left, self._parts = left, parts

    def __call__(self, hypothesis: Hypothesis) -> Check:
        made = super().__call__(hypothesis)
        parts = made.parts if self._parts is None else replace(made.parts, p_value=self._parts)
        return replace(made, left=replace(made.left, p_value=self._left), parts=parts)


@pytest.fixture
def judged(given: Study, best: Hypothesis) -> Judge:
    def judged(structure: float = 0.0, checks: Checks | None = None) -> Judgement:
        return judge([best], structure, -np.inf, frozenset(), checks or checks_of(given))

    return judged


def test_structure_without_a_name_must_lead_by_the_price_of_the_axes(judged: Judge, best: Hypothesis) -> None:
    beyond = AXES_LOG_ODDS + STRUCTURE_SHARE * max(best.drop - STRUCTURE_FROM, 0.0)
    assert best.evidence > 5.0
    assert judged(0.0).verdict is Verdict.CAUSE_NAMED
    assert judged(best.evidence + beyond - 0.1).verdict is not Verdict.UNEXPLAINED_STRUCTURE
    assert judged(best.evidence + beyond + 0.1).verdict is Verdict.UNEXPLAINED_STRUCTURE


def test_a_cause_is_named_from_its_own_probability_on(judged: Judge, best: Hypothesis) -> None:
    """Where structure comes near it, the cause stands alone but is no longer named."""
    told = {lead: judged(best.evidence - lead) for lead in np.arange(0.0, 12.0, 0.5)}
    for each in told.values():
        named = each.probabilities["unsettled_dwell"] >= LEAST_NAMED
        assert set(each.causes) == ({"unsettled_dwell"} if named else {"unsettled_dwell", UNCATALOGUED})
        assert each.verdict is (Verdict.CAUSE_NAMED if named else Verdict.CAUSE_AMBIGUOUS)
    assert len({each.verdict for each in told.values()}) == 2


@pytest.mark.parametrize(("p_value", "expected"), [(0.06, Verdict.CAUSE_NAMED), (1e-4, Verdict.CAUSE_AMBIGUOUS)])
def test_a_cause_that_leaves_an_oddity_is_not_named(
    given: Study, judged: Judge, p_value: float, expected: Verdict
) -> None:
    assert judged(checks=Odd(given, p_value)).verdict is expected


@pytest.mark.parametrize(
    ("slugs", "p_value", "expected"),
    [
        (("unsettled_dwell", "inertia_torque"), 1e-3, Verdict.CAUSE_AMBIGUOUS),
        (("unsettled_dwell", "inertia_torque"), 0.5, Verdict.CAUSE_NAMED),
        (("unsettled_dwell",), 1e-3, Verdict.CAUSE_NAMED),
    ],
)
def test_two_causes_must_agree_in_their_parts_to_be_named(
    given: Study, best: Hypothesis, slugs: tuple[str, ...], p_value: float, expected: Verdict
) -> None:
    """Parts may differ by what one template errs by; two templates could share a misfit between them."""
    several = replace(best, effects=tuple(BY_SLUG[slug] for slug in slugs), evidence=best.evidence + 40.0)
    among = [several, best] if len(slugs) > 1 else [several]
    found = judge(among, 0.0, -np.inf, frozenset(), Odd(given, 0.9, p_value))
    assert found.credible == (several,)
    assert found.verdict is expected


class Promoting(Odd):
    """Checks that single effects fail."""

    def __call__(self, hypothesis: Hypothesis) -> Check:
        made = super().__call__(hypothesis)
        return replace(made, excess=20.0) if len(hypothesis.effects) == 1 else made

    def excess(self, hypothesis: Hypothesis) -> float:
        return max(self(hypothesis).excess, 0.0)


@pytest.mark.parametrize(("p_value", "expected"), [(1e-3, Verdict.CAUSE_AMBIGUOUS), (0.5, Verdict.CAUSE_NAMED)])
def test_a_pair_that_is_promoted_for_the_best_failed_is_held_to_its_parts_as_well(
    given: Study, best: Hypothesis, p_value: float, expected: Verdict
) -> None:
    """It had been held to what holds of the single effect that failed, which says nothing of parts."""
    pair = replace(
        best,
        effects=tuple(BY_SLUG[slug] for slug in ("oil_temperature", "inertia_torque")),
        evidence=best.evidence + PAIR_LOG_ODDS - 1.0,
    )
    found = judge([best, pair], 0.0, -np.inf, frozenset(), Promoting(given, 0.9, p_value))
    assert found.credible == (pair,)
    assert found.verdict is expected


def test_a_cause_whose_fit_ran_out_of_steps_is_not_named(given: Study, judged: Judge, best: Hypothesis) -> None:
    assert best.fit is not None
    cut = replace(best, fit=replace(best.fit, status=FitStatus.OUT_OF_STEPS))
    assert judged().verdict is Verdict.CAUSE_NAMED
    assert judge([cut], 0.0, -np.inf, frozenset(), checks_of(given)).verdict is Verdict.CAUSE_AMBIGUOUS


@pytest.mark.parametrize(("p_value", "expected"), [(0.01, Verdict.CAUSE_NAMED), (1e-4, Verdict.CAUSE_AMBIGUOUS)])
def test_however_loud_a_cause_is_it_may_leave_a_little_only(
    given: Study, best: Hypothesis, p_value: float, expected: Verdict
) -> None:
    """Of a thousand nats a template may be wrong by fifty; what is named leaves no more than three."""
    loud = replace(best, evidence=1000.0, drop=1000.0)
    assert judge([loud], 0.0, -np.inf, frozenset(), Odd(given, p_value)).verdict is expected


def test_gains_that_scatter_much_are_less_likely_than_those_that_hardly_do(given: Study) -> None:
    """Without any run to tell them, their prior is left: narrower above the usual scatter than below."""
    gram = gram_of(given.problem, given.baseline.fit)
    untold = replace(gram, along=0.0 * gram.along, squares=0.0 * gram.squares)
    evidence = np.array([project(untold, float(gain), 0.0).evidence for gain in GAINS])
    below, usual, above = np.interp(np.log([0.0025 / 4, 0.0025, 0.0025 * 4]), np.log(GAINS), evidence)
    assert above < below - 1.0 < usual
    assert above > usual - 5.0  # unlikely, not impossible


@pytest.mark.parametrize(
    ("slugs", "uneven", "score", "expected"),
    [
        (("oil_change", "running_in"), LEAST_REMAINDER_P_VALUE / 2, -1.0, Verdict.CAUSE_AMBIGUOUS),
        (("oil_change", "running_in"), LEAST_REMAINDER_P_VALUE / 2, 1.0, Verdict.CAUSE_NAMED),
        (("oil_change", "running_in"), LEAST_REMAINDER_P_VALUE * 2, -1.0, Verdict.CAUSE_NAMED),
        (("oil_change",), LEAST_REMAINDER_P_VALUE / 2, -1.0, Verdict.CAUSE_NAMED),
    ],
)
def test_two_causes_of_other_sizes_in_parts_that_predict_worse_are_not_named(
    given: Study, best: Hypothesis, slugs: tuple[str, ...], uneven: float, score: float, expected: Verdict
) -> None:
    made = checks_of(given)(best)
    comparison = Comparison(
        best_drop=40.0, structure=0.0, tolerance=2.0, credible=1,
        check=replace(made, parts=replace(made.parts, p_value=uneven)),
    )  # fmt: skip
    credible = Hypothesis(effects=tuple(BY_SLUG[slug] for slug in slugs), evidence=30.0, drop=40.0, fit=None)
    named = Judgement(verdict=Verdict.CAUSE_NAMED, causes=slugs, credible=(credible,), comparison=comparison)
    held_out = HeldOut(rmse_before=0.2, rmse_after=0.2, log_score_gain=score, forecast_log_score_gain=0.0)
    found = revise(named, held_out)
    assert found.verdict is expected
    assert set(slugs) <= set(found.causes)
    assert revise(named, None) == named
    for verdict in set(Verdict) - {Verdict.CAUSE_NAMED}:
        assert revise(replace(named, verdict=verdict), held_out).verdict is verdict


@pytest.mark.parametrize(
    ("after", "score", "proposal"),
    [
        (0.2, 1.0, Proposal.PROPOSED),
        (0.2 * MOST_WORSE * 1.01, 1.0, Proposal.WITHHELD_ERROR),
        (0.2 * MOST_WORSE * 1.01, -1.0, Proposal.WITHHELD_ERROR),
        (0.1, -1.0, Proposal.WITHHELD_LOG_SCORE),
    ],
)
def test_an_extension_that_predicts_worse_is_withheld(
    best: Hypothesis, after: float, score: float, proposal: Proposal
) -> None:
    named = Judgement(verdict=Verdict.CAUSE_NAMED, causes=best.slugs, credible=(best,))
    held_out = HeldOut(rmse_before=0.2, rmse_after=after, log_score_gain=score, forecast_log_score_gain=2.0)
    revised = revise(named, held_out)
    assert revised.proposal is proposal
    assert revised.follow_courses
    assert revise(named, None).proposal is Proposal.PROPOSED
    assert not revise(named, None).follow_courses
    assert revise(replace(named, credible=()), held_out).proposal is Proposal.NONE


@pytest.mark.parametrize("logged", [(), (4500.0,)])
@pytest.mark.parametrize("slug", ["oil_change", "torque_zero_shift", "pressure_offset", "viscous_exponent"])
def test_oil_that_was_warm_may_pass_for_fresh_unless_the_log_says_so(
    given: Study, best: Hypothesis, slug: str, logged: tuple[float, ...]
) -> None:
    facts = replace(given.design.facts, oil_changes=logged)
    imitates = slug in {"torque_zero_shift", "pressure_offset"} or (slug == "oil_change" and not logged)
    imitable = like_temperature(facts)
    assert (slug in imitable) == imitates
    called = replace(best, effects=(BY_SLUG[slug],))
    found = judge([called], 0.0, -5.0, imitable, checks_of(given))
    assert found.causes == ((slug, "oil_temperature") if imitates else (slug,))
    assert found.verdict is (Verdict.CAUSE_AMBIGUOUS if imitates else Verdict.CAUSE_NAMED)
    measured = judge([called], 0.0, -np.inf, frozenset(), checks_of(given))
    assert measured.verdict is Verdict.CAUSE_NAMED


def passing(_: Hypothesis) -> SimpleNamespace:
    return SimpleNamespace(passed=True, excess=-1.0)


def test_a_pair_without_the_best_single_may_be_its_rival(best: Hypothesis) -> None:
    """Two causes nearly as good as one other are its rivals; two of which it is one add to the same explanation."""

    def is_credible(*slugs: str, lead: float) -> bool:
        pair = replace(best, effects=tuple(BY_SLUG[slug] for slug in slugs), evidence=best.evidence - lead)
        pair = replace(pair, evidence=pair.evidence + PriorOdds(slack=0.0)(pair))
        return pair in credible_set(best, [best, pair], PriorOdds(slack=0.0), cast(Checks, passing))

    assert is_credible("oil_temperature", "inertia_torque", lead=CREDIBLE_MARGIN_PAIRS - 0.5)
    assert not is_credible("oil_temperature", "inertia_torque", lead=CREDIBLE_MARGIN + 0.5)
    assert not is_credible(best.slugs[0], "inertia_torque", lead=CREDIBLE_MARGIN_PAIRS - 0.5)


def compared(given: Study, best: Hypothesis, drop: float, structure: float, tolerance: float) -> Comparison:
    return Comparison(
        best_drop=drop, structure=structure, tolerance=tolerance, credible=1, check=checks_of(given)(best)
    )


def test_what_a_loud_vibration_leaves_in_averages_is_not_named_beside_it(given: Study, best: Hypothesis) -> None:
    """A named cause of 15 nats beside a ripple of 300 is the ripple's; one of 60 nats is a cause of its own."""
    estimate = Estimate(name="ripple amplitude", value=0.1, sd=0.01, unit="Nm")
    ripple = RawEvidence(effect="shaft_ripple", log_evidence=300.0, estimate=estimate, note="")
    for nats, causes in ((15.0, ("shaft_ripple",)), (60.0, ("viscous_exponent", "shaft_ripple"))):
        judged = Judgement(
            verdict=Verdict.CAUSE_NAMED,
            causes=("viscous_exponent",),
            comparison=compared(given, best, nats, 0.0, 0.05 * nats),
        )
        found = with_vibrations(judged, (ripple,))
        assert found.verdict is Verdict.CAUSE_NAMED
        assert found.causes == causes


def test_structure_without_a_name_beside_a_vibration_counts_by_its_own_evidence(given: Study, best: Hypothesis) -> None:
    """Beside a ripple of 60 nats, 8 nats without a name are its trace; 91 nats are not, however little of them an effect
    explains."""
    estimate = Estimate(name="ripple amplitude", value=0.1, sd=0.01, unit="Nm")
    ripple = RawEvidence(effect="shaft_ripple", log_evidence=60.0, estimate=estimate, note="")
    for nats, verdict in ((8.0, Verdict.CAUSE_NAMED), (91.0, Verdict.UNEXPLAINED_STRUCTURE)):
        judged = Judgement(
            verdict=Verdict.UNEXPLAINED_STRUCTURE,
            explanations=explanations_of({(UNCATALOGUED,): 1.0}),
            comparison=compared(given, best, 0.03, nats, 0.0),
        )
        found = with_vibrations(judged, (ripple,))
        assert found.verdict is verdict
        assert found.causes == (("shaft_ripple",) if verdict is Verdict.CAUSE_NAMED else ())
