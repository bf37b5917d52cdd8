"""The extension that a judgement proposes for adoption, and why one is withheld."""

from models.diagnosis.attribution.verdict import Judgement, Proposal
from models.diagnosis.extension import Extension, build_extension
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import amplitude_deviations
from models.diagnosis.validation.held_out import Gain

#: Weight of an alternative without a probability of its own: it stays finite.
_LEAST_WEIGHT = 1e-6


def proposed_extension(problem: FitProblem, judgement: Judgement) -> Extension | None:
    """The fitted hypotheses of the credible set, weighted by probability; None where nothing is proposed."""
    if judgement.proposal is not Proposal.PROPOSED:
        return None
    alternatives = [
        (
            max(min(judgement.probabilities.get(slug, 0.0) for slug in hypothesis.slugs), _LEAST_WEIGHT),
            hypothesis.fit,
            amplitude_deviations(problem, hypothesis.fit),
        )
        for hypothesis in judgement.credible
        if hypothesis.fit is not None
    ]
    return build_extension(alternatives, problem.design.facts, courses=judgement.follow_courses)


def withheld_note(proposal: Proposal, gain: Gain | None) -> str:
    """Why an extension is withheld, or nothing where none is."""
    if proposal is Proposal.WITHHELD_ERROR:
        return "The extension is not proposed: its error on held-out runs is larger than the baseline's."
    if proposal is Proposal.WITHHELD_LOG_SCORE and gain is not None:
        return (
            "The extension is not proposed: the log score of held-out runs is lower with it than without, by "
            f"{-gain.log_score_gain:.3g} nats."
        )
    return ""
