"""What an adopted extension takes off measurements and adds to a life, against the effect's own change."""

import json
from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign, DutyRun, StationaryRun
from models.diagnosis.criteria import MOST_PLATEAUS
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.fitted_effect import Draw, FittedEffect, ranges_of, small_factors_at
from models.diagnosis.effects.history import STATIC
from models.diagnosis.effects.readings import DAYS, STRAIGHT
from models.diagnosis.effects.thermal import log_viscosity_ratio
from models.diagnosis.extension import Extension, NotFiniteError, build_extension, facts_from, facts_to
from models.records.runs import Plateaus
from tests.models.diagnosis.campaigns import Study, campaign, study, warmth

CYCLES = np.array([0.0, 3000.0, 8000.0, 20000.0])
PRESSURE = np.array([3e5, 6e5])
VELOCITY = np.linspace(0.5, 12.0, 30)
ONSET = 6000.0


@pytest.fixture(scope="module")
def warm() -> Study:
    given = campaign(51, warmth, loops=False)
    duty = (
        DutyRun(cycles=3000.0, engagements=3000.0, energy=8e3),
        DutyRun(cycles=15000.0, engagements=12000.0, energy=12e3),
    )
    return study(replace(given, duty=duty))


def drawn(given: Study, *effects: tuple[str, float, tuple[float, ...]], weight: float = 1.0) -> Draw:
    one = [FittedEffect(effect=BY_SLUG[slug], amplitude=a, shape=shape) for slug, a, shape in effects]
    return Draw(weight=weight, laws=given.baseline.fit.laws, effects=tuple(one))


def extended(given: Study, *draws: Draw, courses: bool = True) -> Extension:
    return build_extension(draws, given.design.facts, ranges_of(given.design.rows), courses=courses)


def extension_of(given: Study, *effects: tuple[str, float, tuple[float, ...]], courses: bool = True) -> Extension:
    return extended(given, drawn(given, *effects), courses=courses)


TEMPERATURE = ("oil_temperature", 0.4, (0.0, -40.0))  # a film that has the oil's temperature
WEAR = ("accelerated_wear", 0.05, (ONSET, 1.0, STATIC))


def test_json_carries_it_exactly(warm):
    built = extension_of(warm, TEMPERATURE, WEAR)
    again = Extension.from_dict(json.loads(json.dumps(built.to_dict(), allow_nan=False)))
    assert again.effects == built.effects == ("oil_temperature", "accelerated_wear")
    run = warm.campaign.stationary[2]
    assert np.array_equal(again.artefact(run, warm.campaign), built.artefact(run, warm.campaign))
    assert np.array_equal(again.course(CYCLES, PRESSURE, VELOCITY), built.course(CYCLES, PRESSURE, VELOCITY))
    facts = warm.design.facts
    assert facts_to(facts_from(json.loads(json.dumps(facts_to(facts))))) == facts_to(facts)


def test_the_artefact_of_temperature_is_that_of_the_viscosity_in_both_directions(warm) -> None:
    """Written out: C_v v^0.3 ((ν/ν_ref)^β - 1) with C_v of the fitted laws."""
    run = warm.campaign.stationary[4]
    found = extension_of(warm, TEMPERATURE).artefact(run, warm.campaign)[0]
    rows = warm.design.rows.run == 4
    scene = warm.baseline.fit.prediction.scene
    viscous = scene.parameters[rows, 3] * warm.design.rows.velocity[rows] ** 0.3
    facts = warm.design.facts
    ratio = log_viscosity_ratio(run.plateaus.oil_temperature, facts.reference_temperature, facts.oil)
    assert np.allclose(found, viscous * np.expm1(0.4 * ratio), rtol=1e-9, atol=1e-12)
    assert np.abs(found).max() > 0.05
    # and what it leaves is nearer to a run at the usual temperature than what was measured
    usual = replace(run.plateaus, oil_temperature=np.full_like(run.plateaus.torque, facts.reference_temperature))
    assert np.abs(extension_of(warm, TEMPERATURE).artefact(replace(run, plateaus=usual), warm.campaign)).max() < 1e-12
    # turned the other way the artefact turns as well
    back = replace(run, plateaus=replace(run.plateaus, speed=-run.plateaus.speed, torque=-run.plateaus.torque))
    assert np.allclose(extension_of(warm, TEMPERATURE).artefact(back, warm.campaign)[0], -found)
    # a shifted zero does not turn with the clutch
    zero = extension_of(warm, ("torque_zero_shift", 0.3, (0.0, ONSET, *STRAIGHT)))
    assert np.allclose(zero.artefact(back, warm.campaign), 0.3)
    assert np.allclose(zero.artefact(run, warm.campaign), 0.3)
    assert np.allclose(zero.artefact(warm.campaign.stationary[1], warm.campaign), 0.0)
    # without temperature nothing is taken off
    table = warm.campaign.stationary[4].plateaus
    bare = Plateaus(pressure=table.pressure, speed=table.speed, torque=table.torque)
    run = StationaryRun(run_id="later", cycles=2e4, plateaus=bare)
    assert np.array_equal(
        extension_of(warm, TEMPERATURE).artefact(run, warm.campaign), np.zeros((1, table.torque.size))
    )
    # a course is no artefact
    assert not extension_of(warm, WEAR).artefact(warm.campaign.stationary[5], warm.campaign).any()


def test_where_an_effect_makes_no_number_nothing_passes_for_no_correction(warm, monkeypatch):
    effect = BY_SLUG["torque_zero_shift"]
    zero = extension_of(warm, (effect.slug, 0.3, (0.0, ONSET, *STRAIGHT)))
    run = warm.campaign.stationary[4]
    assert np.isfinite(zero.artefact(run, warm.campaign)).all()

    def broken(scene, amplitude, shape):
        change = effect.change(scene, amplitude, shape)
        change[0] = np.nan
        return change

    monkeypatch.setitem(BY_SLUG, effect.slug, replace(effect, change=broken))
    with pytest.raises(
        NotFiniteError, match=f"torque_zero_shift is not finite at 1 of {run.plateaus.torque.size} points"
    ):
        zero.artefact(run, warm.campaign)


def test_a_huge_run_and_runs_unlike_any_before(warm):
    rng = np.random.default_rng(0)
    count = 2 * MOST_PLATEAUS + 345
    table = Plateaus(
        pressure=rng.uniform(0, 2e6, count),
        speed=rng.uniform(-300, 300, count),
        torque=rng.uniform(0, 40, count),
        oil_temperature=rng.uniform(290, 400, count),
    )
    built = extension_of(warm, TEMPERATURE)
    run = StationaryRun(run_id="huge", cycles=3e4, plateaus=table)
    found = built.artefact(run, Campaign(geometry=warm.campaign.geometry, oil=warm.campaign.oil))
    assert found.shape == (1, count)
    assert np.isfinite(found).all()
    # the same plateaus by themselves
    some = np.arange(MOST_PLATEAUS - 5, MOST_PLATEAUS + 5)
    alone = built.artefact(replace(run, plateaus=table.take(some)), warm.campaign)
    assert np.allclose(alone, found[:, some], rtol=1e-9, atol=1e-12)
    still = Plateaus(pressure=np.zeros(3), speed=np.zeros(3), torque=np.zeros(3))
    assert np.array_equal(built.artefact(replace(run, plateaus=still), warm.campaign), np.zeros((1, 3)))


def test_a_course_begins_at_its_onset_and_is_the_effects_mean(warm):
    built = extension_of(warm, WEAR)
    (found,) = built.course(CYCLES, PRESSURE, VELOCITY)
    assert found.shape == (4, 2)
    assert np.array_equal(found[:2], np.zeros((2, 2)))
    assert (found[2:] < 0).all()
    # worn twice as far beyond the onset, linear growth: (20000 - 6000)/(8000 - 6000) as much, up to the law's decay
    assert 3 < found[3, 0] / found[2, 0] < 7.5
    # the mean over velocity of a single velocity each
    each = [built.course(CYCLES, PRESSURE, np.array([v])) for v in VELOCITY]
    assert np.allclose(found, np.mean(each, axis=0)[0])
    silent = extension_of(warm, WEAR, courses=False)
    assert not silent.course(CYCLES, PRESSURE, VELOCITY).any()


def test_a_course_ends_friction_at_most_and_does_not_turn_it(warm):
    """An effect of one and a half times the curve itself, at the beginning of a life."""
    beyond = ("running_in", -1.5, (float(np.log(1e4)), 1.0))
    found = extension_of(warm, beyond).course(np.zeros(1), PRESSURE, VELOCITY)[0, 0]
    table = warm.baseline.fit.laws.parameters(np.repeat(PRESSURE, VELOCITY.size), np.zeros(2 * VELOCITY.size))
    m_s, ratio, v_s, c_v = table.T
    v = np.tile(VELOCITY, PRESSURE.size)
    curve = m_s * (1 + (ratio - 1) * np.exp(-v_s / v)) + c_v * v**0.3
    assert np.allclose(found, -curve.reshape(PRESSURE.size, -1).mean(axis=1))
    # the control: half of it is half of it
    less = extension_of(warm, ("running_in", -0.5, (float(np.log(1e4)), 1.0)))
    half = less.course(np.zeros(1), PRESSURE, VELOCITY)[0, 0]
    assert np.allclose(half, 0.5 * found)


def test_draws_weigh_as_they_should_and_logged_severity_is_counted(warm) -> None:
    alone = extension_of(warm, WEAR).course(CYCLES, PRESSURE, VELOCITY)
    both = extended(warm, drawn(warm, WEAR, weight=0.6), drawn(warm, weight=0.2))
    assert both.effects == ("accelerated_wear",)
    assert np.allclose(both.weights, [0.75, 0.25])
    course = both.course(CYCLES, PRESSURE, VELOCITY)
    assert np.allclose(course[0], alone[0])
    assert not course[1].any()
    # logged severity is counted and then no course
    logged = extension_of(warm, ("load_severity", 0.8, ()))
    assert logged.severity_exponent == 0.8
    assert not logged.course(CYCLES, PRESSURE, VELOCITY).any()
    # the controls: without courses nothing of it is followed; others count nothing
    assert extension_of(warm, ("load_severity", 0.8, ()), courses=False).severity_exponent is None
    assert extension_of(warm, WEAR).severity_exponent is None


def test_a_draw_carries_the_template_s_discrepancy_along_life(warm):
    """1 + b cos(π x): as much more in the first state as less in the last, and beyond it as in the last."""
    effect = BY_SLUG["torque_zero_shift"]
    small = (0.0,) * small_factors_at(warm.design.points, ranges_of(warm.design.rows)).shape[1]
    zero = FittedEffect(effect=effect, amplitude=0.4, shape=(0.0, -1.0, *STRAIGHT), factors=(0.25, 0.0, *small))
    built = extended(warm, Draw(weight=1.0, laws=warm.baseline.fit.laws, effects=(zero,)))
    tests = warm.campaign.stationary
    assert np.allclose(built.artefact(tests[0], warm.campaign), 0.4 * 1.25)
    assert np.allclose(built.artefact(tests[-1], warm.campaign), 0.4 * 0.75)
    later = replace(tests[-1], cycles=3.0 * tests[-1].cycles)
    assert np.allclose(built.artefact(later, warm.campaign), 0.4 * 0.75)


def test_a_zero_that_creeps_by_days_keeps_the_days_of_its_diagnosis(warm):
    """A later test does not stretch them: what was taken off stays, and the next test is beyond the last."""
    campaign = warm.campaign
    timed = tuple(replace(run, moment=1e9 + 1e5 * k) for k, run in enumerate(campaign.stationary))
    study_of = replace(campaign, stationary=timed, dynamic=())
    facts = replace(warm.design.facts, first_moment=1e9, last_moment=1e9 + 1e5 * (len(timed) - 1))
    kept = replace(warm, campaign=study_of, design=replace(warm.design, facts=facts))
    built = extension_of(kept, ("torque_zero_shift", 0.5, (DAYS, 1.0, *STRAIGHT)))
    seen = replace(study_of, stationary=timed[:-1])
    for run, share in ((timed[1], 1 / (len(timed) - 1)), (timed[-1], 1.0)):
        found = built.artefact(run, seen)
        assert found[0, 0] == pytest.approx(0.5 * share, rel=0.02)
