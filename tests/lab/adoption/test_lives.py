"""Lives that go on after what was measured."""

from dataclasses import replace

import httpx2
import numpy as np
import pytest

from tests.lab.adoption import trials
from tests.lab.blind.rig.hide import hide
from tests.lab.blind.rig.plan import RADIUS, RPM
from tests.lab.blind.rig.world import read

SECONDS = (5, 31)


@pytest.mark.slow
def test_the_true_course_is_that_of_what_is_measured() -> None:
    """Mean torque over pressure at the states, computed from noise-free readings on the reference's own grid."""
    hidden = hide(SECONDS, ("running_in",), 50.0, loops=False, full=True)
    site = hidden.plan.sites[0]
    torque = read(hidden.plan, hidden.clutch, hidden.effects)[0]
    seen = (torque / site.bar).mean(axis=1)
    course = trials.mean_cof(hidden, hidden.plan.life.cycles)
    np.testing.assert_allclose(course / course[0], seen / seen[0], rtol=2e-3)
    bare = trials.mean_cof(replace(hidden, effects=()), hidden.plan.life.cycles)
    assert np.abs(bare / bare[0] - seen / seen[0]).max() > 5e-3  # the effect is in it


def test_an_artefact_moves_no_life() -> None:
    hidden = hide(SECONDS, ("oil_temperature",), 50.0, loops=False)
    cycles = np.linspace(0, 2 * hidden.plan.life.span, 7)
    bare = trials.mean_cof(replace(hidden, effects=()), cycles)
    np.testing.assert_array_equal(trials.mean_cof(hidden, cycles), bare)
    law = hidden.clutch.law(hidden.plan.pressures[:, None], np.array(cycles[-1]))
    torque = law.torque(np.linspace(20, 1970, 40) * RPM * RADIUS)
    assert bare[-1] == pytest.approx((torque / hidden.plan.pressures[:, None]).mean(), rel=1e-12)


def test_an_end_is_the_first_time_that_its_share_is_passed() -> None:
    hidden = hide(SECONDS, loops=False)
    end = 2 * hidden.plan.life.span
    share = trials.passed_at(hidden, end)
    assert share is not None
    cycles = np.linspace(0, 2 * end, 4001)
    course = trials.mean_cof(hidden, cycles)
    first = cycles[np.flatnonzero(course <= share * course[0])[0]]
    assert first == pytest.approx(end, abs=2 * cycles[1])
    growing = replace(hidden, clutch=replace(hidden.clutch, theta=np.abs(hidden.clutch.theta)))
    assert trials.passed_at(growing, end) is None  # it never falls


def test_a_busy_service_is_asked_again() -> None:
    """As it may be beside other work, the adoption among all that is asked."""
    answers = [httpx2.Response(503, headers={"Retry-After": "0"}), httpx2.Response(200, json={"version": 1})]
    transport = httpx2.MockTransport(lambda _: answers.pop(0))
    with httpx2.Client(base_url="http://127.0.0.1", transport=transport) as http:
        assert trials.asked(http, "PUT", "model", json={}) == {"version": 1}
