"""What the report makes of a judgement: it repeats the verdict, and says why an extension is withheld."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.attribution.check import Checks
from models.diagnosis.attribution.decide import revise
from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.attribution.explanations import explanations_of
from models.diagnosis.attribution.investigate import Investigation
from models.diagnosis.attribution.search import SearchResult
from models.diagnosis.attribution.sizes import Size, Sizes, sizes_of
from models.diagnosis.attribution.verdict import Comparison, Judgement, Proposal, Verdict
from models.diagnosis.detection.alarm import alarms_of
from models.diagnosis.detection.projected_fit import project_fit
from models.diagnosis.report.assemble import report_of
from models.diagnosis.report.proposed_extension import reason_against
from models.diagnosis.validation.extended_model import Validation
from models.diagnosis.validation.held_out import Gain
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, study
from tests.models.diagnosis.report.test_summary import GAIN
from tests.models.diagnosis.test_diagnose import late

PLANTED = ("unsettled_dwell", 0.1, (0.0, 0.5))
BESIDE = ("viscous_exponent", 0.01, ())
WORSE = replace(GAIN, log_score_gain=-1.0)


@pytest.fixture(scope="module")
def given() -> Study:
    return study(campaign(4, late, cycles=(0.0, 3000.0), loops=False))


@pytest.mark.parametrize(
    ("effects", "gain", "verdict"),
    [
        ((PLANTED, BESIDE), WORSE, Verdict.CAUSE_AMBIGUOUS),
        ((PLANTED, BESIDE), GAIN, Verdict.CAUSE_NAMED),
        ((PLANTED, BESIDE), None, Verdict.CAUSE_NAMED),
        ((PLANTED,), WORSE, Verdict.CAUSE_NAMED),
    ],
)
def test_two_causes_that_predict_worse_than_none_are_not_named(
    given: Study,
    effects: tuple[tuple[str, float, tuple[float, ...]], ...],
    gain: Gain | None,
    verdict: Verdict,
) -> None:
    problem, fit, rng = given.problem, given.extended(*effects), np.random.default_rng(1)
    projected = project_fit(problem, given.baseline.fit)
    hypothesis = Hypothesis(effects=tuple(each.effect for each in fit.effects), evidence=30.0, drop=40.0, fit=fit)
    made = Checks(problem, rng)(hypothesis)
    check = replace(made, parts=replace(made.parts, p_value=0.001))
    judgement = Judgement(
        verdict=Verdict.CAUSE_NAMED,
        causes=hypothesis.slugs,
        credible=(hypothesis,),
        explanations=explanations_of({hypothesis.slugs: 0.9, (): 0.1}),
        comparison=Comparison(best_drop=40.0, structure=0.0, tolerance=2.0, credible=1, check=check),
    )
    investigation = Investigation(
        baseline=given.baseline,
        projected=projected,
        alarms=alarms_of(problem, projected, rng),
        search=SearchResult(problem=problem, hypotheses=(hypothesis,)),
        raw=(),
        where=(),
    )
    validation = Validation(extended=fit, gain=gain)
    revised = revise(judgement, validation.held_out)
    report = report_of(investigation, revised, validation, sizes_of(problem, revised, rng), ())
    assert report.verdict is verdict
    assert (report.causes == hypothesis.slugs) == (verdict is Verdict.CAUSE_NAMED)
    assert set(hypothesis.slugs) <= set(report.causes)
    beside = "together with something that is not in the catalogue" in report.summary
    assert beside == (verdict is Verdict.CAUSE_AMBIGUOUS)
    # of the second cause a hundredth was planted, of which these data do not even know the sign
    unsure = [] if gain is WORSE or len(effects) == 1 else ["do not determine the size of viscous exponent"]
    assert (report.extension is None) == (gain is WORSE or bool(unsure))
    assert all(reason in report.not_adoptable for reason in unsure)
    assert report.statistics["lambda"] == 40.0
    assert report.statistics["parts_p_value"] == 0.001


def test_why_an_extension_is_not_proposed_is_said() -> None:
    none = Sizes(by_slug={})
    assert "error on held-out runs is larger" in reason_against(Proposal.WITHHELD_ERROR, GAIN, none)
    unlikely = replace(GAIN, log_score_gain=-825.0)
    said = reason_against(Proposal.WITHHELD_LOG_SCORE, unlikely, none)
    assert "less likely with it than without" in said
    assert "nats" not in said
    assert reason_against(Proposal.PROPOSED, GAIN, none) == ""
    assert reason_against(Proposal.NONE, None, none) == ""
    either = Size(value=1e4, sd=2e4, interval=(-2e4, 4e4), other_sign=0.3, courses=True)
    said = reason_against(Proposal.PROPOSED, GAIN, Sizes(by_slug={"pressure_offset": either}))
    assert "size of pressure offset (−0.2 to 0.4 bar): it depends on the course" in said
    sure = replace(either, interval=(1e4, 4e4), other_sign=0.001)
    assert reason_against(Proposal.PROPOSED, GAIN, Sizes(by_slug={"pressure_offset": sure})) == ""
