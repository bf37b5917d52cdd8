"""The verdict and the judgement that it is part of, as values; `decide` makes them."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from models.diagnosis.attribution.check import Check
from models.diagnosis.attribution.evidence import Hypothesis


class Verdict(StrEnum):
    """The honest answers: nothing beyond noise, these causes, one of these, something else, too little data."""

    MODEL_ADEQUATE = "model_adequate"
    CAUSE_NAMED = "cause_named"
    CAUSE_AMBIGUOUS = "cause_ambiguous"
    UNEXPLAINED_STRUCTURE = "unexplained_structure"
    INSUFFICIENT_DATA = "insufficient_data"


#: Stands for something that no effect of the catalogue is.
UNCATALOGUED = "uncatalogued"


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Slugs of the effects at work (UNCATALOGUED among them, or none), the probability that these and no others are, and
    the probability that the estimated amplitudes have the right signs (None where nothing was estimated)."""

    effects: tuple[str, ...]
    probability: float
    sign_probability: float | None = None


def probability_of(explanations: Iterable[Explanation], slug: str) -> float:
    """The probability that an effect is at work, alone or beside others."""
    return min(sum(explanation.probability for explanation in explanations if slug in explanation.effects), 1.0)


def probabilities_by_slug(explanations: Iterable[Explanation]) -> dict[str, float]:
    """The probability of each effect of the catalogue, largest first."""
    listed = tuple(explanations)
    slugs = dict.fromkeys(slug for explanation in listed for slug in explanation.effects if slug != UNCATALOGUED)
    probabilities = {slug: probability_of(listed, slug) for slug in slugs}
    return dict(sorted(probabilities.items(), key=lambda item: -item[1]))


class Proposal(StrEnum):
    """Whether the extended model is proposed for adoption: there is none; it is; it is withheld, for its error on held-out
    runs is larger than the baseline's, or its log score there is lower."""

    NONE = "none"
    PROPOSED = "proposed"
    WITHHELD_ERROR = "withheld_error"
    WITHHELD_LOG_SCORE = "withheld_log_score"


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The numbers of a comparison of hypotheses [nats], all of the first member of the credible set (of the best hypothesis
    where that set is empty): the drop of its cost, what its template may be wrong by, its check; the evidence of structure
    that no effect explains; the size of the credible set; the evidence of an unmeasured oil temperature where that competes,
    else None."""

    best_drop: float
    structure: float
    tolerance: float
    credible: int
    check: Check
    unmeasured: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldOut:
    """How an extended model does on runs that were held out, against the baseline: RMS errors [Nm], gain of log score
    [nats], and the gain of log score when the last states are predicted from the first ones [nats]."""

    rmse_before: float
    rmse_after: float
    log_score_gain: float
    forecast_log_score_gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """The verdict and its causes, both read off the explanations (`attribution.explanations`), the credible set (hypotheses
    that the data do not distinguish from the best, best first), the explanations, most probable first, the numbers of the
    comparison (None where nothing was compared), the slug of an uncatalogued rig fault that does about as well as the best;
    after validation, what is proposed and whether effects of use are followed beyond the data."""

    verdict: Verdict
    causes: tuple[str, ...] = ()
    credible: tuple[Hypothesis, ...] = ()
    explanations: tuple[Explanation, ...] = ()
    comparison: Comparison | None = None
    fault: str | None = None
    proposal: Proposal = Proposal.NONE
    follow_courses: bool = False

    @property
    def probabilities(self) -> dict[str, float]:
        """The probability of each effect of the catalogue, largest first."""
        return probabilities_by_slug(self.explanations)

    @property
    def open(self) -> bool:
        """Whether something is left to be found out."""
        return self.verdict in {Verdict.CAUSE_AMBIGUOUS, Verdict.UNEXPLAINED_STRUCTURE}
