"""The diagnosis of a campaign: baseline, alarm, candidates, verdict, and what follows from it."""

from dataclasses import dataclass, replace

import numpy as np

from models.diagnosis.attribution.decide import CLOSE, OVER_NOTHING, Judgement, judge
from models.diagnosis.attribution.evidence import Hypothesis, finite
from models.diagnosis.attribution.screening import Column, columns_of
from models.diagnosis.attribution.search import Found, hypotheses_of
from models.diagnosis.attribution.unmeasured_temperature import temperature_evidence
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.baseline.prediction import frame_of
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.detection.alarm import CONTRASTS_SHARE, EFFECTS_SHARE, Lead, lead
from models.diagnosis.detection.lack_of_fit import FIXED_LINE, axes_of
from models.diagnosis.detection.periodogram import lines
from models.diagnosis.detection.raw_records.evidence import RawEvidence, raw_evidence
from models.diagnosis.detection.view import View, view_of
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.effect import Kind, sized
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.diagnosis.pooled_fit.gauss_newton import Fit, Priors, fit, priors_of
from models.diagnosis.pooled_fit.projection import gram_of, likely_curve_gain
from models.diagnosis.pooled_fit.starts import sober, starting_laws
from models.diagnosis.report.assemble import insufficient, report_of
from models.diagnosis.report.report import Report, Verdict

#: Fewer plateaus or speeds are no campaign.
FEWEST_ROWS, FEWEST_SPEEDS = 24, 6
#: A line of one frequency at all speeds is structure from so much evidence [nats] on: nothing else need confirm it.
LEAST_LINE = 14.0
#: An alarm that neither an effect nor an axis of structure confirms must be so much [nats] beyond its threshold: about
#: five times rarer by chance. That of the effects more: where no effect comes to anything once it is refitted, the shape
#: that raised it was one of many.
UNCONFIRMED, UNCONFIRMED_EFFECTS = 1.6, 6.0
#: Gauss-Newton steps after which starts are compared.
ROUGH = 12
#: So many plateaus determine every curve: one start is enough.
MANY_PLATEAUS = 8000
#: A slow vibration leaves something in averages too: up to this share of its own evidence nothing else is named, and up
#: to a larger one structure without a name is taken for it.
LEFT_BY_VIBRATION, LEFT_WITHOUT_NAME = 0.1, 0.5
#: Torques [Nm] outside are no clutch's.
LEAST_TORQUE, MOST_TORQUE = 1e-6, 1e7


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """The pooled fit without effects, where it started, its noise, its priors, and what was noted on the way."""

    start: Laws
    noise: Noise
    priors: Priors
    fit: Fit
    notes: tuple[str, ...]


def diagnose(campaign: Campaign, *, rng: np.random.Generator, without: frozenset[str] = frozenset()) -> Report:
    """What the baseline gets wrong in this campaign, why, and what an extension gains. The same rng, the same answer.

    Effects whose slugs stand in `without` are taken out of the catalogue.
    """
    design = build_design(campaign)
    missing = missing_for_baseline(design)
    if missing:
        return insufficient(missing, design)
    try:
        with np.errstate(all="ignore"):
            return _diagnosed(campaign, design, without, rng)
    except (np.linalg.LinAlgError, ArithmeticError) as failure:
        return insufficient(f"the pooled fit broke down on these numbers ({failure}).", design)


def _diagnosed(campaign: Campaign, design: Design, without: frozenset[str], rng: np.random.Generator) -> Report:
    baseline = fit_baseline(design)
    if not np.isfinite(baseline.fit.cost):
        return insufficient("no finite torque can be fitted to these numbers.", design)
    effects = [sized(effect, design.facts) for effect in CATALOGUE if effect.slug not in without]
    columns = columns_of(effects, [effect.grid(design.facts) for effect in effects])
    raw = tuple(each for each in raw_evidence(campaign) if each.effect not in without)
    view, leads, found = _looked(design, baseline, columns, raw, rng)
    if found is not None and found.better is not None:  # what the baseline had missed raised the alarm, or hid what did
        baseline = replace(baseline, fit=found.better)
        view, leads, found = _looked(design, baseline, columns, raw, rng)
    judgement = Judgement(verdict=Verdict.MODEL_ADEQUATE)
    if found is None:
        found = Found(noise=baseline.noise, hypotheses=[])
    else:
        unmeasured = -np.inf
        if not design.facts.temperature_measured and "oil_temperature" not in without:
            unmeasured = temperature_evidence(design, found.noise, baseline.priors, baseline.fit)
        structure = max((each.strength for each in axes_of(view, leads, raw, found.stranger)), default=0.0)
        if confirmed(leads, found.hypotheses, max(structure, unmeasured)):
            judgement = judge(design, found.noise, baseline.priors, found.hypotheses, structure, unmeasured, rng)
    return report_of(
        campaign, design, found.noise, baseline.priors, view, with_lines(judgement, raw), found.hypotheses,
        found.stranger, raw, leads, baseline.notes, rng,
    )  # fmt: skip


def _looked(
    design: Design, baseline: Baseline, columns: list[Column], raw: tuple[RawEvidence, ...], rng: np.random.Generator
) -> tuple[View, dict[str, Lead], Found | None]:
    """The view from a baseline, its alarms, and what was found where there is any, or raw records show more than swings."""
    view = view_of(design, baseline.noise, baseline.priors, baseline.fit, columns)
    leads = alarms(design, baseline, view, rng)
    beside = any(each.effect in BY_SLUG and not _vibrates(each) for each in raw)
    if not (beside or any(each.raised for each in leads.values())):
        return view, leads, None
    found = hypotheses_of(design, baseline.noise, baseline.priors, baseline.start, baseline.fit, view, raw)
    return view, leads, found


def missing_for_baseline(design: Design) -> str:
    """What is missing for a pooled baseline, or nothing."""
    steady = design.rows.velocity[design.closed & design.rows.steady]
    if steady.size < FEWEST_ROWS:
        return f"there are {steady.size} plateaus of stationary tests under pressure, and at least {FEWEST_ROWS} are needed."
    speeds = np.unique(np.round(steady / float(steady.max()), 3)).size
    if speeds < FEWEST_SPEEDS:
        return f"there are {speeds} distinct speeds, and at least {FEWEST_SPEEDS} are needed for a Stribeck curve."
    usual, largest = design.usual_torque, float(np.abs(design.torque).max())
    if not (usual > LEAST_TORQUE and largest < MOST_TORQUE):
        return f"torques of {usual:.3g} Nm in the median and {largest:.3g} Nm at most are no clutch's."
    return ""


def fit_baseline(design: Design) -> Baseline:
    """The pooled fit, and the noise that its residuals show, in turns."""
    notes = list(design.notes)
    frame = frame_of(design)
    start = starting_laws(design, frame)
    priors = priors_of(design, start.theta, frame)
    noise = first_noise(design)
    starts = (start, sober(design, start)) if design.plateaus < MANY_PLATEAUS else (start,)
    fitted = min((fit(design, noise, each, priors, steps=ROUGH) for each in starts), key=lambda each: each.cost)
    noise, assumed = estimate_noise(design, fitted.residual, fitted.torque, noise)
    # with a noise that was only assumed a fit may have gone down a wrong valley
    again = min((fit(design, noise, each, priors, steps=ROUGH) for each in starts), key=lambda each: each.cost)
    fitted = min((fit(design, noise, each.laws, priors) for each in (fitted, again)), key=lambda each: each.cost)
    noise, assumed = estimate_noise(design, fitted.residual, fitted.torque, noise)
    fitted = fit(design, noise, fitted.laws, priors)
    curve_gain = likely_curve_gain(gram_of(design, noise, priors, fitted, np.zeros((design.torque.size, 0))))
    if curve_gain > 0.0:
        noise = replace(noise, curve_gain=curve_gain)
        fitted = fit(design, noise, fitted.laws, priors)
    if assumed:
        notes.append("Too few rows to tell noise: 1 % of the torque is assumed.")
    if not design.facts.temperature_measured:
        notes.append("No oil temperature was measured: nothing that it could imitate is named.")
    return Baseline(start=start, noise=noise, priors=priors, fit=fitted, notes=tuple(notes))


def alarms(design: Design, baseline: Baseline, view: View, rng: np.random.Generator) -> dict[str, Lead]:
    """The three statistics of the alarm."""
    one_sided = np.array([float(column.effect.positive) for column in view.columns])
    return {
        "effects": lead(view.projections, view.effects, one_sided, EFFECTS_SHARE, rng),
        "contrasts": lead(view.projections, view.smooth, np.zeros(len(view.contrasts.axes)), CONTRASTS_SHARE, rng),
        "lines": lines(design, baseline.noise, baseline.fit.residual),
    }


def confirmed(leads: dict[str, Lead], hypotheses: list[Hypothesis], otherwise: float) -> bool:
    """Whether an alarm holds: an effect has evidence, or something else has (`otherwise` nats), or it is loud."""
    evidence = max((each.evidence for each in hypotheses if finite(each)), default=-np.inf)
    loud = any(
        each.value > each.threshold + (UNCONFIRMED_EFFECTS if name == "effects" else UNCONFIRMED)
        for name, each in leads.items()
        if each.raised
    )
    return loud or max(evidence, otherwise) >= OVER_NOTHING


def _vibrates(each: RawEvidence) -> bool:
    return each.effect in BY_SLUG and BY_SLUG[each.effect].kind is Kind.VIBRATION


def with_lines(judgement: Judgement, raw: tuple[RawEvidence, ...]) -> Judgement:
    """The verdict with what raw records show beside it: vibrations of the catalogue are causes of their own, where they
    are more than what a wrong template may leave behind; another line alone is structure without a name."""
    least = CLOSE + 2 * judgement.statistics.get("tolerance", 0.0)
    seen = [each for each in raw if each.log_evidence > least]
    known = [each for each in seen if _vibrates(each)]
    loudest = max((each.log_evidence for each in known), default=0.0)
    unnamed = judgement.verdict is Verdict.UNEXPLAINED_STRUCTURE
    share = LEFT_WITHOUT_NAME if unnamed else LEFT_BY_VIBRATION
    if 0.0 < max(judgement.statistics.get(name, 0.0) for name in ("lambda", "structure")) < share * loudest:
        judgement = Judgement(verdict=Verdict.MODEL_ADEQUATE, statistics=judgement.statistics)
    judgement = judgement.joined(tuple(each.effect for each in known))
    lined = any(each.effect == FIXED_LINE and each.log_evidence > LEAST_LINE for each in seen)
    if lined and judgement.verdict is Verdict.MODEL_ADEQUATE:
        return replace(judgement, verdict=Verdict.UNEXPLAINED_STRUCTURE)
    return judgement
