"""The verdict, read off the explanations and off nothing else.

p(nothing) >= LIKELY                                            the model is adequate
C = the causes of probability >= SURE,
    p(uncatalogued) <= 1 - SURE and p(exactly C) >= LIKELY      C is named
p(uncatalogued) >= LIKELY of all that is not nothing            structure without a name
otherwise                                                       ambiguous: the smallest set of explanations that holds
                                                                SURE of what is not nothing
"""

from collections.abc import Mapping, Sequence
from itertools import product

from models.diagnosis.attribution.verdict import UNCATALOGUED, Explanation, Verdict, probabilities_by_slug
from models.diagnosis.criteria import LIKELY, SURE
from models.diagnosis.explanations.posterior import Posterior


def explanations_of(posterior: Posterior) -> tuple[Explanation, ...]:
    """The list in public terms, most probable first: everything without a name is `uncatalogued`; vibrations are at work or
    not beside each alternative."""
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
    """The verdict and its causes; UNCATALOGUED may stand among those of an ambiguous one."""
    shares = {explanation.effects: explanation.probability for explanation in explanations}
    nothing = shares.get((), 0.0)
    if nothing >= LIKELY:
        return Verdict.MODEL_ADEQUATE, ()
    unknown = sum(share for effects, share in shares.items() if UNCATALOGUED in effects)
    sure = tuple(slug for slug, share in probabilities_by_slug(explanations).items() if share >= SURE)
    exactly = sum(share for effects, share in shares.items() if set(effects) == set(sure))
    if sure and unknown <= 1.0 - SURE and exactly >= LIKELY:
        return Verdict.CAUSE_NAMED, sure
    if unknown >= LIKELY * (1.0 - nothing):
        return Verdict.UNEXPLAINED_STRUCTURE, ()
    return Verdict.CAUSE_AMBIGUOUS, tuple(dict.fromkeys(slug for effects in smallest(shares) for slug in effects))


def smallest(shares: Mapping[tuple[str, ...], float]) -> list[tuple[str, ...]]:
    """The fewest explanations, most probable first, that hold SURE of what is not nothing."""
    chosen, mass = list[tuple[str, ...]](), 0.0
    something = 1.0 - shares.get((), 0.0)
    for effects, share in sorted(shares.items(), key=lambda item: -item[1]):
        if mass >= SURE * something:
            break
        if effects:
            chosen.append(effects)
            mass += share
    return chosen
