"""Candidates refitted together with the whole baseline, and what that makes of their evidence."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.design import Design
from models.diagnosis.effect import Effect
from models.diagnosis.fitting import Fit, Fitted, Priors, fit
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
    """A screened candidate with everything free, from its linear amplitudes and drop: its evidence is corrected by how
    much more (or less) the cost drops than was thought."""
    amplitudes, thought = linear
    start = tuple(
        Fitted(effect=effect, amplitude=float(amplitude), shape=shape)
        for effect, amplitude, shape in zip(screened.effects, amplitudes, screened.shapes, strict=True)
    )
    if any(each.effect.positive and each.amplitude < 0 for each in start):
        return Hypothesis(effects=screened.effects, evidence=screened.evidence, drop=thought, fit=None)
    found = fit(design, noise, null.laws, priors, start, steps=STEPS)
    drop = null.cost - found.cost
    smooth = sum(shape.smooth for effect in screened.effects for shape in effect.shapes)
    price = min(max(drop - thought, 0.0), 0.5 * smooth)
    evidence = screened.evidence + drop - thought - price
    wrong = any(each.effect.positive and each.amplitude < 0 for each in found.effects)
    return Hypothesis(effects=screened.effects, evidence=-np.inf if wrong else evidence, drop=drop, fit=found)


def at_gain(noise: Noise, run_gain: float) -> Noise:
    """The noise with another scatter of the runs' gains."""
    return replace(noise, run_gain=run_gain)


def finite(hypothesis: Hypothesis) -> bool:
    """Whether the refit came to anything."""
    return hypothesis.fit is not None and bool(np.isfinite(hypothesis.evidence))
