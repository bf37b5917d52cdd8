"""The size of a cause: what the data say of it, whatever course over life is assumed, and what is not offered."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis import criteria
from models.diagnosis.criteria import DRAWS, SIGN_UNDETERMINED, SIZES_SAMPLED
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.explanations.amplitude_posterior import Proportional
from models.diagnosis.explanations.sizes import _size
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.report.report import Report
from tests.models.diagnosis.campaigns import Where, campaign, look, rehearsal


@pytest.fixture(scope="module")
def creeping() -> Report:
    return look(rehearsal(7, {"pressure_offset": 0.5}, dynamic=False, tests=12), 0)


def loud(at: Where) -> np.ndarray:
    """A zero that stationary tests alone tell."""
    return np.full_like(at.velocity, 1.5 if at.cycles > 4000 else 0.0)


@pytest.fixture(scope="module")
def shifted() -> Report:
    return look(campaign(7, loud, loops=False))


@pytest.mark.slow
def test_an_offset_whose_sign_depends_on_the_course_assumed_is_no_adoption(creeping: Report) -> None:
    assert "pressure_offset" in creeping.causes
    assert creeping.verdict is Verdict.CAUSE_AMBIGUOUS
    assert creeping.extension is None
    assert creeping.not_adoptable in creeping.summary
    estimate = next(each for each in creeping.candidates if each.effect == "pressure_offset").estimate
    low, high = estimate.interval
    assert low < 0.0 < 0.35 < high


def test_where_nothing_of_a_size_may_be_left_its_sign_is_not_determined() -> None:
    """Samples whose form leaves nothing of it after the last state have no sign."""
    tenth = SIZES_SAMPLED // 10
    assert _size(np.repeat([0.0, 4.4], [3 * tenth, 7 * tenth])).other_sign == pytest.approx(0.3)
    assert _size(np.repeat([-1.0, 4.4], [tenth, 9 * tenth])).other_sign == pytest.approx(0.1)
    assert _size(np.full(10 * tenth, 4.4)).other_sign == 0.0


def test_a_zero_whose_sign_is_known_is_offered_by_draws_that_carry_only_what_the_report_names(shifted: Report) -> None:
    assert shifted.causes == ("torque_zero_shift",)
    assert shifted.extension is not None
    assert shifted.not_adoptable == ""
    estimate = next(each for each in shifted.candidates if each.effect == "torque_zero_shift").estimate
    low, high = estimate.interval
    assert 0.0 < low < estimate.value < high
    # draws weigh one and carry only what the report names
    assert shifted.extension.weights.size <= DRAWS
    assert shifted.extension.weights.sum() == pytest.approx(1.0)
    assert set(shifted.extension.effects) == set(shifted.causes)
    at_work = sum(each.probability for each in shifted.explanations if set(shifted.causes) <= set(each.effects))
    assert at_work > 0.98  # alone, or with something beside it: no draw has nothing to take off
    assert all(draw["effects"] for draw in shifted.extension.content["draws"])
    sizes = [effect["amplitude"] for draw in shifted.extension.content["draws"] for effect in draw["effects"]]
    assert len(set(sizes)) > DRAWS // 2
    assert np.mean(np.array(sizes) < 0) <= SIGN_UNDETERMINED


def test_what_another_form_would_call_a_size_widens_what_is_stated_and_not_what_is_adopted(shifted, monkeypatch):
    monkeypatch.setattr(criteria, "SIZE_FORM", 0.3)
    wide = look(campaign(7, loud, loops=False))
    stated, wider = (
        next(each for each in report.candidates if each.effect == "torque_zero_shift").estimate
        for report in (shifted, wide)
    )
    assert wider.sd > 1.5 * stated.sd
    assert wide.extension.content == shifted.extension.content


# --- Amplitudes to which shapes and templates' errors are in proportion, beside a dense sum and what is jointly normal.

#: Rows of which an amplitude and what is in proportion to it change these [Nm], 1 Nm noise; fitted at an amplitude of 2.
FORM, OFF = np.linspace(1.0, 2.0, 30), np.linspace(0.0, 3.0, 30) ** 2
FITTED = FittedEffect(effect=BY_SLUG["oil_change"], amplitude=2.0, shape=(0.0, 0.0, 0.0))


def given(sd: float, residual: np.ndarray, fitted: FittedEffect = FITTED) -> Proportional:
    columns = np.stack([FORM, fitted.amplitude * OFF], axis=1)
    return Proportional(
        info=columns.T @ columns,
        score=columns.T @ residual,
        sd=np.array([np.inf, sd]),
        of=np.array([0, 0]),
        effects=(fitted,),
    )


def dense(sd: float, residual: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes and their density where what is in proportion is as it is likeliest, from the rows themselves."""
    amplitudes, errors = np.linspace(-1.0, 5.0, 601), np.linspace(-6.0, 6.0, 601) * sd
    model = amplitudes[:, None, None] * (FORM + errors[:, None] * OFF)
    off = residual + FITTED.amplitude * FORM - model
    logs = -0.5 * np.square(off).sum(axis=2) - 0.5 * np.square(errors / sd)
    parts = np.exp(logs.max(axis=1) - logs.max())
    return amplitudes, parts / parts.sum()


@pytest.mark.parametrize("sd", [0.02, 0.3])
def test_amplitudes_have_the_density_of_a_dense_sum(sd: float) -> None:
    residual = np.random.default_rng(3).standard_normal(FORM.size) + 0.2 * FORM
    amplitudes, density = dense(sd, residual)
    found = FITTED.amplitude + np.concatenate(list(given(sd, residual).amplitudes(400, np.random.default_rng(0))))
    expected = np.interp((0.05, 0.5, 0.95), np.cumsum(density), amplitudes)
    np.testing.assert_allclose(np.quantile(found, (0.05, 0.5, 0.95)), expected, atol=0.02)


@pytest.mark.parametrize("residual", [0.0, 0.2])
def test_where_an_amplitude_is_well_determined_the_integral_is_that_of_a_normal(residual: float) -> None:
    at_work = given(0.01, residual * FORM)
    whole = at_work.info + np.diag([0.0, 0.01**-2.0])
    normal = 0.5 * at_work.score @ np.linalg.solve(whole, at_work.score) - 0.5 * np.linalg.slogdet(whole)[1]
    assert at_work.log_integral() == pytest.approx(normal - np.log(0.01), abs=0.05)


def test_an_effect_does_not_vanish_while_what_is_in_proportion_to_it_explains_the_data() -> None:
    """A shape that only scales the effect, by 1 ± 0.5: as jointly normal, an amplitude of 2 would be 2 ± 1."""
    columns = np.stack([FORM, FITTED.amplitude * FORM], axis=1)
    at_work = replace(given(0.5, np.zeros(FORM.size)), info=columns.T @ columns)
    normal = np.linalg.inv(at_work.info + np.diag([0.0, 0.5**-2.0]))
    assert normal[0, 0] ** 0.5 == pytest.approx(1.0, abs=0.02)
    found = FITTED.amplitude + np.concatenate(list(at_work.amplitudes(1000, np.random.default_rng(0))))
    assert np.mean(np.abs(found) < 0.5) < 0.002  # 0.06 of a normal


@pytest.mark.parametrize("below", [0.5, 3.0, 7.9, 7.99999, 30.0])
def test_what_falls_off_from_no_effect_at_all_is_integrated(below: float) -> None:
    """Of a drag whose data ask for so many deviations less than none."""
    drag = replace(FITTED, effect=BY_SLUG["hydrodynamic_drag"], shape=(1.0, 0.0, 0.0, 0.0, 0.0))
    deviation = float(FORM @ FORM) ** -0.5
    at_work = given(1e-4, -(drag.amplitude + below * deviation) * FORM, drag)
    steps = -drag.amplitude + np.linspace(0.0, 10.0 * deviation, 200001)
    logs = at_work.score[0] * steps - 0.5 * at_work.info[0, 0] * np.square(steps)
    dense = np.log(np.exp(logs - logs[0]).sum() * (steps[1] - steps[0])) + logs[0] - 0.5 * np.log(2 * np.pi)
    assert at_work.log_integral() == pytest.approx(dense, abs=0.2)
    drawn = [drag.amplitude + step[0] for step in at_work.amplitudes(50, np.random.default_rng(0))]
    assert all(0.0 <= amplitude < 8.0 * deviation for amplitude in drawn)
