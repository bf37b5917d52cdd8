"""From evidence to a verdict: what cannot be told from the best stands beside it, and the case is closed or not.

Every template errs, so evidence saturates: with λ the drop of the best one's cost, candidates within
CLOSE + TOLERANCE λ nats of it are not told from it, and two effects at once must gain PAIR_PRICE + 2 TOLERANCE λ more than
the best alone. After the best one is fitted, what is left must look like noise, and its amplitude must be one in all
parts of the data, both up to TOLERANCE λ; else the structure is unexplained.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from models.diagnosis.alarm import lead, lines
from models.diagnosis.design import Design
from models.diagnosis.fitting import Priors
from models.diagnosis.refitting import Hypothesis, finite
from models.diagnosis.report import Verdict
from models.diagnosis.viewing import View, view_of
from models.diagnosis.whitening import Noise

#: Candidates this close [nats] to the best are not told from it, and this share of λ more.
CLOSE, TOLERANCE = 4.6, 0.05
#: A cause is named where it has this many nats over nothing.
OVER_NOTHING = 3.0
#: Two effects at once must gain this much [nats] beyond twice the tolerance.
PAIR_PRICE = 4.0
#: False alarms allowed in closing a case: structure that is left, and amplitudes that differ between parts.
LEFT_SHARE, PARTS_SHARE = 5e-3, 3e-3
#: A line in raw records has paid for its search: it is there.
VIBRATION_PROBABILITY = 0.98
#: So many of the candidates that stand are closed at most.
MOST_CLOSED = 4
#: What oil temperature could imitate where it was not measured.
LIKE_TEMPERATURE = frozenset({"torque_zero_shift", "pressure_offset"})


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


def judge(
    design: Design,
    noise: Noise,
    priors: Priors,
    hypotheses: list[Hypothesis],
    unmeasured: float,
    rng: np.random.Generator,
) -> Judgement:
    """The verdict on hypotheses, best first; `unmeasured` is the evidence [nats] of an oil temperature that was not
    measured (-inf where it was)."""
    usable = [each for each in hypotheses if finite(each)]
    singles = [each for each in usable if len(each.effects) == 1]
    if not singles:
        return Judgement(verdict=Verdict.UNEXPLAINED_STRUCTURE)
    best, pool = singles[0], singles
    pairs = [each for each in usable if len(each.effects) == 2]
    if pairs and pairs[0].evidence > best.evidence + PAIR_PRICE + 2 * tolerance(pairs[0]):
        best, pool = pairs[0], pairs
    slack = tolerance(best)
    near = tuple(each for each in pool if each.evidence >= best.evidence - CLOSE - between(best, each, singles))
    closings = [close(design, noise, priors, each, rng) for each in near[:MOST_CLOSED]]
    closed = [closing for closing in closings if closing.closed]
    statistics = {"lambda": best.drop, "tolerance": slack, "closed": float(len(closed)), **closings[0].statistics}
    probabilities = probabilities_of(hypotheses, slack)
    view = closings[0].view
    causes = tuple(dict.fromkeys(slug for each in near for slug in each.slugs))
    imitated = unmeasured > max(best.evidence - CLOSE - slack, OVER_NOTHING)
    if imitated:
        probabilities = with_unmeasured(probabilities, unmeasured, best.evidence, slack)
        causes = tuple(dict.fromkeys(("oil_temperature", *causes)))
    elif best.evidence < OVER_NOTHING or not closed:
        doubt = doubted(best, closings[0])
        return Judgement(
            verdict=Verdict.UNEXPLAINED_STRUCTURE,
            view=view,
            probabilities={slug: doubt * each for slug, each in probabilities.items()},
            statistics=statistics,
        )
    elif unmeasured > -np.inf and LIKE_TEMPERATURE & set(causes):
        imitated, causes = True, (*causes, "oil_temperature")
    named = len(near) == 1 and not imitated
    return Judgement(
        verdict=Verdict.CAUSE_NAMED if named else Verdict.CAUSE_AMBIGUOUS,
        causes=causes,
        standing=near,
        view=view,
        probabilities=probabilities,
        statistics=statistics,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Closing:
    """Whether what a hypothesis leaves looks like noise and its amplitude is one everywhere, by how much it does not at most
    [nats]; the view of its fit."""

    closed: bool
    excess: float
    view: View
    statistics: dict[str, float]


def close(design: Design, noise: Noise, priors: Priors, hypothesis: Hypothesis, rng: np.random.Generator) -> Closing:
    """Three tests on what is left: smooth contrasts, parts of the data, lines over the clock."""
    if hypothesis.fit is None:
        raise ValueError("a hypothesis must be fitted to be closed")
    slack = tolerance(hypothesis)
    view = view_of(design, noise, priors, hypothesis.fit, [])
    left = lead(view.projections, view.smooth, np.zeros(len(view.contrasts.axes)), LEFT_SHARE, rng)
    parts = lead(view.projections, view.inside, np.zeros(view.blocks), PARTS_SHARE, rng)
    line, _ = lines(design, noise, hypothesis.fit.residual)
    statistics: dict[str, float] = {}
    for name, found in (("closure", left), ("parts", parts), ("left_lines", line)):
        statistics |= {f"{name}_value": found.value, f"{name}_p_value": found.p_value}
    excess = max(each.value - each.threshold - slack for each in (left, parts, line))
    return Closing(closed=excess <= 0, excess=excess, view=view, statistics=statistics)


def doubted(best: Hypothesis, closing: Closing) -> float:
    """The share of its probability that a candidate keeps where its case does not close: something else competes."""
    cooled = closing.excess / (1.0 + 0.5 * tolerance(best))
    return float(0.5 / (1.0 + np.exp(np.clip(cooled, 0.0, 500.0)))) if closing.excess > 0 else 1.0


def with_unmeasured(probabilities: dict[str, float], unmeasured: float, best: float, slack: float) -> dict[str, float]:
    """The probabilities with an unmeasured oil temperature among what competes."""
    share = float(1 / (1 + np.exp(-np.clip((unmeasured - best) / (1.0 + 0.5 * slack), -500, 500))))
    found = {slug: (1 - share) * each for slug, each in probabilities.items() if slug != "oil_temperature"}
    return dict(sorted({**found, "oil_temperature": share}.items(), key=lambda item: -item[1]))


def tolerance(hypothesis: Hypothesis) -> float:
    """What a template may be wrong by [nats]."""
    return TOLERANCE * max(hypothesis.drop, 0.0)


def between(best: Hypothesis, other: Hypothesis, singles: Sequence[Hypothesis]) -> float:
    """What the templates by which two hypotheses differ may be wrong by [nats]: what both hold does not count."""
    shared = set(best.slugs) & set(other.slugs)
    alone = max((each.drop for each in singles if set(each.slugs) <= shared and each is not best), default=0.0)
    return TOLERANCE * max(best.drop - alone, 0.0)


def probabilities_of(hypotheses: list[Hypothesis], slack: float) -> dict[str, float]:
    """The probability that an effect is at work: evidences, pairs at their price, cooled by the tolerance."""
    priced = [each.evidence - (PAIR_PRICE + slack if len(each.effects) == 2 else 0.0) for each in hypotheses]
    logs = np.array([0.0, *priced]) / (1.0 + 0.5 * slack)
    weights = np.exp(logs - logsumexp(logs))
    found: dict[str, float] = {}
    for weight, each in zip(weights[1:].tolist(), hypotheses, strict=True):
        for slug in each.slugs:
            found[slug] = found.get(slug, 0.0) + weight
    return dict(sorted(found.items(), key=lambda item: -item[1]))
