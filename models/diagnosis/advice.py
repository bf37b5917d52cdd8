"""Which test would decide: trials are added to the design, and the one that most likely leaves one candidate is taken.

Were candidate a true, a trial would show the torque that a foretells for it; what of the difference d of a's and b's torques
(over all rows, those measured and those to come) b cannot take up is

    λ_ab = ½ dᵀ V⁻¹ (1 - P_[J_b, U_b]) d      [nats]

with J_b the baseline's sensitivities where b has it, U_b those of b's amplitude, its smooth shapes and what it may be bent
by. Evidence for a against b, now l_ab, would then be about normal with mean l_ab + Δ and variance 1 + 2Δ, Δ what λ_ab rises
by; a stands alone where it is above CLOSE for every b. The probability of that, over the candidates by their evidence, less
COST a run, is what trials are ranked by. A cause without a rival is set against no effect at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.optimize import nnls
from scipy.special import ndtr, softmax

from models.arrays import FloatArray
from models.diagnosis.baseline import Prediction, predict
from models.diagnosis.bending import BEND, bends
from models.diagnosis.campaign import Campaign
from models.diagnosis.design import Design, Points, build_design
from models.diagnosis.effects import oil_temperature
from models.diagnosis.facts import REFERENCE_TEMPERATURE, facts_of
from models.diagnosis.fitting import Fit, Fitted, Priors, effect_columns, effect_precisions, effect_rows
from models.diagnosis.projection import Gram, gram_of, project
from models.diagnosis.report import Advice
from models.diagnosis.trials import TRIALS, with_trial
from models.diagnosis.verdict import CLOSE
from models.diagnosis.whitening import Noise

#: Tests advised at most; what one must bring [nats] to be worth its time (where none does, the best one with LEAST is
#: named).
MOST, WORTH, LEAST = 3, 3.0, 0.1
#: What a run must add to the probability that one candidate is left.
COST = 0.01
_NONE = "baseline"


@dataclass(frozen=True, slots=True, kw_only=True)
class _View:
    """What is foretold for some rows: each candidate's prediction and torque [N] Nm, and the noise [N] Nm."""

    design: Design
    predictions: tuple[Prediction, ...]
    torques: tuple[FloatArray, ...]
    deviation: FloatArray


def advise(
    campaign: Campaign, design: Design, noise: Noise, priors: Priors, fits: Sequence[Fit], evidences: Sequence[float] = ()
) -> tuple[Advice, ...]:
    """The trials that leave one of the fits (the candidates, best first, with evidences [nats] if known), best trial first."""
    fitted = [each for each in fits if each.effects]
    if not fitted:
        return ()
    known = np.array(evidences if len(evidences) == len(fits) else np.zeros(len(fits)), dtype=np.float64)
    known = known[[bool(each.effects) for each in fits]]
    candidates = tuple(fitted) if len(fitted) > 1 else (fitted[0], _bare(fitted[0]))
    truths = len(fitted)
    with np.errstate(all="ignore"):
        look = _Look(design, noise, priors, candidates)
        now = look.distances(None)
        found = []
        for key in TRIALS:
            then = with_trial(campaign, key)
            added = None if then is None else _added(then, campaign, design)
            if added is None or not added.torque.size:
                continue
            gained = np.maximum(look.distances(added) - now, 0.0)
            pair = gained[0] + np.where(np.arange(len(candidates)) == 0, np.inf, 0.0)
            other = int(pair.argmin())
            if not (np.isfinite(gained).all() and pair[other] > LEAST):
                continue
            left = decided(gained, known, truths) - COST * (len(added.runs))
            effect, rival = _names(candidates[0], candidates[other])
            advice = Advice(key=key, test=TRIALS[key].text, effect=effect, other=rival, nats=float(pair[other]))
            found.append(((left, float(pair[other])), advice))
        first = _thermometer(campaign, design, noise, priors, fitted)
    ranked = [advice for _, advice in sorted(found, key=lambda each: each[0], reverse=True)]
    worthy = [advice for advice in ranked if advice.nats >= WORTH] or ranked[:1]
    return (*first, *worthy)[:MOST]


def decided(gained: FloatArray, evidences: FloatArray, truths: int) -> float:
    """The probability that one candidate is left, by what is gained [k, k] nats for row against column and by evidences
    [truths] nats; candidates from `truths` on are no candidates for the truth, and are CLOSE behind nothing."""
    weights = softmax(evidences)
    lead = np.zeros(gained.shape)
    lead[:truths, :truths] = evidences[:, None] - evidences
    chance = ndtr((lead + gained - CLOSE) / np.sqrt(1.0 + 2.0 * gained))
    np.fill_diagonal(chance, 1.0)
    return float(weights @ chance[:truths].min(axis=1))


def _names(best: Fit, rival: Fit) -> tuple[str, str]:
    """What one has in it that the other has not."""
    mine, others = ([each.effect.slug for each in fit.effects] for fit in (best, rival))
    own = [slug for slug in mine if slug not in others] or mine
    return own[0], next((slug for slug in others if slug not in mine), _NONE)


def _bare(fit: Fit) -> Fit:
    """Its baseline without the effects."""
    return replace(fit, torque=fit.prediction.torque, effects=())


class _Look:
    """Distances of candidates, on what was measured and with rows to come."""

    def __init__(self, design: Design, noise: Noise, priors: Priors, fits: tuple[Fit, ...]) -> None:
        self._design, self._noise, self._priors, self._fits = design, noise, priors, fits
        view = _View(
            design=design,
            predictions=tuple(fit.prediction for fit in fits),
            torques=tuple(_torque(design, fit.prediction, fit) for fit in fits),
            deviation=noise.deviation,
        )
        self._law = _noise_law(design, noise, fits[0].torque)
        self._known = [self._gram(view, k, priors) for k in range(len(fits))]

    def distances(self, added: Design | None) -> FloatArray:
        """λ [k, k] nats of each candidate (row), were it true, against each other one (column)."""
        grams = self._known
        if added is not None:
            predictions = tuple(predict(added, fit.laws) for fit in self._fits)
            torques = tuple(_torque(added, at, fit) for at, fit in zip(predictions, self._fits, strict=True))
            deviation = _usual_deviation(self._law, added, torques[0])
            view = _View(design=added, predictions=predictions, torques=torques, deviation=deviation)
            none = replace(self._priors, rows=self._priors.rows[:0], means=self._priors.means[:0])
            grams = [_joined(gram, self._gram(view, k, none)) for k, gram in enumerate(grams)]
        columns = [0.5 * np.maximum(np.diag(project(gram, self._noise.run_gain).info), 0.0) for gram in grams]
        return np.stack(columns, axis=1)

    def _gram(self, view: _View, rival: int, priors: Priors) -> Gram:
        """What rows tell of all candidates' differences from a rival, and of what that one can take up; without priors
        where they are added to others, which have them already."""
        fit, prediction = self._fits[rival], view.predictions[rival]
        own, precisions = [], []
        for each in fit.effects:
            changes = effect_rows(view.design, prediction, each)
            bent = changes[:, None] * _bends(self._design, view.design, each)
            own += [effect_columns(view.design, prediction, each), bent]
            precisions += [*effect_precisions(each), *[BEND**-2.0] * bent.shape[1]]
        apart = np.stack([torque - view.torques[rival] for torque in view.torques], axis=1)
        silent = replace(
            fit, prediction=prediction, torque=view.torques[rival], residual=np.zeros(apart.shape[0]), effects=()
        )
        columns = np.nan_to_num(np.concatenate([*own, apart], axis=1))
        gram = gram_of(view.design, replace(self._noise, deviation=view.deviation), priors, silent, columns)
        if priors.rows.size:
            diagonal = gram.base + np.arange(len(precisions))
            gram.matrix[diagonal, diagonal] += precisions
        return replace(gram, base=gram.base + len(precisions))


def _torque(design: Design, prediction: Prediction, fit: Fit) -> FloatArray:
    """[N] Nm of a candidate at the rows."""
    changes = [np.nan_to_num(effect_rows(design, prediction, each)) for each in fit.effects]
    return np.asarray(prediction.torque + sum(changes, np.zeros_like(prediction.torque)), dtype=np.float64)


def _bends(known: Design, rows: Design, fitted: Fitted) -> FloatArray:
    """What an effect may be bent by [N, k] at rows, over the ranges of the known ones: beyond them as at their ends."""
    if rows is known:
        return bends(known, fitted.effect)
    count = rows.torque.size
    ends = {name: (getattr(known.rows, name).min(), getattr(known.rows, name).max()) for name in _RANGES}
    cut = replace(rows.rows, **{name: np.clip(getattr(rows.rows, name), *each) for name, each in ends.items()})
    joined = {
        each.name: np.concatenate([getattr(known.rows, each.name), getattr(cut, each.name)]) for each in fields(Points)
    }
    return bends(replace(known, rows=Points(**joined)), fitted.effect)[-count:]


_RANGES = ("velocity", "cycles", "clock")


def _thermometer(
    campaign: Campaign, design: Design, noise: Noise, priors: Priors, fits: Sequence[Fit]
) -> list[Advice]:
    """Where oil temperature was not measured and would be mistaken for a shifted zero: measure it, and move it.

    What that brings is λ of a temperature effect of the usual size, which a shifted zero does not have.
    """
    key = "sweep_60c"
    then = with_trial(campaign, key)
    mistaken = any(each.effect.slug == "torque_zero_shift" for fit in fits for each in fit.effects)
    if design.facts.temperature_measured or not mistaken or then is None:
        return []
    added = _added(then, campaign, design)
    added = replace(added, facts=replace(added.facts, reference_temperature=REFERENCE_TEMPERATURE))
    effect = oil_temperature.EFFECT
    usual = replace(fits[0], effects=(Fitted(effect=effect, amplitude=effect.prior_sd, shape=(0.0,)),))
    nats = float(_Look(design, noise, priors, (usual, _bare(fits[0]))).distances(added)[0, 1])
    test = f"{TRIALS[key].text}, and oil temperature recorded from now on"
    return [Advice(key=key, test=test, effect="torque_zero_shift", other=effect.slug, nats=nats)]


def _added(then: Campaign, campaign: Campaign, design: Design) -> Design:
    """The rows of the trial's runs alone; of what is then known beside them only what does not move what was fitted."""
    stationary, dynamic = then.stationary[len(campaign.stationary) :], then.dynamic[len(campaign.dynamic) :]
    facts = replace(
        facts_of(then), states=design.facts.states, reference_temperature=design.facts.reference_temperature
    )
    return replace(build_design(replace(then, stationary=stationary, dynamic=dynamic)), facts=facts)


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


def _noise_law(design: Design, noise: Noise, torque: FloatArray) -> FloatArray:
    """(a², b²) [2, 2] of plateaus and of loops, σ² = (a² + b² M²)/n as `models.diagnosis.noise` has it."""
    steady = np.arange(design.torque.size) < design.plateaus
    variance = noise.deviation**2 * design.samples
    found = []
    for part in (steady, ~steady):
        part = part if part.any() else ~part
        columns = np.stack([np.ones(int(part.sum())), torque[part] ** 2], axis=1) / variance[part, None]
        scale = columns.mean(axis=0)
        found.append(nnls(columns / scale, np.ones(columns.shape[0]))[0] / scale)
    return np.array(found)


def _usual_deviation(law: FloatArray, added: Design, torque: FloatArray) -> FloatArray:
    """The noise [n] Nm that rows to come will have."""
    steady = np.arange(added.torque.size) < added.plateaus
    constant, share = np.where(steady[:, None], law[0], law[1]).T
    return np.asarray(np.sqrt((constant + share * torque**2) / added.samples), dtype=np.float64)
