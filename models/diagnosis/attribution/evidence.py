"""The evidence of a hypothesis: its effects refitted together with the whole baseline, and Laplace's integral about that
fit.

    evidence = ln ∫ p(data | θ, a, shapes) p(θ, a, shapes) - the same without effects      [nats]

summed over the scatter of the gains, plus the part of the shape grid as it was screened. Where a smooth shape lies at its
bound the integral is that over what falls off there, ∫ e^{-gt - ht²/2} dt.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from scipy.special import erfcx, logsumexp

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import Laws
from models.diagnosis.criteria import DISCREPANCY_SD, TOLERANCE
from models.diagnosis.effects.amplitude_prior import log_peak
from models.diagnosis.effects.effect import Effect
from models.diagnosis.effects.fitted_effect import FittedEffect, effect_precisions, free_shapes
from models.diagnosis.effects.template_discrepancy import discrepancy_factors
from models.diagnosis.pooled_fit.gauss_newton import Fit, fit
from models.diagnosis.pooled_fit.gram import Gram, gram_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Projected, projections_of

#: Gauss-Newton steps of a refit at most: it is followed to its end. With 10, a running-in was 49 nats short of it and stood
#: behind what it was; 31 and 35 steps ended the longest two of 30 refits near the best (`make blind SEED=23 SIZE=0.03`), 48
#: that of a zero shift which eq. 6 had absorbed.
STEPS = 80


class HypothesisStatus(StrEnum):
    """How its evidence came about: from the linear screen only; refitted, with a one-sided effect negative; or as its refit
    ended (`FitStatus`)."""

    SCREENED = "screened"
    WRONG_SIGN = "wrong_sign"
    CONVERGED = "converged"
    STALLED = "stalled"
    OUT_OF_STEPS = "out_of_steps"
    NOT_FINITE = "not_finite"


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

    @property
    def status(self) -> HypothesisStatus:
        """How its evidence came about."""
        if self.fit is None:
            return HypothesisStatus.SCREENED
        return HypothesisStatus.WRONG_SIGN if self.fit.wrong_sign else HypothesisStatus(self.fit.status.value)

    @property
    def usable(self) -> bool:
        """Whether it was refitted and has a finite evidence."""
        return self.fit is not None and bool(np.isfinite(self.evidence))

    @property
    def usable_evidence(self) -> float:
        """Its evidence [nats], -inf where it is not usable."""
        return self.evidence if self.usable else -np.inf

    @property
    def tolerance(self) -> float:
        """What its template may be wrong by [nats]."""
        return TOLERANCE * max(self.drop, 0.0)

    def against(self, evidence: float, drop: float) -> "Hypothesis":
        """Against a baseline that is so much [nats] better."""
        return replace(self, evidence=self.evidence - evidence, drop=max(self.drop - drop, 0.0))

    def with_raw(self, evidence: Mapping[str, float]) -> "Hypothesis":
        """With the evidence [nats] that raw records add to that of its effects, by slug."""
        return replace(self, evidence=self.evidence + sum(evidence.get(slug, 0.0) for slug in self.slugs))


@dataclass(frozen=True, slots=True, kw_only=True)
class Null:
    """No effect: the baseline's fit at the likely gains, its log marginal likelihood, and its log likelihood at the
    gains that suit it best [nats]."""

    fit: Fit
    evidence: float
    profile: float


def null_of(problem: FitProblem, fitted: Fit) -> Null:
    """What every hypothesis is compared with."""
    evidence, profile = laplace(problem, fitted)
    return Null(fit=fitted, evidence=evidence, profile=profile)


def refitted(
    problem: FitProblem,
    null: Null,
    laws: Laws,
    start: tuple[FittedEffect, ...],
    shape_evidence: float,
    linear: tuple[float, float],
    *,
    steps: int = STEPS,
) -> Hypothesis:
    """A candidate with everything free, from laws and amplitudes: its evidence is Laplace's about that fit, summed over the
    gains' scatter, with the grid's part as screened; `linear` (evidence, drop) where its sign is wrong from the start."""
    effects = tuple(fitted.effect for fitted in start)
    if any(fitted.wrong_sign for fitted in start):
        return Hypothesis(effects=effects, evidence=linear[0], drop=linear[1], fit=None, shape_evidence=shape_evidence)
    refit = fit(problem, laws, start, steps=steps)
    marginal, profile = laplace(problem, refit)
    evidence = -np.inf if refit.wrong_sign else marginal - null.evidence + shape_evidence
    drop = max(profile - null.profile, 0.0)
    return Hypothesis(effects=effects, evidence=evidence, drop=drop, fit=refit, shape_evidence=shape_evidence)


def laplace(problem: FitProblem, fitted: Fit) -> tuple[float, float]:
    """Log marginal likelihood [nats] about a fit up to a constant, the gains' scatter summed over; and log likelihood at the
    gains' likeliest scatter."""
    gram, outward = _held_at_bounds(gram_of(problem, fitted), int(problem.priors.free.sum()), fitted)
    prior = sum(
        log_peak(effect.effect) + 0.5 * float(np.log(effect_precisions(effect)[1:]).sum()) for effect in fitted.effects
    )
    discrepancies = sum(discrepancy_factors(problem.design, effect.effect).shape[1] for effect in fitted.effects)
    prior -= np.log(DISCREPANCY_SD) * discrepancies
    sided = np.log(2.0) * sum(effect.effect.positive for effect in fitted.effects)
    projections = list(projections_of(gram, problem.noise))
    marginal = logsumexp([projected.evidence + _beside_bounds(projected, outward) for projected in projections])
    return float(marginal + prior + sided), max(projected.profile for projected in projections)


def _held_at_bounds(gram: Gram, first: int, fitted: Fit) -> tuple[Gram, FloatArray]:
    """The Gram matrix with shapes at a bound among the changes [h], and which way is out for each [h] ±1; the effects'
    columns begin at `first`."""
    ways: list[float] = []  # 0 for what is free
    for effect in fitted.effects:
        smooth = [(x, shape) for x, shape in zip(effect.shape, effect.effect.shapes, strict=True) if shape.smooth]
        out = np.array([1.0, *(1.0 if 2 * x > shape.lowest + shape.highest else -1.0 for x, shape in smooth)])
        ways += np.where(free_shapes(effect), 0.0, out).tolist()
    outward = np.array(ways)
    held = first + np.flatnonzero(outward)
    order = np.concatenate([np.setdiff1d(np.arange(gram.base), held), held, np.arange(gram.base, gram.matrix.shape[0])])
    matrix, along = gram.matrix[np.ix_(order, order)], gram.along[:, order]
    return replace(gram, matrix=matrix, along=along, base=gram.base - held.size), outward[outward != 0]


def _beside_bounds(projected: Projected, outward: FloatArray) -> float:
    """What the shapes at a bound add to the evidence [nats]: all of their prior lies on one side, and where the data ask for
    values beyond, it falls off there (twice the half of a normal one that it would be where they do not)."""
    info = np.maximum(np.diag(projected.info), 1e-300)
    slope = np.maximum(outward * projected.score, 0.0) / np.sqrt(2 * info)
    return float((np.log(erfcx(slope)) - 0.5 * np.log(info)).sum())
