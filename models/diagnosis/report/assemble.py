"""The report of a campaign, put together from what its chapters found."""

from collections.abc import Sequence

from models.diagnosis.criteria import NEGLIGIBLE
from models.diagnosis.design.design import Design
from models.diagnosis.effects.faults import FAULT_BY_SLUG
from models.diagnosis.experiments.test_plan import Advice
from models.diagnosis.explanations.alternative import NOTHING
from models.diagnosis.explanations.outlying_run import outlying_run
from models.diagnosis.explanations.posterior import Posterior
from models.diagnosis.explanations.sizes import Sizes
from models.diagnosis.explanations.verdict import Judgement, Verdict
from models.diagnosis.pooled_fit.baseline_fit import Baseline
from models.diagnosis.pooled_fit.gauss_newton import FitStatus
from models.diagnosis.pooled_fit.run_scatter import run_scatter
from models.diagnosis.raw_records.evidence import RawEvidence
from models.diagnosis.report.candidates import candidates_of, with_signs
from models.diagnosis.report.lack_of_fit import misfit_of
from models.diagnosis.report.maps import loop_traces, residual_maps
from models.diagnosis.report.proposed_extension import proposed_extension, reason_against
from models.diagnosis.report.report import Report
from models.diagnosis.report.statistics import statistics_of
from models.diagnosis.report.summary import Findings, summarise
from models.diagnosis.report.visible import unseen_of, visible_of
from models.diagnosis.report.wording import effect_name
from models.diagnosis.validation.extended_model import Validation


def report_of(
    baseline: Baseline,
    posterior: Posterior,
    judgement: Judgement,
    raw: Sequence[RawEvidence],
    validation: Validation,
    sizes: Sizes,
    advice: tuple[Advice, ...],
) -> Report:
    """Candidates, misfits, gain, advice, maps, loops, extension, summary."""
    problem, fitted = posterior.problem, posterior.null.fit
    reason = reason_against(judgement.proposal, validation.gain, sizes)
    notes = tuple(note for note in (*_notes(baseline, posterior, judgement, raw), reason) if note)
    scatter = run_scatter(posterior.null.evidence.screened)
    candidates = candidates_of(problem, judgement, raw, sizes.by_slug)
    extended = validation.extended
    visible = visible_of(posterior)
    findings = Findings(
        verdict=judgement.verdict,
        causes=judgement.causes,
        explanations=with_signs(judgement.explanations, candidates),
        candidates=candidates,
        baseline=misfit_of(problem, fitted, judgement.where),
        extended=None if extended is None else misfit_of(problem, extended, judgement.left),
        gain=validation.gain,
        advice=advice,
        visible=visible,
        unseen=unseen_of(posterior, visible, raw),
        notes=notes,
        tests=len(problem.design.runs),
        states=int(problem.design.facts.states.size),
        resembles="" if judgement.likest is None else FAULT_BY_SLUG[judgement.likest].title,
        scatter=scatter,
        withheld=reason,
    )
    return Report(
        verdict=judgement.verdict,
        causes=judgement.causes,
        summary=summarise(findings),
        explanations=findings.explanations,
        candidates=findings.candidates,
        baseline=findings.baseline,
        extended=findings.extended,
        gain=validation.gain,
        advice=advice,
        visible=visible,
        maps=residual_maps(problem, fitted, extended),
        loops=loop_traces(problem, fitted, extended),
        extension=proposed_extension(problem, judgement, sizes, reason),
        not_adoptable=reason,
        notes=notes,
        statistics=statistics_of(posterior, judgement, scatter),
    )


def insufficient(missing: str, design: Design) -> Report:
    """Nothing can be judged."""
    return Report(
        verdict=Verdict.INSUFFICIENT_DATA,
        causes=(),
        summary=f"Too little data for a pooled baseline: {missing}",
        explanations=(),
        candidates=(),
        baseline=None,
        extended=None,
        gain=None,
        advice=(),
        visible=(),
        maps=None,
        loops=(),
        extension=None,
        not_adoptable="",
        notes=design.notes,
        statistics={},
    )


def _notes(
    baseline: Baseline, posterior: Posterior, judgement: Judgement, raw: Sequence[RawEvidence]
) -> tuple[str, ...]:
    """Of the baseline, of raw records, of fits that did not end, and on an outlying run where the case is open."""
    notes = [*baseline.notes, *(f"{record.effect}: {record.note}." for record in raw)]
    unfinished = [
        " and ".join(effect_name(slug) for slug in cause.slugs) for cause in judgement.stand if cause.unfinished
    ]
    if posterior.null.fit.status is FitStatus.OUT_OF_STEPS and posterior.probabilities[NOTHING] > NEGLIGIBLE:
        unfinished.append("nothing at work")
    notes += [
        f"The fit with {name} ended before its optimum: its probability may be larger than stated."
        for name in unfinished
    ]
    if judgement.open:
        # an effect in one run alone may bend a better baseline's laws until that run fits
        alone = outlying_run(baseline.problem, baseline.fit)
        notes.append(alone or outlying_run(posterior.problem, posterior.null.fit))
    return tuple(note for note in notes if note)
