"""Explanations: what may be at work, an exclusive list with probabilities that sum to one, and what is read off it.

An explanation is a set of effects, UNCATALOGUED for something that no effect of the catalogue is, or nothing. The verdict,
the causes, the probability of each effect and the report's words are all read off this list, so they cannot disagree:

    nothing               p(nothing) >= 1/2                           the model is adequate
    unknown               p(uncatalogued, alone or beside) >= 1/2     unexplained structure
    C                     p(exactly C) >= 1/2, p(uncatalogued) <= 1 - LEAST_NAMED, and C likely: the causes are named
    otherwise             ambiguous: the smallest set of explanations that holds CREDIBLE_MASS

where C are the effects of probability LEAST_NAMED or more, the second from LEAST_SECOND_NAMED on.
"""

from collections.abc import Iterable, Mapping

import numpy as np

from models.diagnosis.attribution.verdict import (
    UNCATALOGUED,
    Explanation,
    Verdict,
    probabilities_by_slug,
    probability_of,
)
from models.diagnosis.criteria import CREDIBLE_MASS, LEAST_EXPLANATION, LEAST_NAMED, LEAST_SECOND_NAMED

#: Shares by which probabilities are moved until the list reads as the rules decided; and half, but for rounding.
_SHARES, _HALF = np.linspace(0.0, 1.0, 101), 0.5 - 1e-9


def explanations_of(weights: Mapping[tuple[str, ...], float]) -> tuple[Explanation, ...]:
    """Weights as explanations, most probable first, without those that are negligible."""
    total = sum(weights.values())
    merged: dict[frozenset[str], tuple[tuple[str, ...], float]] = {}
    for effects, weight in weights.items():
        own = tuple(dict.fromkeys(effects))
        order, before = merged.get(frozenset(own), (own, 0.0))
        merged[frozenset(own)] = order, before + weight / total
    kept = [(effects, weight) for effects, weight in merged.values() if weight >= LEAST_EXPLANATION]
    whole = sum(weight for _, weight in kept)
    explanations = [Explanation(effects=effects, probability=weight / whole) for effects, weight in kept]
    return tuple(sorted(explanations, key=lambda explanation: -explanation.probability))


def credible_explanations(explanations: Iterable[Explanation]) -> tuple[Explanation, ...]:
    """The fewest explanations, most probable first, that hold CREDIBLE_MASS."""
    chosen, mass = list[Explanation](), 0.0
    for explanation in explanations:
        chosen.append(explanation)
        mass += explanation.probability
        if mass >= CREDIBLE_MASS:
            break
    return tuple(chosen)


def read(explanations: tuple[Explanation, ...]) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict and the causes that explanations, most probable first, amount to."""
    nothing = sum(explanation.probability for explanation in explanations if not explanation.effects)
    unknown = probability_of(explanations, UNCATALOGUED)
    if nothing >= _HALF:
        return Verdict.MODEL_ADEQUATE, ()
    if unknown >= _HALF:
        return Verdict.UNEXPLAINED_STRUCTURE, ()
    by_slug = probabilities_by_slug(explanations)
    likely = tuple(slug for slug, share in by_slug.items() if share >= LEAST_SECOND_NAMED)
    exactly = sum(explanation.probability for explanation in explanations if set(explanation.effects) == set(likely))
    if likely and by_slug[likely[0]] >= LEAST_NAMED and unknown <= 1.0 - LEAST_NAMED + 1e-9 and exactly >= _HALF:
        return Verdict.CAUSE_NAMED, likely
    near = credible_explanations(explanations)
    return Verdict.CAUSE_AMBIGUOUS, tuple(dict.fromkeys(slug for explanation in near for slug in explanation.effects))


def reconciled(
    weights: Mapping[tuple[str, ...], float], target: Mapping[tuple[str, ...], float], verdict: Verdict
) -> tuple[Explanation, ...]:
    """The explanations by their evidence, moved towards `target` (what the checks of a case leave) by the least share with
    which they read as `verdict`, and as its causes where they are named."""
    named = next(iter(target)) if verdict is Verdict.CAUSE_NAMED else None
    total, whole = sum(weights.values()), sum(target.values())
    for share in _SHARES.tolist() if total > 0 else [1.0]:
        mixed = {
            effects: (1 - share) * weights.get(effects, 0.0) / max(total, 1e-300)
            + share * target.get(effects, 0.0) / whole
            for effects in {**weights, **target}
        }
        explanations = explanations_of(mixed)
        reads, causes = read(explanations)
        if reads is verdict and (named is None or set(causes) == set(named)):
            return explanations
    return explanations
