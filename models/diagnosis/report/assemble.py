"""The report: everything that a judgement says, in public terms."""

from collections.abc import Sequence

import numpy as np

from models.diagnosis.attribution.decide import CLOSE, OVER_NOTHING, Judgement
from models.diagnosis.attribution.evidence import Hypothesis, finite
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import Design
from models.diagnosis.detection.alarm import Lead
from models.diagnosis.detection.lack_of_fit import axes_of, misfit_of
from models.diagnosis.detection.raw_records.evidence import RawEvidence
from models.diagnosis.detection.view import View, amplitude_deviations
from models.diagnosis.effects.catalogue import BY_SLUG
from models.diagnosis.effects.effect import sized
from models.diagnosis.effects.estimate import Estimate
from models.diagnosis.effects.uncatalogued.catalogue import UNCATALOGUED_BY_SLUG
from models.diagnosis.experiments.test_plan import Rival, advise
from models.diagnosis.extension import Extension, build_extension
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit, Priors
from models.diagnosis.report.maps import loop_traces, residual_maps
from models.diagnosis.report.outlying_run import odd_run
from models.diagnosis.report.report import Candidate, Gain, Report, Verdict, Visible
from models.diagnosis.report.summary import Findings, summarise
from models.diagnosis.validation.held_out import measure_gain
from models.diagnosis.validation.smooth_correction import AXES as SMOOTH_AXES
from models.diagnosis.validation.smooth_correction import smooth_fit

#: λ [nats] at which an effect is seen 90 % of the time.
SEEN = 11.0
#: Candidates with less than this probability are not listed.
LEAST_PROBABILITY = 1e-3
#: An extension whose held-out error is more than this times the baseline's is not proposed.
MOST_WORSE = 1.02
#: Hypotheses so much [nats] behind may come back when another test is made.
NEARBY = 8.0
#: Verdicts that leave something to be found out.
OPEN = {Verdict.CAUSE_AMBIGUOUS, Verdict.UNEXPLAINED_STRUCTURE}
WITHHELD = "The extension is not proposed: runs that it had not seen were {}."
MISSED, UNLIKELY = "missed by more with it than without", "less probable with it than without, by {:.3g} nats"


def report_of(
    campaign: Campaign,
    design: Design,
    noise: Noise,
    priors: Priors,
    view: View,
    judgement: Judgement,
    hypotheses: Sequence[Hypothesis],
    stranger: Hypothesis | None,
    raw: Sequence[RawEvidence],
    leads: dict[str, Lead],
    notes: tuple[str, ...],
    rng: np.random.Generator,
) -> Report:
    """Assemble it: candidates, misfits, gain, advice, maps, loops, extension, summary."""
    fits = [each.fit for each in judgement.standing if each.fit is not None]
    where = axes_of(view, leads, raw, stranger)
    extended = fits[0] if fits else None
    if judgement.verdict is Verdict.UNEXPLAINED_STRUCTURE:
        extended = smooth_fit(
            design, noise, priors, view.fit, [each.axis for each in where if each.axis in SMOOTH_AXES]
        )
    gain = None if extended is None else measure_gain(design, noise, priors, view.fit, extended, rng)
    if harmful(gain):
        judgement = judgement.unsure()
    candidates = _candidates(design, noise, priors, judgement, hypotheses, raw)
    baseline = misfit_of(design, noise, view.fit, where)
    after = None
    if extended is not None:
        left = axes_of(judgement.view, {}) if fits and judgement.view is not None else ()
        after = misfit_of(design, noise, extended, left)
    advice = advise(campaign, design, noise, priors, *_race(judgement, hypotheses))
    visible = visible_of(view)
    extension = _extension(design, noise, priors, judgement, gain)
    said = (*notes, *(f"{each.effect}: {each.note}." for each in raw))
    if judgement.verdict in OPEN:
        said = (*said, *filter(None, [odd_run(design, noise, view.fit)]))
    if extension is not None and gain is not None and harmful(gain):
        extension, said = None, (*said, withheld(gain))
    findings = Findings(
        verdict=judgement.verdict,
        causes=judgement.causes,
        candidates=candidates,
        baseline=baseline,
        extended=after,
        gain=gain,
        advice=advice,
        visible=visible,
        notes=said,
        tests=len(design.runs),
        states=int(design.facts.states.size),
        looks=_looks(judgement, hypotheses, stranger),
        scatter=noise.run_gain,
    )
    return Report(
        verdict=judgement.verdict,
        causes=judgement.causes,
        summary=summarise(findings),
        candidates=candidates,
        baseline=baseline,
        extended=after,
        gain=gain,
        advice=advice,
        visible=visible,
        maps=residual_maps(design, noise, view.fit, extended),
        loops=loop_traces(design, view.fit, extended),
        extension=extension,
        notes=said,
        statistics=_statistics(leads, judgement),
    )


def _looks(judgement: Judgement, hypotheses: Sequence[Hypothesis], stranger: Hypothesis | None) -> str:
    """What is not in the catalogue and does about as well as the best that is, if it comes to anything."""
    if stranger is None or judgement.verdict not in OPEN:
        return ""
    least = max((each.evidence - CLOSE for each in hypotheses if finite(each)), default=0.0)
    return UNCATALOGUED_BY_SLUG[stranger.slugs[0]].description if stranger.evidence >= max(least, OVER_NOTHING) else ""


def _race(judgement: Judgement, hypotheses: Sequence[Hypothesis]) -> tuple[list[Rival], list[Rival]]:
    """The hypotheses that stand, and those of as many effects that are not far behind, best first."""
    standing = [Rival(fit=each.fit, evidence=each.evidence) for each in judgement.standing if each.fit is not None]
    if not standing:
        return [], []
    out = {each.slugs for each in judgement.standing}
    alike = [
        each
        for each in hypotheses
        if each.slugs not in out
        and len(each.effects) == len(judgement.standing[0].effects)
        and each.evidence > standing[0].evidence - NEARBY
    ]
    alike.sort(key=lambda each: -each.evidence)
    return standing, [Rival(fit=each.fit, evidence=each.evidence) for each in alike if each.fit is not None]


def insufficient(missing: str, design: Design) -> Report:
    """Nothing can be judged."""
    return Report(
        verdict=Verdict.INSUFFICIENT_DATA,
        causes=(),
        summary=f"Too little data for a pooled baseline: {missing}",
        candidates=(),
        baseline=None,
        extended=None,
        gain=None,
        advice=(),
        visible=(),
        maps=None,
        loops=(),
        extension=None,
        notes=design.notes,
        statistics={},
    )


def _candidates(
    design: Design,
    noise: Noise,
    priors: Priors,
    judgement: Judgement,
    hypotheses: Sequence[Hypothesis],
    raw: Sequence[RawEvidence],
) -> tuple[Candidate, ...]:
    """Each effect as the verdict has it, else alone, else beside the one that it goes with best."""
    seen = {each.effect: each for each in raw}
    alone = [each for each in hypotheses if len(each.effects) == 1 and finite(each)]
    found = []
    for slug, probability in judgement.probabilities.items():
        if probability < LEAST_PROBABILITY and slug not in judgement.causes:
            continue
        beside: tuple[str, ...] = ()
        first = next((each for each in (*judgement.standing, *alone, *hypotheses) if slug in each.slugs), None)
        if first is None or first.fit is None:
            usual = sized(BY_SLUG[slug], design.facts).prior_sd
            estimate = _sound(seen[slug].estimate) if slug in seen else _estimate(slug, 0.0, usual)
            known = first.evidence if first else judgement.statistics.get(f"{slug}_unmeasured", 0.0)
            evidence = seen[slug].log_evidence if slug in seen else known
        else:
            place = first.slugs.index(slug)
            deviation = amplitude_deviations(design, noise, priors, first.fit)[place]
            estimate = _estimate(slug, first.fit.effects[place].amplitude, deviation)
            evidence = first.evidence
            beside = tuple(each for each in first.slugs if each != slug)
        found.append(
            Candidate(
                effect=slug,
                title=BY_SLUG[slug].title,
                probability=probability,
                log_evidence_gain=_finite(evidence),
                estimate=estimate,
                beside=beside,
            )
        )
    return tuple(found)


def _estimate(slug: str, amplitude: float, deviation: float) -> Estimate:
    effect = BY_SLUG[slug]
    return Estimate(
        name=effect.amplitude,
        value=_finite(amplitude * effect.scale),
        sd=_finite(deviation * effect.scale),
        unit=effect.unit,
    )


def _sound(told: Estimate) -> Estimate:
    return Estimate(name=told.name, value=_finite(told.value), sd=_finite(told.sd), unit=told.unit)


def harmful(gain: Gain | None) -> bool:
    """Whether an extension foretells what it has not seen worse than the baseline does."""
    return gain is not None and (gain.rmse_after > MOST_WORSE * gain.rmse_before or gain.log_score_gain < 0)


def withheld(gain: Gain) -> str:
    """Why an extension that foretells worse is not proposed."""
    if gain.rmse_after > MOST_WORSE * gain.rmse_before:
        return WITHHELD.format(MISSED)
    return WITHHELD.format(UNLIKELY.format(-gain.log_score_gain))


def visible_of(view: View) -> tuple[Visible, ...]:
    """The smallest amplitude of each effect that would have been seen, at the middle one of the shapes that show at all, and
    at the best of them."""
    info = np.diag(view.likely.info)
    sizes: dict[str, list[float]] = {}
    effects = {column.effect.slug: column.effect for column in view.columns}
    for column, seen in zip(view.columns, info[view.effects], strict=True):
        size = float(np.sqrt(2 * SEEN / seen)) * column.effect.scale if seen > 0 else np.inf
        if np.isfinite(size):
            sizes.setdefault(column.effect.slug, []).append(size)
    return tuple(
        Visible(
            effect=slug,
            amplitude=float(np.quantile(each, 0.5, method="higher")),
            least=min(each),
            usual=effects[slug].prior_sd * effects[slug].scale,
            unit=effects[slug].unit,
        )
        for slug, each in sizes.items()
    )


def _extension(
    design: Design, noise: Noise, priors: Priors, judgement: Judgement, gain: Gain | None
) -> Extension | None:
    fitted: list[tuple[float, Fit, list[float]]] = []
    for each in judgement.standing:
        if each.fit is not None:
            weight = max(min(judgement.probabilities.get(slug, 0.0) for slug in each.slugs), 1e-6)
            fitted.append((weight, each.fit, amplitude_deviations(design, noise, priors, each.fit)))
    if not fitted:
        return None
    return build_extension(fitted, design.facts, courses=gain is not None and gain.remaining > 0)


def _statistics(leads: dict[str, Lead], judgement: Judgement) -> dict[str, float]:
    found = {}
    for name, each in leads.items():
        found[f"{name}_value"] = each.value
        found[f"{name}_threshold"] = each.threshold
        found[f"{name}_p_value"] = each.p_value
    return {name: value for name, value in {**found, **judgement.statistics}.items() if np.isfinite(value)}


def _finite(value: float) -> float:
    return float(np.clip(np.nan_to_num(value), -1e300, 1e300))
