"""Which test would decide: trials are added to the design, and the one that parts the best cause from its rivals is taken.

With J the baseline's sensitivities, g_a the change that cause a makes as it was fitted and g_b that of its rival, what a
trial shows of a that b cannot imitate is

    λ = ½ g_aᵀ V⁻¹ (1 - P_[J, g_b]) g_a      [nats],

and the smaller of it and of what it shows of b that a cannot imitate is how far the trial parts the two. A pair counts up
to DECIDED nats: there it is decided, and more of it does not make up for another pair. A cause without a rival is set
against no effect at all. Of causes that several fits share, only what they do not share is compared.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.amplitude import precision
from models.diagnosis.baseline import predict
from models.diagnosis.campaign import Campaign
from models.diagnosis.design import Design, build_design
from models.diagnosis.effects import oil_temperature
from models.diagnosis.facts import REFERENCE_TEMPERATURE, facts_of
from models.diagnosis.fitting import Fit, Fitted, Priors
from models.diagnosis.projection import Gram, change_columns, gram_of, project
from models.diagnosis.report import Advice
from models.diagnosis.trials import TRIALS, with_trial
from models.diagnosis.whitening import Noise

#: Tests advised at most; what one must bring [nats] to be worth its time (where none does, the best one with LEAST is
#: named); what decides a pair.
MOST, WORTH, LEAST, DECIDED = 3, 3.0, 0.1, 15.0
#: What brings less than this share of the best one's nats is not advised beside it.
FAINT = 0.02
_NONE = "baseline"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cause:
    """What one fit has in it that another has not."""

    effects: tuple[Fitted, ...]

    @property
    def name(self) -> str:
        return self.effects[0].effect.slug

    @property
    def looseness(self) -> float:
        """How far its amplitude may go: the prior's precision of a factor on the whole change."""
        return float(np.mean([each.amplitude**2 * precision(each.effect, each.amplitude) for each in self.effects]))


def advise(campaign: Campaign, design: Design, noise: Noise, priors: Priors, fits: Sequence[Fit]) -> tuple[Advice, ...]:
    """The trials that part the causes of the fits (one fit a candidate of the set, best first), best trial first."""
    causes = _causes(fits)
    if not causes:
        return ()
    with np.errstate(all="ignore"):
        now = _gram(design, noise.deviation, noise, priors, fits[0], causes)
        known = _distances(now, noise, causes)
        none = _without_prior(priors)
        found = []
        for key in TRIALS:
            then = with_trial(campaign, key)
            if then is None:
                continue
            added = _added(then, campaign)
            if not added.torque.size:
                continue
            usual = _usual_deviation(design, noise, added)
            both = _joined(now, _gram(added, usual, noise, none, fits[0], causes))
            advice = _worth(key, _distances(both, noise, causes), known, causes)
            if advice is not None:
                found.append(advice)
        ranked = [advice for _, advice in sorted(found, key=lambda each: each[0], reverse=True)]
        first = _thermometer(campaign, design, noise, priors, fits[0], causes)
    least = max(WORTH, FAINT * max((advice.nats for advice in ranked), default=0.0))
    worthy = [advice for advice in ranked if advice.nats >= least] or ranked[:1]
    return (*first, *worthy)[:MOST]


def _causes(fits: Sequence[Fit]) -> list[_Cause]:
    """Of each fit what it does not share with all others; distinct ones, best first."""
    slugs = [frozenset(each.effect.slug for each in fit.effects) for fit in fits if fit.effects]
    common = frozenset.intersection(*slugs) if len(slugs) > 1 else frozenset()
    found: dict[frozenset[str], _Cause] = {}
    for fit in fits:
        own = tuple(each for each in fit.effects if each.effect.slug not in common)
        if own:
            found.setdefault(frozenset(each.effect.slug for each in own), _Cause(effects=own))
    return list(found.values())


def _worth(
    key: str, then: FloatArray, known: FloatArray, causes: Sequence[_Cause]
) -> tuple[tuple[float, float], Advice] | None:
    """How much a trial brings (pairs decided count up to DECIDED, then the sum), and the advice for its best pair."""
    gained = then - known
    pair = int(gained.argmax())
    if not (np.isfinite(gained).all() and gained[pair] > LEAST):
        return None
    counted = float((np.minimum(then, DECIDED) - np.minimum(known, DECIDED)).sum())
    other = causes[pair + 1].name if len(causes) > 1 else _NONE
    advice = Advice(key=key, test=TRIALS[key].text, effect=causes[0].name, other=other, nats=float(gained[pair]))
    return (counted, float(gained.sum())), advice


def _thermometer(
    campaign: Campaign, design: Design, noise: Noise, priors: Priors, fit: Fit, causes: Sequence[_Cause]
) -> list[Advice]:
    """Where oil temperature was not measured and would be mistaken for a shifted zero: measure it, and move it.

    What that brings is λ of a temperature effect of the usual size, which a shifted zero does not have.
    """
    key = "sweep_60c"
    then = with_trial(campaign, key)
    mistaken = any(each.effect.slug == "torque_zero_shift" for cause in causes for each in cause.effects)
    if design.facts.temperature_measured or not mistaken or then is None:
        return []
    added = _added(then, campaign)
    added = replace(added, facts=replace(added.facts, reference_temperature=REFERENCE_TEMPERATURE))
    effect = oil_temperature.EFFECT
    usual = _Cause(effects=(Fitted(effect=effect, amplitude=effect.prior_sd, shape=(0.0,)),))
    now = _gram(design, noise.deviation, noise, priors, fit, [usual])
    both = _joined(
        now, _gram(added, _usual_deviation(design, noise, added), noise, _without_prior(priors), fit, [usual])
    )
    test = f"{TRIALS[key].text}, and oil temperature recorded from now on"
    nats = float(_distances(both, noise, [usual])[0])
    return [Advice(key=key, test=test, effect="torque_zero_shift", other=effect.slug, nats=nats)]


def _added(then: Campaign, campaign: Campaign) -> Design:
    """The rows of the trial's runs alone, with what is then known of the campaign beside them."""
    stationary, dynamic = then.stationary[len(campaign.stationary) :], then.dynamic[len(campaign.dynamic) :]
    return replace(build_design(replace(then, stationary=stationary, dynamic=dynamic)), facts=facts_of(then))


def _gram(
    design: Design, deviation: FloatArray, noise: Noise, priors: Priors, fit: Fit, causes: Sequence[_Cause]
) -> Gram:
    """What a design's rows tell of the baseline and of each cause's change."""
    prediction = predict(design, fit.laws)
    effects = [each for cause in causes for each in cause.effects]
    changes = [
        (np.nan_to_num(each.effect.change(prediction.scene, each.amplitude, each.shape)), each.effect.lags(each.shape))
        for each in effects
    ]
    owner = np.repeat(np.arange(len(causes)), [len(cause.effects) for cause in causes])
    columns = np.nan_to_num(change_columns(design, prediction, changes)) @ (owner[:, None] == np.arange(len(causes)))
    silent = Fit(
        laws=fit.laws,
        prediction=prediction,
        torque=prediction.torque,
        residual=np.zeros(design.torque.size),
        effects=(),
        cost=0.0,
    )
    return gram_of(design, replace(noise, deviation=deviation), priors, silent, columns)


def _without_prior(priors: Priors) -> Priors:
    """For rows that are added to others, which have the prior already."""
    return replace(priors, rows=priors.rows[:0], means=priors.means[:0])


def _joined(first: Gram, second: Gram) -> Gram:
    """Of both designs' rows: runs are independent."""
    runs = int(first.run_of_curve.max()) + 1
    return replace(
        first,
        matrix=first.matrix + second.matrix,
        along=np.concatenate([first.along, second.along]),
        squares=np.concatenate([first.squares, second.squares]),
        run_of_curve=np.concatenate([first.run_of_curve, second.run_of_curve + runs]),
    )


def _distances(gram: Gram, noise: Noise, causes: Sequence[_Cause]) -> FloatArray:
    """How far the first cause is from each other one [k - 1], or from none [1]: λ in nats."""
    info = project(gram, noise.run_gain).info
    if len(causes) == 1:
        return np.array([0.5 * max(float(info[0, 0]), 0.0)])

    def left(first: int, second: int) -> float:
        loose = info[second, second] + causes[second].looseness
        return 0.5 * max(float(info[first, first] - info[first, second] ** 2 / max(loose, 1e-300)), 0.0)

    return np.array([min(left(0, k), left(k, 0)) for k in range(1, len(causes))])


def _usual_deviation(design: Design, noise: Noise, added: Design) -> FloatArray:
    """The noise [n] Nm that rows to come will have: as plateaus and loops usually have."""
    steady = np.arange(design.torque.size) < design.plateaus
    usual = [float(np.median(noise.deviation[part] if part.any() else noise.deviation)) for part in (steady, ~steady)]
    return np.where(np.arange(added.torque.size) < added.plateaus, *usual)
