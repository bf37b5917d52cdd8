"""The posterior over explanations, and what is decided by it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from models.diagnosis.campaign import Campaign, EventKind, MaintenanceEvent, StationaryRun
from models.diagnosis.criteria import ANYTHING_WRONG, ISOLABLE, SURE
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.diagnosis.explanations.decide import decide, explanations_of
from models.diagnosis.explanations.posterior import Prior, Search, isolable, posterior_of
from models.diagnosis.explanations.shapeless import outlying_run, temperature_evidence
from models.diagnosis.explanations.verdict import NOTHING, UNCATALOGUED, Alternative, Explanation, Verdict
from models.diagnosis.pooled_fit.baseline_fit import Baseline
from models.diagnosis.raw_records.evidence import FIXED_LINE, RawEvidence
from tests.lab.blind.rig.hide import hide
from tests.lab.blind.rig.sent import campaign as sent
from tests.models.diagnosis.campaigns import Where, altered, campaign, look, rehearsal, study, warmth
from tests.models.diagnosis.test_diagnose import PLANTED, warm

# --- The posterior: the same data, the same answer; what is planted leads, what nobody planted does not; ends of the
# list.


def shift(at: Where) -> np.ndarray:
    """1.5 Nm from cycle 4000 on."""
    return np.full_like(at.velocity, 1.5 if at.cycles > 4000 else 0.0)


def shuffled(given: Campaign) -> Campaign:
    """The runs sent in another order, by other names."""
    renamed = [replace(run, run_id=f"other-{k}") for k, run in enumerate(given.stationary)]
    return replace(given, stationary=tuple(reversed(renamed)))


@pytest.fixture(scope="module")
def zero() -> Baseline:
    return study(campaign(7, shift, loops=False)).baseline


@pytest.fixture(scope="module")
def plain() -> Baseline:
    return study(campaign(7, loops=False)).baseline


def record(effect: str, evidence: float) -> RawEvidence:
    estimate = AmplitudeEstimate(name="amplitude", value=0.1, sd=0.01, unit="Nm")
    return RawEvidence(effect=effect, log_evidence=evidence, estimate=estimate, note="torque swings")


def test_other_names_and_another_order_of_runs_change_no_probability(zero: Baseline) -> None:
    first = posterior_of(zero, ()).probabilities
    again = posterior_of(study(shuffled(campaign(7, shift, loops=False))).baseline, ()).probabilities
    assert next(iter(first)) == next(iter(again)) == Alternative(("torque_zero_shift",))
    assert max(abs(first.get(h, 0.0) - again.get(h, 0.0)) for h in {*first, *again}) < 0.02


def test_probabilities_sum_to_one_over_what_the_catalogue_holds(zero: Baseline) -> None:
    found = posterior_of(zero, (record("shaft_ripple", 12.0),))
    assert sum(found.probabilities.values()) == pytest.approx(1.0)
    explanations = explanations_of(found)
    assert sum(each.probability for each in explanations) == pytest.approx(1.0)
    assert len({frozenset(each.effects) for each in explanations}) == len(explanations)
    assert set(decide(explanations)[1]) == {"torque_zero_shift", "shaft_ripple"}
    # a cause that is out of the catalogue is not on the list
    left = posterior_of(zero, (), frozenset({"torque_zero_shift"}))
    assert left.probabilities[NOTHING] > posterior_of(zero, ()).probabilities[NOTHING]
    assert not any("torque_zero_shift" in alternative.causes for alternative in left.weights)


def said(plain: Baseline, *records: RawEvidence) -> tuple[Verdict, tuple[str, ...]]:
    return decide(explanations_of(posterior_of(plain, records)))


def test_a_vibration_alone_is_a_cause_and_a_line_at_all_speeds_has_no_name(plain: Baseline) -> None:
    assert said(plain) == (Verdict.MODEL_ADEQUATE, ())
    assert said(plain, record("stick_slip", 30.0)) == (Verdict.CAUSE_NAMED, ("stick_slip",))
    assert said(plain, record(FIXED_LINE, 30.0)) == (Verdict.UNEXPLAINED_STRUCTURE, ())
    assert said(plain, record(FIXED_LINE, 2.0)) == (Verdict.MODEL_ADEQUATE, ())


def test_the_priors_of_one_thing_sum_to_what_may_be_wrong() -> None:
    prior = Prior(effects=15, unknowns=16)
    shares = 15 * np.exp(prior(Alternative(("e",)))) + 16 * np.exp(prior(Alternative((), "cycles")))
    assert shares == pytest.approx(ANYTHING_WRONG / (1 - ANYTHING_WRONG))
    pair = Alternative(("a", "b"))
    assert prior(pair) < prior(Alternative(("a",))) - 2.0


# --- The verdict as it is read off lists of explanations.

U = UNCATALOGUED


def listed(shares: dict[tuple[str, ...], float]) -> tuple[Explanation, ...]:
    assert sum(shares.values()) == pytest.approx(1.0)
    return tuple(Explanation(effects=effects, probability=share) for effects, share in shares.items())


@pytest.mark.parametrize(
    ("shares", "verdict", "causes"),
    [
        ({(): 1.0}, Verdict.MODEL_ADEQUATE, ()),
        ({(): 0.51, ("a",): 0.49}, Verdict.MODEL_ADEQUATE, ()),
        ({("a",): 0.95, (): 0.05}, Verdict.CAUSE_NAMED, ("a",)),
        ({("a",): 0.6, ("a", "b"): 0.4}, Verdict.CAUSE_NAMED, ("a",)),
        ({("a", "b"): 0.95, ("a",): 0.05}, Verdict.CAUSE_NAMED, ("a", "b")),
        ({tuple("hgfedcba"): 1.0}, Verdict.CAUSE_NAMED, tuple("abcdefgh")),  # of equal ones the order is that of names
        ({("a",): 0.45, ("a", "b"): 0.3, ("a", "c"): 0.25}, Verdict.CAUSE_AMBIGUOUS, ("a", "b", "c")),
        ({("a",): 0.6, ("b",): 0.35, (): 0.05}, Verdict.CAUSE_AMBIGUOUS, ("a", "b")),
        ({("a",): 0.85, (U,): 0.15}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
        ({("a",): 0.8, ("a", U): 0.2}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
        ({(U,): 0.5, ("a",): 0.3, (): 0.2}, Verdict.UNEXPLAINED_STRUCTURE, ()),
        ({("a", U): 0.92, (U,): 0.08}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
        ({("a", U): 0.8, (U,): 0.2}, Verdict.UNEXPLAINED_STRUCTURE, ()),
        ({(): 0.4, (U,): 0.35, ("a",): 0.25}, Verdict.UNEXPLAINED_STRUCTURE, ()),
        ({(): 0.4, (U,): 0.2, ("a",): 0.4}, Verdict.CAUSE_AMBIGUOUS, ("a", U)),
    ],
)
def test_verdict(shares: dict[tuple[str, ...], float], verdict: Verdict, causes: tuple[str, ...]) -> None:
    assert decide(listed(shares)) == (verdict, causes)


# --- An outlying run is named; an effect that all runs show makes none of them an outlier.


def reversed_torque(run: StationaryRun) -> np.ndarray:
    return -run.plateaus.torque


def too_low(run: StationaryRun) -> np.ndarray:
    """Another clutch: a third less at low speed than at high speed."""
    return run.plateaus.torque * (2 + run.plateaus.speed / run.plateaus.speed.max()) / 3


def with_one(place: int, changed: Callable[[StationaryRun], np.ndarray]) -> Campaign:
    """Of seven tests, one with another torque."""
    given = campaign(2, loops=False, cycles=(0.0, 1000.0, 3000.0, 6000.0, 10000.0, 15000.0, 21000.0))
    run = given.stationary[place]
    return altered(given, lambda each: {"torque": changed(run)} if each is run else {})


@pytest.mark.slow
def test_a_run_that_is_not_like_the_others_is_named_in_the_summary() -> None:
    report = look(with_one(4, too_low), 1)
    assert report.verdict in {Verdict.UNEXPLAINED_STRUCTURE, Verdict.CAUSE_AMBIGUOUS}
    assert "Run stationary-4 at" in report.summary


@pytest.mark.parametrize(("changed", "place"), [(reversed_torque, 2), (too_low, 4)])
def test_a_run_that_is_not_like_the_others_is_named(changed, place: int) -> None:
    """About eq. 3, for the law's form bends to it as far as its sizes allow."""
    known = study(with_one(place, changed)).baseline
    assert f"Run stationary-{place} at" in outlying_run(known.problem.exact, known.exact)


@pytest.mark.parametrize("planted", [None, warm])
def test_no_run_is_odd_where_all_are_alike(planted) -> None:
    known = study(campaign(2, planted, loops=False)).baseline
    for problem, fitted in ((known.problem.exact, known.exact), (known.problem, known.fit)):
        assert outlying_run(problem, fitted) == ""


# --- What an oil temperature that nobody measured may account for: its own doing, and not what gains do as well.


def fresh(at: Where) -> np.ndarray:
    """From cycle 4000 on the viscous term is a fifth less."""
    return -0.2 * (at.cycles > 4000.0) * at.parameters.viscous_coefficient * at.velocity**0.3


@pytest.mark.slow
def test_a_logged_oil_change_is_likelier_than_a_temperature_that_nobody_measured() -> None:
    """One step at the cycle of the log against a course of its own for every test: each is possible, one is simple."""
    change = MaintenanceEvent(cycles=4000.0, event=EventKind.OIL_CHANGE)
    report = look(replace(campaign(5, fresh, temperature=False), maintenance=(change,)), 0)
    assert "oil_change" in report.causes
    gained = {each.effect: each.log_evidence_gain for each in report.candidates}
    assert gained["oil_change"] > gained.get("oil_temperature", 0.0) + 5.0
    assert report.candidates[0].effect == "oil_change"
    assert report.candidates[0].probability > 0.6


@pytest.mark.slow
def test_without_a_thermometer_an_oil_change_that_nobody_logged_may_be_warmer_oil() -> None:
    report = look(campaign(5, fresh, temperature=False), 0)
    assert report.verdict is Verdict.CAUSE_AMBIGUOUS
    assert set(report.causes) >= {"oil_change", "oil_temperature"}


@pytest.mark.slow
def test_gains_that_scatter_are_no_evidence_of_a_temperature() -> None:
    """Whatever size of them the noise was given; the control: a temperature is."""
    given = study(campaign(5, temperature=False, gain=0.005))
    for size in (2e-4, given.problem.noise.run_gain):
        problem = given.problem.with_noise(replace(given.problem.noise, run_gain=size))
        assert temperature_evidence(problem, given.baseline.fit) < 3.0
    warm = study(campaign(5, warmth, temperature=False, gain=0.005))
    assert temperature_evidence(warm.problem, warm.baseline.fit) > 10.0


@pytest.mark.slow
def test_what_stands_beside_a_certain_cause_was_refitted() -> None:
    given = study(rehearsal(14, {"hydrodynamic_drag": 1.0, "torque_zero_shift": 1.5}, tests=3))
    posterior = posterior_of(given.baseline, ())
    standing = [alternative for alternative, share in posterior.probabilities.items() if share > 0.05]
    assert standing == [Alternative(("hydrodynamic_drag", "squeeze_film"))]  # the simulated rig has a film
    assert standing[0] in posterior.nodes


@pytest.mark.slow
def test_a_loud_cause_is_refitted_however_little_its_screen_promised() -> None:
    """Heating by a quarter, and the law's form has absorbed half of it; without loops all of it, for nothing but the form of
    the curve shows it there."""
    with_loops, without = (
        hide((404, 3245693708, 3), ("interface_heating",), 300.0, loops=one) for one in (True, False)
    )
    found = posterior_of(study(sent(with_loops)).baseline, ())
    heating, drag = Alternative(("interface_heating",)), Alternative(("hydrodynamic_drag",))
    assert heating in found.nodes
    assert found.weights[heating] > found.weights.get(drag, -np.inf) + 20.0
    assert found.isolability["interface_heating"] > ISOLABLE
    swept = posterior_of(study(sent(without)).baseline, ())
    assert swept.probabilities.get(heating, 0.0) < SURE


@pytest.mark.slow
def test_a_loud_cause_is_found_where_the_laws_form_has_bent_the_baseline() -> None:
    """Inertia of 2 Nm in three states: the law's form goes as far as its sizes allow, and from there the refit with inertia
    ends 800 nats behind, and behind a film that is not there."""
    given = study(campaign(21, lambda at: 0.012 * at.acceleration / 0.058, cycles=(0.0, 4000.0, 12000.0)))
    search = Search(given.baseline, [], frozenset())
    search._single()
    inertia, film = (search.nodes[Alternative((slug,))][0] for slug in ("inertia_torque", "squeeze_film"))
    assert inertia.log_evidence > film.log_evidence + 100.0
    assert inertia.fit.effects[0].amplitude == pytest.approx(0.012, rel=0.05)


@pytest.mark.slow
def test_an_unmeasured_temperature_competes_under_the_scatter_of_gains_that_nothing_has() -> None:
    """Friction that recovers in rests passes for gains that scatter; about that baseline a temperature explains nothing."""
    hidden = hide((404, 3894774685, 2), ("rest_recovery",), 300.0, loops=True)
    found = posterior_of(study(sent(hidden)).baseline, ())
    assert found.weights[Alternative(("rest_recovery",))] > found.weights[Alternative(("oil_temperature",))] + 20.0


def test_the_least_isolable_cause_goes_first_and_the_other_is_judged_by_what_it_is_alone() -> None:
    drag, heating, both = Alternative(("drag",)), Alternative(("heating",)), Alternative(("drag", "heating"))
    isolabilities = {
        NOTHING: {},
        drag: {"drag": 0.9},
        heating: {"heating": 0.3},
        both: {"drag": 0.4, "heating": 0.2},  # beside each other neither can be told from the law's form
    }
    weights = {NOTHING: 0.0, drag: 0.0, heating: 0.0, both: 0.0}
    merged, like_the_law = isolable(weights, isolabilities)
    assert merged == {NOTHING: pytest.approx(np.log(2.0)), drag: pytest.approx(np.log(2.0))}
    assert like_the_law == {"heating": pytest.approx(0.5)}
    unfitted = Alternative(("drag", "unseen"))
    assert isolable({unfitted: 0.0}, isolabilities) == ({unfitted: 0.0}, {})  # each by its ι alone


@pytest.mark.slow
def test_what_was_not_refitted_counts_as_its_likeliest_parent_promises() -> None:
    some = 0.2  # of an inertia that bends the baseline
    quiet = campaign(1, lambda at: some * PLANTED["inertia_torque"](at))
    search = Search(study(quiet).baseline, [], frozenset())
    search._single()
    search._screen(search._unscreened)
    weights = search.posterior([], frozenset()).weights
    inertia, film = Alternative(("inertia_torque",)), Alternative(("squeeze_film",))
    assert film in search.nodes
    assert weights[inertia] > weights[film] + 3.0
    assert weights[Alternative(("inertia_torque", "squeeze_film"))] < weights[inertia] - 2.0
