"""Residual maps against means taken row by row, NaN where nothing was measured, loops as they were measured."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.pooled_fit.projection import without_likely_gains
from models.diagnosis.report.maps import MOST_BINS, SHOWN, loop_traces, residual_maps
from models.diagnosis.report.report import misfit_of
from tests.models.diagnosis.campaigns import CYCLES, PRESSURES, SPEEDS, campaign
from tests.models.diagnosis.fitted import Study, bump, study


@pytest.fixture(scope="module")
def bumped() -> Study:
    return study(campaign(31, bump))


def test_cells_are_means_of_residual_over_noise(bumped):
    found = residual_maps(bumped.problem, bumped.baseline.fit, None)
    assert found is not None
    assert np.allclose(found.pressure, PRESSURES)
    assert np.allclose(found.speed, SPEEDS)
    assert np.array_equal(found.cycles, CYCLES)
    design, noise = bumped.design, bumped.problem.noise
    left = without_likely_gains(bumped.problem, bumped.baseline.fit)
    for p in (0, 3):
        for s in (1, 12):
            cell = [
                left[i] / noise.deviation[i]
                for i in range(design.plateaus)
                if abs(design.rows.pressure[i] - PRESSURES[p]) < 1
                and abs(design.points.velocity[i] / 0.058 - SPEEDS[s]) < 1e-6
            ]
            assert len(cell) == len(CYCLES)
            assert found.speed_pressure_before[p, s] == pytest.approx(sum(cell) / len(cell))
        for c in (0, 4):
            rows = (design.rows.cycles[: design.plateaus] == CYCLES[c]) & (
                np.abs(design.rows.pressure[: design.plateaus] - PRESSURES[p]) < 1
            )
            white = (left / noise.deviation)[: design.plateaus][rows]
            assert found.pressure_cycles_before[c, p] == pytest.approx(white.mean())
    # without an extension after is before
    assert np.array_equal(found.speed_pressure_before, found.speed_pressure_after)


def test_what_maps_and_loops_show_is_the_error_that_the_report_states(bumped: Study) -> None:
    """Runs that are off by gains of their own were shown as an error of 13 deviations where the RMSE was that of noise."""
    design, off = bumped.design, 1.0 + 0.15 * (1.0 + bumped.design.rows.run % 2)
    noise = replace(bumped.problem.noise, run_gain=0.02)
    problem = replace(bumped.problem, design=replace(design, torque=off * design.torque), noise=noise)
    fit = replace(bumped.baseline.fit, residual=problem.design.torque - bumped.baseline.fit.torque)
    rmse = misfit_of(problem, fit).rmse
    found = residual_maps(problem, bumped.baseline.fit, fit)
    assert found is not None
    assert rmse < 0.5
    assert np.nanmean(np.abs(found.speed_pressure_after)) < 2
    for loop in loop_traces(problem, fit, None):
        assert np.sqrt(np.mean((loop.measured - loop.baseline) ** 2)) < 0.5


def test_the_bump_shows_where_it_is(bumped):
    found = residual_maps(bumped.problem, bumped.baseline.fit, None)
    by_speed = found.speed_pressure_before.mean(axis=0)
    velocity = found.speed * 0.058
    assert abs(velocity[int(by_speed.argmax())] - 3.0) < 1.0
    assert by_speed.max() > 1
    # the control: over cycles nothing stands out
    assert np.abs(found.pressure_cycles_before.mean(axis=1)).max() < 0.5 * by_speed.max()


def test_nothing_measured_is_not_a_number(bumped):
    holes = (bumped.design.rows.velocity > 5) & (bumped.design.rows.pressure > 6.9e5)
    given = campaign(31, bump, loops=False)
    runs = []
    for run in given.stationary:
        table = run.plateaus
        keep = ~((table.pressure > 6.9e5) & (table.speed * 0.058 > 5))
        columns = {name: getattr(table, name)[keep] for name in ("pressure", "speed", "torque", "oil_temperature")}
        runs.append(replace(run, plateaus=type(table)(**columns)))
    assert holes.any()
    thinned = study(replace(given, stationary=tuple(runs)))
    found = residual_maps(thinned.problem, thinned.baseline.fit, None)
    missing = np.isnan(found.speed_pressure_before)
    assert missing.any()
    assert missing[:-1].sum() == 0
    assert np.array_equal(missing[-1], found.speed * 0.058 > 5)


def test_many_speeds_and_states_are_gathered(bumped):
    rng = np.random.default_rng(1)
    many = replace(
        bumped.design, rows=replace(bumped.design.rows, velocity=rng.uniform(0.1, 12, bumped.design.torque.size))
    )
    found = residual_maps(replace(bumped.problem, design=many), bumped.baseline.fit, None)
    assert found.speed.size == MOST_BINS
    assert found.speed_pressure_before.shape == (PRESSURES.size, MOST_BINS)
    assert np.all(np.diff(found.speed) > 0)


def test_loops_are_shown_as_measured_and_as_models_have_them(bumped):
    extended = bumped.extended(("squeeze_film", 1e-3, bumped_shape(bumped)))
    found = loop_traces(bumped.problem, bumped.baseline.fit, extended)
    assert len(found) == SHOWN**2
    assert {each.cycles for each in found} == {CYCLES[0], CYCLES[-1], CYCLES[len(CYCLES) // 2]} or len(found) == 9
    for each in found:
        assert each.frequency == pytest.approx(0.1, rel=1e-2)
        assert each.speed.min() >= -1
        assert each.measured.shape == each.baseline.shape == each.extended.shape == each.speed.shape
        # a loop's torque, and no other's
        assert np.abs(each.measured - each.baseline).max() < 0.15 * each.measured.max()
    assert any(not np.allclose(each.baseline, each.extended) for each in found)
    # the control: without an extension both models are one
    assert all(np.array_equal(t.baseline, t.extended) for t in loop_traces(bumped.problem, bumped.baseline.fit, None))


def bumped_shape(given: Study) -> tuple[float, ...]:

    return BY_SLUG["squeeze_film"].grid(given.design.facts)[0].shape


def test_without_loops_no_traces():
    given = study(campaign(32, loops=False, cycles=(0.0, 2000.0, 9000.0)))
    assert loop_traces(given.problem, given.baseline.fit, None) == ()
