"""Every effect of the catalogue: what its change looks like, its units and its limits."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm, t

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Scene, scene_of
from models.diagnosis.baseline.prediction import frame_of, predict
from models.diagnosis.campaign import Oil
from models.diagnosis.criteria import DISCREPANCY_SD
from models.diagnosis.design.design import build_design
from models.diagnosis.diagnose import diagnose
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.effect import (
    Discrepancy,
    Effect,
    Kind,
    amplitude_cost,
    amplitude_precision,
    log_amplitude_peak,
    unit_changes,
)
from models.diagnosis.effects.faults import last_direction
from models.diagnosis.effects.fitted_effect import (
    FittedEffect,
    discrepancy_columns,
    discrepancy_factors,
    effect_rows,
    law_columns,
)
from models.diagnosis.effects.readings import DAYS, STRAIGHT
from models.diagnosis.effects.thermal import HERSEY, log_viscosity_ratio, viscosity
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline, starting_laws
from models.diagnosis.pooled_fit.projection import gram_of, project
from models.friction.stribeck import GAMMA, torque
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, of_size, study


@pytest.fixture(scope="module")
def scene() -> Scene:
    design = build_design(campaign(1))
    return predict(design, starting_laws(design, frame_of(design))).scene


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.slug)
def test_no_amplitude_no_change_where_pressure_scatters_about_its_levels(effect: Effect, scene: Scene) -> None:
    """Half of the rows of the lowest level lie below it, where M̄_c's law ends."""
    rng = np.random.default_rng(1)
    pressure = scene.points.pressure + 2_000.0 * rng.standard_normal(scene.points.pressure.size)
    scattered = scene_of(scene.laws, replace(scene.points, pressure=pressure), scene.facts)
    for tried in effect.grid(scene.facts):
        assert np.abs(effect.change(scattered, 0.0, tried.shape)).max() < 1e-9


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.slug)
def test_no_amplitude_no_change_and_all_changes_are_finite(effect: Effect, scene: Scene) -> None:
    grid = effect.grid(scene.facts)
    columns = unit_changes(effect, scene, [tried.shape for tried in grid]).T if grid else np.zeros((0, 0))
    for tried, column in zip(grid, columns, strict=True):
        assert np.abs(effect.change(scene, 0.0, tried.shape)).max() < 1e-9
        assert column.shape == scene.curve.shape
        assert np.isfinite(column).all()
        one = effect.change(scene, 1e-3 * effect.prior_sd, tried.shape) / (1e-3 * effect.prior_sd)
        np.testing.assert_allclose(column, one, rtol=1e-9, atol=1e-9 * np.abs(one).max())  # many at once, or each alone
        assert np.abs(column).max() > 0
        doubled = effect.change(scene, 2e-3 * effect.prior_sd, tried.shape) / (2e-3 * effect.prior_sd)
        moving = (
            scene.points.velocity > 0.01 * scene.points.velocity.max()
        )  # a film that stands is slow whatever its time
        # small amplitudes act in proportion
        assert np.abs(doubled - column)[moving].max() < 0.05 * np.abs(column[moving]).max()


def test_effects_of_loops_leave_plateaus_alone(scene: Scene) -> None:
    for effect in CATALOGUE:
        if effect.kind is Kind.LAG:
            for tried in effect.grid(scene.facts):
                assert np.abs(effect.change(scene, effect.prior_sd, tried.shape)[scene.points.steady]).max() == 0


def test_units_of_a_few(scene: Scene) -> None:
    steady = scene.points.steady
    inertia = BY_SLUG["inertia_torque"].change(scene, 1.0, ())
    np.testing.assert_allclose(inertia, scene.points.acceleration / 0.058)  # 1 kg m² feels dω/dt
    drag = BY_SLUG["hydrodynamic_drag"].change(scene, 1.0, (1.0, 0.0, 0.0, 0.0))
    assert np.ptp(drag[steady] / scene.points.velocity[steady]) < 1e-12  # pressure is not in it
    offset = BY_SLUG["pressure_offset"].change(scene, 1000.0, (0.0, 0.0, 0.0))
    higher = scene.curve_at(pressure=scene.points.pressure + 1000.0) - scene.curve
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
    expected = scene.curve_at(velocity=points.velocity * thinner) - scene.curve
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


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.slug)
def test_the_prior_is_a_density_with_students_tails(effect):
    def density(a: float) -> float:
        return float(np.exp(log_amplitude_peak(effect) - amplitude_cost(effect, a)) / np.sqrt(2 * np.pi))

    total = quad(lambda u: density(u * effect.prior_sd) * effect.prior_sd, -np.inf, np.inf)[0]
    assert total == pytest.approx(1.0, abs=1e-6)
    witness = t(df=effect.tails, scale=effect.prior_sd).logpdf(6 * effect.prior_sd)
    assert np.log(density(6 * effect.prior_sd)) == pytest.approx(witness, abs=1e-9)
    assert witness > norm(scale=effect.prior_sd).logpdf(6 * effect.prior_sd) + 10.0


@pytest.mark.parametrize("tails", [2.0, 5.0, float("inf")])
def test_the_precision_is_the_slope_of_the_cost(tails):
    effect = replace(BY_SLUG["oil_change"], tails=tails)
    for a in (-3.0, 0.01, 0.4):
        step = 1e-6
        slope = (amplitude_cost(effect, a + step) - amplitude_cost(effect, a - step)) / (2 * step)
        assert amplitude_precision(effect, a) * a == pytest.approx(slope, rel=1e-5)


def test_infinite_tails_are_a_normal_prior():
    effect = replace(BY_SLUG["oil_change"], tails=float("inf"))
    witness = norm(scale=effect.prior_sd)
    for a in (0.0, 0.3):
        found = log_amplitude_peak(effect) - amplitude_cost(effect, a) - 0.5 * np.log(2 * np.pi)
        assert found == pytest.approx(witness.logpdf(a), abs=1e-12)


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
        return prediction.torque + effect_rows(design, prediction, loud)

    wanted = []
    for place in free.tolist():
        step = np.zeros(laws.theta.size)
        step[place] = 1e-5 * max(abs(float(laws.theta[place])), 1.0)
        wanted.append((model(laws.theta + step) - model(laws.theta - step)) / (2 * step[place]))
    columns = law_columns(design, fit.prediction, [loud])[:, free]
    off = np.linalg.norm(columns - np.array(wanted).T, axis=0)
    exact = slug != "unsettled_dwell"  # which reads the laws at the pressure before
    assert (off <= (1e-3 if exact else 0.03) * np.linalg.norm(wanted, axis=1)).all()


def test_an_exact_law_has_no_discrepancy(given):
    """J dω/dt has no form to be uncertain of; a zero adds the same torque at every speed, a drag does not."""
    assert discrepancy_factors(given.design, BY_SLUG["inertia_torque"]).shape[1] == 0
    assert Discrepancy.SPEED not in BY_SLUG["torque_zero_shift"].discrepancies
    assert Discrepancy.SPEED in BY_SLUG["hydrodynamic_drag"].discrepancies


def test_a_discrepancy_absorbs_what_a_template_misses_as_far_as_its_prior_allows(given):
    """Whitened squares that are left of a truth off by one deviation of the prior, with discrepancy and without; a truth
    that is off by ten deviations keeps most of its misfit."""
    drag = BY_SLUG["hydrodynamic_drag"]
    fitted = of_size("hydrodynamic_drag", 1.5, (1.0, 0.0, 0.0, 0.0))
    baseline = given.baseline
    change = effect_rows(given.design, baseline.fit.prediction, fitted)
    extra = discrepancy_columns(given.design, baseline.fit.prediction, fitted)[:, :1].sum(axis=1)
    stiff = replace(fitted, effect=replace(drag, discrepancies=()))

    def left(each: FittedEffect, by: float) -> float:
        residual = baseline.fit.residual * 0 + by * DISCREPANCY_SD * extra
        model = replace(baseline.fit, effects=(each,), torque=baseline.fit.torque + change, residual=residual)
        return project(gram_of(given.problem, model), 1e-3, 0.0).miss

    nothing = left(fitted, 0.0)
    assert left(stiff, 1.0) - left(stiff, 0.0) > 100.0
    assert left(fitted, 1.0) - nothing < 1.1  # one deviation costs what its prior asks for it
    assert left(fitted, 10.0) - nothing > 50.0


@pytest.mark.slow
def test_a_bump_in_speed_is_no_drag():
    """Friction is higher in a band of speeds, in proportion to what it is there: no drag, which pressure does not change."""

    def share(at):
        return 0.06 * np.exp(-0.5 * ((at.velocity - 6.0) / 1.5) ** 2)

    report = diagnose(
        campaign(5, lambda at: share(at) * torque(at.velocity, at.parameters)), rng=np.random.default_rng(1)
    )
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert report.baseline is not None
    assert report.baseline.where[0].axis == "speed_rpm"
    assert all(each.probability < 0.5 for each in report.candidates)


def test_noise_does_not_vanish_where_a_fit_is_far_off(given):
    """A residual with an offset of hundreds of deviations on each curve holds the same noise as one without."""
    design, rng = given.design, np.random.default_rng(2)
    noise = 0.1 * rng.standard_normal(design.torque.size) / np.sqrt(design.samples)
    start = first_noise(design)
    plain, _ = estimate_noise(design, noise, design.torque, start)
    offset, _ = estimate_noise(design, noise + 40.0, design.torque, start)
    assert np.median(offset.deviation / plain.deviation) == pytest.approx(1.0, rel=0.05)
    assert fit_baseline(design).problem.noise.deviation.min() > 0
