"""What the friction law does otherwise than eq. 3, as a result of its own, whatever the verdict is.

    δ = C c/M,     c ~ the posterior of the discrepancy's coefficients, all else that the baseline has free integrated out,

without what eq. 3 can follow, which is projected off (least squares of δ on the relative sensitivities). Its size is the rms
over the plateaus of the closed clutch. What it changes of mean COF is the difference of the two fits' mean torque at the
last state; of the remaining cycles, that of (q - ½)/(1 - q) with q the ratio of the last to the first state's mean torque: a
straight course to half of what it was.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_form import EXACT, LearnedLaw
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit, sensitivities
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import Gram, Projected, coarse_projections, gram_of, law_torque, learned_law
from models.diagnosis.validation.held_out import FittedModel, Gain, measure_gain

#: Draws of the posterior; bands of ln v.
_DRAWS, _BANDS = 400, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A band of speeds [rad/s], and its share of the squared discrepancy [-]."""

    low: float
    high: float
    share: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LawCurve:
    """A friction curve [n] Nm over speed [n] rad/s at one pressure [Pa] and state [cycles]: as measured, by eq. 3, and by
    the law as found, with its deviation."""

    pressure: float
    cycles: float
    speed: FloatArray
    measured: FloatArray
    eq3: FloatArray
    law: FloatArray
    sd: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionLaw:
    """The law's discrepancy: its relative rms [%] with its 90 % interval, the bands of speed in which it lies, its
    effects on predictions [%] (None where no course leads to an end), its gain on held-out runs over eq. 3, and
    curves."""

    rms_percent: float
    interval_percent: tuple[float, float]
    where: tuple[Band, ...]  # the largest share first
    effect_on_mean_cof_percent: float
    effect_on_remaining_cycles_percent: float | None
    gain: Gain | None
    learned: LearnedLaw | None  # the law as found
    curves: tuple[LawCurve, ...] = ()
    adoptable: bool = False  # whether it is proposed in place of eq. 3

    @property
    def mentioned(self) -> bool:
        """Whether the discrepancy is large and certain enough for a sentence."""
        return self.rms_percent >= criteria.LAW_MENTIONED and self.interval_percent[0] > 0.25 * self.rms_percent

    @property
    def predicts(self) -> bool:
        """Whether the discrepancy deserves a sentence and predicts held-out runs better than eq. 3."""
        gain = self.gain
        return self.mentioned and gain is not None and gain.log_score_gain > 0.0 and gain.rmse_after <= gain.rmse_before


def friction_law_of(problem: FitProblem, fitted: PooledFit, rng: np.random.Generator) -> FrictionLaw | None:
    """The friction law's discrepancy from eq. 3 beside the effects of a fit; None where there is no plateau to show
    one."""
    design = problem.design
    rows = np.flatnonzero(design.closed & design.rows.steady)
    if problem.law is None or rows.size == 0:
        return None
    gram = gram_of(problem, fitted)
    projections = coarse_projections(gram, problem.noise)
    likely = max(projections, key=lambda projected: projected.evidence)
    columns, problem = problem.law.columns, problem.with_noise(likely.noise(problem.noise))
    exactly = problem.exact
    alone = fit(exactly, replace(fitted.laws, learned=None), fitted.effects, steps=criteria.FEW_STEPS)
    torque = fitted.torque[rows]
    drawn = columns[rows] @ _draws(gram, projections, rng) / torque[:, None]
    followed = np.linalg.qr(sensitivities(problem, fitted)[rows] / torque[:, None])[0]
    left = drawn - followed @ (followed.T @ drawn)
    low, middle, high = np.quantile(100.0 * np.sqrt(np.square(left).mean(axis=0)), (0.05, 0.5, 0.95)).tolist()
    exact, law = alone.torque[rows], torque + law_torque(problem, fitted)[rows]
    states = design.rows.cycles[rows]
    first, last = states == states.min(), states == states.max()
    return FrictionLaw(
        rms_percent=middle,
        interval_percent=(low, high),
        where=_bands(design.rows.velocity[rows] / design.facts.geometry.mean_radius, left.mean(axis=1)),
        effect_on_mean_cof_percent=100.0 * float(law[last].mean() / exact[last].mean() - 1.0),
        effect_on_remaining_cycles_percent=_of_remaining(
            float(exact[last].mean() / exact[first].mean()), float(law[last].mean() / law[first].mean())
        ),
        gain=None
        if problem.noise.law == EXACT
        else measure_gain(FittedModel(exactly, alone), FittedModel(problem, fitted), rng),
        learned=learned_law(problem, fitted),
        curves=_curves(problem, alone, fitted, torque[:, None] * drawn, rows),
    )


def _draws(gram: Gram, projections: Sequence[Projected], rng: np.random.Generator) -> FloatArray:
    """Posterior draws [k, _DRAWS] of the law's coefficients, over the scatter of the gains and the law's sizes."""
    logs = np.array([projected.evidence for projected in projections])
    weights = np.exp(logs - logs.max())
    counts = np.diff(np.floor(np.cumsum(weights / weights.sum()) * _DRAWS + 1e-9), prepend=0.0).astype(int)
    drawn = []
    for projected, count in zip(projections, counts.tolist(), strict=True):
        if count:
            reduced = gram.reduced(projected.run_gain, projected.curve_gain)
            mean, root = reduced.law_coefficients(projected.sizes)
            drawn.append(mean[:, None] + root @ rng.standard_normal((root.shape[1], count)))
    return np.concatenate(drawn, axis=1)


def _bands(speed: FloatArray, relative: FloatArray) -> tuple[Band, ...]:
    """Bands even in ln v, with their shares of the squares of a relative discrepancy [n], largest first."""
    edges = np.geomspace(speed.min(), speed.max() * (1.0 + 1e-9), _BANDS + 1)
    place = np.clip(np.searchsorted(edges, speed, side="right") - 1, 0, _BANDS - 1)
    squares = np.bincount(place, weights=relative**2, minlength=_BANDS)
    shares = squares / max(float(squares.sum()), 1e-300)
    bands = [
        Band(low=low, high=high, share=share)
        for low, high, share in zip(edges[:-1].tolist(), edges[1:].tolist(), shares.tolist(), strict=True)
    ]
    return tuple(sorted(bands, key=lambda band: -band.share))


def _of_remaining(exact: float, law: float) -> float | None:
    """Relative change [%] of the remaining cycles, from the ratios of last to first mean torque by eq. 3 (`exact`) and
    by the law; None where a ratio leads to no end."""
    if not (0.5 < exact < 1.0 and 0.5 < law < 1.0):
        return None
    remaining = [(ratio - 0.5) / (1.0 - ratio) for ratio in (exact, law)]
    return 100.0 * (remaining[1] / remaining[0] - 1.0)


def _curves(
    problem: FitProblem, alone: PooledFit, fitted: PooledFit, drawn: FloatArray, rows: np.ndarray
) -> tuple[LawCurve, ...]:
    """Friction curves of the first and the last state at the lowest and the highest pressure, at the plateaus' own
    speeds."""
    design = problem.design
    by_law = fitted.torque + law_torque(problem, fitted)
    curves = []
    for cycles in np.unique(design.rows.cycles[rows])[[0, -1]]:
        for level in design.levels[[0, -1]]:
            here = np.flatnonzero((design.rows.cycles[rows] == cycles) & (design.level[rows] == level))
            here = here[np.argsort(design.rows.velocity[rows[here]], kind="stable")]
            if here.size:
                at = rows[here]
                curves.append(
                    LawCurve(
                        pressure=float(level),
                        cycles=float(cycles),
                        speed=design.rows.velocity[at] / design.facts.geometry.mean_radius,
                        measured=design.torque[at],
                        eq3=alone.torque[at],
                        law=by_law[at],
                        sd=drawn[here].std(axis=1),
                    )
                )
    return tuple(curves)
