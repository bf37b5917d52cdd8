"""What is said of a clutch does not hang on its size, its pressures, its speed or how long it lives."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import build_design
from models.diagnosis.diagnose import diagnose
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.effect import Measure, sized
from models.diagnosis.report.report import Report
from tests.models.diagnosis.campaigns import Where, campaign

FACTOR = 12.0


def stretched(given: Campaign, channel: str) -> Campaign:
    """The campaign with a channel of all its tests times FACTOR."""
    steady = tuple(
        replace(run, plateaus=replace(run.plateaus, **{channel: FACTOR * getattr(run.plateaus, channel)}))
        for run in given.stationary
    )
    moving = tuple(
        replace(run, record=replace(run.record, **{channel: FACTOR * getattr(run.record, channel)}))
        for run in given.dynamic
    )
    return replace(given, stationary=steady, dynamic=moving)


def lasting(given: Campaign) -> Campaign:
    """The campaign of a clutch that lives FACTOR times as long."""
    parts = {
        name: tuple(replace(run, cycles=FACTOR * run.cycles) for run in getattr(given, name))
        for name in ("stationary", "dynamic", "maintenance", "duty")
    }
    return replace(given, **parts)


def zero(at: Where) -> np.ndarray:
    return np.full_like(at.velocity, 0.5 if at.cycles > 4000 else 0.0)


def look(given: Campaign) -> Report:
    return diagnose(given, rng=np.random.default_rng(3))


@pytest.mark.slow
def test_the_same_clutch_in_other_sizes_is_told_the_same() -> None:
    given = campaign(9, zero, loops=False)
    first = look(given)
    assert first.causes
    others: dict[str, Callable[[], Campaign]] = {
        "torque": lambda: stretched(given, "torque"),
        "pressure": lambda: stretched(given, "pressure"),
        "speed": lambda: stretched(given, "speed"),
        "life": lambda: lasting(given),
    }
    for name, other in others.items():
        found = look(other())
        assert (found.verdict, found.causes) == (first.verdict, first.causes), name
        best, same = first.candidates[0], found.candidates[0]
        assert same.effect == best.effect
        assert same.log_evidence_gain == pytest.approx(best.log_evidence_gain, rel=0.02), name


def test_what_grows_with_the_clutch_is_as_large_as_the_clutch() -> None:
    given = campaign(9, loops=False)
    facts = build_design(stretched(stretched(given, "torque"), "pressure")).facts
    known = build_design(given).facts
    for effect in CATALOGUE:
        ratio = sized(effect, facts).prior_sd / sized(effect, known).prior_sd
        assert ratio == pytest.approx(FACTOR if effect.grows_with else 1.0)
    assert BY_SLUG["torque_zero_shift"].grows_with is Measure.TORQUE
    assert BY_SLUG["pressure_offset"].grows_with is Measure.PRESSURE
