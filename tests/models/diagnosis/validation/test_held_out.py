"""What an extension gains on held-out runs: something where there is an effect, nothing where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import ATTRACTOR, Scene
from models.diagnosis.criteria import FEW_STEPS
from models.diagnosis.design.autocorrelation import Correlation
from models.diagnosis.design.design import CLOCK, PHASE, PRESSURE, SPEED
from models.diagnosis.design.design import CYCLES as BY_CYCLES
from models.diagnosis.design.design import TEMPERATURE as TEMPERATURE_AXIS
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.fitted_effect import FittedEffect, law_columns
from models.diagnosis.effects.thermal import AT_ONCE
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import law_torque
from models.diagnosis.validation import held_out
from models.diagnosis.validation.extended_model import SLUG, smooth_fit
from models.diagnosis.validation.held_out import FittedModel, Gain, measure_gain
from models.friction.stribeck import torque
from tests.models.diagnosis.campaigns import CYCLES, Study, Where, bump, campaign, study, warmth

TEMPERATURE = ("oil_temperature", 0.3, (0.5, AT_ONCE))


@pytest.fixture(scope="module")
def warm() -> Study:
    return study(campaign(11, warmth, loops=False))


@pytest.fixture(scope="module")
def plain() -> Study:
    return study(campaign(11, loops=False))


def gain_of(given: Study, extended: PooledFit) -> Gain:
    return gain_over(given.problem, given.baseline.fit, extended)


def gain_over(problem: FitProblem, before: PooledFit, after: PooledFit) -> Gain:
    return measure_gain(FittedModel(problem, before), FittedModel(problem, after), np.random.default_rng(0))


def test_a_planted_effect_gains_on_what_was_held_out(warm):
    found = gain_of(warm, warm.extended(TEMPERATURE))
    assert found.log_score_gain > 20
    assert found.forecast_log_score_gain > 0
    assert found.reduction_percent > 5 * found.reduction_sd > 0
    # most of what was beyond noise is gone
    assert found.excess_after < 0.5 * found.excess_before
    assert found.mse_percent_after < found.mse_percent_before
    assert found.rmse_after == pytest.approx(found.rmse_before * (1 - found.reduction_percent / 100))
    assert set(found.held_out_runs) == {run.run_id for run in warm.design.runs}


def test_no_effect_no_gain(plain):
    found = gain_of(plain, plain.extended(TEMPERATURE))
    assert found.log_score_gain < 2
    assert -3 < found.reduction_percent < 1
    assert found.excess_after == pytest.approx(found.excess_before, abs=0.02)


def test_what_was_learned_of_single_curves_does_not_gain(plain):
    """A bump in speed of its own for every curve: it fits better, and by row it would predict better. By run it cannot."""
    design = plain.design
    rng = np.random.default_rng(3)
    sizes = 0.3 * rng.standard_normal(design.curve.max() + 1)
    shape = np.sin(np.pi * design.rows.velocity / design.rows.velocity.max() * 3)
    bumpy = replace(design, torque=design.torque + sizes[design.curve] * shape)
    problem = replace(plain.problem, design=bumpy)
    null = fit(problem, plain.baseline.fit.laws)
    start = [
        FittedEffect(effect=own_curve(curve, bumpy.curve, shape), amplitude=0.0, shape=())
        for curve in range(sizes.size)
    ]
    memorised = fit(problem, null.laws, start)
    learned = null.cost - memorised.cost
    assert learned > 100
    found = gain_over(problem, null, memorised)
    assert found.log_score_gain < 0.15 * learned
    inside = 100 * (1 - np.std(memorised.residual) / np.std(null.residual))
    assert found.reduction_percent < 0.25 * inside
    # curves that are held out are unlearned altogether
    out = bumpy.rows.cycles == CYCLES[2]
    masked = problem.with_noise(held_out._without(problem.noise, out))
    forgot = fit(masked, memorised.laws, memorised.effects, steps=2)
    sizes_of = [np.array([each.amplitude for each in model.effects]) for model in (memorised, forgot)]
    mine = np.unique(bumpy.curve[out])
    assert np.abs(sizes_of[1][mine]).max() < 0.01 * np.abs(sizes_of[0][mine]).max()
    # the control: every other row held out, the rest of each curve gives its bump away
    by_row = held_out._predicted_fold(
        FittedModel(problem, null), FittedModel(problem, memorised), np.arange(bumpy.torque.size) % 2 == 1
    )
    assert by_row.score > 0.25 * learned


def own_curve(curve, curves, shape):
    """An effect of one curve alone."""

    def change(_scene: Scene, amplitude: float, _: tuple[float, ...]) -> np.ndarray:
        return amplitude * np.where(curves == curve, shape, 0.0)

    return replace(
        BY_SLUG["inertia_torque"], slug=f"curve {curve}", change=change, shapes=(), prior_sd=0.3, before_lag=False
    )


def test_states_ahead_are_predicted_with_the_parameters_uncertainty(warm):
    """Against the dense normal density of the held-out rows given the others, every matrix written out."""
    given = warm
    priors = given.problem.priors
    noise = replace(given.problem.noise, plateaus=Correlation(), loops=Correlation(), run_gain=0.0, curve_gain=0.0)
    extended = given.extended(TEMPERATURE)
    out = held_out._last_states(given.design)
    for model in (given.baseline.fit, extended):
        masked = given.problem.with_noise(held_out._without(noise, out))
        found = fit(masked, model.laws, model.effects, steps=FEW_STEPS)
        own = [each.columns(given.design, found.prediction) for each in found.effects]
        laws = law_columns(given.design, found.prediction, found.effects)
        law = given.problem.law.scaled(noise.law)
        jacobian = np.concatenate([law, laws[:, priors.free], *own], axis=1)
        unit = jacobian / noise.deviation[:, None]
        precision = unit[~out].T @ unit[~out]
        rows = priors.rows[:, priors.free]
        beside = slice(law.shape[1], law.shape[1] + rows.shape[1])
        precision[beside, beside] += rows.T @ rows
        precision[: law.shape[1], : law.shape[1]] += np.eye(law.shape[1])
        if own:
            (each,) = found.effects  # half the width of a shape's bounds is its prior's deviation
            widths = [0.5 * (shape.highest - shape.lowest) for _, shape in each.effect.smooth(each.shape)]
            weak = [each.effect.amplitude_precision(each.amplitude), *(width**-2.0 for width in widths)]
            precision[[-3, -2, -1], [-3, -2, -1]] += weak
        scale = 1 / np.sqrt(np.diag(precision))
        spread = np.linalg.inv(precision * scale[:, None] * scale) * scale[:, None] * scale
        covariance = np.eye(int(out.sum())) + unit[out] @ spread @ unit[out].T
        residual = found.residual - law_torque(masked, found)
        density = multivariate_normal.logpdf((residual / noise.deviation)[out], cov=covariance)
        score = held_out._forecast_score(FittedModel(given.problem.with_noise(noise), model), out)
        assert score == pytest.approx(density + 0.5 * int(out.sum()) * np.log(2 * np.pi), abs=0.05)
        # the control: without the parameters' uncertainty it is another number
        bare = -0.5 * float(np.square(residual / noise.deviation)[out].sum())
        assert abs(score - bare) > 1


def test_loops_at_a_pressure_held_out_take_c_from_its_neighbours():
    given = study(campaign(5, cycles=(0.0, 5000.0, 12000.0)))
    nodes = given.baseline.fit.laws.frame.loop_pressures
    out = given.design.level == nodes[2]
    wild = given.baseline.fit.laws.theta.copy()
    wild[ATTRACTOR + 2] += 5.0
    laws = held_out._interpolated_loop_laws(replace(given.baseline.fit.laws, theta=wild), given.design, out)
    between = np.interp(nodes[2], nodes[[1, 3]], wild[[ATTRACTOR + 1, ATTRACTOR + 3]])
    assert laws.theta[ATTRACTOR + 2] == pytest.approx(between)
    assert np.array_equal(np.delete(laws.theta, ATTRACTOR + 2), np.delete(wild, ATTRACTOR + 2))
    # held out by state, every pressure has loops left: nothing is touched
    by_state = given.design.rows.cycles == 5000.0
    assert np.array_equal(
        held_out._interpolated_loop_laws(given.baseline.fit.laws, given.design, by_state).theta,
        given.baseline.fit.laws.theta,
    )


def test_one_state_and_one_pressure_leave_nothing_out():
    alone = study(campaign(6, loops=False, cycles=(100.0,)))
    design = alone.design
    one = replace(design, level=np.full_like(design.level, 5e5))
    fitted = alone.baseline.fit
    assert gain_over(replace(alone.problem, design=one), fitted, fitted) is None


# --- The law's discrepancy predicts what is held out: what friction does otherwise than eq. 3.


def test_a_bump_in_speed_is_the_laws_and_gains_over_eq_3() -> None:
    bumped = study(campaign(41, bump, loops=False))
    exact, law = bumped.baseline.exact, bumped.baseline.fit
    residual = law.residual - law_torque(bumped.problem, law)
    # what the law adds to eq. 3 peaks where the bump is
    velocity = bumped.design.rows.velocity
    near, far = np.abs(velocity - 3) < 0.6, velocity > 8
    assert abs(residual[near].mean()) < 0.4 * abs(exact.residual[near].mean())
    assert abs(residual[far].mean()) < 0.1
    over = FittedModel(bumped.problem.exact, exact), FittedModel(bumped.problem, law)
    gain = measure_gain(*over, np.random.default_rng(0))
    assert gain.log_score_gain > 10
    assert gain.rmse_after < gain.rmse_before
    assert gain.excess_after < 0.7 * gain.excess_before


def test_where_eq_3_is_true_the_law_neither_gains_nor_loses(plain: Study) -> None:
    over = FittedModel(plain.problem.exact, plain.baseline.exact), FittedModel(plain.problem, plain.baseline.fit)
    assert abs(measure_gain(*over, np.random.default_rng(0)).log_score_gain) < 5


# --- Structure without a name that is no law's, filled in smoothly: it fits what was planted, and nothing where nothing was.


def slow(at: Where) -> FloatArray:
    """Four percent of friction, up and down again in a test: more than the law over pressure, swept in it, may follow."""
    swing = np.cos(2 * np.pi * at.clock / at.clock.max())
    return np.asarray(0.04 * torque(at.velocity, at.parameters) * swing, dtype=np.float64)


@pytest.fixture(scope="module")
def slowly() -> Study:
    return study(campaign(41, slow, loops=False))


def smoothed(given: Study, *axes: str) -> PooledFit | None:
    return smooth_fit(given.problem, given.baseline.fit, axes)


def test_a_course_over_the_clock_is_filled_in(slowly: Study) -> None:
    found = smoothed(slowly, CLOCK)
    assert found is not None
    assert {each.effect.slug for each in found.effects} == {SLUG}
    assert slowly.baseline.fit.cost - found.cost > 20
    before, after = (fit.residual - law_torque(slowly.problem, fit) for fit in (slowly.baseline.fit, found))
    clock = slowly.design.rows.clock
    middle = np.abs(clock - 0.5 * clock.max()) < 0.1 * clock.max()
    assert abs(after[middle].mean()) < 0.4 * abs(before[middle].mean())
    gain = gain_of(slowly, found)
    assert gain.log_score_gain > 10
    assert gain.rmse_after < gain.rmse_before


def test_the_wrong_axis_and_no_structure_gain_nothing(slowly: Study) -> None:
    wrong = smoothed(slowly, TEMPERATURE_AXIS)
    assert wrong is not None
    assert slowly.baseline.fit.cost - wrong.cost < 5
    plain = study(campaign(41, loops=False))
    found = smoothed(plain, CLOCK)
    assert found is not None
    assert plain.baseline.fit.cost - found.cost < 5
    assert abs(gain_of(plain, found).log_score_gain) < 5
    # axes that cannot carry it, or that the law has already
    assert smoothed(slowly) is None
    assert smoothed(slowly, "noise") is None
    assert smoothed(slowly, PHASE) is None  # no loops
    for axis in (SPEED, PRESSURE, BY_CYCLES):
        assert smoothed(slowly, axis) is None
