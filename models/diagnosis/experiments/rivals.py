"""The rivals that a test should decide between: the credible set, and hypotheses that may come back into it."""

from collections.abc import Sequence
from dataclasses import dataclass

from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.attribution.verdict import Judgement
from models.diagnosis.criteria import RIVAL_MARGIN
from models.diagnosis.pooled_fit.gauss_newton import Fit


@dataclass(frozen=True, slots=True, kw_only=True)
class Rival:
    """A candidate's fit and its evidence [nats] over nothing."""

    fit: Fit
    evidence: float


def rivals_of(judgement: Judgement, hypotheses: Sequence[Hypothesis]) -> tuple[list[Rival], list[Rival]]:
    """The credible set, and those of as many effects that are not far behind, best first."""
    credible = _fitted(judgement.credible)
    if not credible:
        return [], []
    inside = {hypothesis.slugs for hypothesis in judgement.credible}
    nearby = [
        hypothesis
        for hypothesis in hypotheses
        if hypothesis.slugs not in inside
        and len(hypothesis.effects) == len(judgement.credible[0].effects)
        and hypothesis.evidence > credible[0].evidence - RIVAL_MARGIN
    ]
    return credible, _fitted(sorted(nearby, key=lambda hypothesis: -hypothesis.evidence))


def _fitted(hypotheses: Sequence[Hypothesis]) -> list[Rival]:
    return [Rival(fit=rival.fit, evidence=rival.evidence) for rival in hypotheses if rival.fit is not None]
