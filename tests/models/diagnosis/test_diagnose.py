"""The whole diagnosis on small campaigns: calm where nothing is, right where something loud is planted, honest else."""

from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis import diagnose as diagnose_module
from models.diagnosis.attribution.decide import Judgement
from models.diagnosis.attribution.search import Found
from models.diagnosis.campaign import Campaign, MaintenanceEvent
from models.diagnosis.campaign import EventKind as Event
from models.diagnosis.detection.alarm import Lead
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.diagnose import confirmed, diagnose, with_lines
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.pooled_fit.gauss_newton import Fit
from models.diagnosis.report.report import Report, Verdict
from models.friction.stribeck import StribeckParameters, torque
from models.records.runs import Plateaus
from tests.models.diagnosis.campaigns import Planted, Where, campaign

SEED = 5


def changed(at: Where, **factors: float) -> np.ndarray:
    """The change of the curve's torque where its parameters are multiplied."""
    names = ("static_torque", "coulomb_ratio", "stribeck_velocity", "viscous_coefficient")
    other = {name: np.asarray(getattr(at.parameters, name)) * factors.get(name, 1.0) for name in names}
    return torque(at.velocity, StribeckParameters(**other)) - torque(at.velocity, at.parameters)


def warm(at: Where) -> np.ndarray:
    factor = np.exp(-0.03 * (at.temperature - 358.15))
    return np.asarray(at.parameters.viscous_coefficient) * at.velocity**0.3 * (factor - 1)


def late(at: Where) -> np.ndarray:
    if at.dynamic:
        return np.zeros_like(at.velocity)
    true = torque(at.velocity, at.parameters)
    return 0.15 * np.concatenate([[0.0], -np.diff(true)])


PLANTED: dict[str, Planted] = {
    "oil_temperature": warm,
    "torque_zero_shift": lambda at: np.full_like(at.velocity, 0.6 if at.cycles > 4000 else 0.0),
    "hydrodynamic_drag": lambda at: 0.06 * at.velocity,
    "unsettled_dwell": late,
    "inertia_torque": lambda at: 0.015 * at.acceleration / 0.058,
    "oil_change": lambda at: changed(at, viscous_coefficient=1.25 if at.cycles > 4000 else 1.0),
}


def look(given: Campaign, **options: frozenset[str]) -> Report:
    return diagnose(given, rng=np.random.default_rng(SEED), **options)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_where_nothing_is_planted_the_model_is_adequate(seed: int) -> None:
    report = look(campaign(seed, gain=0.001 * seed))
    assert report.verdict is Verdict.MODEL_ADEQUATE
    assert not report.causes
    assert report.extension is None
    assert report.baseline is not None
    assert report.baseline.rmse == pytest.approx(report.baseline.noise, rel=0.15)


@pytest.mark.parametrize("slug", PLANTED)
def test_what_is_planted_is_found(slug: str) -> None:
    report = look(campaign(7, PLANTED[slug]))
    assert report.verdict in {Verdict.CAUSE_NAMED, Verdict.CAUSE_AMBIGUOUS}
    assert slug in report.causes
    assert report.candidates[0].effect == slug
    assert report.extension is not None
    assert report.extended is not None
    assert report.baseline is not None
    assert report.extended.rmse < report.baseline.rmse


def test_an_amplitude_is_what_was_planted() -> None:
    estimate = look(campaign(7, PLANTED["torque_zero_shift"])).candidates[0].estimate
    assert estimate.unit == "Nm"
    assert abs(estimate.value - 0.6) < 4 * estimate.sd < 0.4


def test_what_is_taken_out_of_the_catalogue_is_not_named() -> None:
    report = look(campaign(7, PLANTED["unsettled_dwell"]), without=frozenset({"unsettled_dwell"}))
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert not report.causes
    assert all(each.effect != "unsettled_dwell" for each in report.candidates)


def test_a_bump_in_speed_is_unexplained_and_on_speed() -> None:
    def bump(at: Where) -> np.ndarray:
        return 0.04 * torque(at.velocity, at.parameters) * np.exp(-0.5 * ((at.velocity - 6.0) / 0.7) ** 2)

    report = look(campaign(7, bump))
    assert report.verdict is Verdict.UNEXPLAINED_STRUCTURE
    assert report.baseline is not None
    assert report.baseline.where[0].axis == "speed_rpm"


def test_without_oil_temperature_no_sensor_drift_is_named() -> None:
    for slug in ("oil_temperature", "torque_zero_shift"):
        report = look(campaign(7, PLANTED[slug], temperature=False))
        assert report.verdict is not Verdict.MODEL_ADEQUATE
        if {"torque_zero_shift", "pressure_offset"} & set(report.causes):
            assert report.verdict is Verdict.CAUSE_AMBIGUOUS
            assert "oil_temperature" in report.causes


def test_one_state_is_enough_for_what_happens_within_a_test() -> None:
    assert look(campaign(8, cycles=(0.0,))).verdict is Verdict.MODEL_ADEQUATE
    report = look(campaign(8, PLANTED["inertia_torque"], cycles=(0.0,)))
    assert "inertia_torque" in report.causes


def test_the_same_generator_the_same_answer() -> None:
    given = campaign(7, PLANTED["inertia_torque"], cycles=(0.0, 3000.0))
    first, second = look(given), look(given)
    assert first.statistics == second.statistics
    assert first.summary == second.summary


def test_too_little_data_says_what_is_missing() -> None:
    assert look(Campaign()).verdict is Verdict.INSUFFICIENT_DATA
    full = campaign(1, cycles=(0.0, 1000.0), loops=False)
    few = tuple(
        replace(
            run,
            plateaus=Plateaus(
                pressure=run.plateaus.pressure, speed=np.full_like(run.plateaus.speed, 50.0), torque=run.plateaus.torque
            ),
        )
        for run in full.stationary
    )
    report = look(replace(full, stationary=few))
    assert report.verdict is Verdict.INSUFFICIENT_DATA
    assert "speeds" in report.summary


def test_a_logged_oil_change_is_preferred_to_an_unlogged_one() -> None:
    given = campaign(7, PLANTED["oil_change"])
    logged = replace(given, maintenance=(MaintenanceEvent(run_id="oil", cycles=4500.0, event=Event.OIL_CHANGE),))
    with_log = next(each for each in look(logged).candidates if each.effect == "oil_change")
    without = next(each for each in look(given).candidates if each.effect == "oil_change")
    assert with_log.log_evidence_gain > without.log_evidence_gain + 1.0


def test_what_a_loud_vibration_leaves_in_averages_is_not_named_beside_it() -> None:
    """A named cause of 15 nats beside a ripple of 300 is the ripple's; one of 60 nats is a cause of its own."""
    estimate = Estimate(name="ripple amplitude", value=0.1, sd=0.01, unit="Nm")
    ripple = RawEvidence(effect="shaft_ripple", log_evidence=300.0, estimate=estimate, note="")
    for nats, causes in ((15.0, ("shaft_ripple",)), (60.0, ("viscous_exponent", "shaft_ripple"))):
        judged = Judgement(
            verdict=Verdict.CAUSE_NAMED,
            causes=("viscous_exponent",),
            statistics={"lambda": nats, "tolerance": 0.05 * nats},
        )
        found = with_lines(judged, (ripple,))
        assert found.verdict is Verdict.CAUSE_NAMED
        assert found.causes == causes


def test_structure_without_a_name_beside_a_vibration_counts_by_its_own_evidence() -> None:
    """Beside a ripple of 60 nats, 8 nats without a name are its trace; 91 nats are not, however little of them an effect
    explains."""
    estimate = Estimate(name="ripple amplitude", value=0.1, sd=0.01, unit="Nm")
    ripple = RawEvidence(effect="shaft_ripple", log_evidence=60.0, estimate=estimate, note="")
    for nats, verdict in ((8.0, Verdict.CAUSE_NAMED), (91.0, Verdict.UNEXPLAINED_STRUCTURE)):
        statistics = {"lambda": 0.03, "structure": nats, "tolerance": 0.0}
        judged = Judgement(verdict=Verdict.UNEXPLAINED_STRUCTURE, statistics=statistics)
        found = with_lines(judged, (ripple,))
        assert found.verdict is verdict
        assert found.causes == (("shaft_ripple",) if verdict is Verdict.CAUSE_NAMED else ())


def test_a_better_baseline_is_looked_at_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """What an effect's fit shows the baseline to have missed is no effect: the alarm is raised, or not, from there."""
    seen: list[Fit] = []
    search = diagnose.hypotheses_of

    def found(*given: object) -> Found:
        seen.append(given[4])  # type: ignore[arg-type]
        first = search(*given)  # type: ignore[arg-type]
        return first if len(seen) > 1 else replace(first, better=calm)

    given = campaign(7, PLANTED["torque_zero_shift"], loops=False)
    expected = look(given).baseline
    calm = diagnose_module.fit_baseline(diagnose_module.build_design(given)).fit
    bent = replace(calm, residual=calm.residual + 0.02 * calm.torque * (calm.prediction.scene.points.cycles > 4000))
    fitted = diagnose_module.fit_baseline
    monkeypatch.setattr(diagnose_module, "fit_baseline", lambda design: replace(fitted(design), fit=bent))
    monkeypatch.setattr(diagnose_module, "hypotheses_of", found)
    report = look(given)
    assert [each is other for each, other in zip(seen, (bent, calm), strict=True)] == [True, True]
    assert report.baseline is not None
    assert expected is not None
    assert report.baseline.rmse == pytest.approx(expected.rmse, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "beyond", "holds"),
    [("effects", 3.0, False), ("effects", 7.0, True), ("contrasts", 3.0, True), ("contrasts", 1.0, False)],
)
def test_an_alarm_that_nothing_confirms_must_be_loud_that_of_the_effects_more_so(
    name: str, beyond: float, holds: bool
) -> None:
    """Where no effect comes to anything once it is refitted, the shape that raised the alarm was one of many."""
    calm = Lead(value=5.0, threshold=10.0, p_value=0.5, index=0)
    leads = {**dict.fromkeys(("effects", "contrasts", "lines"), calm), name: replace(calm, value=10.0 + beyond)}
    assert confirmed(leads, [], -np.inf) is holds
    assert confirmed(leads, [], 3.5)
