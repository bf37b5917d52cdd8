"""Weights of explanations: evidences weighed against each other, at their prior odds and less what a check has against them.

    p_h ∝ exp((evidence_h - odds_h - excess_h - those of the best)/(1 + ½ TOLERANCE λ))

λ is that of what a hypothesis and the best differ in: a template errs by a share of it, so a lead of so many nats counts for
less the larger λ is. Structure without a name competes as one more hypothesis.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from models.diagnosis.attribution.check import Check
from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.attribution.verdict import UNCATALOGUED
from models.diagnosis.criteria import PAIR_LOG_ODDS, SAME_FAMILY_LOG_ODDS, TOLERANCE
from models.diagnosis.effects.catalogued import oil_temperature


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorOdds:
    """Log prior odds against a hypothesis [nats]: none against one effect; against two, more where the best single one
    passes its check by itself, by what its template may be wrong by (`slack` [nats])."""

    slack: float

    def __call__(self, hypothesis: Hypothesis) -> float:
        if len(hypothesis.effects) < 2:
            return 0.0
        kin = len({effect.family for effect in hypothesis.effects}) < len(hypothesis.effects)
        return PAIR_LOG_ODDS + self.slack + (SAME_FAMILY_LOG_ODDS if kin else 0.0)


def unshared(best: Hypothesis, other: Hypothesis, singles: Sequence[Hypothesis]) -> float:
    """λ [nats] of that in which two hypotheses differ: what both hold does not count."""
    shared = set(best.slugs) & set(other.slugs)
    alone = max((single.drop for single in singles if set(single.slugs) <= shared and single is not best), default=0.0)
    return max(best.drop - alone, 0.0)


def weights_of(
    hypotheses: Sequence[Hypothesis],
    best: Hypothesis,
    odds: PriorOdds,
    excess: Callable[[Hypothesis], float],
    structure: float,
) -> dict[tuple[str, ...], float]:
    """The weight of each explanation: the hypotheses by their slugs, structure without a name [nats], nothing at all. They
    sum to one. `excess` [nats] is what a check has against a hypothesis."""
    singles = [hypothesis for hypothesis in hypotheses if hypothesis.usable and len(hypothesis.effects) == 1]

    def value(hypothesis: Hypothesis) -> float:
        return hypothesis.evidence - odds(hypothesis) - excess(hypothesis)

    def cooled(lead: float, differing: float) -> float:
        return lead / (1.0 + 0.5 * TOLERANCE * differing)

    logs: dict[tuple[str, ...], float] = {(): cooled(-value(best), best.drop)}
    if structure > 0.0:
        logs[(UNCATALOGUED,)] = cooled(structure - value(best), best.drop)
    logs |= {other.slugs: cooled(value(other) - value(best), unshared(best, other, singles)) for other in hypotheses}
    total = float(logsumexp(list(logs.values())))
    return {effects: float(np.exp(log - total)) for effects, log in logs.items()}


def with_unmeasured(
    weights: dict[tuple[str, ...], float], unmeasured: float, best: Hypothesis
) -> dict[tuple[str, ...], float]:
    """The weights with an unmeasured oil temperature of evidence `unmeasured` [nats] beside the others."""
    lead = (unmeasured - best.evidence) / (1.0 + 0.5 * best.tolerance)
    share = float(1 / (1 + np.exp(-np.clip(lead, -500, 500))))
    temperature = oil_temperature.EFFECT.slug
    others = {effects: (1 - share) * weight for effects, weight in weights.items() if temperature not in effects}
    return {**others, (temperature,): share}


def kept_share(best: Hypothesis, check: Check) -> float:
    """The share of its probability that a hypothesis keeps where it fails its check: something else competes."""
    cooled = check.excess / (1.0 + 0.5 * best.tolerance)
    return float(0.5 / (1.0 + np.exp(np.clip(cooled, 0.0, 500.0)))) if check.excess > 0 else 1.0
