"""From evidence to a verdict: what cannot be told from the best stands beside it, and the case is closed or not.

Templates may be bent (`effects.template_discrepancy`), so evidence holds what they err by; with λ the drop of the best one's
cost, candidates within CLOSE + RIVAL λ nats of it are not told from it. Two effects at once must gain PAIR_PRICE nats over
the best alone, and TOLERANCE λ more where that one closes the case by itself. Structure without a name competes as well.
After the best is fitted, what is left must look like noise, up to TOLERANCE λ, and its amplitude must be one in all parts
of the data, up to PARTS_TOLERANCE λ; else the structure is unexplained.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from models.diagnosis.attribution.evidence import Hypothesis, finite, undoing
from models.diagnosis.attribution.unmeasured_temperature import with_unmeasured
from models.diagnosis.design.design import Design
from models.diagnosis.detection.alarm import lead
from models.diagnosis.detection.periodogram import lines
from models.diagnosis.detection.view import View, view_of
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Priors
from models.diagnosis.report.report import Verdict

#: Candidates this close [nats] to the best are not told from it (pairs, of which each half has evidence of its own, where
#: they are closer), and this share of λ more.
CLOSE, CLOSE_PAIRS, RIVAL = 4.6, 3.0, 0.005
#: What a template may leave behind, as a share of λ; and what its amplitude may be worth more in parts of the data: parts
#: that differ by δ cost about δ² λ/4.
TOLERANCE, PARTS_TOLERANCE = 0.05, 0.15
#: Structure without a name may have so much more evidence, as a share of λ beyond CLEAR nats: below, no template's error
#: shows.
GENERIC, CLEAR = 0.05, 20.0
#: ... and so many nats more in any case, for the choice among some eight axes (a probability reckons without).
AXES_PRICE = 2.0
#: A cause is named where it has this many nats over nothing.
OVER_NOTHING = 3.0
#: Two effects at once must gain this much [nats].
PAIR_PRICE = 4.0
#: ... and so much more where both are of one family: the second may mend the template of the first.
KIN_PRICE = 8.0
#: A cause is named where its own probability is this at least, the second of two from the lower one on.
LEAST_NAMED, LEAST_OF_TWO = 0.85, 0.8
#: False alarms allowed in closing a case: structure that is left, and amplitudes that differ between parts.
LEFT_SHARE, PARTS_SHARE = 5e-3, 3e-3
#: Where what is left (of two causes the parts, too) would look like that by chance in fewer cases, beyond what a template
#: leaves, nothing is named. However loud it is, the right template leaves hardly more [nats] than the second says.
UNEASY, MOST_LEFT = 0.05, 3.0
#: Two effects worth so much more by themselves than together undo each other, and do not close by so many nats.
MOST_UNDONE, UNDONE = 2.5, 8.0
#: A line in raw records has paid for its search: it is there.
VIBRATION_PROBABILITY = 0.98
#: So many of the candidates that stand are closed at most.
MOST_CLOSED = 4
#: What oil temperature could imitate where it was not measured.
LIKE_TEMPERATURE = frozenset({"torque_zero_shift", "pressure_offset"})
#: ... and what else it could where no maintenance says that it was done: warmer oil is thinner, as fresh oil may be.
UNLESS_LOGGED = frozenset({"oil_change"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """The verdict, its causes, the hypotheses that stand (best first; empty where none does), the best one's view, the
    probability of each effect, and numbers that a test may want."""

    verdict: Verdict
    causes: tuple[str, ...] = ()
    standing: tuple[Hypothesis, ...] = ()
    view: View | None = None
    probabilities: dict[str, float] = field(default_factory=dict)
    statistics: dict[str, float] = field(default_factory=dict)

    def joined(self, vibrations: tuple[str, ...]) -> "Judgement":
        """With vibrations that raw records show: they are causes beside the others, or the only ones."""
        if not vibrations:
            return self
        probabilities = {**dict.fromkeys(vibrations, VIBRATION_PROBABILITY), **self.probabilities}
        verdict = Verdict.CAUSE_NAMED if self.verdict is Verdict.MODEL_ADEQUATE else self.verdict
        causes = (*self.causes, *vibrations)
        if verdict is Verdict.UNEXPLAINED_STRUCTURE:
            causes = ()
        return replace(self, verdict=verdict, causes=causes, probabilities=probabilities)

    def unsure(self) -> "Judgement":
        """With no cause named where two that foretell worse than none ask for other sizes in parts of the data."""
        both = self.standing[0].slugs if self.standing else ()
        pair = self.verdict is Verdict.CAUSE_NAMED and len(both) > 1 and set(both) <= set(self.causes)
        uneven = self.statistics.get("parts_p_value", 1.0) < UNEASY
        return replace(self, verdict=Verdict.CAUSE_AMBIGUOUS) if pair and uneven else self


def judge(
    design: Design,
    noise: Noise,
    priors: Priors,
    hypotheses: list[Hypothesis],
    structure: float,
    unmeasured: float,
    rng: np.random.Generator,
) -> Judgement:
    """The verdict on hypotheses, best first; `structure` is the evidence [nats] of what is not in the catalogue: smooth
    structure without a name on the axis that shows most of it, or the best of the strangers; `unmeasured` that of an oil
    temperature that was not measured (-inf where it was)."""
    usable = [each for each in hypotheses if finite(each)]
    singles = [each for each in usable if len(each.effects) == 1]
    if not singles:
        return Judgement(verdict=Verdict.UNEXPLAINED_STRUCTURE)
    tested = _Tested(design, noise, priors, rng)
    best, price = _leader(singles, [each for each in usable if len(each.effects) == 2], tested)
    standing = _standing(best, usable, singles, price, tested)
    first = tested(standing[0] if standing else best)
    slack = tolerance(best)
    statistics = {
        "lambda": best.drop,
        "structure": structure,
        "tolerance": slack,
        "standing": float(len(standing)),
        **first.statistics,
    }
    probabilities = probabilities_of(hypotheses, best, singles, price, tested, structure)
    unnamed = structure - AXES_PRICE - GENERIC * max(best.drop - CLEAR, 0.0)
    causes = tuple(dict.fromkeys(slug for each in standing for slug in each.slugs))
    imitated = unmeasured > max(best.evidence - CLOSE - slack, OVER_NOTHING)
    if imitated:
        probabilities = with_unmeasured(probabilities, unmeasured, best.evidence, slack)
        causes = tuple(dict.fromkeys(("oil_temperature", *causes)))
        statistics["oil_temperature_unmeasured"] = unmeasured
    elif best.evidence - price(best) < max(OVER_NOTHING, unnamed) or not standing:
        doubt = doubted(best, tested(best))
        return Judgement(
            verdict=Verdict.UNEXPLAINED_STRUCTURE,
            view=first.view,
            probabilities={slug: doubt * each for slug, each in probabilities.items()},
            statistics=statistics,
        )
    elif unmeasured > -np.inf and like_temperature(design) & set(causes):
        imitated, causes = True, (*causes, "oil_temperature")
    left = min(first.statistics[f"{name}_p_value"] for name in ("closure", "parts")[: len(best.effects)])
    easy = left * np.exp(min(slack, MOST_LEFT)) >= UNEASY
    likely = () if imitated or len(standing) > 1 or not easy else _likely(causes, probabilities)
    named = bool(likely) and probabilities[likely[0]] >= LEAST_NAMED
    return Judgement(
        verdict=Verdict.CAUSE_NAMED if named else Verdict.CAUSE_AMBIGUOUS,
        causes=likely if named else causes,
        standing=standing,
        view=first.view,
        probabilities=probabilities,
        statistics=statistics,
    )


def like_temperature(design: Design) -> frozenset[str]:
    """What an oil temperature that was not measured could pass for in this campaign."""
    return LIKE_TEMPERATURE if design.facts.oil_changes else LIKE_TEMPERATURE | UNLESS_LOGGED


def _likely(causes: tuple[str, ...], probabilities: dict[str, float]) -> tuple[str, ...]:
    """One cause, or of two those that are likely enough."""
    return causes if len(causes) == 1 else tuple(each for each in causes if probabilities[each] >= LEAST_OF_TWO)


def _standing(
    best: Hypothesis,
    usable: list[Hypothesis],
    singles: Sequence[Hypothesis],
    price: Callable[[Hypothesis], float],
    tested: "_Tested",
) -> tuple[Hypothesis, ...]:
    """What is better than nothing and cannot be told from the best, best first; none where no case among them closes."""
    # against a single effect stand pairs without it too; with it they are its own story told at length
    pool = [each for each in usable if len(each.effects) == len(best.effects) or not set(best.slugs) & set(each.slugs)]
    pool = [each for each in pool if len(each.effects) >= len(best.effects)]
    pool.sort(key=lambda each: price(each) - each.evidence)

    def stands(each: Hypothesis) -> bool:
        worth = each.evidence - price(each)
        lead = best.evidence - price(best) - worth
        margin = CLOSE if len(each.effects) == 1 else CLOSE_PAIRS
        return (each is best or worth > 0.0) and lead <= margin + RIVAL * unshared(best, each, singles)

    near = [each for each in pool if stands(each)][:MOST_CLOSED]
    closed = [each for each in near if tested(each).closed]
    return tuple(each for each in near if closed and tested(each).excess <= CLOSE)


def _leader(
    singles: list[Hypothesis], pairs: list[Hypothesis], tested: "_Tested"
) -> tuple[Hypothesis, Callable[[Hypothesis], float]]:
    """The best hypothesis, and what each costs against one effect alone [nats]."""
    alone = singles[0]
    promising = bool(pairs) and pairs[0].evidence > alone.evidence + PAIR_PRICE
    slack = 0.0 if promising and not tested(alone).closed else tolerance(alone)

    def price(hypothesis: Hypothesis) -> float:
        if len(hypothesis.effects) < 2:
            return 0.0
        kin = len({effect.family for effect in hypothesis.effects}) < len(hypothesis.effects)
        return PAIR_PRICE + slack + (KIN_PRICE if kin else 0.0)

    best = max(pairs, key=lambda each: each.evidence - price(each), default=alone)
    ahead = best.evidence - price(best) > alone.evidence
    story = not ahead or tested(best).statistics["undoing"] <= MOST_UNDONE or not tested(alone).closed
    return (best if ahead and story else alone), price


class _Tested:
    """Closings of hypotheses, each made once."""

    def __init__(self, design: Design, noise: Noise, priors: Priors, rng: np.random.Generator) -> None:
        self._given = design, noise, priors
        self._rng = rng
        self._known: dict[tuple[str, ...], Closing] = {}

    def __call__(self, hypothesis: Hypothesis) -> "Closing":
        if hypothesis.slugs not in self._known:
            self._known[hypothesis.slugs] = close(*self._given, hypothesis, self._rng)
        return self._known[hypothesis.slugs]

    def excess(self, hypothesis: Hypothesis) -> float:
        """By how much [nats] it is known not to close, 0 where it closes or was not looked at."""
        known = self._known.get(hypothesis.slugs)
        return max(known.excess, 0.0) if known is not None else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Closing:
    """Whether what a hypothesis leaves looks like noise and its amplitude is one everywhere, by how much it does not at most
    [nats]; the view of its fit."""

    closed: bool
    excess: float
    view: View
    statistics: dict[str, float]


def close(design: Design, noise: Noise, priors: Priors, hypothesis: Hypothesis, rng: np.random.Generator) -> Closing:
    """Three tests on what is left (smooth contrasts, parts of the data, lines over the clock), and one on a pair itself."""
    if hypothesis.fit is None:
        raise ValueError("a hypothesis must be fitted to be closed")
    slack = tolerance(hypothesis)
    view = view_of(design, noise, priors, hypothesis.fit, [])
    left = lead(view.projections, view.smooth, np.zeros(len(view.contrasts.axes)), LEFT_SHARE, rng)
    parts = lead(view.projections, view.inside, np.zeros(view.blocks), PARTS_SHARE, rng)
    line = lines(design, noise, hypothesis.fit.residual)
    statistics = {"undoing": undoing(design, noise, priors, hypothesis)}
    for name, found in (("closure", left), ("parts", parts), ("left_lines", line)):
        statistics |= {f"{name}_value": found.value, f"{name}_p_value": found.p_value}
    uneven = PARTS_TOLERANCE / TOLERANCE * slack
    excess = max(each.value - each.threshold - most for each, most in ((left, slack), (parts, uneven), (line, slack)))
    if statistics["undoing"] > MOST_UNDONE:
        excess = max(excess, UNDONE * (1.0 + 0.5 * slack))
    return Closing(closed=excess <= 0, excess=excess, view=view, statistics=statistics)


def doubted(best: Hypothesis, closing: Closing) -> float:
    """The share of its probability that a candidate keeps where its case does not close: something else competes."""
    cooled = closing.excess / (1.0 + 0.5 * tolerance(best))
    return float(0.5 / (1.0 + np.exp(np.clip(cooled, 0.0, 500.0)))) if closing.excess > 0 else 1.0


def tolerance(hypothesis: Hypothesis) -> float:
    """What a template may be wrong by [nats]."""
    return TOLERANCE * max(hypothesis.drop, 0.0)


def unshared(best: Hypothesis, other: Hypothesis, singles: Sequence[Hypothesis]) -> float:
    """λ [nats] of that in which two hypotheses differ: what both hold does not count."""
    shared = set(best.slugs) & set(other.slugs)
    alone = max((each.drop for each in singles if set(each.slugs) <= shared and each is not best), default=0.0)
    return max(best.drop - alone, 0.0)


def probabilities_of(
    hypotheses: list[Hypothesis],
    best: Hypothesis,
    singles: Sequence[Hypothesis],
    price: Callable[[Hypothesis], float],
    tested: _Tested,
    structure: float,
) -> dict[str, float]:
    """The probability that an effect is at work: evidences against the best, pairs at their price, less what does not
    close, cooled by the tolerance of what differs. Hypotheses, structure without a name and nothing at all exclude each
    other and no effect is twice in one, so no probability is beyond 1."""

    def value(each: Hypothesis) -> float:
        return each.evidence - price(each) - tested.excess(each)

    def cooled(lead: float, differing: float) -> float:
        return lead / (1.0 + 0.5 * TOLERANCE * differing)

    logs = [cooled(max(structure, 0.0) - value(best), best.drop)]
    logs += [cooled(value(each) - value(best), unshared(best, each, singles)) for each in hypotheses]
    weights = np.exp(np.array(logs) - logsumexp(logs))
    found: dict[str, float] = {}
    for weight, each in zip(weights[1:].tolist(), hypotheses, strict=True):
        for slug in each.slugs:
            found[slug] = found.get(slug, 0.0) + weight
    return dict(sorted(found.items(), key=lambda item: -item[1]))
