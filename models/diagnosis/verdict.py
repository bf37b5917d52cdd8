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
    design: Design, noise: Noise, priors: Priors, hypotheses: list[Hypothesis], rng: np.random.Generator
) -> Judgement:
    """The verdict on hypotheses, best first."""
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
    assert best.fit is not None
    view = view_of(design, noise, priors, best.fit, [])
    left = lead(view.projections, view.smooth, np.zeros(len(view.contrasts.axes)), LEFT_SHARE, rng)
    parts = lead(view.projections, view.inside, np.zeros(view.blocks), PARTS_SHARE, rng)
    line, _ = lines(design, noise, best.fit.residual)
    probabilities = probabilities_of(hypotheses, slack)
    statistics = {"lambda": best.drop, "tolerance": slack}
    for name, found in (("closure", left), ("parts", parts), ("left_lines", line)):
        statistics |= {f"{name}_value": found.value, f"{name}_p_value": found.p_value}
    closed = all(each.value <= each.threshold + slack for each in (left, parts, line))
    if best.evidence < OVER_NOTHING or not closed:
        return Judgement(
            verdict=Verdict.UNEXPLAINED_STRUCTURE, view=view, probabilities=probabilities, statistics=statistics
        )
    causes = tuple(dict.fromkeys(slug for each in near for slug in each.slugs))
    verdict = Verdict.CAUSE_NAMED if len(near) == 1 else Verdict.CAUSE_AMBIGUOUS
    if not design.facts.temperature_measured and LIKE_TEMPERATURE & set(causes):
        verdict, causes = Verdict.CAUSE_AMBIGUOUS, tuple(dict.fromkeys((*causes, "oil_temperature")))
    return Judgement(
        verdict=verdict, causes=causes, standing=near, view=view, probabilities=probabilities, statistics=statistics
    )


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

