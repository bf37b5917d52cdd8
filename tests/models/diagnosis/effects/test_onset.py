"""What is wrong from some state on is named by what it is, and not by the one effect that has a step."""

import numpy as np
import pytest

from models.diagnosis.design.design import build_design
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import FROM_THE_START
from models.diagnosis.effects.faults import FAULT_BY_SLUG
from models.diagnosis.explanations.posterior import posterior_of
from models.diagnosis.explanations.verdict import Alternative
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from models.friction.stribeck import GAMMA
from tests.models.diagnosis.campaigns import Where, campaign
from tests.models.diagnosis.fitted import study
from tests.models.diagnosis.test_diagnose import look

ONSET = 4000.0


def dragging(at: Where) -> np.ndarray:
    """0.8 Nm of drag in mid speed from cycle 4000 on, a little more than linear in speed."""
    return np.where(at.cycles > ONSET, 0.13 * at.velocity**1.1, 0.0)


def losing_pulses(at: Where) -> np.ndarray:
    """From cycle 4000 on the shaft turns a quarter faster than the encoder says."""
    m_s, m_c, v_s, c_v = (
        getattr(at.parameters, name)
        for name in ("static_torque", "coulomb_ratio", "stribeck_velocity", "viscous_coefficient")
    )

    def torque(v: np.ndarray) -> np.ndarray:
        return m_s * (1 + (m_c - 1) * np.exp(-v_s / v)) + c_v * v**GAMMA

    return np.where(at.cycles > ONSET, torque(1.25 * at.velocity) - torque(at.velocity), 0.0)


@pytest.mark.parametrize(
    ("planted", "wanted"),
    [(dragging, Alternative(("hydrodynamic_drag",))), (losing_pulses, Alternative((), "speed_scale_step"))],
)
def test_what_begins_at_a_state_is_no_oil_change(planted, wanted: Alternative) -> None:
    found = posterior_of(fit_baseline(build_design(campaign(7, planted, loops=False))), ())
    assert next(iter(found.probabilities)) == wanted
    assert sum(share for each, share in found.probabilities.items() if "oil_change" in each.causes) < 0.1
    if wanted.causes:
        assert found.nodes[wanted].fit.effects[0].shape[-1] > 0.0


def test_the_paragraph_says_from_when_on_an_effect_is_at_work() -> None:
    report = look(campaign(7, dragging, loops=False))
    assert report.causes == ("hydrodynamic_drag",)
    assert "Drag in mid speed (from about " in report.summary
    assert report.extension is not None
    (onset,) = {effect["shape"][-1] for draw in report.extension.content["draws"] for effect in draw["effects"]}
    assert f"(from about {onset:,.0f} cycles on)" in report.summary


@pytest.mark.parametrize("slug", ["hydrodynamic_drag", "squeeze_film", "gain_with_clock"])
def test_an_effect_is_as_likely_at_work_from_the_start_as_from_a_state_on(slug: str) -> None:
    given = study(campaign(7, loops=False))
    grid = (BY_SLUG | FAULT_BY_SLUG)[slug].grid(given.problem.design.facts)
    shares = [np.exp([t.log_weight for t in grid if (t.shape[-1] > 0) is later]).sum() for later in (False, True)]
    assert shares[0] == pytest.approx(shares[1])


def test_an_extension_that_was_stored_without_an_onset_is_at_work_from_the_start() -> None:
    given = study(campaign(7, loops=False))
    effect, scene = BY_SLUG["hydrodynamic_drag"], given.baseline.fit.prediction.scene
    before = (1.0, 0.0, 0.0, 0.0)
    assert not effect.lags(before)
    assert np.array_equal(effect.change(scene, 1.0, before), effect.change(scene, 1.0, (*before, FROM_THE_START)))
