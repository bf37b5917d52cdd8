"""What the report makes of a judgement: two causes that foretell badly, and are not one everywhere, are not named."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.attribution.decide import Judgement
from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.detection.view import view_of
from models.diagnosis.report import assemble
from models.diagnosis.report.report import Gain, Report, Verdict
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
def test_two_causes_that_foretell_worse_than_none_are_not_named(
    given: Study,
    monkeypatch: pytest.MonkeyPatch,
    effects: tuple[tuple[str, float, tuple[float, ...]], ...],
    gain: Gain | None,
    verdict: Verdict,
) -> None:
    monkeypatch.setattr(assemble, "measure_gain", lambda *_: gain)
    monkeypatch.setattr(assemble, "advise", lambda *_: ())
    known, fit = given.baseline, given.extended(*effects)
    view = view_of(given.design, known.noise, known.priors, known.fit, [])
    standing = Hypothesis(effects=tuple(each.effect for each in fit.effects), evidence=30.0, drop=40.0, fit=fit)
    judgement = Judgement(
        verdict=Verdict.CAUSE_NAMED,
        causes=standing.slugs,
        standing=(standing,),
        view=view,
        probabilities=dict.fromkeys(standing.slugs, 0.9),
        statistics={"parts_p_value": 0.001},
    )
    report: Report = assemble.report_of(
        given.campaign, given.design, known.noise, known.priors, view, judgement, [standing], None, (), {}, (),
        np.random.default_rng(1),
    )  # fmt: skip
    assert report.verdict is verdict
    assert report.causes == standing.slugs
    assert ("something else may be at work too" in report.summary) == (verdict is Verdict.CAUSE_AMBIGUOUS)


def test_why_an_extension_is_not_proposed_is_told_by_what_went_wrong() -> None:
    missed = replace(GAIN, rmse_after=1.1 * GAIN.rmse_before)
    assert "missed by more with it" in assemble.withheld(missed)
    unlikely = replace(GAIN, rmse_after=0.9 * GAIN.rmse_before, log_score_gain=-825.0)
    assert "less probable with it than without, by 825 nats" in assemble.withheld(unlikely)
