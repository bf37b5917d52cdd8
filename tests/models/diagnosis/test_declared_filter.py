"""The torque channel's own low-pass: named as a delay where it is not declared, taken off and not discovered where it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.diagnosis.campaign import Campaign
from models.diagnosis.explanations.verdict import Verdict
from models.records.runs import Record
from models.records.torque_filter import filtered_as_torque
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.test_diagnose import look
from tests.support import one_quick

SLUG = "channel_delay"
#: Time constant of the hidden filter [s].
FILTER = 0.04


def behind(record: Record) -> Record:
    """Torque behind the filter, by scipy on a clock ten times as fine; the sensor's noise, too."""
    step = float(record.time[1] - record.time[0]) / 10
    fine = np.arange(record.time[0], record.time[-1] + step, step)
    kept = np.exp(-step / FILTER)
    torque = np.interp(fine, record.time, record.torque)
    late = lfilter([1 - kept], [1, -kept], torque, zi=[kept * torque[0]])[0]
    return replace(record, torque=np.interp(record.time, fine, late))


def hidden(seed: int, declared: float) -> Campaign:
    """A campaign whose dynamic tests are behind the filter, of which so much [s] is declared."""
    given = campaign(seed)
    tests = tuple(replace(run, record=filtered_as_torque(behind(run.record), declared)) for run in given.dynamic)
    return replace(given, dynamic=tests)


@pytest.mark.parametrize("seed", one_quick([1, 2, 7]))
def test_a_filter_is_named_undeclared_and_not_declared(seed: int) -> None:
    undeclared = look(hidden(seed, 0.0))
    assert undeclared.causes == (SLUG,)
    estimate = undeclared.candidates[0].estimate
    assert estimate.value == pytest.approx(1000 * FILTER, abs=4 * estimate.sd)
    assert look(hidden(seed, FILTER)).verdict is Verdict.MODEL_ADEQUATE


@pytest.mark.slow
def test_what_is_left_beyond_the_declared_filter_is_what_is_found() -> None:
    report = look(hidden(7, 0.5 * FILTER))
    assert report.causes == (SLUG,)
    estimate = report.candidates[0].estimate
    assert estimate.value == pytest.approx(500 * FILTER, abs=4 * estimate.sd)
