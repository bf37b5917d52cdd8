"""What an oil temperature that nobody measured may account for: its own doing, and not what gains do as well."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign, EventKind, MaintenanceEvent
from models.diagnosis.diagnose import diagnose
from models.diagnosis.explanations.shapeless import temperature_evidence
from tests.models.diagnosis.campaigns import Where, campaign
from tests.models.diagnosis.fitted import study, warmth


def fresh(at: Where) -> np.ndarray:
    """From cycle 4000 on the viscous term is a fifth less."""
    return -0.2 * (at.cycles > 4000.0) * at.parameters.viscous_coefficient * at.velocity**0.3


def logged(given: Campaign) -> Campaign:
    return replace(given, maintenance=(MaintenanceEvent(run_id="oil", cycles=4000.0, event=EventKind.OIL_CHANGE),))


@pytest.mark.slow
def test_a_logged_oil_change_is_likelier_than_a_temperature_that_nobody_measured() -> None:
    """One step at the cycle of the log against a course of its own for every test: each is possible, one is simple."""
    report = diagnose(logged(campaign(5, fresh, temperature=False)), rng=np.random.default_rng(0))
    assert "oil_change" in report.causes
    gained = {each.effect: each.log_evidence_gain for each in report.candidates}
    assert gained["oil_change"] > gained.get("oil_temperature", 0.0) + 5.0
    assert report.candidates[0].effect == "oil_change"
    assert report.candidates[0].probability > 0.6


def test_gains_that_scatter_are_no_evidence_of_a_temperature() -> None:
    """Whatever size of them the noise was given; the control: a temperature is."""
    given = study(campaign(5, temperature=False, gain=0.005))
    for size in (2e-4, given.problem.noise.run_gain):
        problem = given.problem.with_noise(replace(given.problem.noise, run_gain=size))
        assert temperature_evidence(problem, given.baseline.fit) < 3.0
    warm = study(campaign(5, warmth, temperature=False, gain=0.005))
    assert temperature_evidence(warm.problem, warm.baseline.fit) > 10.0
