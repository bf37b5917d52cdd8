"""Which causes a campaign could tell apart, from its design alone."""

import numpy as np
import pytest

from models.diagnosis.diagnose import diagnose
from models.diagnosis.report.report import Isolability
from tests.models.diagnosis.campaigns import campaign


def isolability(*, loops: bool) -> Isolability:
    """Of a simulated campaign without an effect and without a thermometer."""
    tests = campaign(3, loops=loops, temperature=False)
    found = diagnose(tests, rng=np.random.default_rng(0), isolability=True).isolability
    assert found is not None
    return found


@pytest.fixture(scope="module")
def sweeps() -> Isolability:
    return isolability(loops=False)


def test_a_drag_and_a_shifted_zero_are_parted_by_an_open_clutch(sweeps: Isolability) -> None:
    (pair,) = [pair for pair in sweeps.pairs if set(pair.effects) == {"hydrodynamic_drag", "torque_zero_shift"}]
    assert not pair.apart
    assert "the clutch open" in pair.test
    assert pair.with_trial > 0.9 > pair.probability


def test_what_these_tests_cannot_show_is_said(sweeps: Isolability) -> None:
    assert {"oil_temperature", "channel_delay", "inertia_torque", "squeeze_film"} <= set(sweeps.unseen)
    shown = {slug for pair in sweeps.pairs for slug in pair.effects}
    assert not shown & set(sweeps.unseen)
    assert not {"shaft_ripple", "stick_slip"} & (shown | set(sweeps.unseen))


def test_pairs_come_hardest_first_and_only_those_get_a_test(sweeps: Isolability) -> None:
    chances = [pair.probability for pair in sweeps.pairs]
    assert chances == sorted(chances)
    for pair in sweeps.pairs:
        assert pair.with_trial >= pair.probability
        assert pair.apart == (pair.probability >= 0.9) == (pair.test == "" and pair.with_trial == pair.probability)


def test_it_is_computed_on_request_only() -> None:
    assert diagnose(campaign(3, loops=False), rng=np.random.default_rng(0)).isolability is None
