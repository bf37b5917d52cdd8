"""The paragraph that an engineer would sign: what was found, how sure, how large, what it does to predictions, what next.

Sentences in the order in which one would ask, of MAX_WORDS words at most: where they are more, those that matter least are
left out. The numbers behind them are the report's fields.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from models.diagnosis import criteria
from models.diagnosis.design.design import CLOCK, CYCLES, FREQUENCY, PHASE, PRESSURE, SPEED, TEMPERATURE, TORQUE
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import Kind
from models.diagnosis.effects.fitted_effect import Estimate
from models.diagnosis.experiments.test_plan import BASELINE, Advice
from models.diagnosis.explanations.decide import smallest
from models.diagnosis.explanations.shapeless import ADVICE
from models.diagnosis.explanations.verdict import UNCATALOGUED, Verdict, probabilities_by_slug
from models.diagnosis.pooled_fit.projection import RunScatter
from models.diagnosis.raw_records.evidence import FIXED_LINE
from models.diagnosis.report.report import Misfit, Report, Visible
from models.diagnosis.validation.held_out import Gain

_AXES = {
    PRESSURE: "pressure",
    TORQUE: "the torque itself",
    SPEED: "speed",
    CYCLES: "cycles",
    CLOCK: "the time since the test began",
    TEMPERATURE: "oil temperature",
    PHASE: "the place within a dynamic test's loop",
    FREQUENCY: "frequency, in the raw records",
}
#: What to look at where an error that has no name depends on an axis.
_LOOK_AT = {
    PRESSURE: "the pressure sensor and what holds the pressure",
    TORQUE: "the torque sensor's scale",
    SPEED: "the speed signal and what rubs beside the clutch",
    CYCLES: "what was changed between the tests",
    CLOCK: "what warms or drifts during a test",
    TEMPERATURE: "the oil's thermometer and the plate's temperature",
    PHASE: "filters and delays between the channels",
    FREQUENCY: "what turns, or is driven, like that",
}


def effect_name(slug: str) -> str:
    """A slug in words."""
    return slug.replace("_", " ")


def _with_article(slug: str) -> str:
    """An effect of the catalogue as a sentence names it."""
    return f"{BY_SLUG[slug].article} {effect_name(slug)}".lstrip()


def _capitalised(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}"


def listed(parts: Sequence[str], word: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`; nothing of nothing."""
    return f" {word} ".join(part for part in (", ".join(parts[:-1]), *parts[-1:]) if part)


def _points_of_life(count: int) -> str:
    return f"{count} point{'s' * (count != 1)} of the clutch's life"


def probability(value: float) -> str:
    """Two digits; no certainty."""
    return "above 0.99" if value > 0.99 else "below 0.01" if value < 0.01 else f"{value:.2f}"


def with_unit(text: str, unit: str) -> str:
    """A number with its unit, if it has one."""
    return text if unit in {"-", ""} else f"{text} {unit}"


def signed(estimate: Estimate) -> str:
    """Value with its 90 % interval, and the probability of its sign where that is not sure: said to be open where the
    interval holds both signs."""
    sign = None if estimate.one_sided else estimate.sign_probability
    (low, high), unit = estimate.interval, estimate.unit
    low = max(low, 0.0) if estimate.one_sided else low
    size = f"{estimate.name}: {with_unit(number(estimate.value), unit)}"
    if high > low:
        size += f", 90 % interval {number(low)} to {with_unit(number(high), unit)}"
    both_signs = low < 0.0 < high
    if sign is None or (not both_signs and sign > 0.99):  # the interval says it
        return size
    way = f"{'negative' if estimate.value < 0 else 'positive'} with probability {probability(sign)}"
    return f"{size}, the sign is open ({way})" if both_signs else f"{size}, {way}"


def number(value: float) -> str:
    """Three digits, without an exponent where that is readable."""
    if 100 <= abs(value) < 1e6:
        return _signed(f"{value:,.0f}")
    return _signed(f"{value:.3g}") if value == 0 or 1e-4 <= abs(value) < 100 else f"{value:.2e}"


def _signed(text: str) -> str:
    """With a minus that is no hyphen."""
    return text.replace("-", "−")


#: How much a sentence matters: it stays; it goes where words are short; it goes first.
MUST, SHOULD, MAY = 0, 1, 2


class Sentence(NamedTuple):
    """A sentence and how much it matters."""

    text: str
    matters: int = MUST


def summarise(report: Report) -> str:
    """The paragraph."""
    say = {
        Verdict.MODEL_ADEQUATE: _adequate,
        Verdict.CAUSE_NAMED: _named,
        Verdict.CAUSE_AMBIGUOUS: _ambiguous,
        Verdict.UNEXPLAINED_STRUCTURE: _unexplained,
    }
    found = [Sentence("These data are too few to judge the model.")]
    if report.verdict in say:
        found = say[report.verdict](report)
    tests = f"{report.tests} tests" if report.tests != 1 else "1 test"
    data = f"{tests} at {_points_of_life(report.states)} {'were' if report.tests != 1 else 'was'} examined."
    sentences = {sentence.text: sentence for sentence in (Sentence(data, MAY), *found, *_noted(report.notes))}
    kept = list(sentences.values())  # each once
    for matters in (MAY, SHOULD):
        for place in range(len(kept) - 1, -1, -1):
            if _words(kept) > criteria.MAX_WORDS and kept[place].matters == matters:
                del kept[place]
    return " ".join(sentence.text for sentence in kept if sentence.text)


def _words(sentences: Sequence[Sentence]) -> int:
    return sum(len(sentence.text.split()) for sentence in sentences)


def _adequate(report: Report) -> list[Sentence]:
    noise = "" if report.baseline is None else f" of {number(report.baseline.noise)} Nm"
    nothing = next((item.probability for item in report.explanations if not item.effects), 1.0)
    sentences = [
        Sentence(
            f"The model is adequate (probability {probability(nothing)}): nothing exceeds the noise{noise} and the scatter "
            f"from run to run{_scatter(report.scatter)}."
        )
    ]
    others, mass = list[str](), nothing
    for item in report.explanations:
        if item.effects and mass < criteria.SURE:
            names = " together with ".join(map(_cause_name, item.effects))
            others.append(f"{names} (probability {probability(item.probability)})")
            mass += item.probability
    if others:
        sentences.append(Sentence(f"Not excluded: {listed(others)}."))
    after = "Nothing needs to be done; diagnose again after the next tests."
    if report.scatter is not None and report.scatter.lower > criteria.USUAL_GAIN:
        after = "The runs scatter more than usual. A zero that drifts between runs would also cause this: "
        after += "repeat a test at once."
    sentences += [Sentence(after), *_detection_limits(report)]
    if report.states < 3:
        say = "says" if report.states == 1 else "say"
        sentences.append(Sentence(f"{_points_of_life(report.states)} {say} little about its course.", SHOULD))
    return sentences


#: What an engineer asks for first: what the paragraph always gives, where the data show it in some form.
_ASKED_FIRST = ("torque_zero_shift", "pressure_offset")


def _detection_limits(report: Report) -> list[Sentence]:
    """From which size on these data would have shown an effect, in the form that shows best and in the hardest one: the
    torque's zero and the pressure's offset first, then effects that must be largest against what is usual, those with a unit
    before the others."""
    order = sorted(report.visible, key=lambda v: (v.unit == "-", -v.least / v.usual, -v.amplitude / v.usual))
    first = [v for slug in _ASKED_FIRST for v in order if v.effect == slug]
    first = [*first, *(v for v in order if v not in first)][: criteria.VISIBLE_MENTIONED]
    sentences = []
    if first:
        sizes = listed([_shown(visible) for visible in first])
        sentences = [Sentence(f"Nine times in ten, these data would show {sizes}.")]
    if report.unseen:
        names = listed([effect_name(slug) for slug in report.unseen])
        sentences.append(Sentence(f"These data cannot show, at any size: {names}.", SHOULD))
    return sentences


def _shown(visible: Visible) -> str:
    """The smallest sizes that show, `a torque zero shift of 0.64 Nm at best and 11 Nm at worst`."""
    name = _with_article(visible.effect)
    if visible.unit == "-":
        name = f"a {BY_SLUG[visible.effect].amplitude.partition(' (')[0]}"
    hardest = _threshold(visible.amplitude, visible.unit) if math.isfinite(visible.amplitude) else "of no size"
    return f"{name} of {_threshold(visible.least, visible.unit)} at best and {hardest} at worst"


def _threshold(value: float, unit: str) -> str:
    return with_unit(number(float(f"{value:.2g}")), unit)


def _scatter(scatter: RunScatter | None) -> str:
    """In brackets: the estimate, or that it is the prior's."""
    if scatter is None:
        return ""
    median, lower, upper = (f"{100 * share:.2g}" for share in (scatter.median, scatter.lower, scatter.upper))
    if scatter.assumed:
        return f" (taken as {median} % of the torque; these data can hardly tell)"
    return f" ({median} % of the torque; 90 % interval {lower} to {upper} %)"


def _named(report: Report) -> list[Sentence]:
    causes = set(report.causes)
    names = " together with ".join(_with_article(slug) for slug in report.causes)
    share = sum(item.probability for item in report.explanations if causes <= set(item.effects))
    sentences = [
        Sentence(f"The cause{'s are' if len(causes) > 1 else ' is'} {names} (probability {probability(share)}).")
    ]
    for item in report.candidates:
        if item.effect in causes:
            effect, below = BY_SLUG[item.effect], item.estimate.value < 0
            physics = effect.opposite_physics if below and effect.opposite_physics else effect.physics
            seen = [note.partition(": ")[2] for note in report.notes if note.startswith(f"{item.effect}: ")]
            sentences += [Sentence(physics, SHOULD), *(Sentence(_capitalised(note)) for note in seen)]
            sentences.append(Sentence(f"{_capitalised(signed(item.estimate))}."))
    companions = [
        f"{effect_name(item.effect)} (probability {probability(item.probability)})"
        for item in report.candidates
        if item.effect not in causes and item.probability >= 0.3
    ]
    if companions:
        also = "Something else may also be at work; these data do not show it clearly"
        sentences.append(Sentence(f"{also}: {listed(companions, 'or')}.", SHOULD))
    return [*sentences, *_gained(report), *_next(report)]


#: Instead of the size of an effect that was not fitted, or whose quantity was not measured.
_NO_SIZE = "size not estimated"


def _ambiguous(report: Report) -> list[Sentence]:
    """What is certain with its size, then the explanations among which the choice is, each with its probability, and each
    effect's size where it first comes."""
    sized = {candidate.effect: candidate.estimate for candidate in report.candidates}
    shares = probabilities_by_slug(report.explanations)
    sure = tuple(slug for slug in report.causes if shares.get(slug, 0.0) >= criteria.SURE)
    near = _worth_saying(report)
    choices = []
    for item in (item for item in report.explanations if item.effects in near and set(sure) <= set(item.effects)):
        names = [_cause_name(slug) for slug in item.effects if slug not in sure]
        if UNCATALOGUED in item.effects and report.resembles:
            names[-1] += f", such as {report.resembles}"
        sizes = [
            signed(estimate) if estimate.value != 0.0 else _NO_SIZE
            for slug in item.effects
            if slug not in sure and (estimate := sized.pop(slug, None)) is not None
        ]
        choices.append((" together with ".join(names) or "nothing", item.probability, sizes))
    certain = [Sentence(f"{_capitalised(signed(sized[slug]))}.") for slug in sure if slug in sized]
    remaining = [*_gained(report), *_next(report)]

    def others(shown: int) -> list[str]:
        """All that is not among the first choices."""
        something = sum(item.probability for item in report.explanations if item.effects)
        rest = something - sum(chance for _, chance, _ in choices[:shown])
        return [f"others ({probability(rest)})"] if rest >= 0.005 and not sure else []

    descriptions = [f"{name} ({'; '.join((probability(chance), *sizes))})" for name, chance, sizes in choices]
    # then without sizes, which are in the report's fields, and with fewer probabilities
    ways = [[*descriptions, *others(len(choices))]]
    for shown in range(min(len(choices), 8), 0, -1):
        brief = [
            f"{name.partition(', such as ')[0]} "
            f"({'; '.join((probability(chance), *(size for size in sizes if size == _NO_SIZE)))})"
            for name, chance, sizes in choices[:shown]
        ]
        other_names = [effect_name(slug) for slug in report.causes if slug not in {*sure, UNCATALOGUED}]
        unsaid = [name for name in other_names if not any(name in alternative for alternative in brief)]
        ways.append([*brief, *(unsaid or others(shown))])
    for alternatives in ways:
        sentences = [*_open(report, sure, certain, alternatives), *remaining]
        if _words([sentence for sentence in sentences if sentence.matters == MUST]) <= criteria.MAX_WORDS:
            break
    return sentences


def _worth_saying(report: Report) -> list[tuple[str, ...]]:
    """The fewest explanations that are SURE to hold the truth if anything is at work, without those that are far less
    probable than the first."""
    shares = {item.effects: item.probability for item in report.explanations}
    near = smallest(shares)
    return [effects for effects in near if shares[effects] > (1.0 - criteria.SURE) * shares[near[0]]]


def _open(
    report: Report, sure: Sequence[str], certain: Sequence[Sentence], alternatives: Sequence[str]
) -> list[Sentence]:
    """What is certain with its size, and the alternatives in words."""
    if not sure:
        wrong = 1.0 - sum(item.probability for item in report.explanations if not item.effects)
        disagree = f"probably disagree with the model (probability {probability(wrong)})"
        if wrong > 0.99:
            disagree = "disagree with the model"
        first = "Explanations that remain, with their probabilities"
        return [Sentence(f"The data {disagree}. {first}: {listed(alternatives, 'or')}.")]
    share = sum(item.probability for item in report.explanations if set(sure) <= set(item.effects))
    verb = "is at work" if len(sure) == 1 else "are at work"
    names_in_words = f"{listed([_with_article(slug) for slug in sure])} {verb} (probability {probability(share)})"
    sentences = [Sentence(f"{_capitalised(names_in_words)}."), *certain]
    if len(alternatives) == 1:
        sentences.append(Sentence(f"Also at work: {alternatives[0]}."))
    elif alternatives:
        sentences.append(Sentence(f"There may also be (with probabilities): {listed(alternatives, 'or')}."))
    return sentences


def _cause_name(slug: str) -> str:
    return "something that is not in the catalogue" if slug == UNCATALOGUED else effect_name(slug)


def _unexplained(report: Report) -> list[Sentence]:
    unknown = sum(item.probability for item in report.explanations if UNCATALOGUED in item.effects)
    resembles = f" It most resembles {report.resembles}." if report.resembles else ""
    first = (
        f"The model is wrong in a way that no effect of the catalogue explains (probability {probability(unknown)}), "
    )
    first += f"so no cause is named.{resembles}"
    axes = [
        where.axis for where in ([] if report.baseline is None else report.baseline.where[:2]) if where.strength > 0
    ]
    swings = [note.partition(": ")[2] for note in report.notes if note.startswith(f"{FIXED_LINE}: ")]
    if swings and axes[:1] == [FREQUENCY]:
        sentences, axes = [Sentence(f"In the raw records {swing}") for swing in swings], [FREQUENCY]
    else:
        sentences = [Sentence(_error(report.baseline, axes)), *_gained(report)]
    look_at = ", then ".join(_LOOK_AT[axis] for axis in axes) or "the rig"
    again = "Next: repeat the last test at once and diagnose again. If it is gone, one run caused it; if not, look at"
    return [Sentence(first), *sentences, Sentence(f"{again} {look_at}.")]


def _error(misfit: Misfit | None, axes: Sequence[str]) -> str:
    """The baseline's error, and what it depends on."""
    if misfit is None:
        return ""
    size, where = number(misfit.rmse), listed([_AXES[axis] for axis in axes])
    if misfit.rmse <= misfit.noise:
        pattern = f", but it is not random: it depends on {where}" if where else ""
        return f"The error is small ({size} Nm RMS, no more than the noise){pattern}."
    depends = f", and depends on {where}" if where else ""
    return f"The error is {size} Nm RMS, where noise alone gives {number(misfit.noise)} Nm{depends}."


def _gained(report: Report) -> list[Sentence]:
    """What the extension gains on runs that were held out, whether it improves remaining life, why it may not be adopted."""
    gain = report.gain
    if report.not_adoptable:
        return [Sentence(report.not_adoptable)]
    if gain is None:
        return []
    added = {
        Verdict.CAUSE_NAMED: "this cause" if len(report.causes) == 1 else "these causes",
        Verdict.UNEXPLAINED_STRUCTURE: "a smooth correction",
    }.get(report.verdict, listed([effect_name(slug) for slug in report.extended_effects]))
    way = "smaller" if gain.reduction_percent >= 0 else "larger"
    change = f"{abs(gain.reduction_percent):.1f} ± {gain.reduction_sd:.1f} % {way}"
    hardest = _hardest(gain, report.extended)
    left_out = f"With {added} in the model, the error on runs left out of the fit is {change}.{hardest}"
    sentences = [Sentence(left_out, SHOULD)]
    if report.verdict is Verdict.UNEXPLAINED_STRUCTURE:
        return sentences
    better = gain.forecast_log_score_gain > 0
    adoptable = () if report.extension is None else report.extension.effects
    way = "better" if better else "no better"
    ahead = f"The last tests are predicted {way} from the earlier ones with {added} in the model"
    ahead += "; you can adopt this." if adoptable and better else "."
    if courses := listed([effect_name(slug) for slug in adoptable if BY_SLUG[slug].kind is Kind.COURSE]):
        then = f"includes {courses}" if better else f"leaves out how {courses} goes on"
        ahead += f" If you adopt it, the predicted remaining life {then}."
    return [*sentences, Sentence(ahead, SHOULD if report.verdict is Verdict.CAUSE_AMBIGUOUS else MUST)]


def _hardest(gain: Gain, extended: Misfit | None) -> str:
    """Where held-out runs are predicted far worse than they were fitted, and how far from what was kept that is."""
    hardest = gain.hardest
    if hardest is None or extended is None or gain.rmse_after < 5.0 * extended.rmse:  # less is what gains make
        return ""
    what, size, unit = ("curves", 1e-5, "bar") if hardest.axis == PRESSURE else ("tests", 1.0, "cycles")
    extrapolation = f"{number(size * hardest.beyond)} {unit} outside" if hardest.beyond > 0.0 else "within"
    place = f"{number(size * hardest.value)} {unit}, {extrapolation} the others' range"
    errors = f"{number(hardest.rmse)} Nm RMS, against {number(extended.rmse)} Nm for all tests when none is left out"
    return f" Worst are the {what} at {place}: {errors}."


def _next(report: Report) -> list[Sentence]:
    """What to look at of a named cause, and the first test of the plan with what it is good for; where no test is, what to
    look at of the likeliest explanation."""
    looked_at = [report.causes] if report.verdict is Verdict.CAUSE_NAMED else []
    if not looked_at and not report.advice:
        looked_at = _worth_saying(report)
    known = ([BY_SLUG[slug].check for slug in effects if slug in BY_SLUG] for effects in looked_at)
    checks = next(filter(None, known), [])
    sentences = [Sentence(f"Next: {'; '.join(checks)}.")] if checks else []
    if not report.advice:
        no_more = "" if report.gain is None else "No further test would tell much more."
        return [*sentences, Sentence(no_more, SHOULD)]
    best = report.advice[0]
    if best.narrows:
        narrower = f"its interval narrows by {100 * (1 - best.narrows):.0f} %"
        size = "its size" if len(report.causes) == 1 else f"the size of {effect_name(best.effect)}"
        to_measure = "To measure" if sentences else "Next, to measure"
        return [*sentences, Sentence(f"{to_measure} {size} better: {brief_test(best)}; {narrower}.")]
    first = "Then" if sentences else "Next"
    if best.nats < criteria.WORTHWHILE:
        first = "No single test is likely to decide. The best"
    decides = f"It decides with probability {probability(best.probability)}"
    if best.other == BASELINE:
        decides += f" whether {_cause_name(best.effect)} is at work"
    elif {(best.effect,), (best.other,)} != set(_worth_saying(report)):
        decides += f" (hardest to tell apart: {_cause_name(best.effect)} and {_cause_name(best.other)})"
    return [*sentences, Sentence(f"{first}: {brief_test(best)}. {decides}.")]


#: Words from which a test is put shortly. The longest test of one kind has 16, two kinds take 29 and more.
_LONG_TEST = 20


def brief_test(advice: Advice) -> str:
    """A test in words; a long one by its kinds, pressures, speeds and frequency alone, as a rig is set. Pauses and further
    use are never left out."""
    later = any(step.pause for step in advice.steps) or len({step.cycles for step in advice.steps}) > 1
    if later or len(advice.test.split()) <= _LONG_TEST or not advice.steps:
        return advice.test
    kinds = []
    for kind, name in (("stationary_stribeck", "stationary"), ("dynamic_stribeck", "dynamic")):
        if steps := [step for step in advice.steps if step.kind == kind]:
            frequencies = sorted({step.frequency for step in steps if step.frequency is not None})
            pressures = [float(f"{1e-5 * value:.2g}") for step in steps for value in step.pressures]
            closed = [value for value in pressures if value > 0.0]
            opened = ", also with the clutch open" if 0.0 in pressures and closed else ""
            speeds = _range([round(float(f"{value * 30.0 / math.pi:.3g}")) for step in steps for value in step.speeds])
            speeds = f"up to{speeds[4:]}" if speeds.startswith("0 to") else speeds
            oils = {step.temperature - 273.15 for step in steps if step.temperature is not None}
            oil = f", also at {number(max(oils))} °C" if oils else ""
            at = [*(f"{number(value)} Hz" for value in frequencies), *([f"{_range(closed)} bar"] if closed else [])]
            at.append(f"{speeds} rpm")
            kinds.append(f"{name} tests{'' if closed else ' with the clutch open'} at {', '.join(at)}{opened}{oil}")
    return f"{', and '.join(kinds)} (steps in the report)"


def _range(values: Sequence[float]) -> str:
    low, high = number(min(values)), number(max(values))
    return low if low == high else f"{low} to {high}"


def _noted(notes: Sequence[str]) -> list[Sentence]:
    """Notes on the whole campaign; those on single runs or effects, which begin with a name, stay in the report."""
    plain_notes = [note for note in notes if " " in note.split(":")[0] or ":" not in note]
    return [
        Sentence(note if note.endswith(".") else f"{note}.", MUST if ADVICE in note else SHOULD) for note in plain_notes
    ]
