"""Temperatures and filters that a campaign declares."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from models.arrays import FloatArray
from models.clutch import Geometry
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import build_design
from models.diagnosis.design.facts import facts_of
from models.diagnosis.effects.fitted_effect import Draw, FittedEffect, ranges_of
from models.diagnosis.effects.thermal import INTERFACE_HEATING, REFERENCE_FLUX, WHOLE, _computed, _measured
from models.diagnosis.explanations.verdict import Verdict
from models.diagnosis.extension import build_extension
from models.friction.stribeck import torque
from models.records.runs import Plateaus, Record
from models.records.torque_filter import filtered_as_torque
from tests.models.diagnosis.campaigns import Where, altered, campaign, look, scene_of, study

# --- The torque channel's own low-pass: named as a delay where it is not declared, taken off and not discovered where
# it is.

SLUG = "channel_delay"
#: Time constant of the hidden filter [s].
FILTER = 0.04


def behind(record: Record) -> Record:
    """Torque behind the filter, by scipy on a clock ten times as fine; the sensor's noise, too."""
    step = float(record.time[1] - record.time[0]) / 10
    fine = np.arange(record.time[0], record.time[-1] + step, step)
    kept = np.exp(-step / FILTER)
    torque = np.interp(fine, record.time, record.torque)
    late = lfilter([1 - kept], [1, -kept], torque, zi=[kept * torque[0]])[0]
    return replace(record, torque=np.interp(record.time, fine, late))


def hidden(seed: int, declared: float) -> Campaign:
    """A campaign whose dynamic tests are behind the filter, of which so much [s] is declared."""
    given = campaign(seed)
    tests = tuple(replace(run, record=filtered_as_torque(behind(run.record), declared)) for run in given.dynamic)
    return replace(given, dynamic=tests)


@pytest.mark.parametrize(("seed", "declared"), [(1, 0.0), (2, 0.0), (7, 0.0), (7, 0.5 * FILTER)])
@pytest.mark.slow
def test_what_is_left_beyond_the_declared_filter_is_what_is_found(seed: int, declared: float) -> None:
    report = look(hidden(seed, declared))
    assert report.causes == (SLUG,)
    estimate = report.candidates[0].estimate
    assert estimate.value == pytest.approx(1000 * (FILTER - declared), abs=4 * estimate.sd)
    assert look(hidden(seed, FILTER)).verdict is Verdict.MODEL_ADEQUATE


# --- Heating is judged by the plate's temperature where it was measured, and as before where it was not.

GEOMETRY = Geometry()
#: Loss of torque at the reference's heat flux, and what the plate then rises by [K], both at the usual flow of oil.
LOSS, RISE = 0.12, 25.0
HEATING = INTERFACE_HEATING.slug


def warmth(friction: FloatArray, velocity: FloatArray, cycles: float, clock: FloatArray) -> FloatArray:
    """Of the interface, over that at 0.32 W/mm²: the heat flux, more or less as the flow of cooling oil is, from test
    to test and within one; no power density knows of that."""
    area = GEOMETRY.friction_faces * GEOMETRY.lining_area
    flow = 1 + 0.5 * np.sin(2 * np.pi * cycles / 7000.0) + 0.3 * np.sin(clock / 90.0)
    return np.abs(friction) * velocity / GEOMETRY.mean_radius / (0.32e6 * area) * flow


def heated(at: Where) -> FloatArray:
    bare = torque(at.velocity, at.parameters)
    return bare * np.expm1(np.log1p(-LOSS) * warmth(bare, at.velocity, at.cycles, at.clock))


def with_plate(given: Campaign, rise: float, offset: float = 0.0) -> Campaign:
    """The campaign with the plate's temperature: `rise` K above the oil for each unit of warmth, by the friction as it was
    before it was weakened; and a thermometer's noise of 0.1 K and offset."""
    rng = np.random.default_rng(0)

    def temperature(table: Plateaus | Record, cycles: float, clock: FloatArray) -> FloatArray:
        velocity, bare = GEOMETRY.sliding_velocity(table.speed), table.torque
        for _ in range(5):
            bare = table.torque * np.exp(LOSS * warmth(bare, velocity, cycles, clock))
        above = rise * warmth(bare, velocity, cycles, clock)
        oil = table.oil_temperature
        return (358.15 if oil is None else oil) + offset + above + 0.1 * rng.standard_normal(above.size)

    clock = 5.0 * np.arange(given.stationary[0].plateaus.torque.size) + 2.5
    return altered(
        given,
        lambda run: {"plate_temperature": temperature(run.plateaus, run.cycles, clock)},
        lambda run: {"plate_temperature": temperature(run.record, run.cycles, run.record.time)},
    )


@pytest.mark.slow
@pytest.mark.xfail(
    strict=True,
    reason="of 2,378 nats a pattern over the loops' phase, beside heating, has 16: an uncatalogued cause too",
)
def test_hidden_heating_is_named_by_the_plate_and_not_without_it() -> None:
    given = with_plate(campaign(7, heated), RISE)
    report = look(given)
    assert report.causes == (HEATING,)
    estimate = report.candidates[0].estimate
    warming = facts_of(given).plate_warming
    expected = 100 * LOSS * warming[1] * REFERENCE_FLUX / RISE  # at the flow that was usual
    assert abs(estimate.value - expected) < 4 * estimate.sd
    assert HEATING not in look(campaign(7, heated)).causes


def test_where_the_channel_is_missing_warmth_is_computed() -> None:
    scene = scene_of(campaign(1))
    assert scene.facts.plate_warming is None
    assert np.isnan(scene.points.plate_rise).all()
    tried = INTERFACE_HEATING.grid(scene.facts)
    assert len(tried) == 20
    computed = _computed(scene, 1.5, 1.5)
    assert _measured(scene, computed) is computed
    # where some tests have it the others are computed
    given = with_plate(campaign(1), RISE)
    scene = scene_of(altered(given, moving=lambda _: {"plate_temperature": None}))
    assert len(INTERFACE_HEATING.grid(scene.facts)) == 20
    computed = _computed(scene, 1.5, 0.0)
    used, steady = _measured(scene, computed), scene.points.steady
    np.testing.assert_array_equal(used[~steady], computed[~steady])
    assert np.abs(used - computed)[steady].min() > 0

    # a plate that stays at the oils temperature is nowhere warm
    def cool(table: Plateaus | Record) -> dict[str, FloatArray]:
        return {"plate_temperature": np.asarray(table.oil_temperature)}

    scene = scene_of(altered(campaign(1), lambda run: cool(run.plateaus), lambda run: cool(run.record)))
    assert not INTERFACE_HEATING.change(scene, 0.1, (0.0, WHOLE, 0.0)).any()
    # without oil temperature the plate is above its own coldest
    given = with_plate(campaign(1, temperature=False), RISE)
    points = build_design(given).points
    for run in range(len(given.stationary)):
        assert points.plate_rise[points.steady & (points.run == run)].min() == 0.0
    assert facts_of(given).plate_warming is not None


def test_with_the_channel_it_goes_with_the_plate_and_a_thermometers_offset_is_nothing() -> None:
    for offset in (0.0, -4.0):
        scene = scene_of(with_plate(campaign(1), RISE, offset))
        assert len(INTERFACE_HEATING.grid(scene.facts)) == 4
        change = INTERFACE_HEATING.change(scene, 0.1, (0.0, WHOLE, 0.0))
        lost = np.log1p(change / scene.curve) / np.log1p(-0.1)
        area = GEOMETRY.friction_faces * GEOMETRY.lining_area
        at_rest, per_flux = scene.facts.plate_warming
        assert at_rest == pytest.approx(offset, abs=1.5)
        assert per_flux * 0.32e6 == pytest.approx(RISE, rel=0.4)  # flow and losses are in it
        np.testing.assert_allclose(lost, (scene.points.plate_rise - at_rest) / (per_flux * 0.32e6), atol=1e-9)
        loops = ~scene.points.steady
        modelled = warmth(scene.curve, scene.points.velocity, 0.0, np.zeros(1)) * 0.32e6 * area
        assert np.corrcoef(lost[loops], modelled[loops])[0, 1] > 0.7  # the course within a loop is the plate's own


def test_an_adopted_model_takes_off_by_the_plate_of_a_later_test() -> None:
    given = with_plate(campaign(7, heated), RISE)
    fitted = study(given)
    facts = fitted.design.facts
    heating = FittedEffect(effect=INTERFACE_HEATING, amplitude=LOSS, shape=INTERFACE_HEATING.grid(facts)[0].shape)
    draw = Draw(weight=1.0, laws=fitted.baseline.fit.laws, effects=(heating,))
    extension = build_extension([draw], facts, ranges_of(fitted.design.rows), courses=False)
    last = given.stationary[-1]
    warm, cold = (
        extension.artefact(replace(last, run_id="later", plateaus=plateaus), given)
        for plateaus in (last.plateaus, replace(last.plateaus, plate_temperature=last.plateaus.oil_temperature))
    )
    assert warm.min() < -0.5
    assert np.abs(cold).max() < 0.1 * np.abs(warm).max()
    kept = type(extension).from_dict(extension.to_dict())
    again = kept.artefact(replace(last, run_id="later"), given)
    np.testing.assert_array_equal(again, warm)
