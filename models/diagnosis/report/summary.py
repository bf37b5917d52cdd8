"""The paragraph that an engineer would sign: what was looked at, what is wrong, why this cause, what to do next."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from models.diagnosis.attribution.decide import LEAST_NAMED
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.experiments.test_plan import WORTH
from models.diagnosis.report.report import Advice, Candidate, Gain, Misfit, Verdict, Visible, Where

#: Rivals that are spoken of and between which probabilities, effects whose visible amplitude is told.
_SPOKEN, _RIVAL, _OPEN, _TOLD = 3, 0.001, 0.1, 3
#: What was fitted beside a cause and not named is told from this probability on.
_COMPANION = 0.3
#: An effect beyond so many deviations of its prior is stronger than one would expect.
_STRONG = 2.0
#: Fewer states say little of a course over life.
_COURSE = 3
#: A share [%] below which its size is not told.
_LEAST_PERCENT = 0.1
#: Digits after the point at most.
_DIGITS = 5

#: What a negative amplitude of an effect means where its physics has another way in mind.
_OTHERWISE = {
    "channel_delay": "Torque is ahead of the speed: it is the speed's channel that a filter or the recorder delays."
}
#: More evidence than this [nats] decides as well; less than that is none.
_PLENTY, _LEAST_NATS = 100.0, 1.0

_AXES = {
    "pressure_bar": "pressure",
    "torque_nm": "the torque itself",
    "speed_rpm": "speed",
    "cycles": "cycles",
    "test_clock_s": "the time since the test began",
    "oil_temperature_c": "oil temperature",
    "loop_phase": "the phase of the loops",
    "acceleration": "the sign of the acceleration",
    "frequency_hz": "frequency, in the raw records",
    "noise": "the scatter itself",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What a report says, before its paragraph."""

    verdict: Verdict
    causes: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    baseline: Misfit | None
    extended: Misfit | None
    gain: Gain | None
    advice: tuple[Advice, ...]
    visible: tuple[Visible, ...]
    notes: tuple[str, ...]
    tests: int
    states: int
    looks: str = ""  # what is not in the catalogue and does as well
    scatter: float = 0.0  # of the runs' gains [-]


def summarise(found: Findings) -> str:
    """Sentences, in the order in which one would ask."""
    tell = {
        Verdict.MODEL_ADEQUATE: _adequate,
        Verdict.CAUSE_NAMED: _named,
        Verdict.CAUSE_AMBIGUOUS: _ambiguous,
        Verdict.UNEXPLAINED_STRUCTURE: _unexplained,
        Verdict.INSUFFICIENT_DATA: _insufficient,
    }[found.verdict]
    fitted = "was fitted" if found.tests == 1 else "were fitted at once"
    seen = f"{_count(found.tests, 'test')} at {_count(found.states, 'state')} of use {fitted}."
    parts = [seen, *tell(found), *_gained(found), *_next(found), *_noted(found.notes)]
    return " ".join(part for part in parts if part)


def _adequate(found: Findings) -> list[str]:
    noise = "" if found.baseline is None else f" of {_number(found.baseline.noise)} Nm"
    scatter = f" ({_number(100 * found.scatter)} % of the torque)" if found.scatter > 0 else ""
    parts = [
        f"Nothing stands out of the noise{noise} and the scatter from run to run{scatter}: the model is adequate for these "
        "data."
    ]
    told = [each for each in found.visible if each.effect in BY_SLUG and _within_reach(each, each.amplitude)]
    if told:
        seen = "; ".join(_seen_from(each) for each in told[:_TOLD])
        parts.append(f"These data would have shown, nine times in ten and each in its middle form: {seen}.")
    hidden = [each.effect for each in found.visible if each.effect in BY_SLUG and not _within_reach(each, each.least)]
    if hidden:
        parts.append(f"Even a strong effect would have stayed hidden behind the baseline for: {_listed(hidden)}.")
    if found.states < _COURSE:
        parts.append(f"Of a course over life {_count(found.states, 'state')} of use can say little.")
    return parts


def _within_reach(visible: Visible, amplitude: float) -> bool:
    return amplitude <= _STRONG * visible.usual


def _seen_from(visible: Visible) -> str:
    unit = "" if visible.unit in {"-", ""} else f" {visible.unit}"
    return f"{_name(visible.effect)} ({BY_SLUG[visible.effect].amplitude}) from {_number(visible.amplitude)}{unit} on"


def _named(found: Findings) -> list[str]:
    chosen = [each for each in found.candidates if each.effect in found.causes]
    several = len(found.causes) > 1
    causes = " together with ".join(_name(slug) for slug in found.causes)
    parts = [_misses(found), f"The cause{'s are' if several else ' is'} {causes}."]
    parts += [f"{_physics(each)} Here: {_estimate(each.estimate)}." for each in chosen]
    second = [
        each for each in found.candidates if each.effect not in found.causes and set(each.beside) & set(found.causes)
    ]
    second = [each for each in second if each.probability >= _COMPANION]
    if second:
        told = [f"{_name(each.effect)} (probability {_probability(each.probability)})" for each in second]
        parts.append(f"Something else may be at work beside it, which these data do not tell: {' or '.join(told)}.")
    best = max((each.log_evidence_gain for each in chosen), default=0.0)
    rivals = [
        each  # one that is as good or was fitted with the cause stood beside it, not against it
        for each in found.candidates
        if each.effect not in found.causes
        and _RIVAL < each.probability < _OPEN
        and each.log_evidence_gain < best - 1.0
        and not set(each.beside) & set(found.causes)
    ]
    if rivals and chosen:
        told = [f"{_name(each.effect)} by {_number(best - each.log_evidence_gain)} nats" for each in rivals[:_SPOKEN]]
        parts.append(f"Refitted with everything else free, that explains the data better than {_and(told)}.")
    return parts


def _ambiguous(found: Findings) -> list[str]:
    known = {each.effect: each for each in found.candidates}
    told = []
    for slug in sorted(found.causes, key=lambda slug: -known[slug].probability if slug in known else 0.0):
        each = known.get(slug)
        if each is not None and each.estimate.value != 0.0:
            told.append(f"{_name(slug)} (probability {_probability(each.probability)}; {_estimate(each.estimate)})")
        else:
            told.append(f"{_name(slug)} (not measured, so it cannot be excluded)")
    sure = [each.effect for each in known.values() if each.probability >= LEAST_NAMED and each.estimate.value != 0.0]
    if set(found.causes) <= set(sure):
        left = "what that leaves is not quite noise, or parts of the data ask for other sizes"
        return [
            _misses(found),
            f"It looks like {' together with '.join(told)}, but {left}: something else may be at work too.",
        ]
    if len(told) == 1:
        such = f", such as {found.looks}" if found.looks else ""
        return [_misses(found), f"The cause may be {told[0]}, or something that the catalogue does not hold{such}."]
    none = f" It may be none of them: {found.looks} would do as well." if found.looks else ""
    which = "These data cannot tell which of these is the cause, the likeliest first"
    return [_misses(found), f"{which}: {', '.join(told)}.{none}"]


def _unexplained(found: Findings) -> list[str]:
    return [
        _misses(found),
        "No effect of the catalogue accounts for it, alone or with another: something beyond noise would be left, parts of "
        "the data would ask for different sizes of the effect, or two would have to undo each other. So no cause is named.",
        f"It looks most like {found.looks}." if found.looks else "",
    ]


def _insufficient(_: Findings) -> list[str]:
    return ["That is too little to judge the model by."]


def _misses(found: Findings) -> str:
    if found.baseline is None:
        return ""
    percent = 100 * found.baseline.unexplained_share
    share = f"{'less than 0.1' if percent < _LEAST_PERCENT else _number(percent)} % of the squared residual"
    where = _axes(found.baseline.where)
    if found.baseline.rmse <= found.baseline.noise:
        return (
            f"The baseline misses the data by {_number(found.baseline.rmse)} Nm, no more than noise alone would, but not by "
            f"chance: what it misses goes together{where}."
        )
    return (
        f"The baseline misses the data by {_number(found.baseline.rmse)} Nm where noise alone would make "
        f"{_number(found.baseline.noise)} Nm; {share} is structure{where}."
    )


def _axes(where: Sequence[Where]) -> str:
    told = [_AXES.get(each.axis, each.axis) for each in where[:2] if each.strength > 0]
    return f", which lives on {' and '.join(told)}" if told else ""


def _gained(found: Findings) -> list[str]:
    gain = found.gain
    if gain is None or found.verdict in {Verdict.MODEL_ADEQUATE, Verdict.INSUFFICIENT_DATA}:
        return []
    change = f"{abs(gain.reduction_percent):.1f} ± {gain.reduction_sd:.1f} %"
    way = "less" if gain.reduction_percent >= 0 else "more"
    model = {
        Verdict.CAUSE_AMBIGUOUS: "the model extended by the likeliest that could be fitted",
        Verdict.UNEXPLAINED_STRUCTURE: "the model with a smooth correction",
    }.get(found.verdict, "the extended model")
    beyond = f"; the part beyond noise is {_number(gain.excess_after)} Nm against {_number(gain.excess_before)} Nm"
    told = (
        f"On runs that were held out, {model} misses by {_number(gain.rmse_after)} Nm against "
        f"{_number(gain.rmse_before)} Nm ({change} {way}), noise and gains that scatter included"
        f"{beyond if max(gain.excess_after, gain.excess_before) > 0 else ''}."
    )
    if gain.rmse_after > gain.rmse_before and gain.log_score_gain < 0:
        told += " So it is of no use there."
    ahead = (
        f"It {'also foretells' if gain.reduction_percent > 0 else 'foretells'} the last states better from the first ones."
        if gain.remaining > 0
        else "It foretells the last states from the first ones no better: for remaining life it is no gain."
    )
    return [told, ahead]


def _next(found: Findings) -> list[str]:
    if not found.advice or found.verdict not in {Verdict.CAUSE_NAMED, Verdict.CAUSE_AMBIGUOUS}:
        return []
    best = found.advice[0]
    nats = f"about {_number(best.nats)} nats" if best.nats <= _PLENTY else f"more than {_number(_PLENTY)} nats"
    pair = f"{_name(best.effect)} and {_name(best.other)}"
    if best.other == "baseline":
        pair = f"{_name(best.effect)} and nothing at all"
    if best.nats < _LEAST_NATS:
        return ["No test that was considered would tell more."]
    if best.nats < WORTH:
        return [f"No single test would decide; the most telling is: {best.test} ({nats} between {pair})."]
    if best.other == "baseline":
        return [f"To confirm it: {best.test}. That would add {nats} for or against it."]
    return [f"What would decide: {best.test}. It would part {pair} by {nats}."]


def _noted(notes: Sequence[str]) -> list[str]:
    """Notes on the whole campaign, as sentences; those on single runs, which begin with its name, are counted."""
    single = [note for note in notes if " " not in note.split(":")[0] and ":" in note and not _on_effect(note)]
    told = [note if note.endswith(".") else f"{note}." for note in notes if note not in single]
    told = [note[0].upper() + note[1:].replace("_", " ") if _on_effect(note) else note for note in told]
    stand = "stands" if len(single) == 1 else "stand"
    return [*told, f"{_count(len(single), 'note')} on single runs {stand} in the report."] if single else told


def _on_effect(note: str) -> bool:
    return note.split(":")[0] in BY_SLUG


def _name(slug: str) -> str:
    return slug.replace("_", " ")


def _physics(candidate: Candidate) -> str:
    if candidate.estimate.value < 0 and candidate.effect in _OTHERWISE:
        return _OTHERWISE[candidate.effect]
    return BY_SLUG[candidate.effect].physics if candidate.effect in BY_SLUG else ""


def _listed(slugs: Sequence[str]) -> str:
    return _and([_name(slug) for slug in slugs])


def _and(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _probability(value: float) -> str:
    return "above 0.99" if value > 0.99 else "below 0.01" if value < 0.01 else f"{value:.2f}"


def _estimate(estimate: Estimate) -> str:
    """Value and deviation to the deviation's second digit."""
    unit = "" if estimate.unit in {"-", ""} else f" {estimate.unit}"
    if not estimate.sd > 0:
        return f"{estimate.name} {_number(estimate.value)}{unit}"
    digits = max(0, 1 - math.floor(math.log10(estimate.sd)))
    if digits > _DIGITS:
        return f"{estimate.name} {_number(estimate.value)} ± {_number(estimate.sd)}{unit}"
    return f"{estimate.name} {_signed(f'{estimate.value:.{digits}f}')} ± {estimate.sd:.{digits}f}{unit}"


def _number(value: float) -> str:
    """Three digits, without an exponent where that is readable."""
    if 100 <= abs(value) < 1e6:
        return _signed(f"{value:,.0f}")
    return _signed(f"{value:.3g}") if value == 0 or 1e-3 <= abs(value) < 100 else f"{value:.2e}"


def _signed(number: str) -> str:
    """With a minus that is no hyphen."""
    return number.replace("-", "−")
