"""Candidates refitted together with the whole baseline, what that makes of their evidence, pairs that undo each other."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erfcx, logsumexp

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.design.design import Design
from models.diagnosis.effects.amplitude_prior import log_peak
from models.diagnosis.effects.effect import Effect
from models.diagnosis.effects.template_discrepancy import BEND, bends
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import (
    Fit,
    Fitted,
    Priors,
    effect_precisions,
    effect_rows,
    fit,
    free_shapes,
)
from models.diagnosis.pooled_fit.projection import Gram, Projected, gram_of, projections_of

#: Gauss-Newton steps that a candidate is given, and one that is worth following to its end.
STEPS, MOST_STEPS = 10, 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """What may be at work (no effect, one, two): evidence [nats] over none, and its fit (None where only screened);
    drop [nats] of the cost, the gains free under both, an estimate of λ; shape_evidence [nats] is the grid's part of the
    evidence."""

    effects: tuple[Effect, ...]
    evidence: float
    drop: float
    fit: Fit | None
    shape_evidence: float = 0.0

    @property
    def slugs(self) -> tuple[str, ...]:
        """Public names."""
        return tuple(effect.slug for effect in self.effects)

    def less(self, evidence: float, drop: float) -> "Hypothesis":
        """Against a baseline that is so much [nats] better."""
        return replace(self, evidence=self.evidence - evidence, drop=max(self.drop - drop, 0.0))

    def seen_raw(self, evidence: Mapping[str, float]) -> "Hypothesis":
        """With what raw records say of its effects [nats]."""
        return replace(self, evidence=self.evidence + sum(evidence.get(slug, 0.0) for slug in self.slugs))


@dataclass(frozen=True, slots=True, kw_only=True)
class Null:
    """The baseline's fit at the likely gains, its log marginal likelihood, and its log likelihood at the gains that suit it
    best [nats]."""

    fit: Fit
    evidence: float
    profile: float


def null_of(design: Design, noise: Noise, priors: Priors, fitted: Fit) -> Null:
    """What every hypothesis is compared with."""
    evidence, profile = laplace(design, noise, priors, fitted)
    return Null(fit=fitted, evidence=evidence, profile=profile)


def refitted(
    design: Design,
    noise: Noise,
    priors: Priors,
    null: Null,
    laws: Laws,
    start: tuple[Fitted, ...],
    shape_evidence: float,
    linear: tuple[float, float],
    *,
    steps: int = STEPS,
) -> Hypothesis:
    """A candidate with everything free, from laws and amplitudes: its evidence is Laplace's about that fit, summed over the
    gains' scatter, with the grid's part as screened; `linear` (evidence, drop) where its sign is wrong from the start."""
    effects = tuple(each.effect for each in start)
    if any(each.effect.positive and each.amplitude < 0 for each in start):
        return Hypothesis(effects=effects, evidence=linear[0], drop=linear[1], fit=None, shape_evidence=shape_evidence)
    found = fit(design, noise, laws, priors, start, steps=steps)
    wrong = any(each.effect.positive and each.amplitude < 0 for each in found.effects)
    marginal, profile = laplace(design, noise, priors, found)
    evidence = -np.inf if wrong else marginal - null.evidence + shape_evidence
    drop = max(profile - null.profile, 0.0)
    return Hypothesis(effects=effects, evidence=evidence, drop=drop, fit=found, shape_evidence=shape_evidence)


def laplace(design: Design, noise: Noise, priors: Priors, fitted: Fit) -> tuple[float, float]:
    """Log marginal likelihood [nats] about a fit up to a constant, the gains' scatter summed over; and log likelihood at the
    gains' likeliest scatter."""
    gram = gram_of(design, noise, priors, fitted, np.zeros((design.torque.size, 0)))
    gram, outward = _held_at_bounds(gram, int(priors.free.sum()), fitted)
    price = sum(
        log_peak(each.effect) + 0.5 * float(np.log(effect_precisions(each)[1:]).sum()) for each in fitted.effects
    )
    price -= np.log(BEND) * sum(bends(design, each.effect).shape[1] for each in fitted.effects)
    sided = np.log(2.0) * sum(each.effect.positive for each in fitted.effects)
    projections = projections_of(gram, noise)
    marginal = logsumexp([each.evidence + _beside_bounds(each, outward) for each in projections])
    return float(marginal + price + sided), max(each.profile for each in projections)


def _held_at_bounds(gram: Gram, first: int, fitted: Fit) -> tuple[Gram, FloatArray]:
    """The Gram matrix with shapes at a bound among the changes [h], and which way is out for each [h] ±1; the effects'
    columns begin at `first`."""
    ways: list[float] = []  # 0 for what is free
    for each in fitted.effects:
        smooth = [(x, known) for x, known in zip(each.shape, each.effect.shapes, strict=True) if known.smooth]
        out = np.array([1.0, *(1.0 if 2 * x > known.lowest + known.highest else -1.0 for x, known in smooth)])
        ways += np.where(free_shapes(each), 0.0, out).tolist()
    outward = np.array(ways)
    held = first + np.flatnonzero(outward)
    order = np.concatenate([np.setdiff1d(np.arange(gram.base), held), held, np.arange(gram.base, gram.matrix.shape[0])])
    matrix, along = gram.matrix[np.ix_(order, order)], gram.along[:, order]
    return replace(gram, matrix=matrix, along=along, base=gram.base - held.size), outward[outward != 0]


def _beside_bounds(projected: Projected, outward: FloatArray) -> float:
    """What the shapes at a bound add to the evidence [nats]: all of their prior lies on one side, and where the data would
    have them beyond it falls off there (twice the half of a normal one that it would be where they would not)."""
    info = np.maximum(np.diag(projected.info), 1e-300)
    slope = np.maximum(outward * projected.score, 0.0) / np.sqrt(2 * info)
    return float((np.log(erfcx(slope)) - 0.5 * np.log(info)).sum())


def finite(hypothesis: Hypothesis) -> bool:
    """Whether the refit came to anything."""
    return hypothesis.fit is not None and bool(np.isfinite(hypothesis.evidence))


def undoing(design: Design, noise: Noise, priors: Priors, hypothesis: Hypothesis) -> float:
    """How much more two effects would be worth by themselves than they are together, Σ λ_i/λ; 1 of one effect, or of less
    than a nat. Where it is large, the difference of two templates follows structure that neither of them is."""
    if hypothesis.fit is None or len(hypothesis.fit.effects) < 2:
        return 1.0
    found = hypothesis.fit
    changes = [effect_rows(design, found.prediction, each) for each in found.effects]
    gram = gram_of(design, noise, priors, replace(found, effects=()), np.stack(changes, axis=1))
    info = max(projections_of(gram, noise), key=lambda each: each.evidence).info
    alone, both = 0.5 * float(np.trace(info)), 0.5 * float(info.sum())
    return alone / max(both, 1e-3 * alone) if alone > 1.0 else 1.0
