"""The candidates of a report: each effect that competed, with its probability, evidence and estimated amplitude."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.diagnosis.attribution.evidence import Hypothesis
from models.diagnosis.attribution.sizes import Size
from models.diagnosis.attribution.verdict import Explanation, Judgement
from models.diagnosis.criteria import LEAST_LISTED
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import sized
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import amplitude_deviations
from models.diagnosis.report.report import Candidate


def candidates_of(
    problem: FitProblem,
    judgement: Judgement,
    hypotheses: Sequence[Hypothesis],
    raw: Sequence[RawEvidence],
    sizes: Mapping[str, Size],
) -> tuple[Candidate, ...]:
    """Each effect as the verdict has it, else alone, else beside the one that it goes with best."""
    records = {record.effect: record for record in raw}
    alone = [hypothesis for hypothesis in hypotheses if len(hypothesis.effects) == 1 and hypothesis.usable]
    unmeasured = judgement.comparison.unmeasured if judgement.comparison is not None else None
    candidates = []
    for slug, probability in judgement.probabilities.items():
        if probability < LEAST_LISTED and slug not in judgement.causes:
            continue
        beside: tuple[str, ...] = ()
        hypothesis = next((h for h in (*judgement.credible, *alone, *hypotheses) if slug in h.slugs), None)
        if hypothesis is not None and hypothesis.fit is not None:
            place = hypothesis.slugs.index(slug)
            deviation = amplitude_deviations(problem, hypothesis.fit)[place]
            estimate = _estimate(slug, hypothesis.fit.effects[place].amplitude, deviation)
            if slug in sizes:
                estimate = _sized(slug, sizes[slug])
            evidence = hypothesis.evidence
            beside = tuple(other for other in hypothesis.slugs if other != slug)
        elif slug in records:
            estimate, evidence = _finite_estimate(records[slug].estimate), records[slug].log_evidence
        else:  # screened only, or an oil temperature that was not measured
            estimate = _estimate(slug, 0.0, sized(BY_SLUG[slug], problem.design.facts).prior_sd)
            evidence = hypothesis.evidence if hypothesis is not None else (unmeasured or 0.0)
        candidates.append(
            Candidate(
                effect=slug,
                title=BY_SLUG[slug].title,
                probability=probability,
                log_evidence_gain=_finite(evidence),
                estimate=estimate,
                beside=beside,
                fit=None if hypothesis is None else hypothesis.status,
            )
        )
    return tuple(candidates)


def _estimate(slug: str, amplitude: float, deviation: float) -> Estimate:
    effect = BY_SLUG[slug]
    return Estimate(
        name=effect.amplitude,
        value=_finite(amplitude * effect.scale),
        sd=_finite(deviation * effect.scale),
        unit=effect.unit,
        one_sided=effect.positive,
    )


def _sized(slug: str, size: Size) -> Estimate:
    scale = BY_SLUG[slug].scale
    low, high = (_finite(scale * end) for end in size.interval)
    return replace(_estimate(slug, size.value, size.sd), stated_interval=(low, high), stated_sign=1.0 - size.other_sign)


def _finite_estimate(estimate: Estimate) -> Estimate:
    return Estimate(name=estimate.name, value=_finite(estimate.value), sd=_finite(estimate.sd), unit=estimate.unit)


def with_signs(explanations: Iterable[Explanation], candidates: Iterable[Candidate]) -> tuple[Explanation, ...]:
    """Explanations with the probability that the least certain of their effects' signs is right."""
    signs = {candidate.effect: candidate.estimate.sign_probability for candidate in candidates}
    return tuple(
        replace(
            explanation,
            sign_probability=min(
                (sign for slug in explanation.effects if (sign := signs.get(slug)) is not None), default=None
            ),
        )
        for explanation in explanations
    )


def _finite(value: float) -> float:
    return float(np.clip(value, -1e300, 1e300))
