"""Which test would decide: the right one for pairs that are known to be alike, and as much of it as was foretold."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis import trials
from models.diagnosis.advice import WORTH, advise
from models.diagnosis.baseline import predict
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun
from models.diagnosis.catalogue import BY_SLUG
from models.diagnosis.design import build_design
from models.diagnosis.effects.torque_zero_shift import STRAIGHT
from models.diagnosis.fitting import Fit, Fitted, effect_rows
from models.diagnosis.report import Advice
from models.diagnosis.trials import TRIALS, with_trial
from models.runs import Plateaus
from tests.models.diagnosis.campaigns import Where, campaign
from tests.models.diagnosis.fitted import Study, study, warmth


def inertia(at: Where) -> np.ndarray:
    return 0.012 * at.acceleration / 0.058


@pytest.fixture(scope="module")
def swung() -> Study:
    return study(campaign(21, inertia, cycles=(0.0, 4000.0, 12000.0)))


@pytest.fixture(scope="module")
def warm() -> Study:
    return study(campaign(22, warmth, loops=False))


def advised(given: Study, *fits: Fit) -> tuple[Advice, ...]:
    return advise(given.campaign, given.design, given.baseline.noise, given.baseline.priors, fits)


def test_inertia_and_a_film_are_parted_by_loops_at_another_frequency(swung):
    found = advised(swung, swung.extended(("inertia_torque", 0.01, ())), swung.extended(squeeze(swung)))
    assert found[0].key in {"loops_0.5hz", "loops_1hz"}
    assert {found[0].effect, found[0].other} == {"inertia_torque", "squeeze_film"}
    assert found[0].nats > WORTH
    assert found[0].test == TRIALS[found[0].key].text
    assert [each.nats for each in found] == sorted((each.nats for each in found), reverse=True)
    # the control: a stationary test has no acceleration, and is not advised
    assert {each.key for each in found} <= {"loops_0.5hz", "loops_1hz"}


def squeeze(given: Study):
    tried = BY_SLUG["squeeze_film"].grid(given.design.facts)
    return ("squeeze_film", BY_SLUG["squeeze_film"].prior_sd * 0.1, tried[0].shape)


def test_a_zero_is_parted_from_wear_by_going_on(warm):
    """A shifted zero stays as it is, wear grows."""
    zero = of_size(warm, "torque_zero_shift", -0.6, (0.0, 8000.0, *STRAIGHT))
    wear = of_size(warm, "accelerated_wear", 0.03, (6000.0, 1.0))
    found = advised(warm, zero, wear)
    assert found[0].key == "more_states"
    assert found[0].nats > WORTH
    # the control: the same test again at once tells less than what is worth its time
    assert "repeat" not in {each.key for each in found}


def of_size(given: Study, slug: str, amplitude: float, shape: tuple[float, ...]) -> Fit:
    """The baseline with an effect as large as wanted beside it, not fitted."""
    return replace(given.baseline.fit, effects=(Fitted(effect=BY_SLUG[slug], amplitude=amplitude, shape=shape),))


def test_what_was_foretold_is_what_the_test_brings(warm):
    """The advised test is made in simulation; the drop between refits without and with the effect rises as foretold."""
    extended = warm.extended(("oil_temperature", 0.3, (0.5,)))
    found = advised(warm, extended)
    best = found[0]
    assert best.key in {"sweep_60c", "sweep_100c"}
    assert best.other == "baseline"
    drops = [warm.baseline.fit.cost - extended.cost]
    made = study(with_measured(warm.campaign, best.key, extended))
    drops.append(made.baseline.fit.cost - made.extended(("oil_temperature", 0.3, (0.5,))).cost)
    print(best, drops)
    # linear in the effect and by a noise that is re-estimated: right within a factor of two
    assert 0.5 < (drops[1] - drops[0]) / best.nats < 2.0
    # the control: repeating the test as it was brings far less
    again = study(with_measured(warm.campaign, "repeat", extended))
    repeated = again.baseline.fit.cost - again.extended(("oil_temperature", 0.3, (0.5,))).cost
    assert repeated - drops[0] < 0.2 * best.nats


def with_measured(given: Campaign, key: str, truth: Fit) -> Campaign:
    """The trial's runs with the torque that the fitted model gives there, and noise of one percent."""
    then = with_trial(given, key)
    assert then is not None
    at = build_design(then)
    at = replace(at, facts=replace(at.facts, reference_temperature=358.15))
    prediction = predict(at, truth.laws)
    torque = prediction.torque + sum(effect_rows(at, prediction, each) for each in truth.effects)
    torque = torque * (1 + 0.01 * np.random.default_rng(9).standard_normal(torque.size))
    count = then.stationary[-1].plateaus.torque.size
    last = replace(then.stationary[-1].plateaus, torque=torque[-count:])
    return replace(then, stationary=(*then.stationary[:-1], replace(then.stationary[-1], plateaus=last)))


def test_without_oil_temperature_it_is_asked_for(warm):
    blind = study(campaign(23, loops=False, temperature=False))
    zero = blind.extended(("torque_zero_shift", 0.3, (1.0, 0.0, *STRAIGHT)))
    first = advised(blind, zero)[0]
    assert (first.key, first.other) == ("sweep_60c", "oil_temperature")
    assert "oil temperature recorded" in first.test
    assert first.nats > WORTH
    # the control: where it was measured nobody asks for it
    measured = warm.extended(("torque_zero_shift", 0.3, (1.0, 0.0, *STRAIGHT)))
    assert all(each.other != "oil_temperature" for each in advised(warm, measured))


def test_no_candidate_no_advice(warm):
    assert advised(warm) == ()
    assert advised(warm, warm.baseline.fit) == ()


@pytest.mark.parametrize("key", TRIALS)
def test_every_trial_adds_runs_that_can_be_analysed(key, swung):
    energetic = replace(swung.campaign, duty=(DutyRun(run_id="duty", cycles=4000.0, engagements=4000.0, energy=8e3),))
    then = with_trial(energetic, key)
    assert then is not None
    added = build_design(replace(then, stationary=then.stationary[3:], dynamic=then.dynamic[3:]))
    assert added.torque.size > 50
    trial = TRIALS[key]
    if trial.loops:
        assert added.loops == 5
        assert added.rows.angular_frequency.max() == pytest.approx(2 * np.pi * trial.frequency, rel=1e-3)
    if trial.temperature is not None:
        assert np.all(added.rows.temperature == trial.temperature)
    if trial.pressure != 1:
        assert added.rows.pressure.max() < swung.design.rows.pressure.min()
    if trial.falling:
        assert np.median(np.diff(added.rows.velocity)) < 0
    assert added.rows.cycles.min() >= 12000.0
    assert np.unique(added.rows.cycles).size == max(trial.later, 1)
    if trial.energy != 1:
        assert then.duty[-1].energy == pytest.approx(trial.energy * 8e3)


@pytest.mark.parametrize("key", TRIALS)
def test_trials_on_campaigns_that_have_no_pattern_for_them(key):
    whole = campaign(24, cycles=(0.0, 3000.0))
    bare = [replace(run, plateaus=without_temperature(run.plateaus)) for run in whole.stationary]
    flat = replace(whole.dynamic[0].record, pressure=np.full(whole.dynamic[0].record.time.size, 5e5))
    for given in (
        Campaign(),
        replace(whole, stationary=()),
        replace(whole, dynamic=()),
        replace(whole, stationary=whole.stationary[:1], dynamic=()),
        replace(whole, stationary=tuple(bare), dynamic=()),
        replace(whole, dynamic=(DynamicRun(run_id="flat", cycles=0.0, record=flat),)),
    ):
        then = with_trial(given, key)
        needs_loops, later = TRIALS[key].loops, TRIALS[key].later
        states = {run.cycles for run in (*given.stationary, *given.dynamic)}
        possible = bool(given.dynamic if needs_loops else given.stationary) and (not later or len(states) > 1)
        assert (then is not None) == possible
        if then is not None:
            build_design(then)


def without_temperature(table: Plateaus) -> Plateaus:
    return Plateaus(pressure=table.pressure, speed=table.speed, torque=table.torque)


def test_a_trial_swings_as_the_reference_does():
    then = with_trial(campaign(24, cycles=(0.0, 3000.0)), "loops_0.5hz")
    assert then is not None
    record = then.dynamic[-1].record
    assert record.speed.max() == pytest.approx(2 * trials.SWING)
    assert record.speed.min() == 0
