"""The whole diagnosis on small campaigns: calm where nothing is, right where something loud is planted, honest else."""

from dataclasses import replace

import numpy as np
import pytest

from models.arrays import FloatArray
from models.diagnosis import diagnose as diagnose_module
from models.diagnosis.campaign import Campaign, MaintenanceEvent, StationaryRun
from models.diagnosis.campaign import EventKind as Event
from models.diagnosis.design.design import build_design
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.effect import Measure
from models.diagnosis.explanations.verdict import Verdict
from models.friction.stribeck import torque
from models.records.runs import Plateaus
from tests.models.diagnosis.campaigns import Planted, Where, altered, campaign, look, rehearsal
from tests.support import one_quick


def warm(at: Where) -> np.ndarray:
    factor = np.exp(-0.03 * (at.temperature - 358.15))
    return np.asarray(at.parameters.viscous_coefficient) * at.velocity**0.3 * (factor - 1)


def late(at: Where) -> np.ndarray:
    if at.dynamic:
        return np.zeros_like(at.velocity)
    true = torque(at.velocity, at.parameters)
    return 0.15 * np.concatenate([[0.0], -np.diff(true)])


#: That of a sensor is tried in every run; that of loops by one state below.
PLANTED: dict[str, Planted] = {
    "torque_zero_shift": lambda at: np.full_like(at.velocity, 0.6 if at.cycles > 4000 else 0.0),
    "oil_temperature": warm,
    "hydrodynamic_drag": lambda at: 0.06 * at.velocity,
    "unsettled_dwell": late,
    "inertia_torque": lambda at: 0.015 * at.acceleration / 0.058,
    "oil_change": lambda at: 0.25 * (at.cycles > 4000) * at.parameters.viscous_coefficient * at.velocity**0.3,
}


@pytest.mark.parametrize("seed", one_quick([1, 2, 3]))
def test_where_nothing_is_planted_the_model_is_adequate(seed: int) -> None:
    report = look(campaign(seed, gain=0.001 * seed))
    assert report.verdict is Verdict.MODEL_ADEQUATE
    assert not report.causes
    assert report.extension is None
    assert report.isolability is None  # which is computed on request only
    assert report.baseline.rmse == pytest.approx(report.baseline.noise, rel=0.15)


@pytest.mark.parametrize("slug", one_quick(PLANTED))
def test_what_is_planted_is_found(slug: str) -> None:
    report = look(campaign(7, PLANTED[slug]))
    assert report.verdict in {Verdict.CAUSE_NAMED, Verdict.CAUSE_AMBIGUOUS}
    assert slug in report.causes
    assert report.candidates[0].effect == slug
    assert report.extension is not None
    assert report.extended.rmse < report.baseline.rmse
    if slug == "torque_zero_shift":
        estimate = report.candidates[0].estimate
        assert estimate.unit == "Nm"
        assert abs(estimate.value - 0.6) < 4 * estimate.sd < 0.4


@pytest.mark.parametrize(("seed", "share", "width"), one_quick([(7, 0.04, 0.7), (5, 0.06, 1.5)]))
def test_a_bump_in_speed_is_unexplained_and_on_speed(seed: int, share: float, width: float) -> None:
    """Of friction, which loops show with its lag; sharper than the law's form is expected to be."""

    def bump(velocity: FloatArray, _pressure: FloatArray, _cycles: float) -> FloatArray:
        return share * np.exp(-0.5 * ((velocity - 6.0) / width) ** 2)

    report = look(campaign(seed, form=bump))
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert report.baseline.where[0].axis == "speed_rpm"
    assert all(each.probability < 0.5 for each in report.candidates)


@pytest.mark.slow
@pytest.mark.parametrize("slug", ["oil_temperature", "torque_zero_shift"])
def test_without_oil_temperature_neither_it_nor_a_zero_is_named_for_the_other(slug: str) -> None:
    for seed in (7, 8, 9):
        report = look(campaign(seed, PLANTED[slug], temperature=False))
        assert slug in report.causes
        other = {"oil_temperature", "torque_zero_shift", "pressure_offset"} - {slug}
        assert report.verdict is Verdict.CAUSE_AMBIGUOUS or not other & set(report.causes)


@pytest.mark.slow
def test_one_state_is_enough_for_what_happens_within_a_test() -> None:
    assert look(campaign(8, cycles=(0.0,))).verdict is Verdict.MODEL_ADEQUATE
    report = look(campaign(8, PLANTED["inertia_torque"], cycles=(0.0,)))
    assert "inertia_torque" in report.causes


@pytest.mark.slow
def test_the_same_generator_the_same_answer() -> None:
    given = campaign(7, PLANTED["inertia_torque"], cycles=(0.0, 3000.0))
    first, second = look(given), look(given)
    assert first.statistics == second.statistics
    assert first.summary == second.summary


def test_no_data_and_readings_without_noise_are_too_little() -> None:
    assert look(Campaign()).verdict is Verdict.INSUFFICIENT_DATA
    # A dead channel gives the same torque at every speed: nothing can be weighed, and nothing breaks down.
    full = campaign(1, cycles=(0.0, 1000.0), loops=False)
    report = look(altered(full, lambda run: {"torque": np.full_like(run.plateaus.torque, 20.0)}))
    assert report.verdict is Verdict.INSUFFICIENT_DATA
    assert "have no noise" in report.summary
    assert look(full).verdict is Verdict.MODEL_ADEQUATE


def at_one_speed(run: StationaryRun) -> StationaryRun:
    pressure = run.plateaus.pressure[::5]
    scatter = np.random.default_rng(int(run.cycles)).standard_normal(pressure.size)
    torque_there = 20.0 * pressure / 5e5 * (1 + 0.005 * scatter)
    return replace(run, plateaus=Plateaus(pressure=pressure, speed=np.full_like(pressure, 50.0), torque=torque_there))


def test_a_campaign_of_one_speed_is_judged_and_says_what_it_cannot_show() -> None:
    full = campaign(1, cycles=tuple(np.linspace(0.0, 9000.0, 10)), loops=False)
    report = look(replace(full, stationary=tuple(at_one_speed(run) for run in full.stationary)))
    assert report.verdict is Verdict.MODEL_ADEQUATE
    assert any("1 speed cannot show" in note for note in report.notes)


@pytest.mark.slow
def test_a_logged_oil_change_is_preferred_to_an_unlogged_one() -> None:
    given = campaign(7, PLANTED["oil_change"])
    logged = replace(given, maintenance=(MaintenanceEvent(cycles=4500.0, event=Event.OIL_CHANGE),))
    with_log = next(each for each in look(logged).candidates if each.effect == "oil_change")
    without = next(each for each in look(given).candidates if each.effect == "oil_change")
    assert with_log.log_evidence_gain > without.log_evidence_gain + 1.0


def test_a_bug_is_no_lack_of_data(monkeypatch: pytest.MonkeyPatch) -> None:

    def broken(*_: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(diagnose_module, "posterior_of", broken)
    with pytest.raises(ZeroDivisionError):
        look(campaign(1, cycles=(0.0, 1000.0), loops=False))


# --- What `clutchlife simulate` writes: nothing is found where nothing is hidden.


@pytest.mark.slow
def test_a_plain_simulated_campaign_is_adequate() -> None:
    report = look(rehearsal(7, tests=8), 1)
    assert report.verdict is Verdict.MODEL_ADEQUATE
    assert report.explanations[0].effects == ()
    # the control: with its film it is not
    film = look(rehearsal(7, {"squeeze_film": 0.1}, tests=4), 1)
    assert film.verdict is not Verdict.MODEL_ADEQUATE


@pytest.mark.slow
def test_nine_of_ten_plain_campaigns_are_adequate() -> None:
    verdicts = [look(rehearsal(seed), seed).verdict for seed in range(10)]
    assert verdicts.count(Verdict.MODEL_ADEQUATE) >= 9


@pytest.mark.slow
def test_a_loud_heating_is_at_work_though_its_screen_leads_to_a_slow_one() -> None:
    """Without loops what its form leaves may be another cause's beside it."""
    report = look(rehearsal(5, {"interface_heating": 15.0}, dynamic=False, tests=6), 1)
    assert report.verdict in {Verdict.CAUSE_NAMED, Verdict.CAUSE_AMBIGUOUS}
    assert report.candidates[0].effect == "interface_heating"
    assert report.candidates[0].probability > 0.99
    assert report.candidates[0].estimate.value == pytest.approx(14.0, abs=2.5)


# --- What is said of a clutch does not hang on its size, its pressures, its speed or how long it lives.

FACTOR = 12.0


def stretched(given: Campaign, channel: str) -> Campaign:
    """The campaign with a channel of all its tests times FACTOR."""
    return altered(
        given,
        lambda run: {channel: FACTOR * getattr(run.plateaus, channel)},
        lambda run: {channel: FACTOR * getattr(run.record, channel)},
    )


def lasting(given: Campaign) -> Campaign:
    """The campaign of a clutch that lives FACTOR times as long."""
    parts = {
        name: tuple(replace(run, cycles=FACTOR * run.cycles) for run in getattr(given, name))
        for name in ("stationary", "dynamic", "maintenance", "duty")
    }
    return replace(given, **parts)


def zero(at: Where) -> np.ndarray:
    return np.full_like(at.velocity, 0.5 if at.cycles > 4000 else 0.0)


@pytest.mark.slow
def test_the_same_clutch_in_other_sizes_is_told_the_same() -> None:
    given = campaign(9, zero, loops=False)
    first = look(given, 3)
    assert first.causes
    others = [stretched(given, channel) for channel in ("torque", "pressure", "speed")]
    for other in (*others, lasting(given)):
        found = look(other, 3)
        assert (found.verdict, found.causes) == (first.verdict, first.causes)
        gains = [report.candidates[0].log_evidence_gain for report in (found, first)]
        assert gains[0] == pytest.approx(gains[1], rel=0.02)


def test_what_grows_with_the_clutch_is_as_large_as_the_clutch() -> None:
    given = campaign(9, loops=False)
    facts = build_design(stretched(stretched(given, "torque"), "pressure")).facts
    known = build_design(given).facts
    for effect in CATALOGUE:
        ratio = effect.sized(facts).prior_sd / effect.sized(known).prior_sd
        assert ratio == pytest.approx(FACTOR if effect.grows_with else 1.0)
    assert BY_SLUG["torque_zero_shift"].grows_with is Measure.TORQUE
    assert BY_SLUG["pressure_offset"].grows_with is Measure.PRESSURE
