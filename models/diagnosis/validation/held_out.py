"""What an extension gains on held-out runs: left out by state and by pressure, never by row.

Baseline and extended model are refitted without the rows of a fold and predict them. A fold is some of the states, some of
the pressures, or the last states (predicted from the first ones). The log score is that of the held-out rows under the
noise, gains of whole runs and curves included; its gain is the difference [nats]. The last states are predicted with the
uncertainty of the parameters,

    r ~ N(0, V + J P⁻¹ Jᵀ),     P = Jᵀ V⁻¹ J over the rows before, priors included,

so that a model that extrapolates boldly is not taken for a better one. The law's discrepancy predicts held-out rows as the
others have it; its own gain is that over eq. 3 taken for exact.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.baseline.law_form import EXACT
from models.diagnosis.baseline.laws import KAPPA, Laws
from models.diagnosis.design.design import CYCLES, PRESSURE, Design
from models.diagnosis.noise.covariance import Noise
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit, prior_gram, sensitivities
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import law_torque

BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardest:
    """The state or pressure at which the extended model's error on held-out rows is largest."""

    axis: str  # cycles, or pressure
    value: float  # there, pressure in Pa
    rmse: float  # [Nm]
    beyond: float  # by how much the value is beyond all that were kept (0: it is among them)


@dataclass(frozen=True, slots=True, kw_only=True)
class Gain:
    """Gain of the extended model over the baseline on runs held out by state and by pressure; rmse [Nm], log score
    [nats]."""

    held_out_runs: tuple[str, ...]
    rmse_before: float
    rmse_after: float
    reduction_percent: float
    reduction_sd: float  # its paired uncertainty [%]
    excess_before: float  # error beyond noise [Nm]
    excess_after: float
    mse_percent_before: float  # of eq. 5
    mse_percent_after: float
    log_score_gain: float
    forecast_log_score_gain: float  # when the last states are predicted from the first ones
    hardest: Hardest | None = None  # where the error after is largest


@dataclass(frozen=True, slots=True, kw_only=True)
class _HeldOut:
    """Held-out rows [h] of one fold, the errors of both models there [h] Nm, and the gain of log score [nats]."""

    rows: NDArray[np.intp]
    before: FloatArray
    after: FloatArray
    score: float


@dataclass(frozen=True, slots=True)
class FittedModel:
    """A fit with its problem, of which the law's discrepancy is part."""

    problem: FitProblem
    fit: PooledFit


def measure_gain(before: FittedModel, after: FittedModel, rng: np.random.Generator) -> Gain | None:
    """The gain of a model over another, or None where there are too few states and pressures to leave out."""
    design, noise = after.problem.design, after.problem.noise
    folds = [_predicted_fold(before, after, fold) for fold in _folds(design)]
    ahead = _last_states(design)
    forecast = 0.0
    if ahead is not None:
        scores = [_forecast_score(model, ahead) for model in (before, after)]
        forecast = scores[1] - scores[0]
    if not folds:
        return None
    rows, off_before, off_after = (
        np.concatenate([getattr(f, name) for f in folds]) for name in ("rows", "before", "after")
    )
    reduction, spread = _reduction(design.curve[rows], off_before, off_after, rng)
    scatter = (noise.run_gain**2 + noise.curve_gain**2) * design.torque[rows] ** 2
    floor = float(np.mean(noise.deviation[rows] ** 2 + scatter))
    total = max(float(np.var(design.torque[rows])), 1e-300)
    square_before, square_after = (float(np.mean(errors**2)) for errors in (off_before, off_after))
    return Gain(
        held_out_runs=tuple(design.runs[run].run_id for run in np.unique(design.rows.run[rows])),
        rmse_before=_rms(off_before),
        rmse_after=_rms(off_after),
        reduction_percent=reduction,
        reduction_sd=spread,
        excess_before=max(square_before - floor, 0.0) ** 0.5,
        excess_after=max(square_after - floor, 0.0) ** 0.5,
        mse_percent_before=100 * square_before / total,
        mse_percent_after=100 * square_after / total,
        log_score_gain=sum(fold.score for fold in folds) * design.torque.size / rows.size,
        forecast_log_score_gain=forecast,
        hardest=max((group for fold in folds for group in _groups(design, fold)), key=lambda group: group.rmse),
    )


def _groups(design: Design, fold: _HeldOut) -> list[Hardest]:
    """RMS errors [Nm] of the extended model at each state, or pressure, that a fold left out."""
    groups = []
    out = np.zeros(design.torque.size, dtype=np.bool_)
    out[fold.rows] = True
    for axis, values in ((CYCLES, design.rows.cycles), (PRESSURE, design.level)):
        groups_left = np.unique(values[design.closed & ~out])
        left = np.setdiff1d(values[out], groups_left)  # none along the other axis
        for value in left.tolist():
            beyond = max(value - float(groups_left[-1]), float(groups_left[0]) - value, 0.0)
            error = _rms(fold.after[values[fold.rows] == value])
            groups.append(Hardest(axis=axis, value=value, rmse=error, beyond=beyond))
    return groups


def _folds(design: Design) -> list[BoolArray]:
    """Masks [N] of the rows that each fold leaves out: some of the states, then some of the pressures."""
    folds = []
    # readings of the open clutch hold no friction to predict: they are never left out
    states, levels = np.unique(design.rows.cycles[design.closed]), design.levels
    if states.size >= 3:
        inner = min(criteria.STATE_FOLDS, states.size)
        # neighbouring states go into different folds
        folds += [design.closed & np.isin(design.rows.cycles, states[start::inner]) for start in range(inner)]
    if levels.size >= 4:
        folds += [
            np.isin(design.level, levels[1:][start :: criteria.PRESSURE_FOLDS])
            for start in range(criteria.PRESSURE_FOLDS)
        ]
    return folds


def _last_states(design: Design) -> BoolArray | None:
    """Mask [N] of the closed clutch's rows in the last FORWARD_SHARE of the states; None with fewer than four states."""
    states = np.unique(design.rows.cycles[design.closed])
    count = max(1, round(criteria.FORWARD_SHARE * states.size))
    return design.closed & (design.rows.cycles >= states[-count]) if states.size >= 4 else None


def _without(noise: Noise, out: BoolArray) -> Noise:
    """The noise with so large a deviation on the rows `out` that they have no weight."""
    return replace(noise, deviation=np.where(out, 1e6, 1.0) * noise.deviation)  # as good as not there


def _forecast_score(model: FittedModel, out: BoolArray) -> float:
    """Log predictive density [nats, up to a constant] of the rows `out` [N] under N(0, V + J P⁻¹ Jᵀ), the model refitted
    to the others; J includes the columns of the law's discrepancy."""
    problem = model.problem
    noise = replace(problem.noise, law=EXACT)  # the law's coefficients are fitted beside the parameters
    kept = problem.with_noise(_without(problem.noise, out))
    refit = fit(kept, model.fit.laws, model.fit.effects, steps=criteria.FEW_STEPS)
    law = np.zeros((out.size, 0)) if problem.law is None else problem.law.scaled(problem.noise.law)
    jacobian = np.column_stack([sensitivities(problem, refit), law])
    precision = problem.metric(_without(noise, out))(jacobian)
    own = precision.shape[0] - law.shape[1]
    precision[:own, :own] += prior_gram(problem.priors, refit)[:-1, :-1]
    precision[own:, own:] += np.eye(law.shape[1])
    columns = np.column_stack([jacobian, refit.residual - law_torque(kept, refit)])
    return _log_predictive(precision, problem.metric(_without(noise, ~out))(columns))


def _log_predictive(precision: FloatArray, products: FloatArray) -> float:
    """Log density [nats] of a residual r ~ N(0, V + J P⁻¹ Jᵀ), without the term of V's determinant, from the precision P
    [p, p] of the parameters and the products [J, r]ᵀ V⁻¹ [J, r] [p + 1, p + 1]:

    -½ (rᵀV⁻¹r - rᵀV⁻¹J (P + JᵀV⁻¹J)⁻¹ JᵀV⁻¹r) - ½ ln(det(P + JᵀV⁻¹J)/det P)
    """
    ridged = precision.copy()
    ridged[np.diag_indices_from(ridged)] *= 1.0 + 1e-12  # P may be singular to rounding
    scale = 1 / np.sqrt(np.diag(ridged))
    inner = (ridged + products[:-1, :-1]) * scale[:, None] * scale
    along = products[:-1, -1] * scale
    quadratic = float(products[-1, -1]) - float(along @ np.linalg.solve(inner, along))
    logdet = float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(ridged * scale[:, None] * scale)[1])
    return -0.5 * (quadratic + logdet)


def _predicted_fold(before: FittedModel, after: FittedModel, out: BoolArray) -> _HeldOut:
    """Errors of both models at the rows `out` [N], each model refitted to the other rows."""
    errors = []
    for model in (before, after):
        masked = model.problem.with_noise(_without(model.problem.noise, out))
        refit = fit(masked, model.fit.laws, model.fit.effects, steps=criteria.FEW_STEPS)
        bridged = _interpolated_loop_laws(refit.laws, masked.design, out)
        if bridged is not refit.laws:
            refit = fit(masked, bridged, refit.effects, steps=0)
        errors.append(np.where(out, refit.residual - law_torque(masked, refit), 0.0))
    problem = after.problem
    squares = np.diag(problem.metric(replace(problem.noise, law=EXACT))(np.stack(errors, axis=1)))
    rows = np.flatnonzero(out)
    return _HeldOut(
        rows=rows, before=errors[0][rows], after=errors[1][rows], score=0.5 * float(squares[0] - squares[1])
    )


def _interpolated_loop_laws(laws: Laws, design: Design, out: BoolArray) -> Laws:
    """The laws with C, at pressures whose loops were all held out, interpolated from neighbouring pressures (log C
    linear between)."""
    nodes = laws.frame.loop_pressures
    looping = ~design.rows.steady
    is_known = np.isin(nodes, np.unique(design.level[looping & ~out]))
    if is_known.all() or not is_known.any():
        return laws
    theta = laws.theta.copy()
    theta[KAPPA] = np.interp(nodes, nodes[is_known], theta[KAPPA][is_known])
    return replace(laws, theta=theta)


def _reduction(
    curve: NDArray[np.intp], before: FloatArray, after: FloatArray, rng: np.random.Generator
) -> tuple[float, float]:
    """Reduction of the RMSE [%] and its bootstrap standard deviation: whole curves are resampled, both models on the
    same ones."""
    _, index = np.unique(curve, return_inverse=True)
    sums = np.stack([np.bincount(index, weights=errors**2) for errors in (before, after)])
    drawn = rng.integers(sums.shape[1], size=(400, sums.shape[1]))
    resampled = sums[:, drawn].sum(axis=2)
    reductions = 100 * (1 - np.sqrt(resampled[1] / np.maximum(resampled[0], 1e-300)))
    return 100 * (1 - _rms(after) / max(_rms(before), 1e-300)), float(np.std(reductions))


def _rms(errors: FloatArray) -> float:
    return float(np.sqrt(np.mean(errors**2)))
