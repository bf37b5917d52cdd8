"""The paragraph that an engineer would sign: what was found, how sure, how large, what it does to predictions, what next.

Sentences in the order in which one would ask, of MAX_WORDS words at most: where they are more, those that matter least are
left out. The numbers behind them are the report's fields.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from models.diagnosis import criteria
from models.diagnosis.design.design import CLOCK, CYCLES, FREQUENCY, PHASE, PRESSURE, SPEED, TEMPERATURE, TORQUE
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import EffectKind
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate
from models.diagnosis.experiments.candidates import TRIALS
from models.diagnosis.experiments.test_plan import BASELINE, Advice
from models.diagnosis.explanations.decide import smallest
from models.diagnosis.explanations.shapeless import ADVICE
from models.diagnosis.explanations.verdict import UNCATALOGUED, Verdict, probabilities_by_slug
from models.diagnosis.pooled_fit.projection import RunScatter
from models.diagnosis.raw_records.evidence import FIXED_LINE
from models.diagnosis.report.report import Misfit, Report, Visible

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
    FREQUENCY: "what turns or is driven at that rate",
}


def effect_name(slug: str) -> str:
    """A slug in words."""
    return slug.replace("_", " ")


def _with_article(slug: str) -> str:
    """The name of an effect of the catalogue with its article."""
    return f"{BY_SLUG[slug].article} {effect_name(slug)}".lstrip()


def _capitalised(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}"


def listed(parts: Sequence[str], word: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`; nothing of nothing."""
    return f" {word} ".join(part for part in (", ".join(parts[:-1]), *parts[-1:]) if part)


def _points_of_life(count: int) -> str:
    return f"{count} point{'s' * (count != 1)} of the clutch's life"


def probability(value: float) -> str:
    """A probability with two digits, as `above 0.99` or `below 0.01` near certainty."""
    return "above 0.99" if value > 0.99 else "below 0.01" if value < 0.01 else f"{value:.2f}"


def with_unit(text: str, unit: str) -> str:
    """A number with its unit, if it has one."""
    return text if unit in {"-", ""} else f"{text} {unit}"


def stated(estimate: AmplitudeEstimate, slug: str) -> str:
    """A sentence on the size of an effect with its 90 % interval, and on its sign where that is not sure."""
    effect, (name, _, onset) = BY_SLUG[slug], estimate.name.partition(" (from ")
    if estimate.value == 0.0:  # nothing was fitted
        return "Its size was not estimated."
    lowest = 0.0 if estimate.one_sided else -math.inf
    value, low, high = (max(end, lowest) for end in (estimate.value, *estimate.interval))
    below = value < 0.0 and bool(effect.states_below)
    if below:
        value, low, high = -value, -high, -low
    size, ends = size_of(slug, value, estimate.unit), [size_of(slug, end, estimate.unit) for end in (low, high)]
    sign = None if estimate.one_sided else estimate.sign_probability
    unsure = sign is not None and (low < 0.0 < high or sign < 1.0 - criteria.SIGN_UNDETERMINED)
    interval = f"90 % interval {ends[0].partition(' ')[0]} to {ends[1]}" if high > low else ""
    aside = "; ".join(
        filter(None, (interval, f"this sign has probability {probability(sign or 0.0)}" if unsure else ""))
    )
    size += f" ({aside})" if aside else ""
    sentence = (effect.states_below if below else effect.states).format(size)
    if estimate.unit != effect.unit:  # another quantity, as of a transient in a raw record
        sentence = f"{_capitalised(name)}: {size}."
    return f"{sentence[:-1]}, from {onset[:-1]}." if onset else sentence


def size_of(slug: str, value: float, unit: str) -> str:
    """The size of an effect with its unit, as a sentence gives it."""
    felt = BY_SLUG[slug].felt
    return with_unit(number(value), unit) if felt is None else with_unit(number(felt.of(value)), felt.unit)


def number(value: float) -> str:
    """A number with three significant digits, without an exponent where that is readable."""
    if 100 <= abs(value) < 1e6:
        return _signed(f"{value:,.0f}")
    if value == 0 or 1e-6 <= abs(value) < 100:
        return _signed(np.format_float_positional(float(f"{value:.3g}") + 0.0, trim="-"))  # no -0
    return f"{value:.2e}"


def _signed(text: str) -> str:
    """The number with a true minus sign in place of a hyphen."""
    return text.replace("-", "−")


#: How much a sentence matters: it stays; it goes last, and first where there are too many words.
MUST, RATHER, SHOULD = range(3)


class Sentence(NamedTuple):
    """A sentence and how much it matters."""

    text: str
    matters: int = MUST


def summarise(report: Report) -> str:
    """The summary paragraph of a report."""
    say = {
        Verdict.MODEL_ADEQUATE: _adequate,
        Verdict.CAUSE_NAMED: _named,
        Verdict.CAUSE_AMBIGUOUS: _ambiguous,
        Verdict.UNEXPLAINED_STRUCTURE: _unexplained,
    }
    said = (*say[report.verdict](report), *_law(report), *_noted(report.notes))
    sentences = {sentence.text: sentence for sentence in said}
    kept = list(sentences.values())  # each once
    for matters in (SHOULD, RATHER):
        for place in range(len(kept) - 1, -1, -1):
            if _words(kept) > criteria.MAX_WORDS and kept[place].matters == matters:
                del kept[place]
    return " ".join(sentence.text for sentence in kept if sentence.text)


#: Which test tells a cause from the form of the friction curve.
_TELLS = {
    "oil_temperature": "a test with the oil 20 K colder",
    "interface_heating": "a thermometer in the plate, or dynamic tests",
    "hydrodynamic_drag": "readings with the clutch open",
    "torque_zero_shift": "readings of the unloaded torque before each test",
    "pressure_offset": "a second pressure gauge",
    "unsettled_dwell": "a test with each plateau held twice as long",
}


def _law(report: Report) -> list[Sentence]:
    """Sentences on the friction curve's difference from eq. 3, and on causes that look like it."""
    law, sentences = report.friction_law, list[Sentence]()
    if law is not None and law.mentioned:
        low, high = (f"{end:.2g}" for end in law.interval_percent)
        band = law.where[0]
        slowest = min(other.low for other in law.where)
        place = f", mostly below {number(float(f'{_rpm(band.high):.2g}'))} rpm" if band.low == slowest else ""
        place = place if band.share > 0.5 else ""
        effect = law.effect_on_remaining_cycles_percent
        matters = "Remaining life does not depend on it."
        if effect is None or abs(effect) >= criteria.LAW_MATTERS:
            matters = f"It changes mean COF by {number(float(f'{law.effect_on_mean_cof_percent:.2g}'))} %."
        sentences.append(
            Sentence(
                f"The friction curve has another form than eq. 3, by {law.rms_percent:.2g} % ({low} to {high} %){place}. "
                f"{matters}",
            )
        )
    if law is not None and law.adoptable and law.gain is not None:
        better = number(float(f"{law.gain.reduction_percent:.2g}"))
        sentences.append(
            Sentence(f"You can adopt the curve as found: it predicts other runs {better} % better.", RATHER)
        )
    if report.like_the_law:
        names = listed([_cause_name(slug) for slug in report.like_the_law], "or")
        tests = list(dict.fromkeys(_TELLS[slug] for slug in report.like_the_law if slug in _TELLS))
        would = f"; {listed(tests, 'or')} would" if tests else ""
        sentences.append(Sentence(f"These tests cannot tell {names} from the form of the friction curve{would}."))
    return sentences


def _rpm(speed: float) -> float:
    return 30.0 * speed / math.pi


def _words(sentences: Sequence[Sentence]) -> int:
    return sum(len(sentence.text.split()) for sentence in sentences)


def _adequate(report: Report) -> list[Sentence]:
    """Sentences for a model that is adequate: its probability, what is not excluded, what to do next."""
    noise = "" if report.baseline is None else f" of {number(report.baseline.noise)} Nm"
    nothing = next((item.probability for item in report.explanations if not item.effects), 1.0)
    sentences = [
        Sentence(
            f"The model is adequate (probability {probability(nothing)}): nothing exceeds the noise{noise}, the scatter "
            f"from run to run{_scatter(report.scatter)} and the form of the friction curve."
        )
    ]
    other = next((item for item in report.explanations if item.effects), None)
    if other is not None and nothing < criteria.SURE:
        names = " together with ".join(map(_cause_name, other.effects))
        sentences.append(Sentence(f"Not excluded: {names} (probability {probability(other.probability)})."))
    after = "Nothing needs to be done; diagnose again after the next tests."
    if report.scatter is not None and report.scatter.lower > criteria.USUAL_GAIN:
        after = (
            "The runs scatter more than usual, perhaps from a drifting zero. Next: repeat the last test immediately, "
        )
        after += "and read the torque unloaded before and after."
    sentences += [Sentence(after), *_detection_limits(report)]
    if report.states < 3:
        say = "says" if report.states == 1 else "say"
        sentences.append(Sentence(f"{_points_of_life(report.states)} {say} little about its course.", SHOULD))
    return sentences


#: What an engineer asks for first: what the paragraph always gives, where the data show it in some form.
_ASKED_FIRST = ("torque_zero_shift", "pressure_offset")


def _detection_limits(report: Report) -> list[Sentence]:
    """Sentences on the smallest sizes that these data would have shown, in the easiest shape of an effect and in the
    hardest one: the torque's zero and the pressure's offset first, then effects whose limits are largest against their
    usual size, those with a unit before the others."""
    order = sorted(report.visible, key=lambda v: (v.unit == "-", -v.least / v.usual, -v.amplitude / v.usual))
    first = [v for slug in _ASKED_FIRST for v in order if v.effect == slug]
    first = [*first, *(v for v in order if v not in first)][: criteria.VISIBLE_MENTIONED]
    sentences = []
    if first:
        sizes = listed([_shown(visible) for visible in first], "or")
        shown = f"Nine times in ten, these tests would have found {sizes}"
        if any(v.amplitude > 1.5 * v.least for v in first):
            shown += "; a fault that starts late or grows slowly must be larger"
        if any(math.isinf(v.amplitude) for v in first):
            shown += ", or may not show at all"
        sentences = [Sentence(f"{shown}.", RATHER)]
    if report.unseen:
        names = listed([effect_name(slug) for slug in report.unseen])
        sentences.append(Sentence(f"These data cannot show, at any size: {names}.", SHOULD))
    return sentences


def _shown(visible: Visible) -> str:
    """The smallest size of an effect that shows, in words: `a torque zero shift of 0.64 Nm`."""
    name, least, unit = _with_article(visible.effect), visible.least, visible.unit
    effect = BY_SLUG[visible.effect]
    if effect.felt is not None:
        least, unit = effect.felt.of(least), effect.felt.unit
    size = with_unit(number(float(f"{least:.2g}")), unit)
    sentence = effect.states.format(size)
    return f"{name} of {size}" if effect.felt is None else f"{name} ({sentence[0].lower()}{sentence[1:-1]})"


def _scatter(scatter: RunScatter | None) -> str:
    """The run-to-run scatter in brackets, as an estimate with its interval or as assumed."""
    if scatter is None:
        return ""
    median, lower, upper = (f"{100 * share:.2g}" for share in (scatter.median, scatter.lower, scatter.upper))
    if scatter.assumed:
        return f" (assumed {median} % of the torque: too few tests to measure it)"
    return f" ({median} % of the torque; 90 % interval {lower} to {upper} %)"


def _named(report: Report) -> list[Sentence]:
    """Sentences for a named cause: its probability, physics and size, what else may be at work, what to check."""
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
            sentences += [Sentence(physics, SHOULD), *(Sentence(f"Here {note}") for note in seen)]
            sentences.append(Sentence(stated(item.estimate, item.effect)))
    companions = [
        f"{effect_name(item.effect)} (probability {probability(item.probability)})"
        for item in report.candidates
        if item.effect not in causes and item.probability >= 0.3
    ]
    if companions:
        also = "Something else may also be at work; these data do not show it clearly"
        sentences.append(Sentence(f"{also}: {listed(companions, 'or')}.", SHOULD))
    checks, further = _next(report)
    if not report.not_adoptable and report.gain is not None and report.gain.forecast_log_score_gain <= 0:
        further = []  # what is of little use need not be known better
    return [*sentences, *checks, *_adoption(report), *further]


def _ambiguous(report: Report) -> list[Sentence]:
    """Sentences of an ambiguous verdict: the causes that are certain, the alternatives with their probabilities, and
    the next steps."""
    estimates = {candidate.effect: candidate.estimate for candidate in report.candidates}
    held = _certain(report)
    remaining = [Sentence(stated(estimates[slug], slug)) for slug in held if slug in estimates]
    checks, further = _next(report)
    remaining += [*checks, *further]
    remaining.append(Sentence("Adopt nothing before the next diagnosis.", RATHER))
    choices = [item for item in report.explanations if item.effects in _worth_saying(report)]
    choices = [item for item in choices if set(held) <= set(item.effects)]
    # without sizes, which are in the report's fields, and with fewer alternatives where there are too many words
    ways = [(len(choices), False), *((count, True) for count in range(min(len(choices), 8), 0, -1))]
    for count, brief in ways:
        alternatives = [_alternative(report, item.effects, held, brief=brief) for item in choices[:count]]
        said = {*held, UNCATALOGUED}.union(*(item.effects for item in choices[:count]))
        unsaid = [effect_name(slug) for slug in report.causes if slug not in said] if brief else []
        left = [item for item in report.explanations if item.effects and set(held) <= set(item.effects)]
        rest = sum(item.probability for item in left if item not in choices[:count])
        others = [f"others ({probability(rest)})"] if rest >= 0.005 and not unsaid else []
        sentences = [_open(report, held, [*alternatives, *unsaid, *others]), *remaining]
        if _words([sentence for sentence in sentences if sentence.matters == MUST]) <= criteria.MAX_WORDS:
            break
    return sentences


def _certain(report: Report) -> tuple[str, ...]:
    """The causes of probability SURE whose sign is known; none beside something unknown, which may be all of it."""
    if UNCATALOGUED in report.causes:
        return ()
    shares = probabilities_by_slug(report.explanations)
    signs = {item.effect: item.estimate.sign_probability for item in report.candidates}
    return tuple(
        slug
        for slug in report.causes
        if shares.get(slug, 0.0) >= criteria.SURE and (signs.get(slug) or 1.0) >= 1.0 - criteria.SIGN_UNDETERMINED
    )


def _alternative(report: Report, effects: Sequence[str], held: Sequence[str], *, brief: bool) -> str:
    """An explanation in words, beside the certain causes: its further causes, with its probability and their sizes."""
    estimates = {candidate.effect: candidate.estimate for candidate in report.candidates}
    beside = [slug for slug in effects if slug not in held]
    names = [effect_name(slug) if brief and slug in BY_SLUG else _cause_name(slug) for slug in beside]
    share = next(item.probability for item in report.explanations if item.effects == tuple(effects))
    more = [] if brief else [_brief_size(estimates[slug], slug) for slug in beside if slug in estimates]
    if report.resembles and UNCATALOGUED in beside and not brief:
        more.append(f"such as {report.resembles}")
    aside = "; ".join((probability(share), *filter(None, more)))
    return f"{' together with '.join(names) or _ALONE} ({aside})"


def _brief_size(estimate: AmplitudeEstimate, slug: str) -> str:
    """A value with its name and without its interval, where its unit is a familiar one and its sign is known; else
    empty."""
    low, high = estimate.interval
    unknown = estimate.value == 0.0 or (low < 0.0 < high and not estimate.one_sided)
    if unknown or BY_SLUG[slug].felt is not None:
        return ""
    size = with_unit(number(estimate.value), estimate.unit)
    name = estimate.name.partition(" (from ")[0]
    return size if name in effect_name(slug) else f"{name} {size}"


def _worth_saying(report: Report) -> list[tuple[str, ...]]:
    """The credible set of explanations, without those far less probable than the first."""
    shares = {item.effects: item.probability for item in report.explanations}
    near = smallest(shares)
    return [effects for effects in near if shares[effects] > (1.0 - criteria.SURE) * shares[near[0]]]


_ALONE = "alone"


def _open(report: Report, sure: Sequence[str], alternatives: Sequence[str]) -> Sentence:
    """A sentence with the certain causes and the alternatives in words."""
    if not sure:
        wrong = 1.0 - sum(item.probability for item in report.explanations if not item.effects)
        disagree = f"probably disagree with the model (probability {probability(wrong)})"
        if wrong > 0.99:
            disagree = "disagree with the model"
        first = "Explanations that remain, with their probabilities"
        return Sentence(f"The data {disagree}. {first}: {listed(alternatives, 'or')}.")
    share = sum(item.probability for item in report.explanations if set(sure) <= set(item.effects))
    verb, it = ("is at work", "it") if len(sure) == 1 else ("are at work", "them")
    first = f"{listed([_with_article(slug) for slug in sure])} {verb} (probability {probability(share)})"
    alone = next((text for text in alternatives if text.startswith(_ALONE)), "")
    beside = [text for text in alternatives if text != alone]
    first += f", maybe {alone}." if alone else "."
    return Sentence(
        f"{_capitalised(first)} Beside {it} may be {listed(beside, 'or')}." if beside else _capitalised(first)
    )


def _cause_name(slug: str) -> str:
    return "an unknown cause" if slug == UNCATALOGUED else _with_article(slug)


def _unexplained(report: Report) -> list[Sentence]:
    """Sentences for a model that is wrong without a known cause: what it resembles, where the error lies, where to
    look."""
    unknown = sum(item.probability for item in report.explanations if UNCATALOGUED in item.effects)
    resembles = f" It looks most like {report.resembles}." if report.resembles else ""
    first = f"The model is wrong in a way that no known cause explains (probability {probability(unknown)}).{resembles}"
    axes = [
        where.axis for where in ([] if report.baseline is None else report.baseline.where[:2]) if where.strength > 0
    ]
    swings = [note.partition(": ")[2] for note in report.notes if note.startswith(f"{FIXED_LINE}: ")]
    if swings and axes[:1] == [FREQUENCY]:
        sentences, axes = [Sentence(f"In the raw records {swing}") for swing in swings], [FREQUENCY]
    else:
        sentences = [Sentence(_error(report.baseline, axes))]
    look_at = ", then ".join(_LOOK_AT[axis] for axis in axes) or "the rig"
    again = "Next: repeat the last test at once and diagnose again. If it is gone, one run caused it; if not, look at"
    return [Sentence(first), *sentences, Sentence(f"{again} {look_at}.")]


def _error(misfit: Misfit | None, axes: Sequence[str]) -> str:
    """A sentence on the baseline's error [Nm RMS] against the noise, and the axes on which it depends."""
    if misfit is None:
        return ""
    size, noise, where = number(misfit.rmse), number(misfit.noise), listed([_AXES[axis] for axis in axes])
    if misfit.rmse <= misfit.noise or size == noise:
        pattern = f", but it is not random: it depends on {where}" if where else ""
        return f"The error is small ({size} Nm RMS, no more than the noise){pattern}."
    depends = f", and depends on {where}" if where else ""
    return f"The error is {size} Nm RMS, where noise alone gives {noise} Nm{depends}."


def _adoption(report: Report) -> list[Sentence]:
    """Sentences on the effect of adopting a named cause, or on the reason against it."""
    adoptable = [] if report.extension is None else [slug for slug in report.extension.effects if slug in BY_SLUG]
    if report.not_adoptable or report.gain is None or not adoptable:
        return [Sentence(report.not_adoptable)]
    it = "it" if len(report.causes) == 1 else "them"
    if report.gain.forecast_log_score_gain <= 0:
        return [
            Sentence(f"If that confirms {it}, adopting {it} is of little use: later tests are predicted no better.")
        ]
    courses = listed([effect_name(slug) for slug in adoptable if BY_SLUG[slug].kind is EffectKind.COURSE])
    then = (
        ["measurements are then corrected"] if any(BY_SLUG[s].kind is not EffectKind.COURSE for s in adoptable) else []
    )
    then += [f"the predicted remaining life then includes {courses}"] if courses else []
    better = listed([*then, "later tests are predicted better"])
    return [Sentence(f"If that confirms {it}, adopt {it}: {better}.")]


def _next(report: Report) -> tuple[list[Sentence], list[Sentence]]:
    """Sentences on the checks to make, of a named cause or where no test is, of the likeliest explanation; and on the
    first test of the plan with its benefit."""
    looked_at = [report.causes] if report.verdict is Verdict.CAUSE_NAMED else []
    best = report.advice[0] if report.advice else None
    if not looked_at and (best is None or best.narrows or best.nats < criteria.WORTHWHILE):  # no test is to decide
        looked_at = [_certain(report), *_worth_saying(report)]
    known = ([BY_SLUG[slug].check for slug in effects if slug in BY_SLUG] for effects in looked_at)
    checks = [Sentence(f"Next: {'. Also '.join(each)}.") for each in [next(filter(None, known), [])] if each]
    if best is None:
        no_more = "" if report.gain is None else "No further test would tell much more."
        return checks, [Sentence(no_more, SHOULD)]
    if best.narrows:
        one = len(report.causes) == 1 or _certain(report) == (best.effect,)
        value = "value" if one else f"value of {effect_name(best.effect)}"
        change = ", which may change this" if report.not_adoptable else ""
        better = f"{'For' if checks else 'Next, for'} a closer {value}{change}: {_test(best)}"
        narrower = f"it narrows the interval by {100 * (1 - best.narrows):.0f} %"
        return checks, [Sentence(f"{better}; {narrower}.", RATHER if checks else MUST)]
    first = "Then" if checks else "Next"
    if best.nats < criteria.WORTHWHILE:
        return checks, [Sentence(f"Most helpful, though unlikely to decide: {_test(best)}.")]
    decides = f"It decides with probability {probability(best.probability)}"
    held = _certain(report) if report.verdict is Verdict.CAUSE_AMBIGUOUS else ()
    doubtful = [slug for slug in (best.effect, best.other) if slug not in {*held, BASELINE}]
    if len(doubtful) == 1:
        decides += f" whether {_cause_name(doubtful[0])} is at work"
    elif doubtful and {(best.effect,), (best.other,)} != set(_worth_saying(report)):
        decides += f"; hardest to tell apart are {listed([_cause_name(slug) for slug in doubtful])}"
    return checks, [Sentence(f"{first}: {_test(best)}. {decides}.")]


def _test(advice: Advice) -> str:
    """An advised test in words, few where it has many, with its time on the rig."""
    trial = TRIALS.get(advice.key)
    brief = "" if trial is None else trial.brief
    hours = advice.minutes / 60.0
    lasts = (
        f"{round(hours):,} hours" if hours >= 3.0 else f"{max(round(advice.minutes), 1)} minutes" if hours > 0.0 else ""
    )
    aside = ", ".join(
        part for part in (f"{lasts} in all" if lasts else "", "steps in the plan" if brief else "") if part
    )
    return f"{brief or advice.test} ({aside})" if aside else advice.test


def _noted(notes: Sequence[str]) -> list[Sentence]:
    """Notes on the whole campaign; those on single runs or effects, which begin with a name, stay in the report."""
    plain_notes = [note for note in notes if " " in note.split(":")[0] or ":" not in note]
    return [
        Sentence(note if note.endswith(".") else f"{note}.", MUST if ADVICE in note else SHOULD) for note in plain_notes
    ]
