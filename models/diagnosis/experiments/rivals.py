"""The rivals that a test should decide between: the causes that stand, and those that may come back."""

from models.diagnosis.criteria import RIVAL_MARGIN
from models.diagnosis.explanations.verdict import Fitted, Judgement


def rivals_of(judgement: Judgement) -> tuple[tuple[Fitted, ...], tuple[Fitted, ...]]:
    """Those that stand, and those of as many effects that are not far behind, best first."""
    if not judgement.stand:
        return (), ()
    best = judgement.stand[0]
    nearby = [
        other
        for other in judgement.others
        if len(other.slugs) == len(best.slugs) and other.evidence > best.evidence - RIVAL_MARGIN
    ]
    return judgement.stand, tuple(nearby)
