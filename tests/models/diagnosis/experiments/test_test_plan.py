"""Which test would decide: the right one for pairs that are known to be alike, and as much of it as was predicted."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.baseline.prediction import predict
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun
from models.diagnosis.criteria import WORTHWHILE
from models.diagnosis.design.design import build_design
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.history import STATIC
from models.diagnosis.effects.readings import STRAIGHT
from models.diagnosis.effects.thermal import AT_ONCE
from models.diagnosis.experiments.candidates import OIL_SETTLING, PASSES, TRIALS, steps_of, with_trial
from models.diagnosis.experiments.information import CandidateDistances
from models.diagnosis.experiments.test_plan import Advice, advise, decided
from models.diagnosis.explanations.verdict import Fitted
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit
from tests.models.diagnosis.campaigns import (
    RPM,
    Study,
    Where,
    altered,
    campaign,
    of_size,
    study,
    warmth,
    without_temperature,
)


def inertia(at: Where) -> np.ndarray:
    return 0.012 * at.acceleration / 0.058


@pytest.fixture(scope="module")
def swung() -> Study:
    return study(campaign(21, inertia, cycles=(0.0, 4000.0, 12000.0)))


@pytest.fixture(scope="module")
def rivals(swung: Study) -> tuple[PooledFit, PooledFit]:
    """Inertia, which is planted, and a film."""
    film = BY_SLUG["squeeze_film"]
    tried = film.grid(swung.design.facts)[0]
    return tuple(
        swung.extended((slug, amplitude, shape))
        for slug, amplitude, shape in (("inertia_torque", 0.012, ()), (film.slug, 0.1 * film.prior_sd, tried.shape))
    )


@pytest.fixture(scope="module")
def warm() -> Study:
    return study(campaign(22, warmth, loops=False))


def advised(given: Study, *fits: PooledFit, nearby: tuple[PooledFit, ...] = ()) -> tuple[Advice, ...]:
    credible = [Fitted(slugs=(), fit=fit, evidence=0.0) for fit in fits]
    behind = [Fitted(slugs=(), fit=fit, evidence=-5.0) for fit in nearby]
    return advise(given.campaign, given.problem, credible, behind)


def test_inertia_and_a_film_are_parted_by_loops(swung, rivals):
    found = advised(swung, *rivals)
    assert {found[0].effect, found[0].other} == {"inertia_torque", "squeeze_film"}
    assert found[0].nats > WORTHWHILE
    assert found[0].test == TRIALS[found[0].key].text
    # the control: a stationary test has no acceleration, and is not advised by itself
    assert all(moving(each.key) for each in found)


def moving(key: str) -> bool:
    """Whether loops are driven in a trial."""
    return any(TRIALS[part].loops for part in TRIALS[key].parts or (key,))


def test_a_zero_is_parted_from_wear_by_an_open_clutch(warm):
    """A shifted zero stays without pressure, wear does not."""
    zero = beside(warm, "torque_zero_shift", -0.6, (0.0, 8000.0, *STRAIGHT))
    wear = beside(warm, "accelerated_wear", 0.03, (6000.0, 1.0, STATIC))
    found = advised(warm, zero, wear)
    assert found[0].key == "open_sweep"
    assert found[0].nats > WORTHWHILE
    # the control: the same test again at once tells less than what is worth its time
    assert "repeats" not in {each.key for each in found}


def beside(given: Study, slug: str, amplitude: float, shape: tuple[float, ...]) -> PooledFit:
    """The baseline with an effect as large as wanted beside it, not fitted."""
    return replace(given.baseline.fit, effects=(of_size(slug, amplitude, shape),))


def test_what_was_predicted_is_what_the_test_brings(warm):
    """The advised test is made in simulation; the drop between refits without and with the effect rises as predicted."""
    temperature = ("oil_temperature", 0.3, (0.5, AT_ONCE))
    extended = warm.extended(temperature)
    found = advised(warm, extended)
    assert found[0].key in {"sweep_60c", "sweeps_60c"}
    best = next(each for each in found if each.key == "sweep_60c")
    assert best.other == "baseline"

    def brought(key: str) -> float:
        then = study(with_measured(warm.campaign, key, extended))
        dropped = then.baseline.fit.cost - then.extended(temperature).cost
        return dropped - (warm.baseline.fit.cost - extended.cost)

    # linear in the effect and by a noise that is re-estimated: right within a factor of two
    assert 0.5 < brought("sweep_60c") / best.nats < 2.0
    # the control: repeating the test as it was brings far less
    assert brought("repeats") < 0.2 * best.nats


def with_measured(given: Campaign, key: str, truth: PooledFit) -> Campaign:
    """The trial's runs with the torque that the fitted model gives there, and noise of one percent."""
    then = with_trial(given, key)
    at = build_design(then)
    at = replace(at, facts=replace(at.facts, reference_temperature=358.15))
    prediction = predict(at, truth.laws)
    torque = prediction.torque + sum(each.rows(at, prediction) for each in truth.effects)
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
    assert first.nats > WORTHWHILE
    # a zero that is out of the race is no reason to ask
    wear = beside(blind, "accelerated_wear", 0.03, (6000.0, 1.0, STATIC))
    assert all(each.other != "oil_temperature" for each in advised(blind, wear, nearby=(zero,)))
    # the control: where it was measured nobody asks for it
    measured = warm.extended(("torque_zero_shift", 0.3, (1.0, 0.0, *STRAIGHT)))
    assert all(each.other != "oil_temperature" for each in advised(warm, measured))


def test_no_candidate_no_advice(warm):
    assert advised(warm) == ()
    assert advised(warm, warm.baseline.fit) == ()


@pytest.mark.parametrize("key", TRIALS)
def test_every_trial_adds_runs_that_can_be_analysed(key, swung):
    energetic = replace(swung.campaign, duty=(DutyRun(cycles=4000.0, engagements=4000.0, energy=8e3),))
    then = with_trial(energetic, key)
    added = build_design(replace(then, stationary=then.stationary[3:], dynamic=then.dynamic[3:]))
    assert added.torque.size > 50
    assert added.rows.cycles.min() >= 12000.0
    trial = TRIALS[key]
    if trial.parts:
        assert len(added.runs) == len(trial.parts)
        return
    if trial.loops:
        assert added.loops == {0.0: 1, 1.0: 5}.get(trial.pressure, 3)
        assert added.rows.angular_frequency.max() == pytest.approx(2 * np.pi * 0.3, rel=1e-3)
        assert added.rows.velocity.max() == pytest.approx(2000 * RPM * 0.058, rel=1e-2)
    if trial.temperature is not None:
        np.testing.assert_allclose(added.rows.temperature, trial.temperature)
    assert added.closed.all() == (trial.pressure != 0)
    if trial.pressure not in {0, 1}:
        assert added.rows.pressure.max() < swung.design.rows.pressure.min()
    if trial.falling:
        assert np.median(np.diff(added.rows.velocity)) < 0
    assert np.unique(added.rows.cycles).size == max(trial.later, 1)
    if trial.energy != 1:
        assert then.duty[-1].energy == pytest.approx(trial.energy * 8e3)


def test_rests_lie_before_the_first_and_the_third_test(swung):
    timed = tuple(replace(run, moment=1e9 + 1e5 * k) for k, run in enumerate(swung.campaign.stationary))
    then = with_trial(replace(swung.campaign, stationary=timed), "rests")
    tests, rests = then.stationary[3:], then.maintenance[len(swung.campaign.maintenance) :]
    assert [rest.cycles for rest in rests] == [tests[0].cycles, tests[2].cycles]
    assert [tests[k].moment - rest.moment for k, rest in zip((0, 2), rests, strict=True)] == [48 * 3600.0] * 2
    # the control: other trials rest nowhere
    assert with_trial(swung.campaign, "more_states").maintenance == swung.campaign.maintenance


@pytest.mark.parametrize("key", TRIALS)
def test_trials_on_campaigns_that_have_no_pattern_for_them(key):
    whole = campaign(24, cycles=(0.0, 3000.0))
    flat = replace(whole.dynamic[0].record, pressure=np.full(whole.dynamic[0].record.time.size, 5e5))
    for given in (
        Campaign(),
        replace(whole, stationary=()),
        replace(whole, dynamic=()),
        replace(whole, stationary=whole.stationary[:1], dynamic=()),
        replace(without_temperature(whole), dynamic=()),
        replace(whole, dynamic=(DynamicRun(run_id="flat", cycles=0.0, record=flat),)),
    ):
        then = with_trial(given, key)
        parts = [TRIALS[part] for part in TRIALS[key].parts or (key,)]
        states = {run.cycles for run in (*given.stationary, *given.dynamic)}
        possible = all(
            (given.dynamic if part.loops else given.stationary) and (not part.later or len(states) > 1)
            for part in parts
        )
        assert (then is not None) == possible
        if then is not None:
            build_design(then)


def test_a_trial_swings_over_the_speeds_of_the_rig():
    """40 to 124 rad/s, and a spike of the encoder."""
    given = campaign(24, cycles=(0.0, 3000.0))
    run = given.dynamic[-1]
    speed = 40.0 + 0.4 * run.record.speed
    speed[100] = 1e4
    slower = replace(run, record=replace(run.record, speed=speed))
    then = with_trial(replace(given, dynamic=(given.dynamic[0], slower)), "loops_0.3hz")
    swing = then.dynamic[-1].record.speed
    assert [swing.min(), swing.max()] == pytest.approx([40.0, 40.0 + 0.4 * 2000 * RPM], rel=0.01)


NONE = np.zeros((2, 3))


def test_what_a_trial_leaves_alone():
    """By hand: 60 nats against the 2.2 that odds of nine to one are, give or take 26; what brings nothing reaches
    them by chance, Φ(-2.2)."""
    even = np.zeros(2)
    sure = np.array([[0.0, 60.0, 0.0], [60.0, 0.0, 0.0]])
    assert decided(sure, even, even) == pytest.approx(0.986, abs=0.003)
    assert decided(NONE, even, even) == pytest.approx(0.014, abs=0.001)
    # alone it is compared with no effect, with the evidence in hand: Φ((30 - 2.2)/1), and Φ((1 - 2.2)/1) by hand
    alone = np.zeros((1, 2))
    assert decided(alone, np.array([30.0]), np.zeros(1)) > 0.99
    assert decided(alone, np.array([3.0]), np.array([-2.0])) == pytest.approx(0.116, abs=0.002)
    # what parts only one way helps only where that one is true
    one_way = np.array([[0.0, 60.0, 0.0], [0.0, 0.0, 0.0]])
    assert decided(one_way, even, even) == pytest.approx(0.5, abs=0.02)
    assert decided(one_way, np.array([2.0, 0.0]), even) > 0.8
    # of three, the one that is hardest to part counts
    third = np.zeros((3, 4))
    third[:2, :2] = 60.0
    assert decided(third, np.zeros(3), np.zeros(3)) < 0.015
    # what has more free pays for it, and helps the other only where that one is true
    lead, some = np.array([3.0, 0.0]), np.array([[0.0, 3.0, 0.0], [3.0, 0.0, 0.0]])
    paid = decided(some, lead, np.array([0.0, -3.0]))
    assert paid > decided(some, lead, even) + 0.05
    assert decided(some, lead, np.array([-3.0, 0.0])) < paid - 0.3


def test_a_hypothesis_that_is_not_far_behind_counts(swung, rivals):
    """Where the film is out of the race by five nats only, what brings it back is not what is advised first."""
    found = advised(swung, rivals[0], nearby=rivals[1:])
    assert found
    assert {each.effect for each in found} == {"inertia_torque"}
    assert {each.other for each in found} == {"baseline"}


def test_a_distance_is_what_a_refit_leaves(swung, rivals):
    """λ against its own witness: torque of the one is made, the other is fitted to it, and half its squares are left."""
    first, second = rivals
    distances = CandidateDistances(swung.problem, (first, second, replace(first, effects=()))).distances(())
    np.testing.assert_allclose(np.diag(distances)[:2], 0.0, atol=1e-6)
    assert 0 < distances[0, 1] < distances[0, 2]
    made = replace(swung.problem, design=replace(swung.design, torque=first.torque))
    null = fit(made, swung.baseline.fit.laws)
    whole = fit(made, first.laws, first.effects)
    assert distances[0, 2] == pytest.approx(null.cost - whole.cost, rel=0.25)


def test_loops_are_not_predicted_where_none_could_be_evaluated():
    """All dynamic tests stood still: what a loop would show depends on an attractor that was not measured."""
    given = study(altered(campaign(22, warmth), moving=lambda run: {"speed": np.full_like(run.record.speed, 100.0)}))
    assert given.design.loops == 0
    found = advised(
        given, given.extended(("oil_temperature", 0.1, (0.0, AT_ONCE))), given.extended(("viscous_exponent", 0.1, ()))
    )
    assert found
    assert not any(moving(each.key) for each in found)


# --- A trial as steps that a rig can run: what is set, how often, how long.

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


def test_steps_take_five_seconds_a_plateau_and_hours_of_oil_and_duty_more() -> None:
    (light,), (warm,), (often,) = (steps_of(GIVEN, key) for key in ("light_sweep", "sweep_60c", "light_sweeps"))
    assert light.minutes == pytest.approx(GIVEN.stationary[-1].plateaus.torque.size * 5.0 / 60.0)
    assert warm.minutes == pytest.approx(light.minutes + OIL_SETTLING)
    assert warm.temperature == 333.15
    assert max(light.pressures) == pytest.approx(0.25 * max(warm.pressures))
    assert (often.repeats, often.minutes) == (5, pytest.approx(5 * light.minutes))
    sweep, loops = steps_of(GIVEN, "open_clutch")
    assert sweep.pressures == loops.pressures == (0.0,)
    assert (loops.frequency, loops.periods) == (0.3, 10)
    assert sweep.minutes == pytest.approx(PASSES * len(sweep.speeds) * 5.0 / 60.0)
    ahead = steps_of(GIVEN, "more_states")
    assert [step.cycles for step in ahead] == [6000.0, 9000.0, 12000.0]
    assert all(step.minutes > 3000 * 10.0 / 60.0 for step in ahead)
