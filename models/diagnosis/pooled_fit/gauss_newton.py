"""The pooled fit: Gauss-Newton with Levenberg's damping on whitened rows, weak priors as further rows.

    min over θ, effects:   ½ |V^{-1/2} (torque - model)|² + ½ |R θ - m|² + Σ_effects -ln p(amplitude)

Effects may be fitted along: each brings its amplitude and its smooth shapes as further parameters. A fit says how it ended.
A refit is a fit that is followed to its end, with effects or beside a pattern that has no name.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.laws import BLOCK, BLOCKS, COURSE, ENDS, LOG_CURVATURE, LOG_DECAY, POWERS, SHARES, Laws
from models.diagnosis.baseline.prediction import Prediction, predict
from models.diagnosis.design.design import Design
from models.diagnosis.effects.effect import SCALES
from models.diagnosis.effects.fitted_effect import FittedEffect, law_columns
from models.diagnosis.noise.covariance import Products
from models.diagnosis.pooled_fit.problem import FitProblem, Priors

#: Gauss-Newton steps where the caller asks for no other number, and damped trials for each.
STEPS = 30
_LARGEST_STEP = 1.5


class FitStatus(StrEnum):
    """The way a fit ended: the cost stopped falling; no step lowered it at all; it used all of its steps; its cost or
    its derivatives were not finite."""

    CONVERGED = "converged"
    STALLED = "stalled"
    OUT_OF_STEPS = "out_of_steps"
    NOT_FINITE = "not_finite"


@dataclass(frozen=True, slots=True, kw_only=True)
class PooledFit:
    """A fit of all rows of a campaign: parameters, predicted torque, residual, effects, cost and how the fit ended."""

    laws: Laws
    prediction: Prediction  # of the baseline part
    torque: FloatArray  # [N] Nm of all of it
    residual: FloatArray  # [N] Nm, measured minus torque
    effects: tuple[FittedEffect, ...]
    cost: float  # [nats], half the whitened squares, priors included
    status: FitStatus  # how it ended

    @property
    def wrong_sign(self) -> bool:
        """Whether the fitted amplitude of a one-sided effect is negative."""
        return any(effect.wrong_sign for effect in self.effects)


def fit(
    problem: FitProblem,
    start: Laws,
    effects: Sequence[FittedEffect] = (),
    *,
    steps: int = STEPS,
    reach: float = math.inf,
) -> PooledFit:
    """The least-cost fit found from a start, effects included, in at most `steps` damped Gauss-Newton steps. It stops
    early where, at the pace of its last two steps, the cost would not come down to `reach`.

    Gains are taken along one torque (`FitProblem.gained`), which keeps the metric fixed while a fit moves.
    """
    metric, priors = problem.metric(), problem.priors
    state = _evaluated(problem, metric, start, tuple(effects))
    damping, growth = 1e-3, 2.0
    status, pace = FitStatus.OUT_OF_STEPS, math.inf
    for left in reversed(range(steps)):
        with np.errstate(over="ignore", invalid="ignore"):
            gram, gradient = _normal(problem, metric, state)
        if not np.isfinite(gram).all():
            status = FitStatus.NOT_FINITE
            break
        fallen = 0.0
        for _ in range(8):
            step = _inside(state, priors, gram + damping * np.diag(np.diag(gram)), gradient)
            trial = _moved(state, priors, step)
            if trial is not None:
                candidate = _evaluated(problem, metric, *trial)
                expected = float(step @ gradient - 0.5 * step @ (gram @ step))
                fallen = state.cost - candidate.cost
                if np.isfinite(candidate.cost) and fallen > 0:
                    share = fallen / max(expected, 1e-12)
                    damping *= 1 / 5 if share > 0.5 else 1 - (2 * share - 1) ** 3
                    growth = 2.0
                    break
            fallen = 0.0
            damping, growth = damping * growth, growth * 2
        if fallen <= 0:
            status = FitStatus.STALLED
            break
        state = candidate
        if fallen < 0.01:  # nats
            status = FitStatus.CONVERGED
            break
        if state.cost - left * max(pace, fallen) > reach:
            break
        pace = fallen
    return replace(state, status=status if np.isfinite(state.cost) else FitStatus.NOT_FINITE)


def _inside(state: PooledFit, priors: Priors, matrix: FloatArray, gradient: FloatArray) -> FloatArray:
    """Solution [m] of matrix · step = gradient; parameters at a bound that the step would cross are held and the others
    solved again."""
    step = np.asarray(np.linalg.solve(matrix, gradient), dtype=np.float64)
    at, at_bound = int(priors.free.sum()), np.zeros(step.size, dtype=np.bool_)
    for fitted in state.effects:
        effect = fitted.effect
        ends = [(-math.inf if effect.positive else effect.lowest, fitted.amplitude, effect.highest)]
        ends += [(shape.lowest, value, shape.highest) for value, shape in effect.smooth(fitted.shape)]
        for lowest, value, highest in ends:
            at_bound[at] = (value <= lowest and step[at] < 0) or (value >= highest and step[at] > 0)
            at += 1
    if at_bound.any():
        step[at_bound] = 0.0
        step[~at_bound] = np.linalg.solve(matrix[np.ix_(~at_bound, ~at_bound)], gradient[~at_bound])
    return step


def _evaluated(problem: FitProblem, metric: Products, laws: Laws, effects: tuple[FittedEffect, ...]) -> PooledFit:
    """The fit at these parameters without a step: torque, residual and cost [nats], which is infinite where they
    overflow."""
    design, priors = problem.design, problem.priors
    with np.errstate(over="ignore", invalid="ignore"):  # a step too far: its cost is infinite, and it is not taken
        prediction = predict(design, laws)
        torque = prediction.torque.copy()
        for effect in effects:
            torque += effect.rows(design, prediction)
        residual = design.torque - torque
        cost = float("inf")
        if np.isfinite(residual).all():
            cost = 0.5 * float(metric(residual[:, None])[0, 0])
            cost += 0.5 * float(((priors.rows @ laws.theta - priors.means) ** 2).sum())
            cost = sum((effect.effect.amplitude_cost(effect.amplitude) for effect in effects), cost)
    return PooledFit(
        laws=laws,
        prediction=prediction,
        torque=torque,
        residual=residual,
        effects=effects,
        cost=cost,
        status=FitStatus.OUT_OF_STEPS,
    )


def sensitivities(problem: FitProblem, fitted: PooledFit) -> FloatArray:
    """∂torque/∂(free θ, then amplitude and smooth shapes of each effect) [N, m]."""
    design, prediction = problem.design, fitted.prediction
    of_effects = [effect.columns(design, prediction) for effect in fitted.effects]
    of_laws = law_columns(design, prediction, fitted.effects)[:, problem.priors.free]
    return np.concatenate([of_laws, *of_effects], axis=1)


def prior_gram(priors: Priors, fitted: PooledFit) -> FloatArray:
    """The priors' contribution [m + 1, m + 1] to the Gram matrix of (sensitivities, residual)."""
    rows, off = priors.rows[:, priors.free], priors.means - priors.rows @ fitted.laws.theta
    free, own = rows.shape[1], [effect.precisions for effect in fitted.effects]
    gram = np.diag(np.concatenate([np.zeros(free), *own, [0.0]]))
    gram[:free, :free] = rows.T @ rows
    gram[:free, -1] = rows.T @ off
    at = free
    for effect, precisions in zip(fitted.effects, own, strict=True):
        gram[at, -1] = -precisions[0] * effect.amplitude
        at += precisions.size
    gram[-1] = gram[:, -1]
    costs = (2.0 * effect.effect.amplitude_cost(effect.amplitude) for effect in fitted.effects)
    gram[-1, -1] = sum(costs, float(off @ off))
    return gram


def _normal(problem: FitProblem, metric: Products, state: PooledFit) -> tuple[FloatArray, FloatArray]:
    """Gram matrix [m, m] and gradient [m] of the cost over the free θ and the effects' parameters."""
    whole = metric(np.column_stack([sensitivities(problem, state), state.residual])) + prior_gram(problem.priors, state)
    gram, gradient = whole[:-1, :-1], whole[:-1, -1]
    diagonal = np.diag(gram)
    gram[np.diag_indices_from(gram)] = np.where(diagonal > 0, (1.0 + 1e-12) * diagonal, 1.0)
    return gram, gradient


def _moved(state: PooledFit, priors: Priors, step: FloatArray) -> tuple[Laws, tuple[FittedEffect, ...]] | None:
    """The laws and effects after a step, shapes kept inside their bounds and logarithms moved by at most 1.5; None if
    the step is not finite."""
    if not np.isfinite(step).all():
        return None
    count = int(priors.free.sum())
    move = np.zeros(state.laws.theta.size)
    move[priors.free] = step[:count]
    for limited in (move[:LOG_DECAY].reshape(BLOCKS, BLOCK)[:, SHARES.start :], move[LOG_DECAY:-POWERS]):
        limited[:] = np.clip(limited, -_LARGEST_STEP, _LARGEST_STEP)
    theta = state.laws.theta + move
    theta[LOG_CURVATURE] = np.clip(theta[LOG_CURVATURE], *np.log(criteria.CURVATURE_BOUNDS))
    courses = theta[:LOG_DECAY].reshape(BLOCKS, BLOCK)[:, COURSE]  # a view
    courses[:] = np.clip(courses, -3.0, 25.0)
    at, effects = count, []
    for fitted in state.effects:
        size = fitted.effect.within(fitted.amplitude + float(step[at]))
        at += 1
        shape = list(fitted.shape)
        for index in fitted.smooth_places:
            parameter = fitted.effect.shapes[index]
            shape[index] = float(np.clip(shape[index] + step[at], parameter.lowest, parameter.highest))
            at += 1
        effects.append(FittedEffect(effect=fitted.effect, amplitude=size, shape=tuple(shape)))
    return replace(state.laws, theta=theta), tuple(effects)


#: Gauss-Newton steps at most: a refit is followed to its end. With 10, a running-in was 49 nats short of it and stood behind
#: what it was; 31 and 35 steps ended the longest two of 30 refits near the best (`make blind SEED=23 SIZE=0.03`).
REFIT_STEPS = 40


def refit(
    problem: FitProblem, starts: Sequence[Laws], effects: tuple[FittedEffect, ...], reach: float = math.inf
) -> PooledFit | None:
    """The best fit from each of several laws with effects; None where a one-sided effect is negative or nothing finite fits.
    A start is followed while it may still come down to `reach`, and to the best of those before it."""
    if any(effect.wrong_sign for effect in effects):
        return None
    best = None
    for laws in starts:
        for start in _starts(problem.design, laws, effects):
            fitted = fit(problem, *start, steps=REFIT_STEPS, reach=reach if best is None else min(reach, best.cost))
            possible = not (fitted.wrong_sign or fitted.status is FitStatus.NOT_FINITE)
            if possible and (best is None or fitted.cost < best.cost):
                best = fitted
    return best


def _starts(
    design: Design, laws: Laws, effects: tuple[FittedEffect, ...]
) -> Iterator[tuple[Laws, tuple[FittedEffect, ...]]]:
    """Starting points of a refit: the laws as given; and where a fresh value is below 0, also with all fresh values
    made positive, the last effect then large and with each smooth shape of its grid, because a screen about curves with
    a wrong sign says little about its size."""
    yield laws, effects
    if np.all(_ends(laws) >= 0.0):  # one that is not free is 0
        return
    upright = _upright(laws)
    yield upright, effects
    if effects:
        *others, last = effects
        large = last.effect.within(math.copysign(SCALES[-1] * last.effect.prior_sd, last.amplitude))
        for tried in last.effect.grid(design.facts):
            if last.effect.stiff(tried.shape) == last.effect.stiff(last.shape):
                yield upright, (*others, replace(last, amplitude=large, shape=tried.shape))


def _ends(laws: Laws) -> FloatArray:
    """The fresh values [BLOCKS, 2] of each law at the lowest and the highest pressure, a view of θ."""
    return laws.theta[:LOG_DECAY].reshape(BLOCKS, BLOCK)[:, ENDS]


def _upright(laws: Laws) -> Laws:
    """Laws with every fresh value above 0. Where an effect bends curves, the baseline alone follows with a C_v < 0, and a
    refit with the effect does not come back: the share that a value loses has no bound where the value passes through 0, and
    its prior is a wall. A heating of 15 % beside a measured plate ended 558 nats above its least cost."""
    turned = replace(laws, theta=laws.theta.copy())
    for block, ends in zip(turned.theta[:LOG_DECAY].reshape(BLOCKS, BLOCK), _ends(turned), strict=True):
        if np.any(ends < 0.0):
            ends[ends < 0.0] = 0.25 * np.abs(ends).max()
            block[SHARES] = np.clip(block[SHARES], -1.0, 1.0)
    return turned


def refit_beside(problem: FitProblem, start: PooledFit, pattern: FloatArray) -> PooledFit | None:
    """The fit to the measured torque minus a pattern [N] Nm, with the pattern added back to its residual: the baseline
    moves to where it leaves that pattern."""
    design = problem.design
    without = replace(problem, design=replace(design, torque=design.torque - pattern))
    fitted = refit(without, [start.laws], start.effects)
    return None if fitted is None else replace(fitted, residual=fitted.residual + pattern)
