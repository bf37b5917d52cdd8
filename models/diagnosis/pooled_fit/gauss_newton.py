"""The pooled fit: Gauss-Newton with Levenberg's damping on whitened rows, weak priors as further rows.

Effects may be fitted along: each brings its amplitude and its smooth shapes as further parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.baseline.criteria import CURVATURE_BOUNDS, USUAL_CURVATURE
from models.diagnosis.baseline.laws import (
    ATTRACTOR,
    BLOCK,
    DRIFT,
    FALL,
    KAPPA,
    LOG_CURVATURE,
    LOG_DECAY,
    OPEN_DRAG,
    POWERS,
    Frame,
    Laws,
)
from models.diagnosis.baseline.prediction import Prediction, predict
from models.diagnosis.design.design import Design
from models.diagnosis.effects import amplitude_prior
from models.diagnosis.effects.effect import Effect, Shape
from models.diagnosis.noise.covariance import Noise, gains_of, whitened, without_gains

#: How alike the two shares of one law are expected to drift [-].
ALIKE_SD = 0.1
#: The open clutch's drag is expected to be some such share of the usual torque.
_DRAG_SD = 0.3
_LARGEST_STEP = 1.5
#: A shape within this share of its range of a bound is at it.
AT_BOUND = 0.01
#: Columns [N, m] with noise and gains whitened.
Whiten: TypeAlias = Callable[[FloatArray], FloatArray]
_SMALL = 0.01  # nats: when the cost falls by less the fit has converged


@dataclass(frozen=True, slots=True, kw_only=True)
class Priors:
    """Rows of prior on θ: (combination θ - mean)/sd, `rows` [q, θ.size] already divided by sd, `means` [q] too; `free`
    [θ.size] which entries are fitted at all."""

    rows: FloatArray
    means: FloatArray
    free: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """An effect in a model: its amplitude and shape."""

    effect: Effect
    amplitude: float
    shape: Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A fitted model: laws, prediction of the baseline part, torque [N] of all of it, residual [N] Nm (measured minus
    torque), the effects in it, cost [nats] (half the whitened squares, priors included)."""

    laws: Laws
    prediction: Prediction
    torque: FloatArray
    residual: FloatArray
    effects: tuple[Fitted, ...]
    cost: float


def priors_of(design: Design, start: FloatArray, frame: Frame) -> Priors:
    """Weak priors around scales of the data, and what cannot be told at all held fast."""
    size = start.size
    level = design.usual_torque
    fastest = 2.0 * frame.reference_velocity
    sds, means = np.full(size, np.nan), start.copy()
    spreads = {0: 10 * level, 1: 3.0, 2: 3 * fastest, 3: 10 * level}
    for k, spread in spreads.items():
        block = k * BLOCK
        sds[block : block + BLOCK] = [spread, spread, 1.5, 1.5, 1.5, 0.7]
        means[block + 2 : block + BLOCK] = [0.0, 0.0, np.log(0.5 * design.facts.life), np.log(0.8)]
    sds[FALL], means[FALL] = (0.7, 1.2), (np.log(0.6 * frame.span), np.log(USUAL_CURVATURE))
    sds[DRIFT:ATTRACTOR], means[DRIFT:ATTRACTOR] = (0.6, 0.4, 0.3), 0.0
    # friction may follow at once: one wide doubt, and a step of 1 from pressure to pressure
    sds[KAPPA], means[KAPPA] = 1.0, 0.0
    sds[KAPPA.start], means[KAPPA.start] = 3.0, np.log(12 * level)
    sds[OPEN_DRAG], means[OPEN_DRAG] = _DRAG_SD * level, 0.0
    rows = np.diag(1 / sds)
    nodes = np.arange(size)[KAPPA]
    rows[nodes[1:], nodes[:-1]] = -1.0
    alike = np.zeros((4, size))
    for k in range(4):
        alike[k, k * BLOCK + 2], alike[k, k * BLOCK + 3] = 1 / ALIKE_SD, -1 / ALIKE_SD
    return Priors(
        rows=np.concatenate([rows, alike]),
        means=np.concatenate([means / sds, np.zeros(4)]),
        free=_free(design, size),
    )


def _free(design: Design, size: int) -> NDArray[np.bool_]:
    closed = design.closed
    states, levels = np.unique(design.rows.cycles[closed]).size, design.levels.size
    loop_states = np.unique(design.rows.cycles[design.plateaus :][closed[design.plateaus :]]).size
    free = np.ones(size, dtype=np.bool_)
    for k in range(4):
        block = k * BLOCK
        free[block + 1] = levels > 1
        free[block + 2 : block + 4] = states > 1, states > 1 and levels > 1
        free[block + 4 : block + 6] = states > 2
    free[FALL] = levels > 2, levels > 3
    free[DRIFT:ATTRACTOR] = loop_states > 1, loop_states > 2, loop_states > 1 and levels > 1
    free[OPEN_DRAG] = not closed.all()
    return free


def effect_rows(design: Design, prediction: Prediction, fitted: Fitted) -> FloatArray:
    """The change [N] Nm of an effect at the rows."""
    change = fitted.effect.change(prediction.scene, fitted.amplitude, fitted.shape)
    return prediction.change_at_rows(design, change, before_lag=fitted.effect.lags(fitted.shape))


def fit(
    design: Design,
    noise: Noise,
    start: Laws,
    priors: Priors,
    effects: Sequence[Fitted] = (),
    *,
    steps: int = 30,
) -> Fit:
    """Minimise half the whitened squares from a start, effects included.

    Gains are taken along the measured torque: it changes little and keeps the metric fixed while a fit moves.
    """
    gains = gains_of(design, design.torque, noise)

    def white(columns: FloatArray) -> FloatArray:
        return without_gains(whitened(columns, design, noise), gains, noise.run_gain, noise.curve_gain)

    state = _evaluated(design, white, start, priors, tuple(effects))
    damping, growth = 1e-3, 2.0
    for _ in range(steps):
        gram, gradient = _normal(design, white, priors, state)
        fallen = 0.0
        for _ in range(8):
            step = _inside(state, priors, gram + damping * np.diag(np.diag(gram)), gradient)
            trial = _moved(state, priors, step)
            if trial is not None:
                candidate = _evaluated(design, white, trial[0], priors, trial[1])
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
            break
        state = candidate
        if fallen < _SMALL:
            break
    return state


def _inside(state: Fit, priors: Priors, matrix: FloatArray, gradient: FloatArray) -> FloatArray:
    """The step [m] that matrix · step = gradient asks for; shapes at a bound beyond which it would lead are held there."""
    step = np.asarray(np.linalg.solve(matrix, gradient), dtype=np.float64)
    at, held = int(priors.free.sum()), np.zeros(step.size, dtype=np.bool_)
    for each in state.effects:
        at += 1
        for value, known in zip(each.shape, each.effect.shapes, strict=True):
            if known.smooth:
                held[at] = (value <= known.lowest and step[at] < 0) or (value >= known.highest and step[at] > 0)
                at += 1
    if held.any():
        step[held] = 0.0
        step[~held] = np.linalg.solve(matrix[np.ix_(~held, ~held)], gradient[~held])
    return step


def _evaluated(design: Design, white: Whiten, laws: Laws, priors: Priors, effects: tuple[Fitted, ...]) -> Fit:
    with np.errstate(all="ignore"):
        prediction = predict(design, laws)
        torque = prediction.torque.copy()
        for each in effects:
            torque += effect_rows(design, prediction, each)
        residual = design.torque - torque
        if not np.isfinite(residual).all():
            cost = float("inf")
        else:
            cost = 0.5 * float((white(residual[:, None]) ** 2).sum()) + 0.5 * float(
                ((priors.rows @ laws.theta - priors.means) ** 2).sum()
            )
            for each in effects:
                cost += amplitude_prior.cost(each.effect, each.amplitude)
    return Fit(laws=laws, prediction=prediction, torque=torque, residual=residual, effects=effects, cost=cost)


def _normal(design: Design, white: Whiten, priors: Priors, state: Fit) -> tuple[FloatArray, FloatArray]:
    """Gram matrix and gradient over the free θ and the effects' parameters."""
    columns = [state.prediction.jacobian(design)[:, priors.free]]
    columns += [effect_columns(design, state.prediction, each) for each in state.effects]
    jacobian = np.concatenate(columns, axis=1)
    rows_white = white(np.column_stack([jacobian, state.residual]))
    size = jacobian.shape[1]
    count = int(priors.free.sum())
    gram = rows_white[:, :size].T @ rows_white[:, :size]
    gradient = rows_white[:, :size].T @ rows_white[:, size]
    rows = priors.rows[:, priors.free]
    gram[:count, :count] += rows.T @ rows
    gradient[:count] -= rows.T @ (priors.rows @ state.laws.theta - priors.means)
    at = count
    for each in state.effects:
        precisions = effect_precisions(each)
        diagonal = np.arange(at, at + precisions.size)
        gram[diagonal, diagonal] += precisions
        gradient[at] -= each.amplitude * precisions[0]
        at += precisions.size
    diagonal = np.diag(gram)
    gram[np.diag_indices_from(gram)] = np.where(diagonal > 0, (1.0 + 1e-12) * diagonal, 1.0)
    return gram, gradient


def effect_precisions(fitted: Fitted) -> FloatArray:
    """1/sd² of the priors on (amplitude, smooth shapes) [1 + s]; that of the amplitude where it is."""
    smooth = [0.5 * (shape.highest - shape.lowest) for shape in fitted.effect.shapes if shape.smooth]
    return np.array([amplitude_prior.precision(fitted.effect, fitted.amplitude), *(width**-2.0 for width in smooth)])


def free_shapes(fitted: Fitted) -> NDArray[np.bool_]:
    """Which of (amplitude, smooth shapes) [1 + s] a refit may move: shapes at a bound stay there."""
    known = [(value, each) for value, each in zip(fitted.shape, fitted.effect.shapes, strict=True) if each.smooth]
    margins = [min(value - each.lowest, each.highest - value) / (each.highest - each.lowest) for value, each in known]
    return np.array([True, *(margin > AT_BOUND for margin in margins)])


def effect_columns(design: Design, prediction: Prediction, fitted: Fitted) -> FloatArray:
    """∂change/∂(amplitude, smooth shapes) [N, 1 + s] at the rows, by central differences."""
    effect, ends = fitted.effect, list[tuple[float, Shape]]()
    deltas = [1e-3 * effect.prior_sd]
    ends += [(fitted.amplitude + side * deltas[0], fitted.shape) for side in (1.0, -1.0)]
    for index, known in enumerate(effect.shapes):
        if known.smooth:
            deltas.append(1e-3 * (known.highest - known.lowest))
            for side in (1.0, -1.0):
                shape = list(fitted.shape)
                shape[index] += side * deltas[-1]
                ends.append((fitted.amplitude, tuple(shape)))
    changes = effect.changes(prediction.scene, ends)
    columns = (changes[:, ::2] - changes[:, 1::2]) / (2 * np.array(deltas))
    return prediction.change_at_rows(design, columns, before_lag=effect.lags(fitted.shape))


def _moved(state: Fit, priors: Priors, step: FloatArray) -> tuple[Laws, tuple[Fitted, ...]] | None:
    """The state after a step, shapes kept inside their bounds; logarithms move by a limited amount."""
    if not np.isfinite(step).all():
        return None
    count = int(priors.free.sum())
    move = np.zeros(state.laws.theta.size)
    move[priors.free] = step[:count]
    for k in range(4):
        block = k * BLOCK
        move[block + 2 : block + BLOCK] = np.clip(move[block + 2 : block + BLOCK], -_LARGEST_STEP, _LARGEST_STEP)
    move[LOG_DECAY:-POWERS] = np.clip(move[LOG_DECAY:-POWERS], -_LARGEST_STEP, _LARGEST_STEP)
    theta = state.laws.theta + move
    theta[LOG_CURVATURE] = np.clip(theta[LOG_CURVATURE], *np.log(CURVATURE_BOUNDS))
    for k in range(4):
        theta[k * BLOCK + 4 : k * BLOCK + 6] = np.clip(theta[k * BLOCK + 4 : k * BLOCK + 6], -3.0, 25.0)
    at, effects = count, []
    for each in state.effects:
        size = each.amplitude + float(step[at])
        at += 1
        shape = list(each.shape)
        for index, parameter in enumerate(each.effect.shapes):
            if parameter.smooth:
                shape[index] = float(np.clip(shape[index] + step[at], parameter.lowest, parameter.highest))
                at += 1
        effects.append(Fitted(effect=each.effect, amplitude=size, shape=tuple(shape)))
    return Laws(theta=theta, frame=state.laws.frame), tuple(effects)
