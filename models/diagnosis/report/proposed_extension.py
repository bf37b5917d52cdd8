"""The extension that a judgement proposes for adoption, and why none is."""

from models.diagnosis.criteria import SIGN_UNDETERMINED
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.template_discrepancy import ranges_of
from models.diagnosis.explanations.sizes import Size, Sizes
from models.diagnosis.explanations.verdict import Judgement, Proposal
from models.diagnosis.extension import Extension, build_extension
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.report.wording import effect_name, number
from models.diagnosis.validation.held_out import Gain


def proposed_extension(problem: FitProblem, judgement: Judgement, sizes: Sizes, reason: str) -> Extension | None:
    """The draws of the causes; None where nothing was fitted, or there is a reason against it."""
    if reason or judgement.proposal is not Proposal.PROPOSED or not any(draw.effects for draw in sizes.draws):
        return None
    design = problem.design
    return build_extension(sizes.draws, design.facts, ranges_of(design.rows), courses=judgement.follow_courses)


def reason_against(proposal: Proposal, gain: Gain | None, sizes: Sizes) -> str:
    """Why an extension is not proposed, or nothing where one is or none was fitted."""
    if proposal is Proposal.WITHHELD_ERROR:
        return "The extension is not proposed: its error on held-out runs is larger than the baseline's."
    if proposal is Proposal.WITHHELD_LOG_SCORE and gain is not None:
        return "The extension is not proposed: held-out runs are less likely with it than without."
    unsure = [_unsure(slug, size) for slug, size in sizes.by_slug.items() if size.other_sign > SIGN_UNDETERMINED]
    return " ".join(unsure) if proposal is Proposal.PROPOSED else ""


def _unsure(slug: str, size: Size) -> str:
    effect = BY_SLUG[slug]
    low, high = (number(effect.scale * end) for end in size.interval)
    why = "it depends on the course over life that is assumed, even in sign" if size.courses else "not even its sign"
    return (
        f"The extension is not proposed: these data do not determine the size of {effect_name(slug)} "
        f"({low} to {high} {effect.unit}): {why}."
    )
