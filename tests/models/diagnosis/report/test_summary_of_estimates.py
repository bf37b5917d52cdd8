"""The paragraph: how the size of an effect is written, whatever it is."""

import re
from dataclasses import replace

import numpy as np

from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.fitted_effect import Estimate
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.report.summary import summarise
from tests.models.diagnosis.report.test_summary import findings


def test_any_amplitude_can_be_written():
    rng = np.random.default_rng(7)
    found = findings(Verdict.CAUSE_NAMED, "oil_change")
    for _ in range(300):
        value, sd = rng.choice([-1, 1]) * 10 ** rng.uniform(-12, 12), 10 ** rng.uniform(-12, 12)
        estimate = Estimate(name="step of C_v", value=value, sd=float(rng.choice([0.0, sd])), unit="%")
        said = summarise(replace(found, candidates=(replace(found.candidates[0], estimate=estimate),)))
        told = re.search(r"step of C_v (-?[\d.,e+-]+)", said.replace("−", "-"))
        assert told is not None
        number = float(told.group(1).replace(",", "").rstrip("."))
        assert abs(number - value) <= max(0.006 * abs(value), 0.06 * estimate.sd)


def test_a_torque_that_is_ahead_is_not_called_delayed():
    found = findings(Verdict.CAUSE_NAMED, "channel_delay")
    ahead = replace(found.candidates[0], estimate=replace(found.candidates[0].estimate, value=-0.012, sd=0.002))
    said = summarise(replace(found, candidates=(ahead,)))
    assert "Torque is ahead of the speed" in said
    assert "−0.0120 ± 0.0020" in said
    assert BY_SLUG["channel_delay"].physics not in said
    late = summarise(found)
    assert BY_SLUG["channel_delay"].physics in late
    assert "ahead" not in late
    other = findings(Verdict.CAUSE_NAMED, "torque_zero_shift")
    below = replace(other.candidates[0], estimate=replace(other.candidates[0].estimate, value=-0.4))
    assert BY_SLUG["torque_zero_shift"].physics in summarise(replace(other, candidates=(below,)))
