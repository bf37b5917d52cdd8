"""What `clutchlife simulate` writes, diagnosed: nothing is found where nothing is hidden."""

import numpy as np
import pytest

from models.diagnosis.diagnose import diagnose
from models.diagnosis.explanations.verdict import Verdict
from tests.models.diagnosis.rehearsals import rehearsal


@pytest.mark.slow
def test_a_plain_simulated_campaign_is_adequate() -> None:
    """It was diagnosed `squeeze film`, the simulator's own, and its clutch was out of specification."""
    report = diagnose(rehearsal(7, tests=8), rng=np.random.default_rng(1))
    assert report.verdict is Verdict.MODEL_ADEQUATE
    assert report.explanations[0].effects == ()
    # the control: with its film it is not
    film = diagnose(rehearsal(7, {"squeeze_film": 0.1}, tests=4), rng=np.random.default_rng(1))
    assert film.verdict is not Verdict.MODEL_ADEQUATE


@pytest.mark.slow
def test_nine_of_ten_plain_campaigns_are_adequate() -> None:
    verdicts = [diagnose(rehearsal(seed), rng=np.random.default_rng(seed)).verdict for seed in range(10)]
    assert verdicts.count(Verdict.MODEL_ADEQUATE) >= 9


def test_a_loud_heating_is_named_though_its_screen_leads_to_a_slow_one() -> None:
    report = diagnose(rehearsal(5, {"interface_heating": 15.0}, dynamic=False, tests=6), rng=np.random.default_rng(1))
    assert (report.verdict, report.causes) == (Verdict.CAUSE_NAMED, ("interface_heating",))
    assert report.candidates[0].estimate.value == pytest.approx(14.0, abs=2.5)
