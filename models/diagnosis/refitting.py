"""Candidates refitted together with the whole baseline, and what that makes of their evidence."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from models.arrays import FloatArray
from models.diagnosis.design import Design
from models.diagnosis.effect import Effect
from models.diagnosis.fitting import Fit, Fitted, Priors, effect_precisions, fit
from models.diagnosis.projection import GAINS, gram_of, project
from models.diagnosis.selection import Screened
from models.diagnosis.whitening import Noise

#: Gauss-Newton steps that a candidate is given.
STEPS = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Hypothesis:
    """What may be at work (no effect, one, two): evidence [nats] over none, and its fit (None where only screened);
    drop [nats] of the cost, an estimate of λ."""

    effects: tuple[Effect, ...]
    evidence: float
    drop: float
    fit: Fit | None

    @property
    def slugs(self) -> tuple[str, ...]:
        """Public names."""
        return tuple(effect.slug for effect in self.effects)

    def seen_raw(self, evidence: Mapping[str, float]) -> "Hypothesis":
        """With what raw records say of its effects [nats]."""
        return replace(self, evidence=self.evidence + sum(evidence.get(slug, 0.0) for slug in self.slugs))


def refitted(
    design: Design,
    noise: Noise,
    priors: Priors,
    null: Fit,
    screened: Screened,
    linear: tuple[FloatArray, float],
) -> Hypothesis:
    """A screened candidate with everything free, from its linear amplitudes: its evidence is Laplace's about that fit,
    summed over the gains' scatter, with the grid's part as screened."""
    start = tuple(
        Fitted(effect=effect, amplitude=float(amplitude), shape=shape)
        for effect, amplitude, shape in zip(screened.effects, linear[0], screened.shapes, strict=True)
    )
    if any(each.effect.positive and each.amplitude < 0 for each in start):
        return Hypothesis(effects=screened.effects, evidence=screened.evidence, drop=linear[1], fit=None)
    found = fit(design, noise, null.laws, priors, start, steps=STEPS)
    with_effects, none = (laplace(design, noise, priors, each) for each in (found, null))
    wrong = any(each.effect.positive and each.amplitude < 0 for each in found.effects)
    evidence = -np.inf if wrong else with_effects - none + screened.shape_evidence
    return Hypothesis(effects=screened.effects, evidence=evidence, drop=null.cost - found.cost, fit=found)


def laplace(design: Design, noise: Noise, priors: Priors, fitted: Fit) -> float:
    """Log marginal likelihood [nats] about a fit up to a constant, the gains' scatter summed over."""
    gram = gram_of(design, noise, priors, fitted, np.zeros((design.torque.size, 0)))
    price = 0.5 * sum(float(np.log(effect_precisions(each.effect)).sum()) for each in fitted.effects)
    sided = np.log(2.0) * sum(each.effect.positive for each in fitted.effects)
    return float(logsumexp([project(gram, float(gain)).evidence for gain in GAINS]) + price + sided)


def at_gain(noise: Noise, run_gain: float) -> Noise:
    """The noise with another scatter of the runs' gains."""
    return replace(noise, run_gain=run_gain)


def finite(hypothesis: Hypothesis) -> bool:
    """Whether the refit came to anything."""
    return hypothesis.fit is not None and bool(np.isfinite(hypothesis.evidence))
