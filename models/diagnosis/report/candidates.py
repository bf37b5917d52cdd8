"""The candidates of a report: each effect that competed, with its probability, evidence and estimated amplitude."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from models.diagnosis.criteria import LEAST_LISTED
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import sized
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.explanations.sizes import Size
from models.diagnosis.explanations.verdict import Explanation, Judgement
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import amplitude_deviations
from models.diagnosis.raw_records.evidence import RawEvidence
from models.diagnosis.report.report import Candidate


def candidates_of(
    problem: FitProblem, judgement: Judgement, raw: Sequence[RawEvidence], sizes: Mapping[str, Size]
) -> tuple[Candidate, ...]:
    """Each effect as the verdict has it, else alone, else beside the one that it goes with best."""
    records = {record.effect: record for record in raw}
    alone = [fitted for fitted in judgement.others if len(fitted.slugs) == 1]
    candidates = []
    for slug, probability in judgement.probabilities.items():
        if probability < LEAST_LISTED and slug not in judgement.causes:
            continue
        fitted = next((f for f in (*judgement.stand, *alone, *judgement.others) if slug in f.slugs), None)
        evidence = judgement.evidence.get(slug, 0.0)
        if fitted is not None:
            place = fitted.slugs.index(slug)
            estimate = _estimate(
                slug, fitted.fit.effects[place].amplitude, amplitude_deviations(problem, fitted.fit)[place]
            )
            if slug in sizes:
                estimate = _sized(slug, sizes[slug])
            evidence = fitted.evidence
        elif slug in records:
            estimate, evidence = _finite_estimate(records[slug].estimate), records[slug].log_evidence
        else:  # screened only, or an oil temperature that was not measured
            estimate = _estimate(slug, 0.0, sized(BY_SLUG[slug], problem.design.facts).prior_sd)
        candidates.append(
            Candidate(
                effect=slug,
                title=BY_SLUG[slug].title,
                probability=probability,
                log_evidence_gain=_finite(evidence),
                estimate=estimate,
                beside=() if fitted is None else tuple(other for other in fitted.slugs if other != slug),
                fit=None if fitted is None else fitted.fit.status,
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
