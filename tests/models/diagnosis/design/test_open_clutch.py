"""Readings with the clutch open: no friction there, its own drag, and what of the reading is no friction's."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.baseline.laws import OPEN_DRAG, Laws
from models.diagnosis.baseline.prediction import frame_of, predict
from models.diagnosis.campaign import Campaign, StationaryRun
from models.diagnosis.criteria import SURE, WORTHWHILE
from models.diagnosis.design.design import Design, build_design, mark_open, points_of
from models.diagnosis.effects.catalogue import CATALOGUE
from models.diagnosis.experiments.candidates import PASSES, TRIALS, runs_of, with_trial
from models.diagnosis.experiments.test_plan import advise
from models.diagnosis.explanations.contrasts import contrasts_of
from models.diagnosis.explanations.evidence import evidence_of
from models.diagnosis.explanations.verdict import Fitted, Verdict
from models.diagnosis.pooled_fit.baseline_fit import fit_baseline, missing_for_baseline
from models.diagnosis.report.maps import loop_traces, residual_maps
from models.diagnosis.validation.held_out import FittedModel, measure_gain
from models.records.criteria import UNLOADED
from tests.models.diagnosis.campaigns import CYCLES, SPEEDS, Study, Where, altered, campaign, look, start_of, study

INERTIA = 0.004
STATES = CYCLES[:4]


def inertia(at: Where) -> np.ndarray:
    return INERTIA * at.acceleration / 0.058


def drag(velocity: np.ndarray) -> np.ndarray:
    """Rises and falls again: no polynomial."""
    x = velocity / 6.0
    return np.asarray(0.5 * x / (1 + 0.8 * x * x), dtype=np.float64)


def opened(given: Campaign, *, moment_of_inertia: float = 0.0, zero: float = 0.0, gauge: float = 0.0) -> Campaign:
    """With the trial `open_clutch` made; the gauge reads what it reads without pressure [Pa]."""
    then = with_trial(given, "open_clutch")
    rng = np.random.default_rng(5)
    sweep, loops = then.stationary[-1], then.dynamic[-1]
    table, record = sweep.plateaus, loops.record

    def reading(speed: np.ndarray, turning: np.ndarray) -> np.ndarray:
        torque = drag(np.abs(given.geometry.sliding_velocity(speed))) + moment_of_inertia * turning + zero
        return np.asarray(torque + 0.05 * rng.standard_normal(speed.size), dtype=np.float64)

    scatter = gauge * rng.standard_normal(record.time.size) - gauge
    measured = replace(table, torque=reading(table.speed, 0.0 * table.speed), pressure=table.pressure - gauge)
    turning = np.gradient(record.speed, record.time)
    swung = replace(record, torque=reading(record.speed, turning), pressure=record.pressure + scatter)
    return replace(
        then,
        stationary=(*given.stationary, replace(sweep, plateaus=measured)),
        dynamic=(*given.dynamic, replace(loops, record=swung)),
    )


@pytest.fixture(scope="module")
def swung() -> Study:
    return study(campaign(31, inertia, cycles=STATES))


@pytest.fixture(scope="module")
def given(swung: Study) -> Study:
    return study(opened(swung.campaign, moment_of_inertia=INERTIA, gauge=2000.0))


def started(design: Design) -> Laws:
    laws = start_of(design)
    theta = laws.theta.copy()
    theta[OPEN_DRAG] = 0.3, -0.1, 0.05, 0.02
    return replace(laws, theta=theta)


def test_open_readings_are_rows_of_their_own(swung: Study, given: Study) -> None:
    design = given.design
    assert (~design.closed).sum() > PASSES * SPEEDS.size
    assert (design.level[~design.closed] == 0.0).all()
    assert set(design.rows.run[~design.closed]) == set(np.unique(design.rows.run)[[len(STATES), -1]])
    np.testing.assert_array_equal(design.levels, swung.design.levels)
    assert frame_of(design).lowest == frame_of(swung.design).lowest
    np.testing.assert_array_equal(frame_of(design).loop_pressures, frame_of(swung.design).loop_pressures)
    # what the laws are asked for at them is a pressure that was measured
    assert design.points.pressure.min() > 3.9e5
    # the control: a light pressure is none
    light = build_design(with_trial(swung.campaign, "light_tests"))
    assert light.closed.all()


def test_an_open_clutch_has_the_lowest_closed_pressure() -> None:
    found = mark_open(points_of(3, pressure=np.array([4 * UNLOADED, 0.5 * UNLOADED, UNLOADED])))
    assert found.engaged.tolist() == [1.0, 0.0, 1.0]
    assert found.pressure.tolist() == [4 * UNLOADED, UNLOADED, UNLOADED]


def test_there_is_no_friction_with_the_clutch_open(given: Study) -> None:
    prediction = predict(given.design, started(given.design))
    scene, opened = prediction.scene, prediction.scene.points.engaged == 0
    for values in (
        scene.curve, scene.gradient, scene.by_velocity, scene.by_pressure, scene.viscous,
        scene.curve_with(cycles=scene.points.cycles + 100.0), scene.curve_with(pressure=scene.points.pressure * 1.1),
    ):  # fmt: skip
        assert np.abs(values[opened]).max() == 0.0
        assert np.abs(values[~opened]).max() > 0.0
    # what is left is the drag alone, in loops without a lag
    x = scene.points.velocity / scene.laws.frame.reference_velocity
    left = given.design.to_rows(0.3 * x - 0.1 * x**2 + 0.05 * x**3 + 0.02 * x**4)
    np.testing.assert_allclose(prediction.torque[~given.design.closed], left[~given.design.closed], rtol=1e-12)


@pytest.mark.parametrize("effect", CATALOGUE, ids=[effect.slug for effect in CATALOGUE])
def test_only_inertia_and_a_zero_are_left_of_the_catalogue(effect, given: Study) -> None:
    scene = predict(given.design, started(given.design)).scene
    opened = scene.points.engaged == 0
    rested = {"rests": (10.0,), "rest_moments": (np.nan,), "rest_lengths": (np.nan,)}
    duty = {"duty_ends": np.array([1e3, 6e3]), "duty_energies": np.array([1e4, 2e4])}
    for facts in (scene.facts, replace(scene.facts, **rested, **duty)):
        at = replace(scene, facts=facts)
        tried = effect.grid(facts)
        if tried:
            columns = effect.unit_changes(at, [each.shape for each in tried])
            assert np.isfinite(columns).all()
            assert (np.abs(columns[opened]).max() > 0) == (effect.slug in {"inertia_torque", "torque_zero_shift"})


def test_the_jacobian_is_that_of_central_differences(given: Study) -> None:
    """Of rows with friction, in plateaus and in loops, and of those without."""
    design = given.design
    laws = started(design)
    jacobian = predict(design, laws).jacobian(design)
    for k in range(laws.theta.size):
        step = np.zeros(laws.theta.size)
        step[k] = 1e-5 * max(abs(laws.theta[k]), 0.1)
        above, below = (predict(design, replace(laws, theta=laws.theta + sign * step)).torque for sign in (1, -1))
        numeric = (above - below) / (2 * step[k])
        # in loops a change of S goes through the continuous law, differences through its steps: 1 % of the largest
        assert np.abs(numeric - jacobian[:, k]).max() <= 0.01 * np.abs(numeric).max() + 1e-9, k
    assert np.abs(jacobian[~design.closed][:, : OPEN_DRAG.start]).max() == 0.0
    assert np.abs(jacobian[design.closed][:, OPEN_DRAG]).max() == 0.0


def test_the_drag_is_fitted_and_held_fast_where_there_is_none(swung: Study, given: Study) -> None:
    assert given.problem.priors.free[OPEN_DRAG].all()
    assert not swung.problem.priors.free[OPEN_DRAG].any()
    extended = given.extended(("inertia_torque", 0.001, ()))
    left = extended.residual[~given.design.closed & given.design.rows.steady]
    assert abs(left.std() / 0.05 - 1) < 0.2  # the noise that was put in, though the drag is no polynomial
    assert extended.effects[0].amplitude == pytest.approx(INERTIA, rel=0.03)


@pytest.mark.slow
def test_an_open_clutch_parts_inertia_from_a_film(swung: Study, given: Study) -> None:
    shape = (0.4, 0.8, 0.05, 0.7, 1.0, 1.0)
    parted = []
    for each in (swung, given):
        mass, film = each.extended(("inertia_torque", 0.001, ())), each.extended(("squeeze_film", 0.005, shape))
        parted.append(film.cost - mass.cost)
    assert parted[1] > parted[0] + 50.0


def test_an_open_clutch_is_advised_where_it_decides(swung: Study) -> None:
    fits = [
        swung.extended(("inertia_torque", 0.001, ())),
        swung.extended(("squeeze_film", 0.005, (0.4, 0.8, 0.05, 0.7, 1.0, 1.0))),
    ]
    standing = [Fitted(slugs=(), fit=each, evidence=0.0) for each in fits]
    found = advise(swung.campaign, swung.problem, standing)
    opened_up = next(advice for advice in found if advice.key == "open_clutch")
    assert opened_up.nats > WORTHWHILE
    # of those that are sure to decide the shortest comes first
    assert all(advice.probability >= SURE for advice in (found[0], opened_up))
    assert found[0].minutes <= opened_up.minutes


def test_nothing_that_is_said_of_open_rows_is_no_number(given: Study, swung: Study) -> None:
    design, noise, fit = given.design, given.problem.noise, given.baseline.fit
    columns, _ = contrasts_of(design, fit.prediction)
    assert np.isfinite(columns).all()
    assert np.abs(columns[~design.closed]).max() == 0.0
    assert (noise.deviation > 0).all()
    assert np.isfinite(noise.deviation).all()
    extended = given.extended(("inertia_torque", 0.001, ()))
    assert np.isfinite(evidence_of(given.problem, extended).whole)
    maps = residual_maps(given.baseline, given.problem, extended)
    np.testing.assert_array_equal(maps.pressure, swung.design.levels)
    assert min(each.pressure for each in loop_traces(given.baseline, given.problem, extended)) > 0
    both = FittedModel(given.problem, fit), FittedModel(given.problem, extended)
    gain = measure_gain(*both, np.random.default_rng(1))
    assert all(np.isfinite([gain.rmse_before, gain.rmse_after, gain.log_score_gain, gain.forecast_log_score_gain]))
    assert not {design.runs[run].run_id for run in design.rows.run[~design.closed]} & set(gain.held_out_runs)


@pytest.mark.parametrize("seed", range(6))
def test_any_mixture_of_open_rows_is_a_design(seed: int) -> None:
    """Pressures of any plateaus are taken away, readings about no pressure of either sign put in their place."""
    rng = np.random.default_rng(seed)
    whole = campaign(40 + seed, cycles=(0.0, 3000.0), loops=bool(seed % 2))

    def opened_at_times(run: StationaryRun) -> dict[str, np.ndarray]:
        away = rng.random(run.plateaus.torque.size) < rng.uniform(0.0, 0.6)
        pressure = np.where(away, 300.0 * rng.standard_normal(away.size), run.plateaus.pressure)
        return {
            "pressure": pressure,
            "torque": np.where(away, 0.05 * rng.standard_normal(away.size), run.plateaus.torque),
        }

    mixed = altered(whole, opened_at_times)
    design = build_design(mixed)
    assert design.levels.min() > 1e5
    baseline = fit_baseline(design)
    assert np.isfinite(baseline.fit.cost)
    assert np.isfinite(baseline.fit.prediction.jacobian(design)).all()
    assert baseline.fit.residual[design.closed].std() < 0.6


def without_pressure(given: Campaign) -> Campaign:
    return altered(
        given,
        lambda run: {"pressure": 0.0 * run.plateaus.pressure},
        lambda run: {"pressure": 0.0 * run.record.pressure},
    )


def test_open_readings_alone_are_too_little_and_loops_without_pressure_go_with_sweeps_under_it() -> None:
    idle = without_pressure(campaign(24, cycles=(0.0, 3000.0)))
    design = build_design(idle)
    assert design.torque.size > 200
    assert not design.closed.any()
    assert "0 plateaus" in missing_for_baseline(design)
    assert look(idle, 1).verdict is Verdict.INSUFFICIENT_DATA
    assert with_trial(idle, "open_sweep") is None
    # loops only without pressure go with sweeps under it
    whole = campaign(25, cycles=(0.0, 3000.0, 6000.0))
    mixed = replace(whole, dynamic=without_pressure(whole).dynamic)
    fitted = fit_baseline(build_design(mixed))
    assert np.isfinite(fitted.fit.cost)


def test_the_open_sweep_is_five_passes_over_one_pressures_speeds() -> None:
    then = with_trial(campaign(24, cycles=(0.0, 3000.0)), "open_clutch")
    table, record = then.stationary[-1].plateaus, then.dynamic[-1].record
    np.testing.assert_allclose(table.speed, np.tile(SPEEDS, PASSES))
    assert not table.pressure.any()
    assert not record.pressure.any()
    assert record.time[-1] == pytest.approx(10 / 0.3)
    assert runs_of("open_clutch") == 2.0
    # what a trial adds is no pattern of the next one
    again = with_trial(then, "light_sweep")
    assert again.stationary[-1].plateaus.pressure.min() == pytest.approx(1e5)
    assert TRIALS["open_clutch"].text
