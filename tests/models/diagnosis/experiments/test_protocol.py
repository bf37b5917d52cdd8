"""A trial as steps that a rig can run: what is set, how often, how long."""

import pytest

from models.diagnosis.experiments.candidates import OIL_SETTLING, PASSES, TRIALS, steps_of
from tests.models.diagnosis.campaigns import campaign

GIVEN = campaign(24, cycles=(0.0, 3000.0))


@pytest.mark.parametrize("key", [key for key, trial in TRIALS.items() if trial.text])
def test_every_trial_has_steps_that_take_time(key: str) -> None:
    steps = steps_of(GIVEN, key)
    assert steps
    for step in steps:
        assert step.minutes > 0.0
        assert step.pressures
        assert len(step.speeds) >= 2
        assert (step.frequency is None) == (step.kind == "stationary_stribeck")


def test_a_sweep_takes_five_seconds_a_plateau_and_hours_of_oil_more() -> None:
    (light,) = steps_of(GIVEN, "light_sweep")
    (warm,) = steps_of(GIVEN, "sweep_60c")
    plateaus = GIVEN.stationary[-1].plateaus.torque.size
    assert light.minutes == pytest.approx(plateaus * 5.0 / 60.0)
    assert warm.minutes == pytest.approx(light.minutes + OIL_SETTLING)
    assert warm.temperature == 333.15
    assert max(light.pressures) == pytest.approx(0.25 * max(warm.pressures))
    (often,) = steps_of(GIVEN, "light_sweeps")
    assert (often.repeats, often.minutes) == (5, pytest.approx(5 * light.minutes))


def test_the_open_clutch_turns_without_pressure() -> None:
    sweep, loops = steps_of(GIVEN, "open_clutch")
    assert sweep.pressures == loops.pressures == (0.0,)
    assert loops.frequency == 0.3
    assert loops.periods == 10
    assert sweep.minutes == pytest.approx(PASSES * len(sweep.speeds) * 5.0 / 60.0)


def test_states_of_use_lie_ahead_and_take_the_duty_that_leads_there() -> None:
    steps = steps_of(GIVEN, "more_states")
    assert [step.cycles for step in steps] == [6000.0, 9000.0, 12000.0]
    assert all(step.minutes > 3000 * 10.0 / 60.0 for step in steps)
