"""What an extension gains on runs that it has not seen: left out by state and by pressure, never by row.

Baseline and extended model are refitted without the rows of a fold and foretell them. A fold is some of the states, some
of the pressures, or the last states (what would have been foretold of them from the first ones). The log score is that of
the held-out rows under the noise, gains of whole runs and curves included; its gain is the difference [nats]. States ahead
are foretold with the uncertainty of the parameters,

    r ~ N(0, V + J P⁻¹ Jᵀ),     P = Jᵀ V⁻¹ J over the rows before, priors included,

for there a model that extrapolates boldly must not be taken for a better one.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.baseline.laws import KAPPA, Laws
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise, gains_of, whitened, without_gains
from models.diagnosis.pooled_fit.gauss_newton import Fit, Priors, effect_columns, effect_precisions, fit
from models.diagnosis.report.report import Gain

#: Folds of states and of pressures, and the share of the states that are foretold from those before.
STATE_FOLDS, PRESSURE_FOLDS, FORWARD_SHARE = 3, 2, 1 / 3
#: Rows left out weigh as if their noise were so many times what it is.
_LEFT_OUT = 1e6
#: Gauss-Newton steps from the fit to all rows: enough to forget the rows that are held out.
_STEPS = 12
_RESAMPLES = 400

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Held:
    """Rows [h] that were held out once, and what either model missed them by [h] Nm; the log score gained."""

    rows: NDArray[np.intp]
    before: FloatArray
    after: FloatArray
    score: float


def measure_gain(
    design: Design, noise: Noise, priors: Priors, baseline: Fit, extended: Fit, rng: np.random.Generator
) -> Gain | None:
    """The gain of an extended model over the baseline, or None where there are too few states and pressures to leave out."""
    folds = _folds(design)
    held = [_held(design, noise, priors, baseline, extended, fold) for fold in folds]
    ahead = _ahead(design)
    remaining = 0.0
    if ahead is not None:
        scores = [_foretold(design, noise, priors, model, ahead) for model in (baseline, extended)]
        remaining = scores[1] - scores[0]
    if not held:
        return None
    rows = np.concatenate([each.rows for each in held])
    before, after = (np.concatenate([getattr(each, name) for each in held]) for name in ("before", "after"))
    reduction, spread = _reduction(design.curve[rows], before, after, rng)
    scatter = (noise.run_gain**2 + noise.curve_gain**2) * design.torque[rows] ** 2
    floor = float(np.mean(noise.deviation[rows] ** 2 + scatter))
    total = float(np.var(design.torque[rows]))
    return Gain(
        held_out_runs=tuple(design.runs[run].run_id for run in np.unique(design.rows.run[rows])),
        rmse_before=_rms(before),
        rmse_after=_rms(after),
        reduction_percent=reduction,
        reduction_sd=spread,
        excess_before=_beyond(before, floor),
        excess_after=_beyond(after, floor),
        mse_percent_before=100 * float(np.mean(before**2)) / max(total, 1e-300),
        mse_percent_after=100 * float(np.mean(after**2)) / max(total, 1e-300),
        log_score_gain=sum(each.score for each in held) * design.torque.size / rows.size,
        remaining=remaining,
    )


def _folds(design: Design) -> list[BoolArray]:
    folds = []
    # readings of the open clutch hold no friction to foretell: they are never left out
    states, levels = np.unique(design.rows.cycles[design.closed]), design.levels
    if states.size >= 3:
        inner = min(STATE_FOLDS, states.size)
        # neighbouring states go into different folds
        folds += [design.closed & np.isin(design.rows.cycles, states[start::inner]) for start in range(inner)]
    if levels.size >= 4:
        folds += [np.isin(design.level, levels[1:][start::PRESSURE_FOLDS]) for start in range(PRESSURE_FOLDS)]
    return folds


def _ahead(design: Design) -> BoolArray | None:
    states = np.unique(design.rows.cycles[design.closed])
    count = max(1, round(FORWARD_SHARE * states.size))
    return design.closed & (design.rows.cycles >= states[-count]) if states.size >= 4 else None


def _without(noise: Noise, out: BoolArray) -> Noise:
    """The noise when those rows are left out."""
    return replace(noise, deviation=np.where(out, _LEFT_OUT, 1.0) * noise.deviation)


def _white(columns: FloatArray, design: Design, noise: Noise) -> FloatArray:
    gains = gains_of(design, design.torque, noise)
    return without_gains(whitened(columns, design, noise), gains, noise.run_gain, noise.curve_gain)


def _foretold(design: Design, noise: Noise, priors: Priors, model: Fit, out: BoolArray) -> float:
    """The log score [nats] of rows that are held out, the uncertainty of what was fitted to the others included."""
    before = _without(noise, out)
    found = fit(design, before, model.laws, priors, model.effects, steps=_STEPS)
    own = [effect_columns(design, found.prediction, each) for each in found.effects]
    jacobian = np.concatenate([found.prediction.jacobian(design)[:, priors.free], *own], axis=1)
    seen = _white(jacobian, design, before)
    told = _white(np.column_stack([jacobian, found.residual]), design, _without(noise, ~out))
    precision = seen.T @ seen
    rows = priors.rows[:, priors.free]
    precision[: rows.shape[1], : rows.shape[1]] += rows.T @ rows
    weak = np.concatenate([np.zeros(rows.shape[1]), *(effect_precisions(each) for each in found.effects)])
    precision[np.diag_indices_from(precision)] += weak + 1e-12 * np.diag(precision)
    columns, residual = told[:, :-1], told[:, -1]
    scale = 1 / np.sqrt(np.diag(precision))
    inner = (precision + columns.T @ columns) * scale[:, None] * scale
    along = (columns.T @ residual) * scale
    quadratic = float(residual @ residual) - float(along @ np.linalg.solve(inner, along))
    logdet = float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(precision * scale[:, None] * scale)[1])
    return -0.5 * (quadratic + logdet)


def _held(design: Design, noise: Noise, priors: Priors, baseline: Fit, extended: Fit, out: BoolArray) -> _Held:
    masked = _without(noise, out)
    missed = []
    for model in (baseline, extended):
        found = fit(design, masked, model.laws, priors, model.effects, steps=_STEPS)
        bridged = _bridged(found.laws, design, out)
        if bridged is not found.laws:
            found = fit(design, masked, bridged, priors, found.effects, steps=0)
        missed.append(np.where(out, found.residual, 0.0))
    squares = np.square(_white(np.stack(missed, axis=1), design, noise)).sum(axis=0)
    rows = np.flatnonzero(out)
    return _Held(rows=rows, before=missed[0][rows], after=missed[1][rows], score=0.5 * float(squares[0] - squares[1]))


def _bridged(laws: Laws, design: Design, out: BoolArray) -> Laws:
    """With C at pressures whose loops were all held out taken from the pressures beside them (log C linear between)."""
    nodes = laws.frame.loop_pressures
    looping = ~design.rows.steady
    known = np.isin(nodes, np.unique(design.level[looping & ~out]))
    if known.all() or not known.any():
        return laws
    theta = laws.theta.copy()
    theta[KAPPA] = np.interp(nodes, nodes[known], theta[KAPPA][known])
    return replace(laws, theta=theta)


def _reduction(
    curve: NDArray[np.intp], before: FloatArray, after: FloatArray, rng: np.random.Generator
) -> tuple[float, float]:
    """By how much the RMSE falls [%], and its deviation: whole curves are drawn anew, both models on the same ones."""
    _, index = np.unique(curve, return_inverse=True)
    sums = np.stack([np.bincount(index, weights=each**2) for each in (before, after)])
    drawn = rng.integers(sums.shape[1], size=(_RESAMPLES, sums.shape[1]))
    again = sums[:, drawn].sum(axis=2)
    reductions = 100 * (1 - np.sqrt(again[1] / np.maximum(again[0], 1e-300)))
    return 100 * (1 - _rms(after) / max(_rms(before), 1e-300)), float(np.std(reductions))


def _rms(missed: FloatArray) -> float:
    return float(np.sqrt(np.mean(missed**2)))


def _beyond(missed: FloatArray, floor: float) -> float:
    return float(np.sqrt(max(float(np.mean(missed**2)) - floor, 0.0)))
