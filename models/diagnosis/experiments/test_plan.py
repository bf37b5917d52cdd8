"""Which test would decide: the trial after which one candidate is most likely left is recommended.

With Δ_ab what a trial adds to λ_ab (`experiments.information`), evidence for a against b would, if a is true, be about
normal afterwards: its mean what it is now, and Δ, and the change of what the freedom of both is worth; its variance 1 + 2Δ
+ (0.4 Δ)². a is left alone where the odds are those of SURE, for every b. Trials are ranked by the probability
of that, over the candidates by their evidence, less 0.005 a run; of those that are sure to decide (SURE) the shortest
comes first. Of a cause without a rival the size is what is left to learn: the trial that narrows it most, less the same a
run.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, softmax

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.design.facts import REFERENCES, facts_of
from models.diagnosis.effects.fitted_effect import FittedEffect
from models.diagnosis.effects.readings import TORQUE_ZERO_SHIFT
from models.diagnosis.effects.thermal import AT_ONCE, OIL_TEMPERATURE
from models.diagnosis.experiments.candidates import TRIALS, Step, runs_of, steps_of, with_trial
from models.diagnosis.experiments.information import CandidateDistances
from models.diagnosis.explanations.verdict import Fitted, Judgement
from models.diagnosis.pooled_fit.gauss_newton import PooledFit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Gram


def rivals_of(judgement: Judgement) -> tuple[tuple[Fitted, ...], tuple[Fitted, ...]]:
    """The causes of the verdict's credible set, and further candidates of as many effects within 8 nats of the best,
    best first."""
    if not judgement.stand:
        return (), ()
    best = judgement.stand[0]
    nearby = [
        other
        for other in judgement.others
        if len(other.slugs) == len(best.slugs) and other.evidence > best.evidence - 8.0
    ]
    return judgement.stand, tuple(nearby)


#: What a cause is compared with where it has no rival.
BASELINE = "baseline"
#: The trial that moves the oil's temperature.
_WARM = "sweep_60c"


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """A test that would decide between two effects, or between an effect and none."""

    key: str  # for machines (`experiments.candidates.TRIALS`)
    test: str
    effect: str
    other: str  # BASELINE for none
    nats: float  # what it is expected to bring
    probability: float = 0.0  # that it leaves one candidate alone
    narrows: float = 0.0  # of a cause without a rival: its size's deviation after it, a share of today's; else 0
    steps: tuple[Step, ...] = ()  # what the rig is to do

    @property
    def minutes(self) -> float:
        """Minutes on the rig."""
        return sum(step.minutes for step in self.steps)


def advise(
    campaign: Campaign, problem: FitProblem, credible: Sequence[Fitted], nearby: Sequence[Fitted] = ()
) -> tuple[Advice, ...]:
    """Recommended trials, best first, by the probability that one of the credible candidates (best first) is left.
    Those nearby are not to be left, but may become credible again."""
    race = [rival for rival in credible if rival.fit.effects]
    if not race:
        return ()
    rivals = [*race, *nearby][: max(len(race), 4)]  # more take too long
    fits = [rival.fit for rival in rivals]
    evidences = np.array([rival.evidence for rival in rivals], dtype=np.float64)
    distances = CandidateDistances(problem, (*fits, bare(fits[0])))
    before = distances.with_freedom(())
    ranked = []
    for key, rows in trials_of(campaign, problem.design, distances).items():
        chance, other, nats = _outcome_of_trial(before, distances.with_freedom(rows), evidences, len(race))
        narrows = distances.size_left(rows) if len(race) == 1 else 0.0
        # less than "positive" (Kass and Raftery, J. Am. Stat. Assoc. 90 (1995) 773) is no advice
        if np.isfinite(chance) and nats >= 1.0 and narrows <= criteria.MAX_LEFT:
            effect, rival = _slugs_to_distinguish(fits[0], fits[other] if len(race) > 1 else None)
            advice = Advice(
                key=key,
                test=TRIALS[key].text,
                effect=effect,
                other=rival,
                nats=nats,
                probability=chance,
                narrows=narrows,
                steps=steps_of(campaign, key),
            )
            # alone in the race, a cause is sure: what is left to learn is its size
            worth = chance if len(race) > 1 else -narrows
            # probability that a run must add for the work that it is
            ranked.append(((worth - 0.005 * runs_of(key), nats), advice))
    first = _thermometer(campaign, problem, fits[: len(race)])
    ranked.sort(key=lambda trial: trial[0], reverse=True)
    worthy = [advice for i, (_, advice) in enumerate(ranked) if i == 0 or advice.nats >= criteria.WORTHWHILE]
    if len(race) > 1:
        sure = sorted(
            (advice for advice in worthy if advice.probability >= criteria.SURE), key=lambda advice: advice.minutes
        )
        worthy = [*sure, *(advice for advice in worthy if advice not in sure)]
    return (*first, *worthy)[:3]


def _outcome_of_trial(
    before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray], evidences: FloatArray, racing: int
) -> tuple[float, int, float]:
    """Expected outcome of a trial: the probability that it leaves one candidate (NaN where it cannot be computed), the
    index of the rival that stays hardest to distinguish from the best candidate, and the evidence [nats] between these
    two that the trial adds.

    `before` and `after` the trial: the distances λ_ab [k, k + 1] and freedoms [k + 1] of the k candidates and of no
    effect (`CandidateDistances.with_freedom`). The first `racing` candidates are credible."""
    count = evidences.size
    gained, change = np.maximum(after[0] - before[0], 0.0), after[1] - before[1]
    freedom = change[:count] - change[-1]
    if not (np.isfinite(gained).all() and np.isfinite(freedom).all()):
        return np.nan, 0, 0.0
    chance = decided(gained, evidences, freedom)
    if racing == 1:
        return chance, count, float(gained[0, -1])
    expected = gained[0, 1:racing] + np.maximum(freedom[0] - freedom[1:racing], 0.0)
    return chance, 1 + int(expected.argmin()), float(expected.min())


def decided(gained: FloatArray, evidences: FloatArray, freedom: FloatArray) -> float:
    """The probability that a trial leaves one candidate; with a single candidate, that it is distinguished from no
    effect.

    `gained` [k, k + 1] nats: what the trial brings for row against column (the last one no effect at all). `evidences` [k]
    nats over no effect. `freedom` [k] nats: how much each of them changes by the trial only because the candidate has more
    free parameters than no effect has (more of them, more to pay).
    """
    count = evidences.size
    after = evidences + freedom
    lead, rivals = after[:, None] - after, gained[:count, :count]
    if count == 1:
        lead, rivals = after[:, None], gained[:1, -1:]
    chance = distinguished(rivals, lead)
    if count > 1:
        np.fill_diagonal(chance, 1.0)
    return float(softmax(evidences) @ chance.min(axis=1))


def distinguished(nats: FloatArray, lead: FloatArray | float = 0.0) -> FloatArray:
    """The probability that a candidate, if it is true, reaches the odds of SURE against a rival that is behind by
    `lead` nats and expected to fall behind by so many `nats` more."""
    odds = np.log(criteria.SURE / (1 - criteria.SURE))
    sd = np.sqrt(1.0 + 2.0 * nats + (0.4 * nats) ** 2)  # a predicted λ is off by 40 %
    return np.asarray(ndtr((lead + nats - odds) / sd), dtype=np.float64)


def _slugs_to_distinguish(best: PooledFit, rival: PooledFit | None) -> tuple[str, str]:
    """Slugs of the two effects that a trial would distinguish: one of the best candidate's alone (else its first), and
    one of the rival's alone (else BASELINE)."""
    of_best = [effect.effect.slug for effect in best.effects]
    of_rival = [effect.effect.slug for effect in rival.effects] if rival is not None else []
    only_best = [slug for slug in of_best if slug not in of_rival] or of_best
    return only_best[0], next((slug for slug in of_rival if slug not in of_best), BASELINE)


def bare(fit: PooledFit) -> PooledFit:
    """The fit's baseline without its effects."""
    return replace(fit, torque=fit.prediction.torque, effects=())


def trials_of(campaign: Campaign, design: Design, distances: CandidateDistances) -> dict[str, list[list[Gram]]]:
    """Gram matrices of rows to come, by trial key, a list for each of its runs; trials without a pattern in the
    campaign are left out. Without a thermometer none is made at another temperature, without a loop that could be
    evaluated no loop is predicted."""
    single = {}
    for key, trial in TRIALS.items():
        possible = design.facts.temperature_measured or trial.temperature is None
        if not trial.parts and possible and (design.loops > 0 or not trial.loops):
            added = _added(campaign, design, key)
            if added is not None:
                single[key] = [distances.grams_of(added)] * trial.times
    trials = {}
    for key, trial in TRIALS.items():
        parts = trial.parts or (key,)
        if trial.text and all(part in single for part in parts):
            trials[key] = [gram for part in parts for gram in single[part]]
    return trials


def _thermometer(campaign: Campaign, problem: FitProblem, fits: Sequence[PooledFit]) -> list[Advice]:
    """Advice to measure and change the oil temperature, where it was not measured and would be mistaken for a shifted
    torque zero; else empty.

    What that brings is λ of a temperature effect of the usual size, which a shifted zero does not have.
    """
    shift = TORQUE_ZERO_SHIFT.slug
    added = _added(campaign, problem.design, _WARM)
    mistaken = any(effect.effect.slug == shift for fit in fits for effect in fit.effects)
    if problem.design.facts.temperature_measured or not mistaken or added is None:
        return []
    added = replace(added, facts=replace(added.facts, reference_temperature=criteria.REFERENCE_TEMPERATURE))
    effect = OIL_TEMPERATURE
    usual = replace(fits[0], effects=(FittedEffect(effect=effect, amplitude=effect.prior_sd, shape=(0.0, AT_ONCE)),))
    distances = CandidateDistances(problem, (usual, bare(fits[0])))
    nats = float(distances.distances([distances.grams_of(added)])[0, 1])
    test = f"{TRIALS[_WARM].text}, and oil temperature recorded from now on"
    chance = float(distinguished(np.array(nats)))
    steps = steps_of(campaign, _WARM)
    return [Advice(key=_WARM, test=test, effect=shift, other=effect.slug, nats=nats, probability=chance, steps=steps)]


def _added(campaign: Campaign, design: Design, key: str) -> Design | None:
    """The design of a trial's runs alone, with the campaign's states and reference values; None where it has no
    rows."""
    then = with_trial(campaign, key)
    if then is None:
        return None
    stationary, dynamic = then.stationary[len(campaign.stationary) :], then.dynamic[len(campaign.dynamic) :]
    facts = replace(facts_of(then), **{name: getattr(design.facts, name) for name in ("states", *REFERENCES)})
    added = replace(build_design(replace(then, stationary=stationary, dynamic=dynamic)), facts=facts)
    return added if added.torque.size else None
