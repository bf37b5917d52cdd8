"""The report of a campaign, put together from what its chapters found: each effect that competed with its probability,
evidence and amplitude, the extension that is proposed for adoption or why none is, and the numbers of the computation.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.diagnosis import criteria
from models.diagnosis.design.design import Design
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import FROM_THE_START
from models.diagnosis.effects.fitted_effect import AmplitudeEstimate, Draw, FittedEffect, ranges_of
from models.diagnosis.experiments.test_plan import Advice
from models.diagnosis.explanations.posterior import Posterior
from models.diagnosis.explanations.shapeless import outlying_run
from models.diagnosis.explanations.sizes import Size, Sizes
from models.diagnosis.explanations.verdict import NOTHING, Explanation, Judgement, Verdict
from models.diagnosis.extension import Extension, build_extension
from models.diagnosis.pooled_fit.baseline_fit import Baseline
from models.diagnosis.pooled_fit.gauss_newton import FitStatus, PooledFit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import RunScatter, amplitude_deviations, run_scatter
from models.diagnosis.raw_records.evidence import RawEvidence
from models.diagnosis.report.friction_law import FrictionLaw
from models.diagnosis.report.isolability import unseen_of, visible_of
from models.diagnosis.report.maps import loop_traces, residual_maps
from models.diagnosis.report.report import Candidate, Report, misfit_of
from models.diagnosis.report.summary import effect_name, number, summarise
from models.diagnosis.validation.held_out import Gain


def candidates_of(
    problem: FitProblem,
    judgement: Judgement,
    raw: Sequence[RawEvidence],
    sizes: Mapping[str, Size],
    isolability: Mapping[str, float],
) -> tuple[Candidate, ...]:
    """Candidates of the report, one for each effect: by the verdict's fit, else alone, else beside its best
    companion."""
    records = {record.effect: record for record in raw}
    alone = [fitted for fitted in judgement.others if len(fitted.slugs) == 1]
    candidates = []
    for slug, probability in judgement.probabilities.items():
        if probability < 1e-3 and slug not in judgement.causes:
            continue
        fitted = next((f for f in (*judgement.stand, *alone, *judgement.others) if slug in f.slugs), None)
        evidence = judgement.evidence.get(slug, 0.0)
        if fitted is not None:
            place, evidence = fitted.slugs.index(slug), fitted.evidence
            effect = fitted.fit.effects[place]
            estimate = _estimate(slug, effect.amplitude, amplitude_deviations(problem, fitted.fit)[place])
            if slug in sizes:
                size, scale = sizes[slug], effect.effect.scale
                low, high = (_finite(scale * end) for end in size.interval)
                estimate = _estimate(slug, size.value, size.sd)
                estimate = replace(estimate, stated_interval=(low, high), stated_sign=1.0 - size.other_sign)
            if onset := _onset(effect):
                estimate = replace(estimate, name=f"{estimate.name} ({onset})")
        elif slug in records:
            estimate, evidence = records[slug].estimate, records[slug].log_evidence
            estimate = replace(estimate, value=_finite(estimate.value), sd=_finite(estimate.sd))
        else:  # screened only, or an oil temperature that was not measured
            estimate = _estimate(slug, 0.0, BY_SLUG[slug].sized(problem.design.facts).prior_sd)
        candidates.append(
            Candidate(
                effect=slug,
                title=BY_SLUG[slug].title,
                probability=probability,
                log_evidence_gain=_finite(evidence),
                estimate=estimate,
                isolability=isolability.get(slug),
                beside=() if fitted is None else tuple(other for other in fitted.slugs if other != slug),
                fit=None if fitted is None else fitted.fit.status,
            )
        )
    return tuple(candidates)


def _onset(fitted: FittedEffect) -> str:
    """The onset of an effect in words, in cycles; empty where it is at work from the start."""
    onset = fitted.effect.onset(fitted.shape)
    return "" if onset == FROM_THE_START else f"from about {number(onset)} cycles on"


def _estimate(slug: str, amplitude: float, deviation: float) -> AmplitudeEstimate:
    """An effect's amplitude with its standard deviation, converted from SI to the unit of the report."""
    effect = BY_SLUG[slug]
    return AmplitudeEstimate(
        name=effect.amplitude,
        value=_finite(amplitude * effect.scale),
        sd=_finite(deviation * effect.scale),
        unit=effect.unit,
        one_sided=effect.positive,
    )


def with_signs(explanations: Iterable[Explanation], candidates: Iterable[Candidate]) -> tuple[Explanation, ...]:
    """Explanations with the probability that the least certain of their effects' signs is right."""
    signs = {candidate.effect: candidate.estimate.sign_probability for candidate in candidates}
    certain = []
    for explanation in explanations:
        known = [sign for slug in explanation.effects if (sign := signs.get(slug)) is not None]
        certain.append(replace(explanation, sign_probability=min(known, default=None)))
    return tuple(certain)


def _finite(value: float) -> float:
    """The value, held within ±1e300, for JSON has no infinity."""
    return float(np.clip(value, -1e300, 1e300))


#: What the paragraph says where causes are open.
ADOPT_NOTHING = "Adopt nothing before the next diagnosis."


def reason_against(verdict: Verdict, gain: Gain | None, sizes: Sizes) -> str:
    """The reason why an extension is not proposed, as a sentence; empty where one is proposed or none was fitted. The
    verdict stays."""
    if not sizes.draws:
        return ""
    if verdict is not Verdict.CAUSE_NAMED:
        return ADOPT_NOTHING
    if gain is not None and (gain.rmse_after > criteria.MOST_WORSE * gain.rmse_before or gain.log_score_gain < 0):
        it = "it" if len(sizes.by_slug) == 1 else "them"
        return f"Do not adopt {it}, even if confirmed: with {it}, the model predicts other runs no better than without."
    return ""


def statistics_of(posterior: Posterior, judgement: Judgement, scatter: RunScatter) -> dict[str, float]:
    """Finite numbers of the computation by name: the run-to-run scatter, the log evidence [nats] of the most probable
    alternative over nothing and the same with its prior, the evidence of the strongest axis, refits."""
    probabilities = posterior.probabilities
    best = next(iter(probabilities))
    numbers = {
        "run_scatter": scatter.median,
        "run_scatter_lower": scatter.lower,
        "run_scatter_upper": scatter.upper,
        "run_scatter_information": scatter.information,
        "probability_nothing": probabilities[NOTHING],
        "log_evidence": posterior.weights[best] - posterior.prior(best),
        "log_posterior_odds": posterior.weights[best] - posterior.weights[NOTHING],
        "structure": judgement.where[0].strength if judgement.where else 0.0,
        "refits": float(posterior.refits),
    }
    return {name: value for name, value in numbers.items() if np.isfinite(value)}


def report_of(
    baseline: Baseline,
    posterior: Posterior,
    judgement: Judgement,
    raw: Sequence[RawEvidence],
    extended: PooledFit | None,
    gain: Gain | None,
    sizes: Sizes,
    advice: tuple[Advice, ...],
    law: FrictionLaw | None,
) -> Report:
    """The report: candidates, misfits, gain, advice, maps, loops, the friction law, extension, summary."""
    problem, fitted = posterior.problem, posterior.null.fit
    reason = reason_against(judgement.verdict, gain, sizes)
    notes = _notes(baseline, posterior, judgement, raw)
    scatter = run_scatter(posterior.null.evidence.screened)
    candidates = candidates_of(problem, judgement, raw, sizes.by_slug, posterior.isolability)
    visible = visible_of(posterior)
    if law is not None:  # where what is at work is open, so is the law beside it
        known = judgement.verdict in {Verdict.MODEL_ADEQUATE, Verdict.CAUSE_NAMED} and not reason
        law = replace(law, adoptable=known and law.predicts)
        if law.adoptable and extended is None:
            extended, gain = fitted, law.gain
    report = Report(
        verdict=judgement.verdict,
        causes=judgement.causes,
        explanations=with_signs(judgement.explanations, candidates),
        candidates=candidates,
        baseline=misfit_of(baseline.problem.exact, baseline.exact, judgement.where),
        extended=None if extended is None else misfit_of(problem, extended, judgement.left),
        extended_effects=() if extended is None else tuple(effect.effect.slug for effect in extended.effects),
        gain=gain,
        advice=advice,
        visible=visible,
        unseen=unseen_of(posterior, visible, raw),
        maps=residual_maps(baseline, problem, extended or fitted),
        loops=loop_traces(baseline, problem, extended or fitted),
        friction_law=law,
        like_the_law=tuple(
            slug
            for slug, share in sorted(posterior.like_the_law.items(), key=lambda item: -item[1])
            if share >= criteria.LIKE_MENTIONED and slug in BY_SLUG
        ),
        extension=None if reason else _extension(problem, fitted, sizes, gain, law),
        not_adoptable=reason,
        notes=notes,
        statistics=statistics_of(posterior, judgement, scatter),
        tests=len(problem.design.runs),
        states=int(problem.design.facts.states.size),
        resembles=", ".join(filter(None, (like.effect.title, _onset(like)))) if (like := judgement.likest) else "",
        scatter=scatter,
    )
    return replace(report, summary=summarise(report))


def _extension(
    problem: FitProblem, fitted: PooledFit, sizes: Sizes, gain: Gain | None, law: FrictionLaw | None
) -> Extension | None:
    """The extension that may be adopted: the causes at work, and the law as found where it is proposed; None without
    either."""
    learned = law.learned if law is not None and law.adoptable else None
    draws = sizes.draws if any(draw.effects for draw in sizes.draws) else ()
    if learned is not None and not draws:
        draws = (Draw(weight=1.0, laws=fitted.laws),)
    if not draws:
        return None
    # effects of use are followed beyond the data only where they help to predict the last states from the first ones
    follow = gain is not None and gain.forecast_log_score_gain > 0
    facts, ranges = problem.design.facts, ranges_of(problem.design.rows)
    return build_extension(draws, facts, ranges, courses=follow, law=learned)


def insufficient(missing: str, design: Design) -> Report:
    """The report of a campaign with too little data to judge."""
    summary = f"Too little data for a diagnosis: {missing}"
    return Report(verdict=Verdict.INSUFFICIENT_DATA, summary=summary, notes=design.notes)


def _notes(
    baseline: Baseline, posterior: Posterior, judgement: Judgement, raw: Sequence[RawEvidence]
) -> tuple[str, ...]:
    """Notes of the baseline, of raw records, of fits that did not converge, and on an outlying run where the case is
    open."""
    notes = [*baseline.notes, *(f"{record.effect}: {record.note}." for record in raw)]
    ran_out = [cause for cause in judgement.stand if cause.fit.status is FitStatus.OUT_OF_STEPS]
    unfinished = [" and ".join(map(effect_name, cause.slugs)) for cause in ran_out]
    if posterior.null.fit.status is FitStatus.OUT_OF_STEPS and posterior.probabilities[NOTHING] > criteria.NEGLIGIBLE:
        unfinished.append("nothing at work")
    ended = "ended before its optimum; its probability may be larger than stated."
    notes += [f"convergence: the fit with {name} {ended}" for name in unfinished]
    if judgement.verdict in {Verdict.CAUSE_AMBIGUOUS, Verdict.UNEXPLAINED_STRUCTURE}:
        # the first baseline before the better one, whose laws may have bent until an outlying run fits
        first_note = outlying_run(baseline.problem.exact, baseline.exact)
        notes.append(first_note or outlying_run(posterior.problem, posterior.null.fit))
    return tuple(note for note in notes if note)
