"""Which test would decide: trials are made in thought, and the one that most likely leaves one candidate is taken.

With Δ_ab what a trial adds to λ_ab (`experiments.information`), evidence for a against b would, were a true, be about
normal afterwards: its mean what it is now, and Δ, and what the freedom of both is worth more by then; its variance
1 + 2Δ + (ERRS Δ)². a is left alone where it is above what `attribution.decide` asks for, for every b. Trials are
ranked by the probability of that, over the candidates by their evidence, less COST a run. A cause without a rival is set
against no effect at all, and of trials that are about as likely to leave it the one with most nats a run is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, softmax

from models.arrays import FloatArray
from models.diagnosis.attribution.decide import CLOSE, LEAST_NAMED, RIVAL, TOLERANCE
from models.diagnosis.campaign import Campaign
from models.diagnosis.design.criteria import REFERENCE_TEMPERATURE
from models.diagnosis.design.design import Design, build_design
from models.diagnosis.design.facts import facts_of
from models.diagnosis.effects.catalogued import oil_temperature
from models.diagnosis.experiments.candidates import TRIALS, runs_of, with_trial
from models.diagnosis.experiments.information import Foretold
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import Fit, Fitted, Priors
from models.diagnosis.pooled_fit.projection import Gram
from models.diagnosis.report.report import Advice

#: Tests advised at most; what one must bring [nats] to be worth its time (where none does, the best one with LEAST is
#: named).
MOST, WORTH, LEAST = 3, 3.0, 0.1
#: Rivals that are compared at most, unless more stand.
MOST_FITS = 4
#: What a run must add to the probability that one candidate is left.
COST = 0.005
#: What is foretold may be wrong by this share.
ERRS = 0.4
_NONE = "baseline"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rival:
    """A candidate's fit and its evidence [nats] over nothing."""

    fit: Fit
    evidence: float


def advise(
    campaign: Campaign,
    design: Design,
    noise: Noise,
    priors: Priors,
    standing: Sequence[Rival],
    nearby: Sequence[Rival] = (),
) -> tuple[Advice, ...]:
    """The trials that leave one of the candidates standing (best first), best trial first. Those nearby are out of the race,
    but may come back into it."""
    race = [each for each in standing if each.fit.effects]
    if not race:
        return ()
    fitted = [each.fit for each in (*race, *nearby)][: max(len(race), MOST_FITS)]
    known = np.array([each.evidence for each in (*race, *nearby)][: len(fitted)], dtype=np.float64)
    with np.errstate(all="ignore"):
        foretold = Foretold(design, noise, priors, (*fitted, _bare(fitted[0])))
        before = foretold.told(())
        found = []
        for key, rows in _made(campaign, design, foretold).items():
            chance, other, nats = _brought(before, foretold.told(rows), known, len(race))
            if np.isfinite(chance) and nats > LEAST:
                effect, rival = _names(fitted[0], fitted[other] if len(race) > 1 else None)
                advice = Advice(key=key, test=TRIALS[key].text, effect=effect, other=rival, nats=nats)
                runs = runs_of(key)
                alone = (round(chance, 1), nats / runs)
                found.append((alone if len(race) == 1 else (chance - COST * runs, nats), advice))
        first = _thermometer(campaign, design, noise, priors, fitted)
    ranked = [advice for _, advice in sorted(found, key=lambda each: each[0], reverse=True)]
    worthy = [advice for i, advice in enumerate(ranked) if i == 0 or advice.nats >= WORTH]
    return (*first, *worthy)[:MOST]


def _brought(
    before: tuple[FloatArray, FloatArray], after: tuple[FloatArray, FloatArray], evidences: FloatArray, racing: int
) -> tuple[float, int, float]:
    """By distances and freedoms before and after a trial: the probability that one candidate is left (NaN where it cannot be
    told), the rival of the best that is hardest to part from it, and the nats between them that the trial brings."""
    count = evidences.size
    gained, freedom = np.maximum(after[0] - before[0], 0.0), (after[1] - before[1])[:count]
    if not (np.isfinite(gained).all() and np.isfinite(freedom).all()):
        return np.nan, 0, 0.0
    chance = decided(gained, before[0][:count, -1], evidences, freedom)
    if racing == 1:
        return chance, count, float(gained[0, -1])
    expected = gained[0, 1:racing] + np.maximum(freedom[0] - freedom[1:racing], 0.0)
    return chance, 1 + int(expected.argmin()), float(expected.min())


def decided(gained: FloatArray, seen: FloatArray, evidences: FloatArray, freedom: FloatArray) -> float:
    """The probability that one candidate is left, by what is gained [k, k + 1] nats for row against column (the last one no
    effect at all), by what is seen [k] nats of each already, by their evidences [k] nats, and by what these change by for
    nothing but the candidates' `freedom` [k] nats: what has more free pays more for it when more is measured.

    A lead is weighed against the error that a template may have, a share of λ: the more is seen, the further it must be.
    """
    count = evidences.size
    after = evidences + freedom
    lead = after[:, None] - after
    rivals = gained[:count, :count] if count > 1 else gained[:1, -1:]
    total = (seen + gained[:count, -1])[:, None]
    needed = np.maximum(CLOSE + RIVAL * total, np.log(LEAST_NAMED / (1 - LEAST_NAMED)) * (1 + 0.5 * TOLERANCE * total))
    chance = ndtr((lead + rivals - needed) / np.sqrt(1.0 + 2.0 * rivals + (ERRS * rivals) ** 2))
    if count > 1:
        np.fill_diagonal(chance, 1.0)
    return float(softmax(evidences) @ chance.min(axis=1))


def _names(best: Fit, rival: Fit | None) -> tuple[str, str]:
    """What one has in it that the other has not."""
    mine = [each.effect.slug for each in best.effects]
    others = [each.effect.slug for each in rival.effects] if rival is not None else []
    own = [slug for slug in mine if slug not in others] or mine
    return own[0], next((slug for slug in others if slug not in mine), _NONE)


def _bare(fit: Fit) -> Fit:
    """Its baseline without the effects."""
    return replace(fit, torque=fit.prediction.torque, effects=())


def _made(campaign: Campaign, design: Design, foretold: Foretold) -> dict[str, list[list[Gram]]]:
    """By trial what its runs would tell, a run each; those that the campaign has a pattern for. Without a thermometer none
    is made at another temperature, without a loop that could be evaluated none is foretold."""
    single = {}
    for key, trial in TRIALS.items():
        tellable = design.facts.temperature_measured or trial.temperature is None
        if not trial.parts and tellable and (design.loops > 0 or not trial.loops):
            added = _added(campaign, design, key)
            if added is not None:
                single[key] = [foretold.ahead(added)] * trial.times
    made = {}
    for key, trial in TRIALS.items():
        parts = trial.parts or (key,)
        if trial.text and all(part in single for part in parts):
            made[key] = [gram for part in parts for gram in single[part]]
    return made


def _thermometer(campaign: Campaign, design: Design, noise: Noise, priors: Priors, fits: Sequence[Fit]) -> list[Advice]:
    """Where oil temperature was not measured and would be mistaken for a shifted zero: measure it, and move it.

    What that brings is λ of a temperature effect of the usual size, which a shifted zero does not have.
    """
    key = "sweep_60c"
    added = _added(campaign, design, key)
    mistaken = any(each.effect.slug == "torque_zero_shift" for fit in fits for each in fit.effects)
    if design.facts.temperature_measured or not mistaken or added is None:
        return []
    added = replace(added, facts=replace(added.facts, reference_temperature=REFERENCE_TEMPERATURE))
    effect = oil_temperature.EFFECT
    usual = replace(fits[0], effects=(Fitted(effect=effect, amplitude=effect.prior_sd, shape=(0.0,)),))
    foretold = Foretold(design, noise, priors, (usual, _bare(fits[0])))
    nats = float(foretold.distances([foretold.ahead(added)])[0, 1])
    test = f"{TRIALS[key].text}, and oil temperature recorded from now on"
    return [Advice(key=key, test=test, effect="torque_zero_shift", other=effect.slug, nats=nats)]


def _added(campaign: Campaign, design: Design, key: str) -> Design | None:
    """The rows of a trial's runs alone, if there are any; of what is then known beside them only what does not move what was
    fitted."""
    then = with_trial(campaign, key)
    if then is None:
        return None
    stationary, dynamic = then.stationary[len(campaign.stationary) :], then.dynamic[len(campaign.dynamic) :]
    known = design.facts
    facts = replace(
        facts_of(then),
        states=known.states,
        reference_temperature=known.reference_temperature,
        usual_torque=known.usual_torque,
        usual_pressure=known.usual_pressure,
    )
    added = replace(build_design(replace(then, stationary=stationary, dynamic=dynamic)), facts=facts)
    return added if added.torque.size else None
