"""The paragraph: every verdict has one, in words and units, and none says nan."""

import re
from dataclasses import replace

import pytest

from models.diagnosis.attribution.explanations import explanations_of
from models.diagnosis.attribution.verdict import UNCATALOGUED, Verdict
from models.diagnosis.detection.lack_of_fit import Misfit
from models.diagnosis.detection.structure_axes import Where
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.experiments.test_plan import Advice
from models.diagnosis.pooled_fit.run_scatter import RunScatter
from models.diagnosis.report.report import Candidate, Visible
from models.diagnosis.report.summary import Findings, summarise
from models.diagnosis.validation.held_out import Gain, Hardest

MISFIT = Misfit(
    rmse=0.15234,
    noise=0.1012,
    unexplained_share=0.123,
    where=(
        Where(axis="oil_temperature_c", strength=31.0, p_value=1e-9),
        Where(axis="cycles", strength=4.0, p_value=0.1),
    ),
)
GAIN = Gain(
    held_out_runs=("a",),
    rmse_before=0.161,
    rmse_after=0.149,
    reduction_percent=7.45,
    reduction_sd=0.9,
    excess_before=0.08,
    excess_after=0.01,
    mse_percent_before=0.3,
    mse_percent_after=0.2,
    log_score_gain=40.0,
    forecast_log_score_gain=3.0,
)


def candidate(slug: str, probability: float, evidence: float = 30.0) -> Candidate:
    effect = BY_SLUG[slug]
    estimate = Estimate(name=effect.amplitude, value=0.3634, sd=0.0547, unit=effect.unit)
    return Candidate(
        effect=slug, title=effect.title, probability=probability, log_evidence_gain=evidence, estimate=estimate
    )


def visible(slug: str, sizes: float) -> Visible:
    """An effect that so many of its usual sizes would have shown."""
    effect = BY_SLUG[slug]
    usual = effect.scale * effect.prior_sd
    return Visible(effect=slug, amplitude=sizes * usual, least=sizes * usual / 2, usual=usual, unit=effect.unit)


def weights(verdict: Verdict, causes: tuple[str, ...]) -> dict[tuple[str, ...], float]:
    """Explanations that read as the verdict, by their effects."""
    if verdict is Verdict.CAUSE_NAMED:
        return {causes: 0.97, (): 0.03}
    if verdict is Verdict.CAUSE_AMBIGUOUS:
        return {(slug,): 1.0 for slug in causes} | ({(UNCATALOGUED,): 0.4} if len(causes) == 1 else {})
    return {(UNCATALOGUED,): 0.9, (): 0.1} if verdict is Verdict.UNEXPLAINED_STRUCTURE else {(): 1.0}


def findings(verdict: Verdict, *causes: str) -> Findings:
    advice = Advice(
        key="repeat", test="stationary test with the oil at 60 °C", effect="oil_change", other="running_in", nats=1234.5
    )
    return Findings(
        verdict=verdict,
        causes=causes,
        explanations=explanations_of(weights(verdict, causes)),
        candidates=tuple(candidate(slug, 0.9 / len(causes)) for slug in causes),
        baseline=MISFIT,
        extended=MISFIT,
        gain=GAIN,
        advice=(advice,),
        visible=tuple(visible(each.slug, 0.2) for each in CATALOGUE),
        notes=(),
        tests=12,
        states=6,
    )


ALL = [
    findings(Verdict.MODEL_ADEQUATE),
    *(findings(Verdict.CAUSE_NAMED, each.slug) for each in CATALOGUE),
    findings(Verdict.CAUSE_NAMED, "oil_temperature", "oil_change"),
    findings(Verdict.CAUSE_AMBIGUOUS, "oil_change", "running_in", "load_severity"),
    findings(Verdict.UNEXPLAINED_STRUCTURE),
    findings(Verdict.INSUFFICIENT_DATA),
]


@pytest.mark.parametrize("found", ALL, ids=lambda found: "-".join((found.verdict.value, *found.causes)))
def test_every_verdict_has_a_paragraph(found):
    said = summarise(found)
    assert said.startswith("12 tests at 6 states of use")
    assert said.endswith(".")
    told = said.replace("M_s", "M").replace("C_v", "C").replace("V_S", "V")
    assert not re.search(r"\bnan\b|\binf\b|None|_|  |\.\.|\( ", told)
    # a number that has a unit is followed by it
    for each in found.candidates:
        if each.estimate.unit not in {"-", ""}:
            assert f"± 0.055 {each.estimate.unit}" in said
        assert each.effect.replace("_", " ") in said


def test_what_is_named_is_explained_and_what_it_beat_is_said():
    found = findings(Verdict.CAUSE_NAMED, "oil_temperature")
    rival = candidate("torque_zero_shift", 0.01, evidence=12.3)
    helper = replace(candidate("viscous_exponent", 0.02, evidence=14.0), beside=("oil_temperature",))
    said = summarise(replace(found, candidates=(*found.candidates, rival, helper)))
    assert BY_SLUG["oil_temperature"].physics in said
    assert "the evidence for it is strong over torque zero shift." in said
    assert "viscous exponent" not in said  # it was fitted with the cause, not against it
    assert (
        "0.149 Nm against 0.161 Nm RMS (7.5 ± 0.9 % less)" in said
        or "0.149 Nm against 0.161 Nm RMS (7.4 ± 0.9 % less)" in said
    )
    assert "predicts the last states better" in said
    assert "It would give strong evidence between oil change and running in." in said
    assert "nats" not in said


def test_no_gain_is_said_as_none():
    worse = replace(GAIN, reduction_percent=-2.0, forecast_log_score_gain=-1.0)
    said = summarise(replace(findings(Verdict.CAUSE_NAMED, "oil_change"), gain=worse))
    assert "(2.0 ± 0.9 % more)" in said
    assert "it does not improve remaining life" in said


def test_a_test_that_decides_little_is_not_oversold():
    found = findings(Verdict.CAUSE_AMBIGUOUS, "oil_change", "running_in")
    assert "What would decide: " in summarise(found)
    weak = replace(found.advice[0], nats=1.6)
    assert "No single test would decide" in summarise(replace(found, advice=(weak,)))
    alone = replace(found.advice[0], other="baseline")
    assert "To confirm it: " in summarise(replace(found, advice=(alone,)))
    assert "decide" not in summarise(replace(found, advice=()))


def test_a_test_of_a_nat_confirms_nothing_and_hardly_any_structure_is_no_percentage():
    found = findings(Verdict.CAUSE_NAMED, "oil_temperature")
    weak = replace(found.advice[0], other="baseline", nats=0.8)
    said = summarise(replace(found, advice=(weak,), baseline=replace(MISFIT, unexplained_share=1e-5)))
    assert "To confirm it" not in said
    assert "No test that was considered would add evidence." in said
    assert "less than 0.1 % of its square is no noise" in said
    assert "To confirm it" in summarise(replace(found, advice=(replace(weak, nats=50.0),)))


def test_what_was_not_measured_cannot_be_excluded():
    found = findings(Verdict.CAUSE_AMBIGUOUS, "torque_zero_shift")
    nobody = replace(candidate("oil_temperature", 0.3), estimate=Estimate(name="β", value=0.0, sd=0.7, unit="-"))
    listed = explanations_of({("torque_zero_shift",): 0.7, ("oil_temperature",): 0.3})
    said = summarise(replace(found, explanations=listed, candidates=(*found.candidates, nobody)))
    assert "or oil temperature (probability 0.30; not measured, so it cannot be excluded)" in said


def test_effects_out_of_reach_are_said_to_be():
    found = findings(Verdict.MODEL_ADEQUATE)
    weak = visible("pressure_offset", 10.0)
    said = summarise(replace(found, visible=(weak,)))
    assert "absorbed by the baseline for: pressure offset" in said
    assert "absorbed" not in summarise(found)


def test_of_a_course_over_life_two_states_say_little():
    found = findings(Verdict.MODEL_ADEQUATE)
    assert "2 states of use say little about a course over life." in summarise(replace(found, states=2))
    assert "1 test at 1 state of use was fitted. " in summarise(replace(found, tests=1, states=1))
    assert "about a course" not in summarise(found)
    some = replace(visible("pressure_offset", 3.0), least=0.1)  # seen in one of its shapes, in most not
    said = summarise(replace(found, visible=(some,)))
    assert "would have shown" not in said
    assert "Even a large effect" not in said
    assert "Only in some of its forms, others being absorbed by the baseline: pressure offset" in said


def test_notes_on_single_runs_are_counted():
    notes = ("sweep-003: 1 plateaus at rest left out.", "sweep-004: the same", "Nothing was known of the oil")
    said = summarise(replace(findings(Verdict.UNEXPLAINED_STRUCTURE), notes=notes))
    assert said.endswith("Nothing was known of the oil. The report has 2 notes on single runs.")
    assert "sweep" not in said


@pytest.mark.parametrize(
    ("strengths", "told"),
    [((31.0, 4.0), ", and depends on oil temperature and cycles."), ((31.0, 0.0), ", and depends on oil temperature.")],
)
def test_axes_that_show_nothing_are_not_mentioned(strengths, told):
    where = tuple(replace(each, strength=nats) for each, nats in zip(MISFIT.where, strengths, strict=True))
    found = findings(Verdict.UNEXPLAINED_STRUCTURE)
    assert f"is no noise{told}" in summarise(replace(found, baseline=replace(MISFIT, where=where)))
    silent = tuple(replace(each, strength=0.0) for each in where)
    assert "is no noise. " in summarise(replace(found, baseline=replace(MISFIT, where=silent)))


@pytest.mark.parametrize(
    ("nats", "words"),
    [(1.6, "weak"), (2.9, "weak"), (3.1, "moderate"), (4.9, "moderate"), (5.1, "strong"), (1e4, "strong")],
)
@pytest.mark.parametrize("other", ["running_in", "baseline"])
def test_evidence_is_given_in_words(nats, words, other):
    """Kass and Raftery's thresholds; the numbers are in the report's fields."""
    found = findings(Verdict.CAUSE_AMBIGUOUS, "oil_change", "running_in")
    said = summarise(replace(found, advice=(replace(found.advice[0], nats=nats, other=other),)))
    assert f"{words} evidence" in said
    assert " nats" not in said


def test_a_baseline_whose_error_is_no_more_than_noise_is_not_said_to_be_worse():
    found = findings(Verdict.CAUSE_AMBIGUOUS, "squeeze_film")
    said = summarise(replace(found, baseline=replace(MISFIT, rmse=0.0987)))
    assert "error is 0.0987 Nm RMS, no more than noise alone" in said
    assert "residuals are not random: they are correlated along oil temperature and cycles." in said
    assert "is no noise" not in said
    assert "no more than noise" not in summarise(found)


def test_the_last_states_are_predicted_also_better_only_where_something_else_is():
    found = findings(Verdict.CAUSE_NAMED, "oil_change")
    assert "It also predicts the last states better" in summarise(found)
    worse = summarise(replace(found, gain=replace(GAIN, reduction_percent=-2.0)))
    assert "It predicts the last states better" in worse
    assert "noise and the scatter of gains included" in worse


def ambiguous(*told: Candidate, resembles: str = "", more: dict[tuple[str, ...], float] | None = None) -> str:
    causes = tuple(each.effect for each in told)
    listed = explanations_of({(each.effect,): each.probability for each in told} | (more or {}))
    found = replace(findings(Verdict.CAUSE_AMBIGUOUS, *causes), candidates=told, explanations=listed)
    return summarise(replace(found, resembles=resembles))


def test_a_likely_cause_that_does_not_close_is_a_choice_of_two() -> None:
    both = {("rest_recovery", UNCATALOGUED): 0.2}
    said = ambiguous(candidate("rest_recovery", 0.8), more=both)
    assert "rest recovery (probability 0.80; " in said
    assert ", or rest recovery together with something that is not in the catalogue (probability 0.20)." in said
    alone = ambiguous(candidate("rest_recovery", 0.6), more={(UNCATALOGUED,): 0.4})
    assert ", or something that is not in the catalogue (probability 0.40)." in alone


def test_an_uncatalogued_fault_is_described() -> None:
    fault, more = "a gain that steps", {(UNCATALOGUED,): 0.4}
    said = ambiguous(candidate("oil_change", 0.6), resembles=fault, more=more)
    assert "not in the catalogue, such as a gain that steps (probability 0.40)." in said
    both = candidate("oil_change", 0.5), candidate("running_in", 0.5)
    assert "catalogue" not in ambiguous(*both, resembles=fault)
    said = summarise(replace(findings(Verdict.UNEXPLAINED_STRUCTURE), resembles=fault))
    assert "It most resembles a gain that steps." in said


def test_an_oil_temperature_that_nobody_measured_has_no_size() -> None:
    nobody = replace(candidate("oil_temperature", 0.8), estimate=Estimate(name="β", value=0.0, sd=0.7, unit="-"))
    said = ambiguous(nobody, candidate("oil_change", 0.2))
    assert "oil temperature (probability 0.80; not measured, so it cannot be excluded)" in said
    assert "0.7" not in said


def test_a_size_whose_sign_is_open_says_so() -> None:
    open_ = Estimate(name="pressure offset", value=-0.111, sd=0.08, unit="bar")
    said = ambiguous(replace(candidate("pressure_offset", 0.8), estimate=open_), candidate("torque_zero_shift", 0.2))
    assert "pressure offset −0.111 ± 0.080 bar, negative with probability 0.92" in said
    heat = summarise(findings(Verdict.CAUSE_NAMED, "interface_heating"))
    one_sided = replace(candidate("interface_heating", 0.9).estimate, one_sided=True)
    found = findings(Verdict.CAUSE_NAMED, "interface_heating")
    told = summarise(replace(found, candidates=(replace(found.candidates[0], estimate=one_sided),)))
    assert "positive with probability above 0.99" in heat
    assert "positive with" not in told  # it cannot be negative


def test_what_was_fitted_beside_a_named_cause_is_told() -> None:
    found = findings(Verdict.CAUSE_NAMED, "oil_change")
    film = replace(candidate("squeeze_film", 0.6), beside=("oil_change",))
    told = "Another effect may be at work beside it, which these data do not confirm: squeeze film (probability 0.60)."
    assert told in summarise(replace(found, candidates=(*found.candidates, film)))
    faint = replace(film, probability=0.1)
    assert "beside it" not in summarise(replace(found, candidates=(*found.candidates, faint)))


def test_the_likeliest_comes_first_and_a_correction_that_improves_nothing_is_said_to_be_none() -> None:
    said = ambiguous(candidate("oil_change", 0.2), candidate("inertia_torque", 0.8))
    assert said.index("inertia torque (") < said.index("oil change (")
    assert "So it does not improve predictions there." not in said
    found = findings(Verdict.UNEXPLAINED_STRUCTURE)
    worse = replace(GAIN, rmse_after=2 * GAIN.rmse_before, reduction_percent=-100.0, log_score_gain=-9.0)
    assert "So it does not improve predictions there." in summarise(replace(found, gain=worse))


def test_how_much_runs_scatter_is_told_where_the_model_is_adequate() -> None:
    found = findings(Verdict.MODEL_ADEQUATE)
    scatter = RunScatter(median=0.021, lower=0.015, upper=0.0304, information=2.0)
    estimated = summarise(replace(found, scatter=scatter))
    assert "from run to run (2.1 % of the torque, estimated; 90 % interval 1.5 to 3 %)" in estimated
    silent = summarise(replace(found, scatter=replace(scatter, information=0.1)))
    assert "from run to run (assumed to be 2.1 % of the torque, 1.5 to 3 %: these data hardly show it)" in silent
    assert "from run to run: the model" in summarise(found)


@pytest.mark.parametrize(
    ("hardest", "told"),
    [
        (
            Hardest(axis="cycles", value=10000.0, rmse=2.5, beyond=1000.0),
            "after 10,000 cycles, 1,000 cycles beyond all",
        ),
        (
            Hardest(axis="pressure_bar", value=5e5, rmse=2.5, beyond=0.0),
            "at 5 bar, between others that were kept: by 2.5",
        ),
    ],
)
def test_held_out_errors_far_beyond_the_fit_are_explained(hardest: Hardest, told: str) -> None:
    """1.52 Nm were stated beside a fit of 0.0217 Nm, and nothing more."""
    found = findings(Verdict.CAUSE_NAMED, "oil_change")
    far = replace(GAIN, rmse_after=1.52, rmse_before=1.9, hardest=hardest)
    said = summarise(replace(found, gain=far, extended=replace(MISFIT, rmse=0.0217)))
    assert f"Held out, it errs most {told}" in said
    assert "The model fits all runs together to 0.0217 Nm." in said
    assert "errs most" not in summarise(replace(found, gain=replace(GAIN, hardest=hardest)))
