"""The verdict, read off the explanations; where the sign of a named cause is open, the case is ambiguous (`diagnose`).

p(nothing) >= LIKELY                                            the model is adequate
C = the causes of probability >= SURE,
    p(uncatalogued) <= 1 - SURE and p(exactly C) >= LIKELY      C is named
p(uncatalogued) >= LIKELY of all that is not nothing            structure without a name; where C is not empty ambiguous: C
                                                                and something uncatalogued
otherwise                                                       ambiguous: the smallest set of explanations that holds
                                                                SURE of what is not nothing
"""

from collections.abc import Mapping, Sequence
from itertools import product

from models.diagnosis import criteria
from models.diagnosis.effects.faults import FAULT_BY_SLUG
from models.diagnosis.explanations.posterior import Posterior
from models.diagnosis.explanations.verdict import (
    NOTHING,
    UNCATALOGUED,
    Alternative,
    Explanation,
    Fitted,
    Judgement,
    Verdict,
    Where,
    axis_of,
    probabilities_by_slug,
)


def explanations_of(posterior: Posterior) -> tuple[Explanation, ...]:
    """Explanations with their probabilities, most probable first, in public terms: everything without a name is
    `uncatalogued`, and each alternative is split by which vibrations are at work beside it."""
    shares = dict[tuple[str, ...], float]()
    for alternative, share in posterior.probabilities.items():
        for at_work in product((False, True), repeat=len(posterior.vibrations)):
            swings, weight = list[str](), share
            for (slug, probability), swinging in zip(posterior.vibrations.items(), at_work, strict=True):
                weight *= probability if swinging else 1.0 - probability
                swings += [slug] * swinging
            effects = (*alternative.causes, *swings, *((UNCATALOGUED,) if alternative.unknown else ()))
            shares[effects] = shares.get(effects, 0.0) + weight
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    return tuple(Explanation(effects=effects, probability=share) for effects, share in ranked)


def decide(explanations: Sequence[Explanation]) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict and the slugs of its causes; UNCATALOGUED may be among the causes of an ambiguous verdict."""
    shares = {explanation.effects: explanation.probability for explanation in explanations}
    nothing = shares.get((), 0.0)
    if nothing >= criteria.LIKELY:
        return Verdict.MODEL_ADEQUATE, ()
    unknown = sum(share for effects, share in shares.items() if UNCATALOGUED in effects)
    sure = tuple(slug for slug, share in probabilities_by_slug(explanations).items() if share >= criteria.SURE)
    exactly = sum(share for effects, share in shares.items() if set(effects) == set(sure))
    if sure and unknown <= 1.0 - criteria.SURE and exactly >= criteria.LIKELY:
        return Verdict.CAUSE_NAMED, sure
    if unknown >= criteria.LIKELY * (1.0 - nothing):
        return (Verdict.CAUSE_AMBIGUOUS, (*sure, UNCATALOGUED)) if sure else (Verdict.UNEXPLAINED_STRUCTURE, ())
    return Verdict.CAUSE_AMBIGUOUS, tuple(dict.fromkeys(slug for effects in smallest(shares) for slug in effects))


def smallest(shares: Mapping[tuple[str, ...], float]) -> list[tuple[str, ...]]:
    """The credible set: the fewest explanations, most probable first, that hold SURE of the probability that anything
    is at work."""
    chosen, mass = list[tuple[str, ...]](), 0.0
    something = 1.0 - shares.get((), 0.0)
    for effects, share in sorted(shares.items(), key=lambda item: -item[1]):
        if mass >= criteria.SURE * something:
            break
        if effects:
            chosen.append(effects)
            mass += share
    return chosen


def judge(posterior: Posterior) -> Judgement:
    """The judgement before validation: the verdict, the probabilities of the explanations, and the fits behind them."""
    explanations = explanations_of(posterior)
    verdict, causes = decide(explanations)
    fitted = _fitted(posterior)
    shares = {explanation.effects: explanation.probability for explanation in explanations}
    sets = {Verdict.CAUSE_NAMED: [causes], Verdict.CAUSE_AMBIGUOUS: smallest(shares)}.get(verdict, [])
    # what averages of plateaus and loops show of an explanation
    chosen = {frozenset(effects) - {UNCATALOGUED, *posterior.vibrations} for effects in sets}
    stand = tuple(cause for cause in fitted if frozenset(cause.slugs) in chosen)
    unnamed = next((alternative for alternative in posterior.probabilities if alternative.unknown), NOTHING)
    likest = posterior.nodes.get(unnamed)
    return Judgement(
        verdict=verdict,
        causes=causes,
        explanations=explanations,
        stand=stand,
        others=tuple(cause for cause in fitted if cause not in stand),
        where=_where({a.unknown: w - posterior.prior(a) for a, w in posterior.weights.items() if not a.causes}),
        left=_where(posterior.nodes[Alternative(tuple(sorted(stand[0].slugs)))].evidence.structure) if stand else (),
        likest=next((e for e in likest.fit.effects if e.effect.slug in FAULT_BY_SLUG), None) if likest else None,
        evidence={
            a.causes[0]: w - posterior.prior(a)
            for a, w in posterior.weights.items()
            if len(a.causes) == 1 and not a.unknown
        },
    )


def _fitted(posterior: Posterior) -> tuple[Fitted, ...]:
    """The refitted causes, alone and in pairs, most probable first."""
    named = [
        alternative
        for alternative in posterior.nodes
        if alternative != NOTHING and not alternative.unknown and alternative in posterior.weights
    ]
    return tuple(
        Fitted(
            slugs=tuple(effect.effect.slug for effect in posterior.nodes[alternative].fit.effects),
            fit=posterior.nodes[alternative].fit,
            evidence=posterior.weights[alternative] - posterior.prior(alternative),
        )
        for alternative in sorted(named, key=posterior.weights.__getitem__, reverse=True)
    )


def _where(evidence: Mapping[str, float]) -> tuple[Where, ...]:
    """The axes of unexplained structure, each with the largest evidence [nats] of its alternatives, largest first."""
    axes: dict[str, float] = {}
    for unknown, value in evidence.items():
        if axis := axis_of(unknown):
            axes[axis] = max(axes.get(axis, 0.0), value)
    return tuple(Where(axis=axis, strength=value) for axis, value in sorted(axes.items(), key=lambda item: -item[1]))
