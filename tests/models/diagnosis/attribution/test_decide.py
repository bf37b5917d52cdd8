"""What stands between evidence and a name: structure that has none, a remainder that is an oddity, a probability."""

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from models.arrays import FloatArray
from models.diagnosis.attribution import decide
from models.diagnosis.attribution.decide import Closing, Judgement
from models.diagnosis.attribution.evidence import Hypothesis, null_of, refitted
from models.diagnosis.detection.view import View
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.pooled_fit.projection import GAINS, gram_of, project
from models.diagnosis.report.report import Verdict
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
    known = given.baseline
    null = null_of(given.design, known.noise, known.priors, known.fit)
    effects = given.extended(("unsettled_dwell", 0.05, (0.0, 0.5))).effects
    return refitted(given.design, known.noise, known.priors, null, known.fit.laws, effects, 0.0, (0.0, 0.0))


@pytest.fixture
def judged(given: Study, best: Hypothesis) -> Judge:
    def judged(structure: float = 0.0) -> Judgement:
        known, rng = given.baseline, np.random.default_rng(1)
        return decide.judge(given.design, known.noise, known.priors, [best], structure, -np.inf, rng)

    return judged


def test_structure_without_a_name_must_lead_by_the_price_of_the_axes(judged: Judge, best: Hypothesis) -> None:
    beyond = decide.AXES_PRICE + decide.GENERIC * max(best.drop - decide.CLEAR, 0.0)
    assert best.evidence > 5.0
    assert judged(0.0).verdict is Verdict.CAUSE_NAMED
    assert judged(best.evidence + beyond - 0.1).verdict is not Verdict.UNEXPLAINED_STRUCTURE
    assert judged(best.evidence + beyond + 0.1).verdict is Verdict.UNEXPLAINED_STRUCTURE


def test_a_cause_is_named_from_its_own_probability_on(judged: Judge, best: Hypothesis) -> None:
    """Where structure comes near it, the cause stands alone but is no longer named."""
    told = {lead: judged(best.evidence - lead) for lead in np.arange(0.0, 12.0, 0.5)}
    for each in told.values():
        named = each.probabilities["unsettled_dwell"] >= decide.LEAST_NAMED
        assert each.causes == ("unsettled_dwell",)
        assert each.verdict is (Verdict.CAUSE_NAMED if named else Verdict.CAUSE_AMBIGUOUS)
    assert len({each.verdict for each in told.values()}) == 2


@pytest.mark.parametrize(("p_value", "expected"), [(0.06, Verdict.CAUSE_NAMED), (1e-4, Verdict.CAUSE_AMBIGUOUS)])
def test_a_cause_that_leaves_an_oddity_is_not_named(
    judged: Judge, monkeypatch: pytest.MonkeyPatch, p_value: float, expected: Verdict
) -> None:
    close = decide.close

    def odd(*arguments: object) -> Closing:
        closing = close(*arguments)  # type: ignore[arg-type] # handed on as they are
        return replace(closing, statistics={**closing.statistics, "closure_p_value": p_value})

    monkeypatch.setattr(decide, "close", odd)
    assert judged().verdict is expected


@pytest.mark.parametrize(
    ("slugs", "p_value", "expected"),
    [
        (("unsettled_dwell", "inertia_torque"), 1e-3, Verdict.CAUSE_AMBIGUOUS),
        (("unsettled_dwell", "inertia_torque"), 0.5, Verdict.CAUSE_NAMED),
        (("unsettled_dwell",), 1e-3, Verdict.CAUSE_NAMED),
    ],
)
def test_two_causes_must_agree_in_their_parts_to_be_named(
    given: Study,
    best: Hypothesis,
    monkeypatch: pytest.MonkeyPatch,
    slugs: tuple[str, ...],
    p_value: float,
    expected: Verdict,
) -> None:
    """Parts may differ by what one template errs by; two templates could share a misfit between them."""
    close, known = decide.close, given.baseline

    def uneven(*arguments: object) -> Closing:
        closing = close(*arguments)  # type: ignore[arg-type] # handed on as they are
        return replace(closing, statistics={**closing.statistics, "closure_p_value": 0.9, "parts_p_value": p_value})

    monkeypatch.setattr(decide, "close", uneven)
    told = replace(best, effects=tuple(BY_SLUG[slug] for slug in slugs), evidence=best.evidence + 40.0)
    among = [told, best] if len(slugs) > 1 else [told]
    found = decide.judge(given.design, known.noise, known.priors, among, 0.0, -np.inf, np.random.default_rng(1))
    assert found.standing == (told,)
    assert found.verdict is expected


@pytest.mark.parametrize(("p_value", "expected"), [(0.01, Verdict.CAUSE_NAMED), (1e-4, Verdict.CAUSE_AMBIGUOUS)])
def test_however_loud_a_cause_is_it_may_leave_a_little_only(
    given: Study, best: Hypothesis, monkeypatch: pytest.MonkeyPatch, p_value: float, expected: Verdict
) -> None:
    """Of a thousand nats a template may be wrong by fifty; what is named leaves no more than three."""
    close, known = decide.close, given.baseline

    def odd(*arguments: object) -> Closing:
        closing = close(*arguments)  # type: ignore[arg-type] # handed on as they are
        return replace(closing, statistics={**closing.statistics, "closure_p_value": p_value})

    monkeypatch.setattr(decide, "close", odd)
    loud, rng = replace(best, evidence=1000.0, drop=1000.0), np.random.default_rng(1)
    found = decide.judge(given.design, known.noise, known.priors, [loud], 0.0, -np.inf, rng)
    assert found.verdict is expected


def test_gains_that_scatter_much_are_less_likely_than_those_that_hardly_do(given: Study) -> None:
    """Without any run to tell them, their prior is left: narrower above the usual scatter than below."""
    known = given.baseline
    gram = gram_of(given.design, known.noise, known.priors, known.fit, np.zeros((given.design.torque.size, 0)))
    untold = replace(gram, along=0.0 * gram.along, squares=0.0 * gram.squares)
    evidence = np.array([project(untold, float(gain), 0.0).evidence for gain in GAINS])
    below, usual, above = np.interp(np.log([0.0025 / 4, 0.0025, 0.0025 * 4]), np.log(GAINS), evidence)
    assert above < below - 1.0 < usual
    assert above > usual - 5.0  # unlikely, not impossible


@pytest.mark.parametrize(
    ("slugs", "uneven", "expected"),
    [
        (("oil_change", "running_in"), decide.UNEASY / 2, Verdict.CAUSE_AMBIGUOUS),
        (("oil_change", "running_in"), decide.UNEASY * 2, Verdict.CAUSE_NAMED),
        (("oil_change",), decide.UNEASY / 2, Verdict.CAUSE_NAMED),
    ],
)
def test_two_causes_of_other_sizes_in_parts_stand_and_are_not_named(
    slugs: tuple[str, ...], uneven: float, expected: Verdict
) -> None:
    standing = Hypothesis(effects=tuple(BY_SLUG[slug] for slug in slugs), evidence=30.0, drop=40.0, fit=None)
    named = Judgement(
        verdict=Verdict.CAUSE_NAMED, causes=slugs, standing=(standing,), statistics={"parts_p_value": uneven}
    )
    assert named.unsure() == replace(named, verdict=expected)
    for told in set(Verdict) - {Verdict.CAUSE_NAMED}:
        assert replace(named, verdict=told).unsure().verdict is told


@pytest.mark.parametrize("logged", [(), (4500.0,)])
@pytest.mark.parametrize("slug", ["oil_change", "torque_zero_shift", "pressure_offset", "viscous_exponent"])
def test_oil_that_was_warm_may_pass_for_fresh_unless_the_log_says_so(
    given: Study, best: Hypothesis, slug: str, logged: tuple[float, ...]
) -> None:
    design, known = replace(given.design, facts=replace(given.design.facts, oil_changes=logged)), given.baseline
    imitates = slug in decide.LIKE_TEMPERATURE or (slug == "oil_change" and not logged)
    assert (slug in decide.like_temperature(design)) == imitates
    called, rng = replace(best, effects=(BY_SLUG[slug],)), np.random.default_rng(1)
    found = decide.judge(design, known.noise, known.priors, [called], 0.0, -5.0, rng)
    assert found.causes == ((slug, "oil_temperature") if imitates else (slug,))
    assert found.verdict is (Verdict.CAUSE_AMBIGUOUS if imitates else Verdict.CAUSE_NAMED)
    measured = decide.judge(design, known.noise, known.priors, [called], 0.0, -np.inf, rng)
    assert measured.verdict is Verdict.CAUSE_NAMED


def test_a_pair_without_the_best_single_may_stand_beside_it(best: Hypothesis) -> None:
    """Two causes nearly as good as one other are its rivals; two of which it is one tell its own story at length."""

    def closed(_: Hypothesis) -> Closing:
        return Closing(closed=True, excess=-1.0, view=cast(View, None), statistics={})

    def price(each: Hypothesis) -> float:
        return decide.PAIR_PRICE * (len(each.effects) - 1)

    def stands(*slugs: str, lead: float) -> bool:
        pair = replace(
            best, effects=tuple(BY_SLUG[slug] for slug in slugs), evidence=best.evidence + decide.PAIR_PRICE - lead
        )
        return pair in decide._standing(best, [best, pair], [best], price, cast(decide._Tested, closed))

    assert stands("oil_temperature", "inertia_torque", lead=decide.CLOSE_PAIRS - 0.5)
    assert not stands("oil_temperature", "inertia_torque", lead=decide.CLOSE + 0.5)
    assert not stands(best.slugs[0], "inertia_torque", lead=decide.CLOSE_PAIRS - 0.5)
