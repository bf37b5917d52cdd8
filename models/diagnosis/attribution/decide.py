"""The verdict: every decision on it, before validation (`decide`) and after (`revise`).

Before. An alarm must be confirmed, by an effect's evidence, by an axis of structure, or by its own size. Hypotheses within
CREDIBLE_MARGIN nats of the best, and CREDIBLE_MARGIN_SHARE λ, are the credible set. Two effects must gain PAIR_LOG_ODDS nats
over the best alone, and TOLERANCE λ more where that one passes its check by itself. Structure without a name competes. After
the best is fitted, what is left must look like noise, up to TOLERANCE λ, and its amplitude must be one in all parts of the
data, up to PARTS_TOLERANCE λ; else the structure is unexplained. Vibrations that raw records show are causes of their own.

After. Two causes that predict held-out runs worse than the baseline, and whose sizes differ between parts of the data, are
ambiguous; an extension that predicts worse is withheld.

Templates have a model discrepancy (`effects.template_discrepancy`), so evidence includes what they err by.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.diagnosis.attribution.check import Checks
from models.diagnosis.attribution.evidence import Hypothesis, HypothesisStatus
from models.diagnosis.attribution.explanations import read, reconciled
from models.diagnosis.attribution.posterior import (
    PriorOdds,
    kept_share,
    unshared,
    weights_of,
    with_unmeasured,
)
from models.diagnosis.attribution.search import SearchResult
from models.diagnosis.attribution.verdict import UNCATALOGUED, Comparison, HeldOut, Judgement, Proposal, Verdict
from models.diagnosis.criteria import (
    AXES_LOG_ODDS,
    CREDIBLE_MARGIN,
    CREDIBLE_MARGIN_PAIRS,
    CREDIBLE_MARGIN_SHARE,
    DOUBT,
    LEAST_EVIDENCE,
    LEAST_LINE,
    LEAST_NAMED,
    LEAST_REMAINDER_P_VALUE,
    LEAST_SECOND_NAMED,
    MOST_CHECKED,
    MOST_LEFT,
    MOST_UNDONE,
    MOST_WORSE,
    PAIR_LOG_ODDS,
    STRUCTURE_FROM,
    STRUCTURE_SHARE,
    UNCONFIRMED,
    UNCONFIRMED_EFFECTS,
    VIBRATION_PROBABILITY,
    VIBRATION_TRACE,
    VIBRATION_TRACE_UNEXPLAINED,
    WRONG,
)
from models.diagnosis.design.facts import Facts
from models.diagnosis.detection.alarm import Alarms
from models.diagnosis.detection.raw_records.evidence import FIXED_LINE, RawEvidence
from models.diagnosis.effects.catalogue import BY_SLUG, CATALOGUE
from models.diagnosis.effects.catalogued import oil_temperature
from models.diagnosis.effects.effect import Kind, Resemblance

_UNKNOWN = (UNCATALOGUED,)


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseEvidence:
    """What a verdict is decided on: the alarms, the search (None where nothing called for one), the evidence [nats] of
    structure that no effect explains (on the axis that shows most of it, or of an uncatalogued rig fault), that of an oil
    temperature that was not measured (-inf where it was), raw records, and the campaign's facts."""

    alarms: Alarms
    search: SearchResult | None
    structure: float
    unmeasured: float
    raw: tuple[RawEvidence, ...]
    facts: Facts


def calls_for_search(alarms: Alarms, raw: Iterable[RawEvidence]) -> bool:
    """Whether hypotheses are to be searched: an alarm is raised, or raw records show an effect other than a vibration."""
    return alarms.raised or any(record.effect in BY_SLUG and not _is_vibration(record) for record in raw)


def decide(case: CaseEvidence, checks: Checks) -> Judgement:
    """The judgement before validation."""
    judgement = _adequate(case.alarms)
    if case.search is not None and confirmed(case.alarms, case.search.hypotheses, max(case.structure, case.unmeasured)):
        imitable = like_temperature(case.facts) if case.unmeasured > -np.inf else frozenset()
        judgement = judge(case.search.hypotheses, case.structure, case.unmeasured, imitable, checks)
    judgement = with_vibrations(judgement, case.raw)
    return judgement if case.search is None else replace(judgement, fault=_fault_as_good(case.search))


def _adequate(alarms: Alarms) -> Judgement:
    """Nothing is wrong, up to what the rarest alarm says against it: a p-value is a Bayes factor of 1/(-e p ln p) at most
    (Sellke, Bayarri and Berger, Am. Stat. 55 (2001) 62)."""
    p_value = min(
        max(min(alarm.p_value for alarm in (alarms.effects, alarms.contrasts, alarms.lines)), 1e-300), 1 / math.e
    )
    against = WRONG / (1.0 - WRONG) / (-math.e * p_value * np.log(p_value))
    weights = {(): 1.0, _UNKNOWN: float(against)}
    return judged(Verdict.MODEL_ADEQUATE, weights, {(): 1.0})


def revise(judgement: Judgement, held_out: HeldOut | None) -> Judgement:
    """The judgement after validation; `held_out` is how the extended model does, None where nothing could be held out."""
    worse_error = held_out is not None and held_out.rmse_after > MOST_WORSE * held_out.rmse_before
    worse_score = held_out is not None and held_out.log_score_gain < 0
    if worse_error or worse_score:
        judgement = _unsure(judgement)
    proposal = Proposal.NONE
    if any(hypothesis.fit is not None for hypothesis in judgement.credible):
        proposal = Proposal.WITHHELD_LOG_SCORE if worse_score else Proposal.PROPOSED
        proposal = Proposal.WITHHELD_ERROR if worse_error else proposal
    follow = held_out is not None and held_out.forecast_log_score_gain > 0
    return replace(judgement, proposal=proposal, follow_courses=follow)


def confirmed(alarms: Alarms, hypotheses: Iterable[Hypothesis], otherwise: float) -> bool:
    """Whether an alarm holds: an effect has evidence, or something else has (`otherwise` nats), or it is far beyond its
    threshold."""
    evidence = max((hypothesis.usable_evidence for hypothesis in hypotheses), default=-np.inf)
    loud = any(
        alarm.raised and alarm.value > alarm.threshold + beyond
        for alarm, beyond in (
            (alarms.effects, UNCONFIRMED_EFFECTS),
            (alarms.contrasts, UNCONFIRMED),
            (alarms.lines, UNCONFIRMED),
        )
    )
    return loud or max(evidence, otherwise) >= LEAST_EVIDENCE


def judge(
    hypotheses: Sequence[Hypothesis],
    structure: float,
    unmeasured: float,
    imitable: frozenset[str],
    checks: Checks,
) -> Judgement:
    """The verdict on hypotheses, best first, that compete with structure without a name and with an unmeasured oil
    temperature [nats]; `imitable` are the effects that such a temperature could look like."""
    usable = [hypothesis for hypothesis in hypotheses if hypothesis.usable]
    singles = [hypothesis for hypothesis in usable if len(hypothesis.effects) == 1]
    if not singles:
        return judged(Verdict.UNEXPLAINED_STRUCTURE, {}, {_UNKNOWN: 1.0})
    best, odds = _best(singles, [hypothesis for hypothesis in usable if len(hypothesis.effects) == 2], checks)
    credible = credible_set(best, usable, odds, checks)
    leader = credible[0] if credible else best  # the best may have failed its check, and another be promoted
    comparison = Comparison(
        best_drop=leader.drop,
        structure=structure,
        tolerance=leader.tolerance,
        credible=len(credible),
        check=checks(leader),
    )
    weights = weights_of(hypotheses, best, odds, checks.excess, structure)
    causes = tuple(dict.fromkeys(slug for hypothesis in credible for slug in hypothesis.slugs))
    temperature = oil_temperature.EFFECT.slug
    imitated = unmeasured > max(best.evidence - CREDIBLE_MARGIN - best.tolerance, LEAST_EVIDENCE)
    if imitated:
        weights = with_unmeasured(weights, unmeasured, best)
        causes = tuple(dict.fromkeys((temperature, *causes)))
        comparison = replace(comparison, unmeasured=unmeasured)
    elif not credible or not _leads(leader, odds, structure):
        share = kept_share(best, checks(best))
        weights = {effects: share * weight for effects, weight in weights.items()}
        weights[_UNKNOWN] = weights.get(_UNKNOWN, 0.0) + 1.0 - share
        return judged(Verdict.UNEXPLAINED_STRUCTURE, weights, {_UNKNOWN: 1.0}, comparison=comparison)
    elif imitable & set(causes):
        imitated, causes = True, (*causes, temperature)
    unfinished = leader.status is HypothesisStatus.OUT_OF_STEPS
    doubtful = imitated or unfinished or len(credible) > 1 or not _remainder_is_noise(leader, comparison)
    probabilities = {slug: sum(w for effects, w in weights.items() if slug in effects) for slug in causes}
    likely = () if doubtful else _likely(causes, probabilities)
    if likely and probabilities[likely[0]] >= LEAST_NAMED:
        return judged(Verdict.CAUSE_NAMED, weights, {likely: 1.0}, credible=credible, comparison=comparison)
    rival: dict[tuple[str, ...], float]
    if imitated:
        rival = {(temperature,): DOUBT, **({leader.slugs: 1.0 - DOUBT} if credible else {_UNKNOWN: DOUBT})}
    elif len(credible) > 1:
        rival = {hypothesis.slugs: 1.0 for hypothesis in credible}
    else:
        rival = _with_a_doubt(leader)
    return judged(Verdict.CAUSE_AMBIGUOUS, weights, rival, credible=credible, comparison=comparison)


def judged(
    verdict: Verdict,
    weights: Mapping[tuple[str, ...], float],
    target: Mapping[tuple[str, ...], float],
    *,
    credible: tuple[Hypothesis, ...] = (),
    comparison: Comparison | None = None,
) -> Judgement:
    """A judgement whose explanations are the weights, as far as they read as the verdict, and tend to `target` else."""
    explanations = reconciled(weights, target, verdict)
    reads, causes = read(explanations)
    return Judgement(verdict=reads, causes=causes, credible=credible, explanations=explanations, comparison=comparison)


def _with_a_doubt(leader: Hypothesis) -> dict[tuple[str, ...], float]:
    """A hypothesis alone, or beside something that is not in the catalogue."""
    return {leader.slugs: 1.0 - DOUBT, (*leader.slugs, UNCATALOGUED): DOUBT}


def like_temperature(facts: Facts) -> frozenset[str]:
    """The effects that an oil temperature that was not measured could look like in this campaign."""
    alike = {Resemblance.ALWAYS} if facts.oil_changes else {Resemblance.ALWAYS, Resemblance.UNLESS_LOGGED}
    return frozenset(effect.slug for effect in CATALOGUE if effect.resembles_temperature in alike)


def _best(singles: Sequence[Hypothesis], pairs: Sequence[Hypothesis], checks: Checks) -> tuple[Hypothesis, PriorOdds]:
    """The best hypothesis of singles and pairs, each best first, and the prior odds that it was found with."""
    alone = singles[0]
    promising = bool(pairs) and pairs[0].evidence > alone.evidence + PAIR_LOG_ODDS
    odds = PriorOdds(slack=0.0 if promising and not checks(alone).passed else alone.tolerance)
    best = max(pairs, key=lambda pair: pair.evidence - odds(pair), default=alone)
    ahead = best.evidence - odds(best) > alone.evidence
    explains = not ahead or checks(best).undoing <= MOST_UNDONE or not checks(alone).passed
    return (best if ahead and explains else alone), odds


def credible_set(
    best: Hypothesis, usable: Sequence[Hypothesis], odds: PriorOdds, checks: Checks
) -> tuple[Hypothesis, ...]:
    """What is better than nothing and cannot be distinguished from the best, best first; none where no member passes its
    check."""
    singles = [hypothesis for hypothesis in usable if len(hypothesis.effects) == 1]
    # pairs without a best single effect are its rivals; pairs with it add to the same explanation
    pool = [
        hypothesis
        for hypothesis in usable
        if len(hypothesis.effects) == len(best.effects)
        or (len(hypothesis.effects) > len(best.effects) and not set(best.slugs) & set(hypothesis.slugs))
    ]
    pool.sort(key=lambda hypothesis: odds(hypothesis) - hypothesis.evidence)

    def is_near(hypothesis: Hypothesis) -> bool:
        worth = hypothesis.evidence - odds(hypothesis)
        lead = best.evidence - odds(best) - worth
        margin = CREDIBLE_MARGIN if len(hypothesis.effects) == 1 else CREDIBLE_MARGIN_PAIRS
        return (hypothesis is best or worth > 0.0) and lead <= margin + CREDIBLE_MARGIN_SHARE * unshared(
            best, hypothesis, singles
        )

    near = [hypothesis for hypothesis in pool if is_near(hypothesis)][:MOST_CHECKED]
    passed = [hypothesis for hypothesis in near if checks(hypothesis).passed]
    return tuple(hypothesis for hypothesis in near if passed and checks(hypothesis).excess <= CREDIBLE_MARGIN)


def _leads(leader: Hypothesis, odds: PriorOdds, structure: float) -> bool:
    """Whether a hypothesis has evidence over nothing and over structure without a name."""
    unexplained = structure - AXES_LOG_ODDS - STRUCTURE_SHARE * max(leader.drop - STRUCTURE_FROM, 0.0)
    return leader.evidence - odds(leader) >= max(LEAST_EVIDENCE, unexplained)


def _remainder_is_noise(leader: Hypothesis, comparison: Comparison) -> bool:
    """Whether what is left (of two causes the parts, too) is no oddity, beyond what a right template leaves."""
    check = comparison.check
    p_value = check.left.p_value if len(leader.effects) == 1 else min(check.left.p_value, check.parts.p_value)
    return bool(p_value * np.exp(min(comparison.tolerance, MOST_LEFT)) >= LEAST_REMAINDER_P_VALUE)


def _likely(causes: tuple[str, ...], probabilities: dict[str, float]) -> tuple[str, ...]:
    """One cause, or of two those that are likely enough."""
    return causes if len(causes) == 1 else tuple(slug for slug in causes if probabilities[slug] >= LEAST_SECOND_NAMED)


def with_vibrations(judgement: Judgement, raw: Iterable[RawEvidence]) -> Judgement:
    """The judgement with what raw records show: vibrations of the catalogue are causes of their own, where they are more
    than what a wrong template may leave behind; another line alone is structure without a name."""
    comparison = judgement.comparison
    least = CREDIBLE_MARGIN + 2 * (comparison.tolerance if comparison else 0.0)
    clear = [record for record in raw if record.log_evidence > least]
    vibrations = [record for record in clear if _is_vibration(record)]
    loudest = max((record.log_evidence for record in vibrations), default=0.0)
    unexplained = judgement.verdict is Verdict.UNEXPLAINED_STRUCTURE
    share = VIBRATION_TRACE_UNEXPLAINED if unexplained else VIBRATION_TRACE
    if 0.0 < (max(comparison.best_drop, comparison.structure) if comparison else 0.0) < share * loudest:
        judgement = judged(Verdict.MODEL_ADEQUATE, {}, {(): 1.0}, comparison=comparison)
    judgement = _joined(judgement, tuple(record.effect for record in vibrations))
    lined = any(record.effect == FIXED_LINE and record.log_evidence > LEAST_LINE for record in clear)
    if lined and judgement.verdict is Verdict.MODEL_ADEQUATE:
        return judged(Verdict.UNEXPLAINED_STRUCTURE, {}, {_UNKNOWN: 1.0}, comparison=comparison)
    return judgement


def _is_vibration(record: RawEvidence) -> bool:
    return record.effect in BY_SLUG and BY_SLUG[record.effect].kind is Kind.VIBRATION


def _joined(judgement: Judgement, vibrations: tuple[str, ...]) -> Judgement:
    """With vibrations that raw records show: they are causes beside the others, or the only ones."""
    if not vibrations:
        return judgement
    before = {explanation.effects: explanation.probability for explanation in judgement.explanations}
    after = {(*effects, *vibrations): weight for effects, weight in before.items()}
    weights = {effects: (1.0 - VIBRATION_PROBABILITY) * weight for effects, weight in before.items()}
    for effects, weight in after.items():
        weights[effects] = weights.get(effects, 0.0) + VIBRATION_PROBABILITY * weight
    verdict = judgement.verdict
    if verdict in {Verdict.MODEL_ADEQUATE, Verdict.CAUSE_NAMED}:
        verdict, after = Verdict.CAUSE_NAMED, {(*judgement.causes, *vibrations): 1.0}
    return judged(verdict, weights, after, credible=judgement.credible, comparison=judgement.comparison)


def _fault_as_good(search: SearchResult) -> str | None:
    """The uncatalogued rig fault that does about as well as the best effect, if it has evidence."""
    if search.fault is None:
        return None
    usable = [hypothesis.evidence for hypothesis in search.hypotheses if hypothesis.usable]
    least = max((evidence - CREDIBLE_MARGIN for evidence in usable), default=0.0)
    return search.fault.slugs[0] if search.fault.evidence >= max(least, LEAST_EVIDENCE) else None


def _unsure(judgement: Judgement) -> Judgement:
    """No cause is named where two predict worse than none and ask for different sizes in parts of the data."""
    both = judgement.credible[0].slugs if judgement.credible else ()
    pair = judgement.verdict is Verdict.CAUSE_NAMED and len(both) > 1 and set(both) <= set(judgement.causes)
    uneven = judgement.comparison is not None and judgement.comparison.check.parts.p_value < LEAST_REMAINDER_P_VALUE
    if not (pair and uneven):
        return judgement
    weights = {explanation.effects: explanation.probability for explanation in judgement.explanations}
    doubted = judged(Verdict.CAUSE_AMBIGUOUS, weights, _with_a_doubt(judgement.credible[0]))
    return replace(judgement, verdict=doubted.verdict, causes=doubted.causes, explanations=doubted.explanations)
