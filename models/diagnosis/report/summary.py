"""The paragraph that an engineer would sign: what was measured, what is wrong, why this cause, what to do next."""

from collections.abc import Sequence
from dataclasses import dataclass

from models.diagnosis.attribution.explanations import credible_explanations
from models.diagnosis.attribution.verdict import UNCATALOGUED, Explanation, Verdict
from models.diagnosis.criteria import (
    COMPANION_FROM,
    FAR_FROM_FIT,
    FEW_STATES,
    LARGE_AMPLITUDE,
    RIVAL_BELOW,
    RIVAL_FROM,
    RIVALS_MENTIONED,
    VISIBLE_MENTIONED,
    WEAK_EVIDENCE,
    WORTHWHILE,
)
from models.diagnosis.design.axes import PRESSURE
from models.diagnosis.detection.lack_of_fit import Misfit
from models.diagnosis.detection.structure_axes import Where
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.experiments.test_plan import BASELINE, Advice
from models.diagnosis.pooled_fit.run_scatter import RunScatter
from models.diagnosis.report.report import Candidate, Visible
from models.diagnosis.report.wording import (
    axis_name,
    conjunction,
    count_of,
    effect_name,
    evidence_in_words,
    number,
    probability,
    signed,
    with_unit,
)
from models.diagnosis.validation.held_out import Gain

#: A share [%] below which its size is not given, and axes of structure that are mentioned at most.
_LEAST_PERCENT, _AXES_MENTIONED = 0.1, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What a report says, before its paragraph; `resembles` is the uncatalogued rig fault that does about as well as the
    best effect, `scatter` that of the runs' gains."""

    verdict: Verdict
    causes: tuple[str, ...]
    explanations: tuple[Explanation, ...]
    candidates: tuple[Candidate, ...]
    baseline: Misfit | None
    extended: Misfit | None
    gain: Gain | None
    advice: tuple[Advice, ...]
    visible: tuple[Visible, ...]
    notes: tuple[str, ...]
    tests: int
    states: int
    resembles: str = ""
    scatter: RunScatter | None = None


def summarise(findings: Findings) -> str:
    """Sentences, in the order in which one would ask."""
    sentences = {
        Verdict.MODEL_ADEQUATE: _adequate,
        Verdict.CAUSE_NAMED: _named,
        Verdict.CAUSE_AMBIGUOUS: _ambiguous,
        Verdict.UNEXPLAINED_STRUCTURE: _unexplained,
        Verdict.INSUFFICIENT_DATA: _insufficient,
    }[findings.verdict](findings)
    fitted = "was fitted" if findings.tests == 1 else "were fitted at once"
    data = f"{count_of(findings.tests, 'test')} at {count_of(findings.states, 'state')} of use {fitted}."
    parts = [data, *sentences, *_gained(findings), *_next(findings), *_noted(findings.notes)]
    return " ".join(part for part in parts if part)


def _adequate(findings: Findings) -> list[str]:
    noise = "" if findings.baseline is None else f" of {number(findings.baseline.noise)} Nm"
    parts = [
        f"Nothing exceeds the noise{noise} and the scatter from run to run{_scatter(findings.scatter)}: the model is "
        "adequate for these data."
    ]
    catalogued = [visible for visible in findings.visible if visible.effect in BY_SLUG]
    shown = [visible for visible in catalogued if _within_reach(visible, visible.amplitude)]
    if shown:
        sizes = "; ".join(_detectable(visible, visible.amplitude) for visible in shown[:VISIBLE_MENTIONED])
        parts.append(f"These data would have shown, with 90 % power: {sizes}.")
    partly = [
        visible
        for visible in catalogued
        if _within_reach(visible, visible.least) and not _within_reach(visible, visible.amplitude)
    ]
    if partly:
        sizes = "; ".join(_detectable(visible, visible.least) for visible in partly[:VISIBLE_MENTIONED])
        parts.append(f"Only in some of its forms, others being absorbed by the baseline: {sizes}.")
    hidden = [visible.effect for visible in catalogued if not _within_reach(visible, visible.least)]
    if hidden:
        names = conjunction([effect_name(slug) for slug in hidden])
        parts.append(f"Even a large effect would be absorbed by the baseline for: {names}.")
    if findings.states < FEW_STATES:
        say = "says" if findings.states == 1 else "say"
        parts.append(f"{count_of(findings.states, 'state')} of use {say} little about a course over life.")
    return parts


def _scatter(scatter: RunScatter | None) -> str:
    """In brackets: the estimate and its interval, or that it is the prior's."""
    if scatter is None:
        return ""
    median, lower, upper = (f"{100 * share:.2g}" for share in (scatter.median, scatter.lower, scatter.upper))
    if scatter.assumed:
        return f" (assumed to be {median} % of the torque, {lower} to {upper} %: these data hardly show it)"
    return f" ({median} % of the torque, estimated; 90 % interval {lower} to {upper} %)"


def _within_reach(visible: Visible, amplitude: float) -> bool:
    return amplitude <= LARGE_AMPLITUDE * visible.usual


def _detectable(visible: Visible, amplitude: float) -> str:
    size = with_unit(number(amplitude), visible.unit)
    return f"{effect_name(visible.effect)} ({BY_SLUG[visible.effect].amplitude}) from {size}"


def _named(findings: Findings) -> list[str]:
    causes = set(findings.causes)
    chosen = [candidate for candidate in findings.candidates if candidate.effect in causes]
    others = [candidate for candidate in findings.candidates if candidate.effect not in causes]
    names = " together with ".join(effect_name(slug) for slug in findings.causes)
    exactly = sum(
        explanation.probability for explanation in findings.explanations if causes <= set(explanation.effects)
    )
    parts = [
        _error(findings),
        f"The cause{'s are' if len(findings.causes) > 1 else ' is'} {names} (probability {probability(exactly)}).",
    ]
    parts += [f"{_physics(candidate)} Here: {signed(candidate.estimate)}." for candidate in chosen]
    companions = [
        f"{effect_name(candidate.effect)} (probability {probability(candidate.probability)})"
        for candidate in others
        if candidate.probability >= COMPANION_FROM
    ]
    if companions:
        parts.append(
            f"Another effect may be at work beside it, which these data do not confirm: {' or '.join(companions)}."
        )
    best = max((candidate.log_evidence_gain for candidate in chosen), default=0.0)
    rivals = [
        f"{evidence_in_words(best - candidate.log_evidence_gain)} over {effect_name(candidate.effect)}"
        for candidate in others
        if RIVAL_FROM < candidate.probability < RIVAL_BELOW
        and candidate.log_evidence_gain < best - WEAK_EVIDENCE
        and not set(candidate.beside) & causes  # it was fitted with the cause, not against it
    ]
    if rivals and chosen:
        parts.append(f"With everything else refitted, the evidence for it is {conjunction(rivals[:RIVALS_MENTIONED])}.")
    return parts


def _ambiguous(findings: Findings) -> list[str]:
    """The explanations among which the choice is, each with its probability, and each effect's size where it first comes."""
    sized = {candidate.effect: candidate.estimate for candidate in findings.candidates}
    alternatives = []
    for explanation in credible_explanations(findings.explanations):
        names = [_alternative(slug, findings.resembles) for slug in explanation.effects] or ["nothing at all"]
        sizes = [
            signed(estimate) if estimate.value != 0.0 else "not measured, so it cannot be excluded"
            for slug in explanation.effects
            if (estimate := sized.pop(slug, None)) is not None
        ]
        inside = "; ".join([f"probability {probability(explanation.probability)}", *sizes])
        alternatives.append(f"{' together with '.join(names)} ({inside})")
    listing = f"{', '.join(alternatives[:-1])}, or {alternatives[-1]}"
    return [_error(findings), f"These data cannot distinguish what explains it, the most probable first: {listing}."]


def _alternative(slug: str, resembles: str) -> str:
    if slug != UNCATALOGUED:
        return effect_name(slug)
    return f"something that is not in the catalogue{f', such as {resembles}' if resembles else ''}"


def _unexplained(findings: Findings) -> list[str]:
    return [
        _error(findings),
        "No effect of the catalogue explains it, alone or with another: a pattern beyond noise would be left, parts of the "
        "data would ask for different sizes of the effect, or two effects would have to cancel each other. So no cause is "
        "named.",
        f"It most resembles {findings.resembles}." if findings.resembles else "",
    ]


def _insufficient(_: Findings) -> list[str]:
    return ["That is too little to judge the model by."]


def _error(findings: Findings) -> str:
    """The baseline's error, and what it depends on."""
    misfit = findings.baseline
    if misfit is None:
        return ""
    error = f"The baseline model's error is {number(misfit.rmse)} Nm RMS"
    where = _axes(misfit.where)
    if misfit.rmse <= misfit.noise:
        along = f" along {where}" if where else ""
        return f"{error}, no more than noise alone, but its residuals are not random: they are correlated{along}."
    percent = 100 * misfit.unexplained_share
    share = f"{'less than 0.1' if percent < _LEAST_PERCENT else number(percent)} % of its square is no noise"
    depends = f", and depends on {where}" if where else ""
    return f"{error} (noise alone: {number(misfit.noise)} Nm); {share}{depends}."


def _axes(where: Sequence[Where]) -> str:
    return " and ".join(axis_name(axis.axis) for axis in where[:_AXES_MENTIONED] if axis.strength > 0)


def _gained(findings: Findings) -> list[str]:
    gain = findings.gain
    if gain is None or findings.verdict in {Verdict.MODEL_ADEQUATE, Verdict.INSUFFICIENT_DATA}:
        return []
    change = f"{abs(gain.reduction_percent):.1f} ± {gain.reduction_sd:.1f} %"
    way = "less" if gain.reduction_percent >= 0 else "more"
    model = {
        Verdict.CAUSE_AMBIGUOUS: "the model extended by the most probable cause that could be fitted",
        Verdict.UNEXPLAINED_STRUCTURE: "the model with a smooth correction",
    }.get(findings.verdict, "the extended model")
    beyond = f"; the part beyond noise is {number(gain.excess_after)} Nm against {number(gain.excess_before)} Nm"
    error = (
        f"On runs that were held out, the error of {model} is {number(gain.rmse_after)} Nm against "
        f"{number(gain.rmse_before)} Nm RMS ({change} {way}), noise and the scatter of gains included"
        f"{beyond if max(gain.excess_after, gain.excess_before) > 0 else ''}."
    )
    error += _hardest(gain, findings.extended)
    if gain.rmse_after > gain.rmse_before and gain.log_score_gain < 0:
        error += " So it does not improve predictions there."
    ahead = (
        f"It {'also predicts' if gain.reduction_percent > 0 else 'predicts'} the last states better from the first ones."
        if gain.forecast_log_score_gain > 0
        else "It predicts the last states from the first ones no better: it does not improve remaining life."
    )
    return [error, ahead]


def _hardest(gain: Gain, extended: Misfit | None) -> str:
    """Where held-out runs are predicted far worse than they were fitted, and how far from what was kept that is."""
    hardest = gain.hardest
    if hardest is None or extended is None or gain.rmse_after < FAR_FROM_FIT * extended.rmse:
        return ""
    pressed = hardest.axis == PRESSURE
    size, unit = (1e-5, "bar") if pressed else (1.0, "cycles")
    place = f"{'at' if pressed else 'after'} {number(size * hardest.value)} {unit}"
    kept = (
        f"{number(size * hardest.beyond)} {unit} beyond all that were kept"
        if hardest.beyond > 0.0
        else "between others that were kept"
    )
    return (
        f" The model fits all runs together to {number(extended.rmse)} Nm. Held out, it errs most {place}, {kept}: by "
        f"{number(hardest.rmse)} Nm RMS, with no gain of those runs known."
    )


def _next(findings: Findings) -> list[str]:
    if not findings.advice or findings.verdict not in {Verdict.CAUSE_NAMED, Verdict.CAUSE_AMBIGUOUS}:
        return []
    best = findings.advice[0]
    evidence = f"{evidence_in_words(best.nats)} evidence"
    other = "no effect at all" if best.other == BASELINE else effect_name(best.other)
    pair = f"{effect_name(best.effect)} and {other}"
    if best.nats < WEAK_EVIDENCE:
        return ["No test that was considered would add evidence."]
    if best.nats < WORTHWHILE:
        return [f"No single test would decide; the most informative is: {best.test} ({evidence} between {pair})."]
    if best.other == BASELINE:
        return [f"To confirm it: {best.test}. That would give {evidence} on whether it is the cause."]
    return [f"What would decide: {best.test}. It would give {evidence} between {pair}."]


def _noted(notes: Sequence[str]) -> list[str]:
    """Notes on the whole campaign, as sentences; those on single runs, which begin with its name, are counted."""
    single = [note for note in notes if " " not in note.split(":")[0] and ":" in note and not _on_effect(note)]
    whole = [note if note.endswith(".") else f"{note}." for note in notes if note not in single]
    whole = [note[0].upper() + note[1:].replace("_", " ") if _on_effect(note) else note for note in whole]
    return [*whole, f"The report has {count_of(len(single), 'note')} on single runs."] if single else whole


def _on_effect(note: str) -> bool:
    return note.split(":")[0] in BY_SLUG


def _physics(candidate: Candidate) -> str:
    if candidate.effect not in BY_SLUG:
        return ""
    effect = BY_SLUG[candidate.effect]
    return effect.opposite_physics if candidate.estimate.value < 0 and effect.opposite_physics else effect.physics
