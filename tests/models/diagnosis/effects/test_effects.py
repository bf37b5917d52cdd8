"""Every effect of the catalogue: what its change looks like, its units and its limits."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import CubicSpline
from scipy.stats import t

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import GAMMA, Scene, curve
from models.diagnosis.baseline.laws import scene_of as scene_of_laws
from models.diagnosis.baseline.prediction import predict
from models.diagnosis.campaign import Campaign, DutyRun, EventKind, MaintenanceEvent, Oil, StationaryRun
from models.diagnosis.criteria import DISCREPANCY_SD
from models.diagnosis.design.facts import facts_of
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.effect import Effect, EffectKind
from models.diagnosis.effects.faults import last_direction
from models.diagnosis.effects.fitted_effect import FittedEffect, discrepancy_factors, law_columns
from models.diagnosis.effects.history import BY_CLOCK, BY_USE, PACE, STATIC, WHOLE
from models.diagnosis.effects.moving import FILM, FIRST_ORDER, LEAST_TIME, MOST_POWER, THICKNESS, usual_slope
from models.diagnosis.effects.readings import DAYS, STRAIGHT
from models.diagnosis.effects.thermal import HERSEY, log_viscosity_ratio, viscosity
from models.diagnosis.explanations.evidence import evidence_of
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline
from models.diagnosis.pooled_fit.gauss_newton import fit
from models.diagnosis.pooled_fit.projection import gram_of, project
from tests.lab.measuring import APPENDIX, parts
from tests.models.diagnosis.campaigns import Study, campaign, of_size, scene_of, study
from tests.models.diagnosis.tables import TABLES


@pytest.fixture(scope="module")
def scene() -> Scene:
    return scene_of(campaign(1))


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.slug)
def test_no_amplitude_no_change_and_all_changes_are_finite(effect: Effect, scene: Scene) -> None:
    grid = effect.grid(scene.facts)
    # half of the rows of the lowest level lie below it, where M̄_c's law ends
    pressure = scene.points.pressure + 2_000.0 * np.random.default_rng(1).standard_normal(scene.points.pressure.size)
    scattered = scene_of_laws(scene.laws, replace(scene.points, pressure=pressure), scene.facts)
    # a film that stands is slow whatever its time
    moving = scene.points.velocity > 0.01 * scene.points.velocity.max()
    columns = effect.unit_changes(scene, [tried.shape for tried in grid]).T if grid else np.zeros((0, 0))
    for tried, column in zip(grid, columns, strict=True):
        for at in (scene, scattered):
            assert np.abs(effect.change(at, 0.0, tried.shape)).max() < 1e-9
        assert column.shape == scene.curve.shape
        assert np.isfinite(column).all()
        one, two = (
            effect.change(scene, k * effect.prior_sd, tried.shape) / (k * effect.prior_sd) for k in (1e-3, 2e-3)
        )
        np.testing.assert_allclose(column, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())  # many at once, or each alone
        assert np.abs(column).max() > 0
        assert effect.kind is not EffectKind.LAG or np.abs(column[scene.points.steady]).max() == 0
        # small amplitudes act in proportion
        assert np.abs(two - column)[moving].max() < 0.05 * np.abs(column[moving]).max()


def test_no_size_is_beyond_what_is_possible(scene: Scene) -> None:
    """A reading was said to contain 414 % of the previous plateau, and heat to take 360 % of friction."""
    facts = scene.facts
    lowest, period = facts.lowest_pressure, facts.shortest_period
    assert lowest is not None
    assert period is not None
    assert lowest == pytest.approx(scene.points.pressure[scene.points.engaged > 0].min())
    bounds = {
        "unsettled_dwell": (0.0, 1.0),
        "interface_heating": (0.0, 0.95),
        "hydrodynamic_drag": (0.0, 0.5 * facts.usual_torque),
        "pressure_offset": (-lowest, lowest),
        "channel_delay": (-period, period),
        "accelerated_wear": (0.0, 1.0),
        "oil_change": (-1.0, 4.0),
    }
    for slug, (low, high) in bounds.items():
        effect = BY_SLUG[slug].sized(facts)
        assert (effect.lowest, effect.highest) == pytest.approx((low, high)), slug
        assert effect.within(2.0 * high) == effect.highest
        assert effect.within(-3.0 * high) == (-3.0 * high if low == 0.0 else effect.lowest)  # a fit may pass through


def test_a_fit_ends_at_the_bound_that_the_data_ask_to_pass(given: Study) -> None:
    """Four times the difference from the plateau before in each reading, which no share is."""
    of_four = of_size("unsettled_dwell", 4.0, (0.0, 0.0))
    begun = of_size("unsettled_dwell", 0.5, (0.0, 0.0))
    planted = of_four.rows(given.design, given.baseline.fit.prediction)
    problem = replace(given.problem, design=replace(given.design, torque=given.design.torque + planted))
    found = fit(problem, given.baseline.fit.laws, [begun], steps=10)
    (dwell,) = found.effects
    assert dwell.amplitude == 1.0
    assert not dwell.free[0]
    assert np.isfinite(evidence_of(problem, found, smooth=False).whole)


def test_units_of_a_few(scene: Scene) -> None:
    steady = scene.points.steady
    inertia = BY_SLUG["inertia_torque"].change(scene, 1.0, ())
    np.testing.assert_allclose(inertia, scene.points.acceleration / 0.058)  # 1 kg m² feels dω/dt
    drag = BY_SLUG["hydrodynamic_drag"].change(scene, 1.0, (1.0, 0.0, 0.0, 0.0))
    assert np.ptp(drag[steady] / scene.points.velocity[steady]) < 1e-12  # pressure is not in it
    offset = BY_SLUG["pressure_offset"].change(scene, 1000.0, (0.0, 0.0, 0.0))
    higher = scene.curve_with(pressure=scene.points.pressure + 1000.0) - scene.curve
    np.testing.assert_allclose(offset, higher, rtol=0.02, atol=1e-4)
    zero = BY_SLUG["torque_zero_shift"].change(scene, 0.5, (0.0, 2000.0, *STRAIGHT))
    assert set(np.unique(zero)) == {0.0, 0.5}
    assert (zero[scene.points.cycles > 2000.0] == 0.5).all()


def test_a_zero_creeps_by_days_where_tests_are_timed(scene: Scene) -> None:
    """Not by cycles: half of the days may have gone at a tenth of them; without moments it is by cycles."""
    points, facts = scene.points, scene.facts
    days = np.where(points.cycles > facts.states[0], 0.5, 0.0) + np.where(points.cycles == facts.states[-1], 0.5, 0.0)
    timed = replace(
        scene, facts=replace(facts, first_moment=1e9, last_moment=2e9), points=replace(points, moment=1e9 * (1 + days))
    )
    zero = BY_SLUG["torque_zero_shift"]
    np.testing.assert_allclose(zero.change(timed, 0.4, (DAYS, 1.0, *STRAIGHT)), 0.4 * days, atol=1e-12)
    untimed = replace(scene, facts=replace(facts, first_moment=None, last_moment=None))
    by_cycles = 0.4 * (points.cycles - facts.states[0]) / facts.life
    np.testing.assert_allclose(zero.change(untimed, 0.4, (DAYS, 1.0, *STRAIGHT)), by_cycles, atol=1e-12)
    courses = [{tried.shape[0] for tried in zero.grid(each.facts)} for each in (timed, untimed)]
    assert (DAYS in courses[0], DAYS in courses[1]) == (True, False)


def test_friction_that_hangs_on_speed_times_viscosity_is_within_reach(scene: Scene) -> None:
    """Hersey's similarity, exactly: oil of ν for ν_ref is a speed of v ν/ν_ref, whatever the pressure and the state."""
    points = scene.points
    steady = points.steady
    thinner = np.exp(log_viscosity_ratio(points.temperature, scene.facts.reference_temperature, scene.facts.oil))
    expected = scene.curve_with(velocity=points.velocity * thinner) - scene.curve
    change = BY_SLUG["oil_temperature"].change(scene, GAMMA, (HERSEY, -40.0))  # a film that has the oil's temperature
    assert np.abs(expected[steady]).max() > 0.01
    np.testing.assert_allclose(change[steady], expected[steady], atol=1e-9)


def test_a_film_that_follows_the_oil_late_shows_a_step_of_its_temperature_later(scene: Scene) -> None:
    """The mean of 1 - e^{-t/τ} over the plateau of the step and over the next: dwells of 5 s, τ of 5 s."""
    points = scene.points
    run = np.flatnonzero((points.run == 0) & points.steady)[:12]
    reference = scene.facts.reference_temperature
    warmer = np.where(np.arange(points.run.size) >= run[5], reference + 1.0, reference)
    stepped = replace(scene, points=replace(points, temperature=warmer))
    change = BY_SLUG["oil_temperature"].change
    at_once, late = (change(stepped, 1e-3, (0.0, log))[run] / scene.viscous[run] for log in (-40.0, np.log(5.0)))
    followed = late[5:7] / at_once[5:7]
    dwell = float(np.diff(points.clock[run])[0])
    means = 1 - 5.0 / dwell * np.exp(-dwell / 5.0 * np.arange(2)) * -np.expm1(-dwell / 5.0)
    np.testing.assert_allclose(followed, means, rtol=1e-3)
    assert np.abs(late[:5]).max() == 0.0


def test_a_delay_is_the_torque_of_a_moment_before(scene: Scene) -> None:
    delayed = scene.curve + BY_SLUG["channel_delay"].change(scene, 0.05, ())
    loop = np.flatnonzero(scene.points.loop == 0)
    phase, late = scene.points.phase[loop], 0.05 * scene.points.angular_frequency[loop]
    expected = np.interp(phase - late, phase, scene.curve[loop], period=2 * np.pi)
    away = scene.points.velocity[loop] > 1.0  # the cusp at rest is no parabola
    np.testing.assert_allclose(delayed[loop][away], expected[away], rtol=2e-4)


def test_wear_at_a_pace_is_the_clutch_of_later(scene: Scene) -> None:
    """Where cycles count twice from some on, torque is that of the cycles so counted, and the amplitude is the static torque
    that is lost by them at the last state."""
    facts, onset, last = scene.facts, float(scene.facts.states[3]), float(scene.facts.states[-1])
    counted = scene.points.cycles + np.maximum(scene.points.cycles - onset, 0.0)
    ends = np.array([last, last + (last - onset)])
    static = scene.laws.parameters(np.full(2, facts.usual_pressure), ends)[:, 0]
    lost = 1.0 - float(static[1] / static[0])
    change = BY_SLUG["accelerated_wear"].change(scene, lost, (onset, 1.0, PACE))
    np.testing.assert_allclose(change, scene.curve_with(cycles=counted) - scene.curve, atol=2e-3 * np.abs(change).max())
    assert lost > 0.01


def test_viscosity_meets_its_two_points_and_one_of_the_reference() -> None:
    oil = Oil(viscosity_40=56e-6, viscosity_100=9.3e-6)
    found = viscosity(np.array([313.15, 373.15, 353.15, 363.15]), oil)
    np.testing.assert_allclose(found[:2], [56e-6, 9.3e-6], rtol=1e-9)
    # log10 log10(ν + 0.7) = 8.2404 - 3.2040 log10 T, rounded coefficients: 1 % of ν
    expected = 10**10 ** (8.2404 - 3.2040 * np.log10([353.15, 363.15])) - 0.7
    np.testing.assert_allclose(found[2:] * 1e6, expected, rtol=0.01)
    assert 0.2 < 1 - found[3] / found[2] < 0.24  # 22 % over the reference's 80 to 90 °C


def test_a_dwell_that_is_far_too_short_is_remembered_for_several(scene: Scene) -> None:
    """x_i = S_i + k a (x_{i-1} - S_i) plateau by plateau, against what the effect says of all at once."""
    effect, points = BY_SLUG["unsettled_dwell"], scene.points
    for share, carried in ((0.3, 1.0), (0.4, 0.5)):
        told = effect.change(scene, share, (0.0, carried))
        ends = scene.curve.copy()
        expected = np.zeros_like(ends)
        for i in np.flatnonzero(points.previous >= 0):
            before = ends[points.previous[i]]
            expected[i] = share * (before - scene.curve[i])
            ends[i] += carried * expected[i]
        np.testing.assert_allclose(told, expected, atol=1e-9)
    assert np.abs(effect.change(scene, 0.3, (0.0, 1.0)) - effect.change(scene, 0.3, (0.0, 0.0))).max() > 0.1


# --- The direction of the last change, by hand.


@pytest.mark.parametrize(
    ("values", "breaks", "expected"),
    [
        ([1.0, 1.0, 2.0, 2.0, 2.001, 1.0, 1.0], [0], [0, 0, 1, 1, 1, -1, -1]),
        ([1.0, 2.0, 1.0, 1.0, 2.0], [0, 2], [0, 1, 0, 0, 1]),
        ([3.0], [0], [0]),
    ],
)
def test_the_direction_is_that_of_the_last_change(values: list[float], breaks: list[int], expected: list[int]) -> None:
    """A run begins at each of the breaks."""
    previous = np.arange(-1, len(values) - 1)
    previous[breaks] = -1
    assert last_direction(np.array(values), previous).tolist() == expected


# --- The prior of an effect's amplitude: a density, a slope that is its derivative, tails that let a large effect
# through.


@pytest.mark.parametrize("effect", [*CATALOGUE, replace(BY_SLUG["oil_change"], tails=float("inf"))])
def test_the_prior_is_students_density_or_a_normal_one(effect: Effect) -> None:
    def density(a: float) -> float:
        return float(np.exp(effect.log_amplitude_peak - effect.amplitude_cost(a)) / np.sqrt(2 * np.pi))

    total = quad(lambda u: density(u * effect.prior_sd) * effect.prior_sd, -np.inf, np.inf)[0]
    assert total == pytest.approx(1.0, abs=1e-6)
    witness = t(df=effect.tails, scale=effect.prior_sd)
    for deviations in (0.0, 0.3, 6.0):
        at = deviations * effect.prior_sd
        assert np.log(density(at)) == pytest.approx(witness.logpdf(at), abs=1e-9)


@pytest.mark.parametrize("tails", [2.0, 5.0, float("inf")])
def test_the_precision_is_the_slope_of_the_cost(tails):
    effect = replace(BY_SLUG["oil_change"], tails=tails)
    for a in (-3.0, 0.01, 0.4):
        step = 1e-6
        slope = (effect.amplitude_cost(a + step) - effect.amplitude_cost(a - step)) / (2 * step)
        assert effect.amplitude_precision(a) * a == pytest.approx(slope, rel=1e-5)


# --- Model discrepancy of templates, structure that has more evidence than any effect, and noise that does not
# vanish.


@pytest.fixture(scope="module")
def given():
    return study(campaign(3))


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda each: each.slug)
def test_discrepancy_factors_stay_within_one_and_are_independent(given, effect):
    """Each φ lies within ±1, and no two of an effect are one."""
    columns = discrepancy_factors(given.design, effect)
    assert columns.shape[0] == given.design.torque.size
    assert np.abs(columns).max(initial=0.0) <= 1.0
    rank = np.linalg.matrix_rank(columns - columns.mean(axis=0)) if columns.shape[1] else 0
    assert rank == columns.shape[1]


#: What reads the laws at another pressure or at other cycles, and what only records in time show.
ELSEWHERE = {"pressure_offset", "load_severity", "shaft_ripple", "stick_slip"}


@pytest.mark.parametrize("slug", sorted({effect.slug for effect in CATALOGUE} - ELSEWHERE))
def test_a_fit_knows_that_effects_change_with_the_friction_that_they_change(given: Study, slug: str) -> None:
    design, fit = given.problem.design, given.baseline.fit
    effect = BY_SLUG[slug]
    loud = FittedEffect(effect=effect, amplitude=2 * effect.prior_sd, shape=effect.grid(design.facts)[-1].shape)
    laws, free = fit.laws, np.flatnonzero(given.problem.priors.free)

    def model(theta: FloatArray) -> FloatArray:
        prediction = predict(design, replace(laws, theta=theta))
        return prediction.torque + loud.rows(design, prediction)

    wanted = []
    for place in free.tolist():
        step = np.zeros(laws.theta.size)
        step[place] = 1e-5 * max(abs(float(laws.theta[place])), 1.0)
        wanted.append((model(laws.theta + step) - model(laws.theta - step)) / (2 * step[place]))
    columns = law_columns(design, fit.prediction, [loud])[:, free]
    off = np.linalg.norm(columns - np.array(wanted).T, axis=0)
    exact = slug != "unsettled_dwell"  # which reads the laws at the pressure before
    assert (off <= (1e-3 if exact else 0.03) * np.linalg.norm(wanted, axis=1)).all()


def test_a_discrepancy_absorbs_what_a_template_misses_as_far_as_its_prior_allows(given):
    """Whitened squares that are left of a truth off by one deviation of the prior, with discrepancy and without; a truth
    that is off by ten deviations keeps most of its misfit."""
    drag = BY_SLUG["hydrodynamic_drag"]
    fitted = of_size("hydrodynamic_drag", 1.5, (1.0, 0.0, 0.0, 0.0))
    baseline = given.baseline
    change = fitted.rows(given.design, baseline.fit.prediction)
    extra = fitted.discrepancy_columns(given.design, baseline.fit.prediction)[:, :1].sum(axis=1)
    stiff = replace(fitted, effect=replace(drag, discrepancies=()))

    def left(each: FittedEffect, by: float) -> float:
        residual = baseline.fit.residual * 0 + by * DISCREPANCY_SD * extra
        model = replace(baseline.fit, effects=(each,), torque=baseline.fit.torque + change, residual=residual)
        return project(gram_of(given.problem, model, exact=False), 1e-3, 0.0).miss

    nothing = left(fitted, 0.0)
    assert left(stiff, 1.0) - left(stiff, 0.0) > 100.0
    assert left(fitted, 1.0) - nothing < 1.1  # one deviation costs what its prior asks for it
    assert left(fitted, 10.0) - nothing > 50.0


def test_noise_does_not_vanish_where_a_fit_is_far_off(given):
    """A residual with an offset of hundreds of deviations on each curve holds the same noise as one without."""
    design, rng = given.design, np.random.default_rng(2)
    noise = 0.1 * rng.standard_normal(design.torque.size) / np.sqrt(design.samples)
    start = first_noise(design)
    plain, _ = estimate_noise(design, noise, design.torque, start)
    offset, _ = estimate_noise(design, noise + 40.0, design.torque, start)
    assert np.median(offset.deviation / plain.deviation) == pytest.approx(1.0, rel=0.05)
    assert fit_baseline(design).problem.noise.deviation.min() > 0


# --- What a rest's length and a film's own equation do, against computations of another kind.

HOUR, DAY = 3600.0, 86400.0


def rested(*hours: float) -> Campaign:
    """A campaign of a test a day whose log says how long the clutch rested before those at 1000, 3000 ... cycles."""
    given = campaign(1)
    tests = given.stationary[1 : 1 + len(hours)]
    events = [
        MaintenanceEvent(cycles=test.cycles, event=EventKind.REST, moment=(test.moment or 0.0) - HOUR * rest)
        for test, rest in zip(tests, hours, strict=True)
    ]
    return replace(given, maintenance=tuple(events))


def test_friction_recovers_with_the_rest_before_a_test() -> None:
    given = rested(2.0, 10.0)
    facts, scene = facts_of(given), scene_of(given)
    assert facts.rests == (1000.0, 3000.0)
    np.testing.assert_allclose(facts.rest_lengths, [2 * HOUR, 10 * HOUR])
    np.testing.assert_allclose(facts.rest_moments, [1e9 + DAY, 1e9 + 2 * DAY])
    effect, first = BY_SLUG["rest_recovery"], scene.points.clock == scene.points.clock[0]
    shares = {}
    for power in (0.0, 1.0):  # of the logarithm of the rest
        change = effect.change(scene, 0.01, (10.0, BY_USE, 6.0, power, WHOLE)) / scene.curve
        shares[power] = [float(change[first & (scene.points.cycles == at)].max()) for at in (1000.0, 3000.0)]
    kept = shares[0.0][0]  # of the cycles and the clock, the same for both
    assert shares[0.0] == pytest.approx([kept, kept])
    assert shares[1.0] == pytest.approx([kept * np.log(3.0) / np.log(11.0), kept])
    # friction as a whole, or its static torque
    whole, static = (effect.change(scene, 0.01, (10.0, BY_USE, 6.0, 0.0, part)) for part in (WHOLE, STATIC))
    some = whole > 0
    sheared = np.where(np.arange(4) == 3, 0.0, scene.parameters)  # without C_v the curve is that of the asperities
    share = curve(scene.points.velocity, sheared) / scene.curve
    np.testing.assert_allclose(static[some], (whole * share)[some], rtol=1e-12)
    assert np.ptp(share[some]) > 0.1
    assert {one.shape[-1] for one in effect.grid(scene.facts)} == {WHOLE, STATIC}


@pytest.mark.parametrize("told", ["at the beginning", "at the end", "not at all"])
def test_a_pause_is_what_the_engagements_between_two_tests_leave(told: str) -> None:
    """20 s an engagement, whether a block is timed by when it began, by when it was over or not sent; the clutch rests for
    12 h before the one from 1000 cycles and for 30 h before that from 6000."""
    rests = {1000.0: 12 * HOUR, 6000.0: 30 * HOUR}
    given, moment, tests, blocks = campaign(1, loops=False), 1e9, list[StationaryRun](), list[DutyRun]()
    for test, after in itertools.pairwise(given.stationary):
        tests.append(replace(test, moment=moment))
        engagements = after.cycles - test.cycles
        begun = moment + 0.5 * HOUR + rests.get(test.cycles, 0.0)
        over = begun + 20.0 * engagements
        block = DutyRun(cycles=after.cycles, engagements=engagements)
        if told != "not at all":
            blocks.append(replace(block, moment=begun if told == "at the beginning" else over - 60.0))
        moment = over
    tests.append(replace(given.stationary[-1], moment=moment))
    facts = facts_of(replace(given, stationary=tuple(tests), duty=tuple(blocks)))
    assert facts.rests == (3000.0, 10000.0)
    np.testing.assert_allclose(facts.rest_lengths, [12 * HOUR, 30 * HOUR], atol=1.2 * HOUR)


def test_a_test_before_the_pause_at_the_same_cycles_has_not_rested() -> None:
    """The dynamic test follows the stationary one by 2000 s; the pause lies between them."""
    given = campaign(1)
    pause = MaintenanceEvent(cycles=3000.0, event=EventKind.REST, moment=1e9 + 2 * DAY + 1000.0)
    scene = scene_of(replace(given, maintenance=(pause,)))
    change = BY_SLUG["rest_recovery"].change(scene, 0.01, (100.0, BY_CLOCK, math.log(600.0), 0.0, WHOLE))
    here = scene.points.cycles == 3000.0
    assert np.abs(change[here & scene.points.steady]).max() < 1e-6
    assert np.abs(change[here & ~scene.points.steady]).max() > 1e-3


def test_a_film_is_the_same_whatever_rows_are_asked_for() -> None:
    """One amplitude means one film time: loops of one pressure alone show what they show among the others."""
    scene = scene_of(campaign(1))
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
    scene = scene_of(campaign(1))
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
    scene = scene_of(campaign(1))
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


def test_the_appendix_holds_the_tables_that_the_catalogue_gives() -> None:
    held = parts((APPENDIX / "diagnosis.md").read_text(encoding="utf-8"))
    for name, make in TABLES.items():
        assert held[name] == make(), "run python -m tests.models.diagnosis.tables"
