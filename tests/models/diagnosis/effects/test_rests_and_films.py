"""What a rest's length and a film's own equation do, against computations of another kind."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from models.diagnosis.baseline.laws import GAMMA, Scene, curve
from models.diagnosis.baseline.prediction import frame_of, predict
from models.diagnosis.campaign import Campaign, DutyRun, EventKind, MaintenanceEvent, StationaryRun
from models.diagnosis.design.design import build_design
from models.diagnosis.design.facts import facts_of
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.history import BY_CLOCK, BY_USE, STATIC, WHOLE
from models.diagnosis.effects.moving import FILM, FIRST_ORDER, LEAST_TIME, MOST_POWER, THICKNESS, usual_slope
from models.diagnosis.pooled_fit.baseline_fit import starting_laws
from tests.models.diagnosis.campaigns import campaign

HOUR, DAY = 3600.0, 86400.0


def scene_of_all(given: Campaign) -> Scene:
    design = build_design(given)
    return predict(design, starting_laws(design, frame_of(design))).scene


def rested(*hours: float) -> Campaign:
    """A campaign of a test a day whose log says how long the clutch rested before those at 1000, 3000 ... cycles."""
    given = campaign(1)
    tests = given.stationary[1 : 1 + len(hours)]
    events = [
        MaintenanceEvent(
            run_id=f"rest-{k}", cycles=test.cycles, event=EventKind.REST, moment=(test.moment or 0.0) - HOUR * rest
        )
        for k, (test, rest) in enumerate(zip(tests, hours, strict=True))
    ]
    return replace(given, maintenance=tuple(events))


def test_a_rest_lasts_from_its_own_moment_to_the_next_test() -> None:
    facts = facts_of(rested(2.0, 10.0))
    assert facts.rests == (1000.0, 3000.0)
    np.testing.assert_allclose(facts.rest_lengths, [2 * HOUR, 10 * HOUR])
    np.testing.assert_allclose(facts.rest_moments, [1e9 + DAY, 1e9 + 2 * DAY])


@pytest.mark.parametrize("told", ["at the beginning", "at the end", "not at all"])
def test_a_pause_is_what_the_engagements_between_two_tests_leave(told: str) -> None:
    """20 s an engagement, whether a block is timed by when it began, by when it was over or not sent; the clutch rests for
    12 h before the one from 1000 cycles and for 30 h before that from 6000."""
    rests = {1000.0: 12 * HOUR, 6000.0: 30 * HOUR}
    given, moment, tests, blocks = campaign(1, loops=False), 1e9, list[StationaryRun](), list[DutyRun]()
    for number, (test, after) in enumerate(itertools.pairwise(given.stationary)):
        tests.append(replace(test, moment=moment))
        engagements = after.cycles - test.cycles
        begun = moment + 0.5 * HOUR + rests.get(test.cycles, 0.0)
        over = begun + 20.0 * engagements
        block = DutyRun(run_id=f"block-{number}", cycles=after.cycles, engagements=engagements)
        if told != "not at all":
            blocks.append(replace(block, moment=begun if told == "at the beginning" else over - 60.0))
        moment = over
    tests.append(replace(given.stationary[-1], moment=moment))
    facts = facts_of(replace(given, stationary=tuple(tests), duty=tuple(blocks)))
    assert facts.rests == (3000.0, 10000.0)
    np.testing.assert_allclose(facts.rest_lengths, [12 * HOUR, 30 * HOUR], atol=1.2 * HOUR)


def test_friction_recovers_with_the_logarithm_of_the_rest_where_the_power_is_one() -> None:
    scene = scene_of_all(rested(2.0, 10.0))
    effect, first = BY_SLUG["rest_recovery"], scene.points.clock == scene.points.clock[0]
    shares = {}
    for power in (0.0, 1.0):
        change = effect.change(scene, 0.01, (10.0, BY_USE, 6.0, power, WHOLE)) / scene.curve
        shares[power] = [float(change[first & (scene.points.cycles == at)].max()) for at in (1000.0, 3000.0)]
    kept = shares[0.0][0]  # of the cycles and the clock, the same for both
    assert shares[0.0] == pytest.approx([kept, kept])
    assert shares[1.0] == pytest.approx([kept * np.log(3.0) / np.log(11.0), kept])


def test_what_recovers_is_friction_as_a_whole_or_its_static_torque() -> None:
    scene = scene_of_all(rested(2.0, 10.0))
    effect = BY_SLUG["rest_recovery"]
    whole, static = (effect.change(scene, 0.01, (10.0, BY_USE, 6.0, 0.0, part)) for part in (WHOLE, STATIC))
    some = whole > 0
    sheared = np.where(np.arange(4) == 3, 0.0, scene.parameters)  # without C_v the curve is that of the asperities
    share = curve(scene.points.velocity, sheared) / scene.curve
    np.testing.assert_allclose(static[some], (whole * share)[some], rtol=1e-12)
    assert np.ptp(share[some]) > 0.1
    assert {one.shape[-1] for one in effect.grid(scene.facts)} == {WHOLE, STATIC}


def test_a_test_before_the_pause_at_the_same_cycles_has_not_rested() -> None:
    """The dynamic test follows the stationary one by 2000 s; the pause lies between them."""
    given = campaign(1)
    pause = MaintenanceEvent(run_id="rest", cycles=3000.0, event=EventKind.REST, moment=1e9 + 2 * DAY + 1000.0)
    scene = scene_of_all(replace(given, maintenance=(pause,)))
    change = BY_SLUG["rest_recovery"].change(scene, 0.01, (100.0, BY_CLOCK, math.log(600.0), 0.0, WHOLE))
    here = scene.points.cycles == 3000.0
    assert np.abs(change[here & scene.points.steady]).max() < 1e-6
    assert np.abs(change[here & ~scene.points.steady]).max() > 1e-3


def test_a_film_is_the_same_whatever_rows_are_asked_for() -> None:
    """One amplitude means one film time: loops of one pressure alone show what they show among the others."""
    scene = scene_of_all(campaign(1))
    shape = (0.3, 0.8, 0.2, 0.5, FILM, 0.0)
    change = BY_SLUG["squeeze_film"].change(scene, 0.5, shape)
    some = scene.points.loop == scene.points.loop.max()
    alone = replace(
        scene,
        points=scene.points.take(some),
        **{name: getattr(scene, name)[some] for name in ("parameters", "curve", "gradient", "decay", "by_velocity")},
    )
    assert np.abs(change[some]).max() > 0.01
    np.testing.assert_allclose(BY_SLUG["squeeze_film"].change(alone, 0.5, shape), change[some], rtol=1e-12)


@pytest.mark.parametrize(("thin", "least", "sheared"), [(0.8, 0.2, 0.5), (1.4, 0.3, 0.7)])
def test_a_film_follows_its_equation(thin: float, least: float, sheared: float) -> None:
    """Against a general solver, two periods long, on the torque of one loop; and to first order where the film is fast."""
    scene = scene_of_all(campaign(1))
    effect, points, middle = BY_SLUG["squeeze_film"], scene.points, scene.laws.frame.reference_velocity
    looping = points.loop >= 0
    slope = float(usual_slope(scene.laws, np.array([sheared]))[0])
    carried = scene.viscous / points.velocity
    seen = float(np.median((sheared * carried - scene.by_velocity + GAMMA * carried)[looping]))
    assert 0.7 < slope / seen < 1.4  # about that of the loops at hand
    time = 0.08  # of the film at mid speed and 5 bar [s]
    change = effect.change(scene, time * slope, (0.0, thin, least, sheared, FILM, 0.0))
    one = np.flatnonzero(points.loop == points.loop[looping][0])
    v, step = points.velocity[one], 2 * np.pi / (one.size * points.angular_frequency[one][0])
    at = step * np.arange(-1, one.size + 1)
    course = CubicSpline(step * np.arange(one.size + 1), np.append(v, v[0]), bc_type="periodic")
    period = step * one.size

    def film(t: float, w: np.ndarray) -> np.ndarray:
        return np.asarray((course(t % period) - w) * (np.maximum(w, 0.0) / middle + least) ** thin / time)

    told = solve_ivp(film, (0.0, 2 * period), [v[0]], t_eval=period + at[1:-1], rtol=1e-8, atol=1e-10, method="LSODA")
    w, dry = told.y[0], scene.parameters[one] * np.array([1.0, 1.0, 1.0, 0.0])
    expected = curve(w, dry) - curve(v, dry) + scene.viscous[one] * ((v / w) ** sheared - 1.0)
    moving = v > 0.05 * v.max()
    np.testing.assert_allclose(change[one][moving], expected[moving], atol=0.02 * np.abs(expected[moving]).max())
    by_powers = effect.change(scene, time * slope, (0.0, thin, least, sheared, FIRST_ORDER, 0.0))[one]
    assert np.abs(by_powers - expected)[moving].max() > 0.1 * np.abs(expected[moving]).max()  # the control


@pytest.mark.parametrize(("power", "thin", "least", "time"), [(0.5, 0.5, 0.1, 0.3), (0.0, 1.5, 0.05, 0.9)])
def test_a_film_of_its_own_strength_relaxes(power: float, thin: float, least: float, time: float) -> None:
    """τ ḣ = H - h by a general solver; its slope at mid speed is the amplitude where it is fast; nothing on plateaus."""
    scene = scene_of_all(campaign(1))
    points, middle = scene.points, scene.laws.frame.reference_velocity
    change = BY_SLUG["squeeze_film"].change(scene, 0.5, (power, thin, least, time, THICKNESS, 0.0))
    assert np.abs(change[points.steady]).max() == 0.0
    one = np.flatnonzero(points.loop == points.loop.max())
    step, tau, q = (
        2 * np.pi / (one.size * points.angular_frequency[one][0]),
        LEAST_TIME * 10**time,
        MOST_POWER / (1 + thin),
    )
    height = (points.velocity[one] / middle + least) ** q
    course = CubicSpline(step * np.arange(one.size + 1), np.append(height, height[0]), bc_type="periodic")
    period = step * one.size
    told = solve_ivp(
        lambda t, h: (course(t % period) - h) / tau,
        (0.0, 4 * period),
        [height.mean()],
        t_eval=3 * period + step * np.arange(one.size),
        max_step=step,
        rtol=1e-8,
    )
    strength = 0.5 * (points.pressure[one] / 5e5) ** (1.0 + 0.5 * power) * middle / (tau * q * (1 + least) ** (q - 1))
    expected = strength * (height - told.y[0])
    np.testing.assert_allclose(change[one], expected, atol=0.02 * np.abs(expected).max())
