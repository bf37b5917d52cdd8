"""The report of a campaign, put together from what its chapters found."""

from collections.abc import Sequence

from models.diagnosis.attribution.evidence import STEPS, Hypothesis, HypothesisStatus
from models.diagnosis.attribution.investigate import Investigation
from models.diagnosis.attribution.sizes import Sizes
from models.diagnosis.attribution.verdict import Judgement, Verdict
from models.diagnosis.design.design import Design
from models.diagnosis.detection.lack_of_fit import Misfit, misfit_of
from models.diagnosis.detection.structure_axes import axes_of
from models.diagnosis.effects.faults import FAULT_BY_SLUG
from models.diagnosis.experiments.test_plan import Advice
from models.diagnosis.pooled_fit.run_scatter import run_scatter
from models.diagnosis.report.candidates import candidates_of, with_signs
from models.diagnosis.report.maps import loop_traces, residual_maps
from models.diagnosis.report.outlying_run import outlying_run
from models.diagnosis.report.proposed_extension import proposed_extension, reason_against
from models.diagnosis.report.report import Report
from models.diagnosis.report.statistics import statistics_of
from models.diagnosis.report.summary import Findings, summarise
from models.diagnosis.report.visible import visible_of
from models.diagnosis.validation.extended_model import Validation


def report_of(
    investigation: Investigation,
    judgement: Judgement,
    validation: Validation,
    sizes: Sizes,
    advice: tuple[Advice, ...],
) -> Report:
    """Candidates, misfits, gain, advice, maps, loops, extension, summary."""
    problem, projected = investigation.problem, investigation.projected
    hypotheses: Sequence[Hypothesis] = () if investigation.search is None else investigation.search.hypotheses
    reason = reason_against(judgement.proposal, validation.gain, sizes)
    notes = tuple(note for note in (*_notes(investigation, judgement), reason) if note)
    scatter = run_scatter(projected.projections)
    candidates = candidates_of(problem, judgement, hypotheses, investigation.raw, sizes.by_slug)
    findings = Findings(
        verdict=judgement.verdict,
        causes=judgement.causes,
        explanations=with_signs(judgement.explanations, candidates),
        candidates=candidates,
        baseline=misfit_of(problem, projected.fit, investigation.where),
        extended=_extended_misfit(investigation, judgement, validation),
        gain=validation.gain,
        advice=advice,
        visible=visible_of(projected, investigation.alarms.effects.threshold),
        notes=notes,
        tests=len(problem.design.runs),
        states=int(problem.design.facts.states.size),
        resembles=FAULT_BY_SLUG[judgement.fault].title if judgement.fault is not None else "",
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
        visible=findings.visible,
        maps=residual_maps(problem, projected.fit, validation.extended),
        loops=loop_traces(problem, projected.fit, validation.extended),
        extension=proposed_extension(problem, judgement, sizes, reason),
        not_adoptable=reason,
        notes=notes,
        statistics=statistics_of(investigation.alarms, judgement.comparison, scatter),
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


def _extended_misfit(investigation: Investigation, judgement: Judgement, validation: Validation) -> Misfit | None:
    """The misfit of the extended model; where structure is left by a hypothesis, on which axes."""
    if validation.extended is None:
        return None
    fitted = any(hypothesis.fit is not None for hypothesis in judgement.credible)
    left = axes_of(judgement.comparison.check.projected) if fitted and judgement.comparison is not None else ()
    return misfit_of(investigation.problem, validation.extended, left)


def _notes(investigation: Investigation, judgement: Judgement) -> tuple[str, ...]:
    """Of the baseline, of raw records, of fits that did not end, and on an outlying run where the case is open."""
    notes = [*investigation.baseline.notes, *(f"{record.effect}: {record.note}." for record in investigation.raw)]
    notes += [
        f"The fit of {' and '.join(hypothesis.slugs)} had not converged after {STEPS} steps: no cause is named by it."
        for hypothesis in judgement.credible
        if hypothesis.status is HypothesisStatus.OUT_OF_STEPS
    ]
    if judgement.open:
        # an effect in one run alone may bend a better baseline's laws until that run fits
        first = investigation.first
        alone = "" if first is None else outlying_run(first.problem, first.fit)
        notes.append(alone or outlying_run(investigation.problem, investigation.projected.fit))
    return tuple(note for note in notes if note)
