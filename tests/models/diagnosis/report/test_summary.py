"""The paragraph: every verdict has one, in words and units, and none says nan."""

import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from models.diagnosis.criteria import MAX_WORDS
from models.diagnosis.design.design import FREQUENCY
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.diagnosis.experiments.candidates import TRIALS, Step
from models.diagnosis.experiments.test_plan import Advice
from models.diagnosis.explanations.verdict import UNCATALOGUED, Explanation, Verdict, Where
from models.diagnosis.extension import Extension
from models.diagnosis.pooled_fit.projection import RunScatter
from models.diagnosis.report.report import Candidate, Misfit, Report, Visible
from models.diagnosis.report.summary import summarise
from models.diagnosis.validation.held_out import Gain

MISFIT = Misfit(
    rmse=0.15234,
    noise=0.1012,
    unexplained_share=0.123,
    where=(Where(axis="oil_temperature_c", strength=31.0), Where(axis="cycles", strength=4.0)),
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
NO_BETTER = replace(GAIN, forecast_log_score_gain=-1.0)


def candidate(slug: str, probability: float, evidence: float = 30.0) -> Candidate:
    effect = BY_SLUG[slug]
    estimate = AmplitudeEstimate(name=effect.amplitude, value=0.3634, sd=0.0547, unit=effect.unit)
    return Candidate(
        effect=slug, title=effect.title, probability=probability, log_evidence_gain=evidence, estimate=estimate
    )


def visible(slug: str, sizes: float) -> Visible:
    """An effect that so many of its usual sizes would have shown."""
    effect = BY_SLUG[slug]
    usual = effect.scale * effect.prior_sd
    return Visible(
        effect=slug, amplitude=sizes * usual, least=sizes * usual / 2, usual=usual, unit=effect.unit, isolability=1.0
    )


def weights(verdict: Verdict, causes: tuple[str, ...]) -> dict[tuple[str, ...], float]:
    """Explanations that read as the verdict, by their effects."""
    if verdict is Verdict.CAUSE_NAMED:
        return {causes: 0.97, (): 0.03}
    if verdict is Verdict.CAUSE_AMBIGUOUS:
        return {(slug,): 1.0 for slug in causes} | ({(UNCATALOGUED,): 0.4} if len(causes) == 1 else {})
    return {(UNCATALOGUED,): 0.9, (): 0.1} if verdict is Verdict.UNEXPLAINED_STRUCTURE else {(): 1.0}


def explanations_of(given: dict[tuple[str, ...], float]) -> tuple[Explanation, ...]:
    """Explanations of these weights, most probable first."""
    total = sum(given.values())
    ranked = sorted(given.items(), key=lambda item: -item[1])
    return tuple(Explanation(effects=effects, probability=weight / total) for effects, weight in ranked)


def findings(verdict: Verdict, *causes: str) -> Report:
    test = "stationary test with the oil at 60 °C"
    advice = Advice(key="repeat", test=test, effect="oil_change", other="running_in", nats=1234.5, probability=0.8)
    return Report(
        verdict=verdict,
        causes=causes,
        explanations=explanations_of(weights(verdict, causes)),
        candidates=tuple(candidate(slug, 0.9 / len(causes)) for slug in causes),
        baseline=MISFIT,
        extended=MISFIT,
        extended_effects=causes,
        gain=GAIN,
        advice=(advice,),
        visible=tuple(visible(each.slug, 0.2) for each in CATALOGUE),
        notes=(),
        tests=12,
        states=6,
    )


WHY = "Do not adopt it, even if confirmed: with it, the model predicts other runs no better than without."
#: Steps of an advised test, and the words of a long one.
SWEEP = Step(
    kind="stationary_stribeck", pressures=(1e5, 4e5), speeds=(2.0944, 206.3), temperature=None, cycles=1, minutes=3
)
SWING = replace(SWEEP, kind="dynamic_stribeck", frequency=0.3, temperature=333.15)
LONG = "all_loads_and_60c"
ALL = [
    findings(Verdict.MODEL_ADEQUATE),
    *(findings(Verdict.CAUSE_NAMED, each.slug) for each in CATALOGUE),
    findings(Verdict.CAUSE_NAMED, "oil_temperature", "oil_change"),
    findings(Verdict.CAUSE_AMBIGUOUS, "oil_change", "running_in", "load_severity"),
    findings(Verdict.UNEXPLAINED_STRUCTURE),
]


@pytest.mark.parametrize("found", ALL, ids=lambda found: "-".join((found.verdict.value, *found.causes)))
def test_every_verdict_has_a_paragraph_that_is_read_once(found: Report) -> None:
    said = summarise(found)
    assert 15 <= len(said.split()) <= MAX_WORDS
    assert said.endswith(".")
    plain = said.replace("M_s", "M").replace("C_v", "C").replace("V_S", "V")
    assert not re.search(r"\bnan\b|\binf\b|None|_|  |\.\.|\( |nats|lives on", plain)
    # a number that has a unit is followed by it
    for each in found.candidates:
        felt = BY_SLUG[each.effect].felt
        unit = each.estimate.unit if felt is None else felt.unit
        value, low, high = (
            f"{x if felt is None else felt.of(x):.3g} {unit}".rstrip() for x in (0.3634, 0.2734, 0.4534)
        )
        if found.verdict is Verdict.CAUSE_NAMED:
            size = f"{value} (90 % interval {low.removesuffix(f' {unit}')} to {high})"
            assert BY_SLUG[each.effect].states.format(size) in said
        elif felt is None:
            assert f" (0.33; {each.estimate.name} {value})" in said
        assert each.effect.replace("_", " ") in said


def test_what_is_named_is_explained_with_its_size_its_gain_and_the_next_test() -> None:
    found = findings(Verdict.CAUSE_NAMED, "oil_temperature")
    said = summarise(found)
    assert "The cause is changed oil temperature (probability 0.97)." in said
    assert BY_SLUG["oil_temperature"].physics in said
    assert "costs 22.3 % (90 % interval 17.3 to 27 %) of the viscous torque." in said  # 1 - 2^-0.363 and so on
    assert f"Next: {BY_SLUG['oil_temperature'].check}." in said
    assert "Then: stationary test with" in said
    assert (
        "It decides with probability 0.80; hardest to tell apart are an oil change and unfinished running in." in said
    )


def test_what_adoption_does_is_said_once_the_cause_is_confirmed() -> None:
    for slug, course in (("oil_change", True), ("oil_temperature", False)):
        extension = Extension(effects=(slug,), content={})
        found = replace(findings(Verdict.CAUSE_NAMED, slug), extension=extension, advice=(), candidates=())
        said = summarise(found)
        then = "the predicted remaining life then includes oil change" if course else "measurements are then corrected"
        assert f"If that confirms it, adopt it: {then} and later tests are predicted better." in said
        assert "No further test would tell much more." in said
    no_better = summarise(replace(found, extension=Extension(effects=("oil_change",), content={}), gain=NO_BETTER))
    assert "adopting it is of little use: later tests are predicted no better." in no_better
    tested = replace(findings(Verdict.CAUSE_NAMED, "oil_change"), gain=NO_BETTER, candidates=())
    assert "Then: " not in summarise(replace(tested, extension=Extension(effects=("oil_change",), content={})))
    mixed = Extension(effects=("oil_change", "torque_zero_shift"), content={})
    said = summarise(replace(findings(Verdict.CAUSE_NAMED, *mixed.effects), extension=mixed, candidates=()))
    assert "measurements are then corrected, the predicted remaining life then includes oil change and later" in said
    assert "adopt" not in summarise(replace(found, extension=None))


def test_where_runs_scatter_more_than_usual_the_paragraph_says_what_may_hide_in_it() -> None:
    found = findings(Verdict.MODEL_ADEQUATE)
    usual, large = (
        RunScatter(median=median, lower=lower, upper=upper, information=3.0)
        for median, lower, upper in ((0.003, 0.002, 0.005), (0.0084, 0.0061, 0.0126))
    )
    assert "runs scatter more than usual" not in summarise(replace(found, scatter=usual))
    said = summarise(replace(found, scatter=large))
    assert "(0.84 % of the torque; 90 % interval 0.61 to 1.3 %)" in said
    assert "perhaps from a drifting zero. Next: repeat the last test immediately, and read the torque unloaded" in said
    assert len(said.split()) <= MAX_WORDS


def test_an_adequate_model_names_the_likeliest_of_what_is_not_excluded() -> None:
    found = findings(Verdict.MODEL_ADEQUATE)
    shares = {(): 0.57, (UNCATALOGUED,): 0.36, ("running_in",): 0.07}
    said = summarise(replace(found, explanations=explanations_of(shares)))
    assert "Not excluded: an unknown cause (probability 0.36)." in said
    sure = summarise(replace(found, explanations=explanations_of({(): 0.95, ("running_in",): 0.05})))
    assert "Not excluded" not in sure
    assert "Nothing needs to be done; diagnose again after the next tests." in sure


def test_why_nothing_may_be_adopted_stands_in_the_paragraph() -> None:
    said = summarise(replace(findings(Verdict.CAUSE_NAMED, "oil_change"), not_adoptable=WHY))
    assert WHY in said


def test_of_an_alternative_that_has_an_estimate_the_size_is_said_where_its_sign_is_sure() -> None:
    found = findings(Verdict.CAUSE_AMBIGUOUS, "torque_zero_shift")
    nobody = replace(
        candidate("oil_temperature", 0.3), estimate=AmplitudeEstimate(name="β", value=0.0, sd=0.7, unit="-")
    )
    listed = explanations_of({("torque_zero_shift",): 0.7, ("oil_temperature",): 0.3})
    said = summarise(replace(found, explanations=listed, candidates=(*found.candidates, nobody)))
    assert "a torque zero shift (0.70; 0.363 Nm) or changed oil temperature (0.30)." in said
    open_sign = replace(
        found.candidates[0], estimate=replace(found.candidates[0].estimate, stated_interval=(-1.0, 2.0))
    )
    assert "a torque zero shift (0.70) or" in summarise(
        replace(found, explanations=listed, candidates=(open_sign, nobody))
    )


def test_what_these_data_would_show_is_said_with_units_zero_and_pressure_first() -> None:
    found = replace(findings(Verdict.MODEL_ADEQUATE), unseen=("channel_delay", "stick_slip"))
    sizes = {"oil_temperature": 4.0, "running_in": 30.0, "unsettled_dwell": 20.0, "pressure_offset": 1.0}
    shown = tuple(visible(slug, size) for slug, size in (*sizes.items(), ("torque_zero_shift", 12.0)))
    said = summarise(replace(found, visible=shown))
    assert (
        "Nine times in ten, these tests would have found a torque zero shift of 3 Nm, a pressure offset of 0.075 bar or "
        "unfinished running in of 120 %; a fault that starts late or grows slowly must be larger."
    ) in said
    assert "These data cannot show, at any size: channel delay and stick slip." in said
    said = summarise(replace(found, visible=(visible("oil_temperature", 4.0),)))
    assert "changed oil temperature (halving the oil's viscosity costs 62 % of the viscous torque); a fault" in said
    one_form = replace(visible("pressure_offset", 3.0), amplitude=0.1, least=0.1)
    assert "would have found a pressure offset of 0.1 bar." in summarise(replace(found, visible=(one_form,)))
    some = replace(one_form, amplitude=math.inf)  # seen in one of its forms alone
    assert "grows slowly must be larger, or may not show at all." in summarise(replace(found, visible=(some,)))


def sized(interval: tuple[float, float], sign: float, value: float = 3.06) -> str:
    """The paragraph on a shifted zero of so many ± 3.16 Nm of this interval."""
    found = findings(Verdict.CAUSE_NAMED, "torque_zero_shift")
    estimate = replace(found.candidates[0].estimate, value=value, sd=3.16, stated_interval=interval, stated_sign=sign)
    return summarise(replace(found, candidates=(replace(found.candidates[0], estimate=estimate),)))


def test_a_size_and_the_words_on_its_sign_agree() -> None:
    assert "The torque sensor reads 3.06 Nm (90 % interval 0.972 to 9.23 Nm) too much." in sized((0.972, 9.23), 0.995)
    assert "0.1 to 9.23 Nm; this sign has probability 0.97) too much." in sized((0.1, 9.23), 0.97)
    assert "to 6.49 Nm; this sign has probability 0.55) too much." in sized((-4.2, 6.49), 0.55)
    assert "sensor reads 3.06 Nm (90 % interval 1 to 4 Nm) too little." in sized((-4.0, -1.0), 0.995, value=-3.06)
    less = "The torque sensor reads 0.4 Nm (90 % interval −0.1 to 0.9 Nm; this sign has probability 0.62) too little."
    assert less in sized((-0.9, 0.1), 0.62, value=-0.4)
    assert "Its size was not estimated." in sized((-0.8, 0.8), 0.5, value=0.0)


def test_no_sentence_stands_twice() -> None:
    found = replace(findings(Verdict.CAUSE_NAMED, "oil_change"), not_adoptable=WHY, notes=(WHY,))
    assert summarise(found).count(WHY) == 1


def test_a_cause_of_all_explanations_is_certain_and_open_is_what_is_beside_it() -> None:
    found = findings(Verdict.CAUSE_AMBIGUOUS, "channel_delay")
    both = explanations_of({("channel_delay",): 0.55, ("channel_delay", UNCATALOGUED): 0.45})
    said = summarise(replace(found, explanations=both))
    assert "A channel delay is at work (probability above 0.99), maybe alone (0.55). Beside it may be an" in said
    assert "Explanations that remain" not in said
    one = explanations_of({("channel_delay", UNCATALOGUED): 1.0})
    said = summarise(replace(found, explanations=one))
    assert (
        "A channel delay is at work (probability above 0.99). Beside it may be an unknown cause (above 0.99)." in said
    )
    alike = {("pressure_offset", "torque_zero_shift"): 0.6, ("torque_zero_shift",): 0.25, ("oil_change",): 0.15}
    found = findings(Verdict.CAUSE_AMBIGUOUS, "pressure_offset", "torque_zero_shift", "oil_change")
    said = summarise(replace(found, explanations=explanations_of(alike)))
    assert "A torque zero shift" not in said  # another explanation may be the true one
    assert "a pressure offset together with a torque zero shift (0.60; 0.363 bar; 0.363 Nm)" in said


def test_a_certain_cause_with_sized_companions_keeps_to_the_words() -> None:
    found = findings(Verdict.CAUSE_AMBIGUOUS, "channel_delay", "pressure_offset", "torque_zero_shift")
    beside = {("channel_delay", UNCATALOGUED): 0.4, ("channel_delay",): 0.2}
    beside |= {("channel_delay", slug): 0.2 for slug in ("pressure_offset", "torque_zero_shift")}
    stated = tuple(
        replace(each, estimate=replace(each.estimate, stated_interval=(0.2, 0.5), stated_sign=0.995))
        for each in found.candidates
    )
    advice = replace(found.advice[0], key=LONG, steps=(SWEEP, SWING), narrows=0.44)
    found = replace(found, explanations=explanations_of(beside), candidates=stated)
    said = summarise(replace(found, advice=(advice,)))
    assert len(said.split()) <= MAX_WORDS
    assert "pressure offset" in said
    assert "torque zero shift" in said
    assert "For a closer value of oil change: " in said


def test_a_test_of_many_words_is_put_into_a_short_line_with_its_time() -> None:
    found = findings(Verdict.CAUSE_NAMED, "inertia_torque")
    for minutes, lasts in ((23.4, "47 minutes"), (300.0, "10 hours")):
        steps = (replace(SWEEP, minutes=minutes), replace(SWING, minutes=minutes))
        advice = replace(found.advice[0], key=LONG, steps=steps, narrows=0.3)
        test = f"{TRIALS[LONG].brief} ({lasts} in all, steps in the plan); it narrows the interval by 70 %."
        assert f"For a closer value: {test}" in summarise(replace(found, advice=(advice,)))
    assert TRIALS[LONG].brief == "stationary and dynamic tests at usual and low pressures, some with the oil at 60 °C"
    assert all(trial.brief or len(trial.text.split()) <= 22 for trial in TRIALS.values())
    assert not any(
        trial.brief for trial in TRIALS.values() if trial.rest or trial.later
    )  # use and rest are always said


def test_what_a_test_decides_and_how_surely() -> None:
    found = findings(Verdict.CAUSE_AMBIGUOUS, "oil_change", "running_in")
    shares = {("oil_change",): 0.6, ("oil_change", "running_in"): 0.3, ("oil_change", UNCATALOGUED): 0.1}
    held = replace(found, explanations=explanations_of(shares))
    said = summarise(held)
    assert "An oil change is at work (probability above 0.99), maybe alone (0.60). Beside it" in said
    assert "or others (0.10)." in said
    assert "It decides with probability 0.80 whether unfinished running in is at work." in said
    assert "Viscous friction stepped up by 0.363 % (" in said
    assert said.endswith("Adopt nothing before the next diagnosis.")
    (test,) = found.advice
    said = summarise(replace(held, advice=(replace(test, nats=0.01),)))
    assert f"Next: {BY_SLUG['oil_change'].check}. Most helpful, though unlikely to decide: stationary test with" in said
    said = summarise(replace(held, advice=(replace(test, effect="running_in", other="baseline"),)))
    assert "whether unfinished running in is at work." in said


def test_nothing_is_asked_of_an_unknown_axis() -> None:
    said = summarise(replace(findings(Verdict.UNEXPLAINED_STRUCTURE), baseline=replace(MISFIT, where=())))
    assert said.endswith("if not, look at the rig.")


def test_a_pair_is_looked_at_and_adopted_in_the_plural() -> None:
    found = findings(Verdict.CAUSE_NAMED, "torque_zero_shift", "inertia_torque")
    said = summarise(replace(found, extension=Extension(effects=found.causes, content={}), candidates=()))
    assert "If that confirms them, adopt them: measurements are then corrected and later tests" in said
    checks = [BY_SLUG[slug].check for slug in found.causes]
    assert f"Next: {checks[0]}. Also {checks[1]}." in said


def test_an_error_as_large_as_noise_is_not_called_correlated_along_cycles() -> None:
    found = replace(findings(Verdict.UNEXPLAINED_STRUCTURE), baseline=replace(MISFIT, rmse=0.1))
    said = summarise(found)
    assert "The error is small (0.1 Nm RMS, no more than the noise), but it is not random: it depends on oil" in said
    assert said.endswith(
        "look at the oil's thermometer and the plate's temperature, then what was changed between the tests."
    )


def test_a_swing_without_a_name_is_said_as_what_it_is() -> None:
    misfit = replace(MISFIT, where=(Where(axis=FREQUENCY, strength=40.0), *MISFIT.where))
    notes = ("fixed_line: torque swings at 12.5 Hz at all speeds alike.",)
    said = summarise(replace(findings(Verdict.UNEXPLAINED_STRUCTURE), baseline=misfit, notes=notes))
    assert "In the raw records torque swings at 12.5 Hz at all speeds alike." in said
    assert said.endswith("look at what turns or is driven at that rate.")


def test_of_a_vibration_its_frequency_is_said_and_what_to_look_at() -> None:
    notes = ("stick_slip: torque swings at 12.5 Hz below 40 % of the highest speed and not above.",)
    found = replace(findings(Verdict.CAUSE_NAMED, "stick_slip"), advice=(), gain=None, notes=notes)
    said = summarise(found)
    assert "Here torque swings at 12.5 Hz below 40 % of the highest speed and not above." in said
    assert said.endswith(f"Next: {BY_SLUG['stick_slip'].check}.")


def test_where_no_test_decides_it_is_said_what_to_look_at_and_what_is_improbable_is_summed() -> None:
    found = replace(findings(Verdict.CAUSE_AMBIGUOUS, "hydrodynamic_drag", "viscous_exponent"), advice=())
    shares = {(UNCATALOGUED,): 0.7, ("hydrodynamic_drag",): 0.15, ("viscous_exponent",): 0.04, ("running_in",): 0.06}
    said = summarise(replace(found, explanations=explanations_of(shares | {("oil_change",): 0.05})))
    assert (
        "an unknown cause (0.70), hydrodynamic drag (0.15; drag at the middle speed 0.363 Nm) or others (0.15)." in said
    )
    assert "or others (0.15)." in said
    assert f"Next: {BY_SLUG['hydrodynamic_drag'].check}." in said


def test_every_effect_says_what_to_look_at() -> None:
    assert all(effect.check for effect in CATALOGUE)


def test_notes_on_single_runs_stay_in_the_report() -> None:
    notes = ("sweep-003: 1 plateaus at rest left out.", "sweep-004: the same", "Nothing was known of the oil")
    said = summarise(replace(findings(Verdict.UNEXPLAINED_STRUCTURE), notes=notes))
    assert said.endswith("Nothing was known of the oil.")
    assert "sweep" not in said


def test_pairs_beside_a_long_test_are_shortened() -> None:
    slugs = [effect.slug for effect in CATALOGUE[:9]]
    pairs = dict.fromkeys(pairwise(slugs), 0.13)
    found = findings(Verdict.CAUSE_AMBIGUOUS, *slugs)
    advice = replace(found.advice[0], key=LONG, steps=(SWEEP, SWING))
    said = summarise(replace(found, explanations=explanations_of(pairs), advice=(advice,)))
    assert len(said.split()) <= MAX_WORDS
    assert all(slug.replace("_", " ") in said for slug in slugs)
    assert 2 <= said.count("(0.1") < 8


def test_of_many_alternatives_those_that_hold_nine_tenths_are_told_and_the_rest_is_summed() -> None:
    slugs = [effect.slug for effect in CATALOGUE[:12]]
    said = summarise(replace(findings(Verdict.CAUSE_AMBIGUOUS, *slugs), candidates=()))
    assert all(slug.replace("_", " ") in said for slug in slugs[:11])
    assert said.count("(0.08") == 12
    assert "or others (0.08)." in said
    assert len(said.split()) <= MAX_WORDS
    assert (
        summarise(findings(Verdict.CAUSE_AMBIGUOUS, *slugs)).count("(0.08") == 8
    )  # with sizes, there are too many words


# --- How the size of an effect is written, whatever it is.


def test_any_amplitude_can_be_written():
    rng = np.random.default_rng(7)
    found = findings(Verdict.CAUSE_NAMED, "oil_change")
    for _ in range(300):
        value, sd = rng.choice([-1, 1]) * 10 ** rng.uniform(-12, 12), 10 ** rng.uniform(-12, 12)
        estimate = AmplitudeEstimate(name="step", value=value, sd=float(rng.choice([0.0, sd])), unit="%")
        said = summarise(replace(found, candidates=(replace(found.candidates[0], estimate=estimate),)))
        way, told = re.search(r"stepped (up|down) by (-?[\d.,e+-]+)", said.replace("−", "-")).groups()
        number = float(told.rstrip(".").replace(",", "")) * (1 if way == "up" else -1)
        assert abs(number - value) <= max(0.006 * abs(value), 0.06 * estimate.sd)


def test_a_torque_that_is_ahead_is_not_called_delayed():
    found = findings(Verdict.CAUSE_NAMED, "channel_delay")
    ahead = replace(found.candidates[0], estimate=replace(found.candidates[0].estimate, value=-0.012, sd=0.002))
    said = summarise(replace(found, candidates=(ahead,)))
    assert "Torque is ahead of the speed" in said
    assert "Torque is recorded 0.012 ms (90 % interval 0.00871 to 0.0153 ms) before speed." in said
    assert BY_SLUG["channel_delay"].physics not in said
    late = summarise(found)
    assert BY_SLUG["channel_delay"].physics in late
    assert "ahead" not in late
    other = findings(Verdict.CAUSE_NAMED, "torque_zero_shift")
    below = replace(other.candidates[0], estimate=replace(other.candidates[0].estimate, value=-0.4))
    assert BY_SLUG["torque_zero_shift"].physics in summarise(replace(other, candidates=(below,)))
