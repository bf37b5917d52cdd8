"""What readings with the clutch open must leave as it was: the laws' frame, the facts, corrections, other trials."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.baseline.prediction import frame_of, predict
from models.diagnosis.campaign import Campaign, StationaryRun
from models.diagnosis.design.design import build_design
from models.diagnosis.design.facts import facts_of
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.catalogued.squeeze_film import usual_slope
from models.diagnosis.effects.catalogued.torque_zero_shift import CLOCK, STRAIGHT
from models.diagnosis.effects.draw import Draw, DrawnEffect
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.effects.template_discrepancy import ranges_of
from models.diagnosis.experiments.candidates import with_trial
from models.diagnosis.extension import build_extension
from models.diagnosis.pooled_fit.gauss_newton import fit
from models.diagnosis.pooled_fit.priors import priors_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.starts import starting_laws
from models.records.criteria import UNLOADED
from tests.models.diagnosis.campaigns import campaign
from tests.models.diagnosis.fitted import Study, study


def open_sweep(given: Campaign, *, cycles: float, faster: float = 1.0, warmer: float = 0.0) -> Campaign:
    """With a sweep without pressure added, at other speeds and temperatures than those of the tests."""
    then = with_trial(given, "open_sweep")
    assert then is not None
    last = then.stationary[-1]
    table = replace(last.plateaus, speed=faster * last.plateaus.speed, torque=0.1 + 0.0 * last.plateaus.torque)
    if table.oil_temperature is not None:
        table = replace(table, oil_temperature=table.oil_temperature + warmer)
    return replace(then, stationary=(*given.stationary, replace(last, cycles=cycles, plateaus=table)))


@pytest.fixture(scope="module")
def closed() -> Study:
    return study(campaign(51, cycles=(0.0, 1000.0, 3000.0)))


def test_a_fast_open_sweep_moves_no_scale_of_friction(closed: Study) -> None:
    both = build_design(open_sweep(closed.campaign, cycles=3000.0, faster=4.0))
    frames = [frame_of(design) for design in (closed.design, both)]
    assert frames[0].reference_velocity == frames[1].reference_velocity
    laws = [starting_laws(design, frame) for design, frame in zip((closed.design, both), frames, strict=True)]
    np.testing.assert_allclose(*(usual_slope(each, np.array([0.2, 0.7])) for each in laws))
    priors = [
        priors_of(design, each.theta, frame)
        for design, each, frame in zip((closed.design, both), laws, frames, strict=True)
    ]
    np.testing.assert_allclose(priors[0].rows, priors[1].rows)
    assert both.rows.velocity.max() > 3.0 * closed.design.rows.velocity.max()


def test_open_tests_are_no_states_and_tell_no_usual_temperature(closed: Study) -> None:
    known = facts_of(closed.campaign)
    then = facts_of(open_sweep(closed.campaign, cycles=9000.0, warmer=-40.0))
    np.testing.assert_array_equal(then.states, known.states)
    assert then.life == known.life
    assert then.reference_temperature == known.reference_temperature
    nothing = replace(closed.campaign, stationary=open_sweep(closed.campaign, cycles=0.0).stationary[-1:], dynamic=())
    assert not facts_of(nothing).temperature_measured
    assert facts_of(nothing).states.size == 0


@pytest.mark.parametrize(
    ("slug", "amplitude", "shape"),
    [("torque_zero_shift", 0.4, (CLOCK, 0.0, *STRAIGHT)), ("unsettled_dwell", 0.2, (0.0, 0.5))],
)
def test_a_correction_is_what_the_diagnosis_saw_where_some_plateaus_are_open(
    closed: Study, slug: str, amplitude: float, shape: tuple[float, ...]
) -> None:
    """Clocks and neighbours count plateaus; those without pressure stand among them for both."""
    first = closed.campaign.stationary[0]
    pressure = np.where(np.arange(first.plateaus.torque.size) % 4 == 1, 0.0, first.plateaus.pressure)
    mixed = replace(first, plateaus=replace(first.plateaus, pressure=pressure))
    runs: tuple[StationaryRun, ...] = (mixed, *closed.campaign.stationary[1:])
    given = replace(closed.campaign, stationary=runs, dynamic=())
    design, known = build_design(given), closed.baseline
    laws = starting_laws(design, frame_of(design))
    priors = priors_of(design, laws.theta, laws.frame)
    noise = replace(known.problem.noise, deviation=0.01 * np.abs(design.torque) + 0.05)
    effect = FittedEffect(effect=BY_SLUG[slug], amplitude=amplitude, shape=shape)
    fitted = fit(FitProblem(design=design, noise=noise, priors=priors), laws, (effect,), steps=0)
    one = DrawnEffect(effect=effect.effect, amplitude=amplitude, shape=shape)
    draws = [Draw(weight=1.0, laws=fitted.laws, effects=(one,))]
    extension = build_extension(draws, design.facts, ranges_of(design.rows), courses=True)
    (found,) = extension.artefact(mixed, replace(given, stationary=runs[1:]))
    rows = np.flatnonzero(design.rows.run == 0)
    seen = BY_SLUG[slug].change(predict(design, fitted.laws).scene, amplitude, shape)[rows]
    np.testing.assert_allclose(found, design.rows.sign[rows] * seen, atol=1e-9)
    assert np.abs(seen[design.closed[rows]]).max() > 0.01


def test_no_trial_is_so_light_that_the_clutch_opens() -> None:
    given = campaign(52, cycles=(0.0, 1000.0), loops=True)
    lowest = min(float(run.plateaus.pressure.min()) for run in given.stationary)

    def scaled(share: float) -> Campaign:
        tests = [
            replace(run, plateaus=replace(run.plateaus, pressure=share * run.plateaus.pressure))
            for run in given.stationary
        ]
        loops = [
            replace(run, record=replace(run.record, pressure=share * run.record.pressure)) for run in given.dynamic
        ]
        return replace(given, stationary=tuple(tests), dynamic=tuple(loops))

    light = scaled(2.0 * UNLOADED / lowest)  # a quarter of which is half of what closes the clutch
    for key in ("light_sweep", "light_loops", "all_loads"):
        assert with_trial(given, key) is not None
        assert with_trial(light, key) is None
    assert with_trial(light, "open_clutch") is not None
