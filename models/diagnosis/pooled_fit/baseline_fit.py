"""The baseline of a campaign: the pooled fit without effects, the sizes of the law's discrepancy, and the noise that its
residuals show, in turns.

It starts from the curves of a few states fitted one by one, and laws fitted through their parameters. About the fit of
eq. 3 alone the law's discrepancy is linearised; from there on every fit is one of both.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction
from models.diagnosis import criteria
from models.diagnosis.baseline.law_discrepancy import law_discrepancy
from models.diagnosis.baseline.law_form import LawSizes
from models.diagnosis.baseline.laws import (
    ATTRACTOR,
    BLOCK,
    COURSE,
    DRIFT,
    ENDS,
    FALL,
    KAPPA,
    LOG_CURVATURE,
    LOG_DECAY,
    POWERS,
    RATIO,
    SHARES,
    Frame,
    Laws,
    falling_weight,
)
from models.diagnosis.baseline.prediction import frame_of
from models.diagnosis.design.design import Design
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.diagnosis.pooled_fit.gauss_newton import STEPS, FitStatus, PooledFit, fit
from models.diagnosis.pooled_fit.problem import FitProblem, LawTerms, priors_of
from models.diagnosis.pooled_fit.projection import (
    GAINS,
    Gram,
    Projected,
    gram_of,
    law_torque,
    learned_law,
    likely_curve_gain,
    projections_of,
)
from models.friction.identification import fit_curves
from models.friction.stribeck import GAMMA
from models.records.runs import Curve

_EXPONENT = 0.8
_MOST_SHARE = 0.6


def starting_laws(design: Design, frame: Frame) -> Laws:
    """Starting laws for the pooled fit, by robust regression over pressure and life through the parameters of
    single-curve fits."""
    pressure, cycles, values, deviations = _curve_values(design)
    theta = np.zeros(ATTRACTOR + frame.loop_pressures.size + POWERS)
    theta[KAPPA] = np.log(12 * design.usual_torque)
    high = (pressure - frame.lowest) / frame.span
    theta[FALL] = np.log(0.6 * frame.span), np.log(criteria.USUAL_CURVATURE)
    for k in range(4):
        best = np.inf
        decays = (0.25, 0.6, 1.5) if k == RATIO and design.levels.size > 2 else (0.6,)
        for scale, decay in product((0.05, 0.15, 0.4, 1.2), decays):
            phi = scale * design.facts.life
            fall = falling_weight(high, frame.span, np.array([np.log(decay * frame.span), theta[LOG_CURVATURE]]))[0]
            first, second = (fall, 1 - fall) if k == RATIO else (1 - high, high)
            done = progress_fraction(cycles, phi, _EXPONENT)
            fresh, cost = _along(first, second, done, values[:, k], deviations[:, k])
            if cost < best:
                best, half = cost, np.log(phi * np.expm1(np.log(2.0) / _EXPONENT))
                theta[k * BLOCK : (k + 1) * BLOCK] = [*fresh, half, np.log(_EXPONENT)]
                if k == RATIO:
                    theta[LOG_DECAY] = np.log(decay * frame.span)
    if _speeds(design).size < criteria.CURVE_SPEEDS:
        _share_torque(theta, design)
    return Laws(theta=theta, frame=frame)


def _share_torque(theta: FloatArray, design: Design) -> None:
    """Change θ in place where too few speeds were measured to tell static from viscous torque: V_S becomes the lowest speed,
    half of the torque is viscous, and C_v ages as M_s does. Single-curve fits end at V_S = 0 or C_v < 0 there, from where
    the pooled fit does not return."""
    static, _, velocity, viscous = theta[: 4 * BLOCK].reshape(4, BLOCK)
    lowest = float(design.rows.velocity.min())
    ends = [float(np.median(design.torque[design.level == level])) for level in design.levels[[0, -1]]]
    static[ENDS] /= 2.0
    velocity[ENDS], velocity[SHARES] = lowest, 0.0
    viscous[ENDS] = 0.5 * np.array(ends) / lowest**GAMMA
    viscous[SHARES], viscous[COURSE] = static[SHARES], static[COURSE]


def _speeds(design: Design) -> FloatArray:
    """The distinct speeds [n] of plateaus under pressure, shares of the highest."""
    velocity = design.rows.velocity[design.closed & design.rows.steady]
    return np.unique(np.round(velocity / float(velocity.max()), 2))


def cautious_laws(design: Design, start: Laws) -> Laws:
    """A second start for the fit, where single curves hardly determine a parameter: fresh values at least a quarter of
    their median, changes over life of at most 0.6, and half of each change at half the life. It may lead to another
    minimum."""
    theta = start.theta.copy()
    for block in theta[: 4 * BLOCK].reshape(4, BLOCK):
        usual = max(float(np.median(np.abs(block[ENDS]))), 1e-12)
        block[ENDS] = np.clip(block[ENDS], 0.25 * usual, None)
        block[SHARES] = np.clip(block[SHARES], -_MOST_SHARE, _MOST_SHARE)
        block[COURSE] = np.log(0.5 * design.facts.life), np.log(_EXPONENT)
    return Laws(theta=theta, frame=start.frame)


def _along(
    first: FloatArray, second: FloatArray, done: FloatArray, value: FloatArray, deviation: FloatArray
) -> tuple[list[float], float]:
    """Two fresh values and their shares of change over life by robust ridge regression, and its cost; robust, because a
    curve's own fit may be far off where it hardly determines a parameter."""
    columns = np.stack([first, second, first * done, second * done], axis=1)
    scale = max(float(np.median(np.abs(value))), 1e-12)
    ridge = np.diag([1e-3, 1e-3, 0.1, 0.1]) / scale
    weight = 1 / deviation
    for _ in range(4):
        matrix = np.concatenate([columns * weight[:, None], ridge])
        solution = np.linalg.lstsq(matrix, np.concatenate([value * weight, np.zeros(4)]), rcond=None)[0]
        off = np.abs(value - columns @ solution) / deviation
        usual = max(float(np.median(off)), 0.3)
        weight = 1 / (deviation * np.sqrt(1 + (off / (2 * usual)) ** 2))
    cost = float(np.log1p((off / (2 * usual)) ** 2).sum()) + off.size * float(np.log(usual))
    u_1, u_2, lost_1, lost_2 = solution.tolist()
    least = 1e-2 * scale
    ends = ((u_1, lost_1), (u_2, lost_2))
    shares = [float(np.clip(lost / (u if abs(u) > least else least), -1.2, 3.0)) for u, lost in ends]
    return [u_1, u_2, *shares], cost


def _curve_values(design: Design) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Pressure [c] Pa, cycles [c], the four Stribeck parameters [c, 4] and their standard deviations [c, 4] of the
    curves of a few runs."""
    plateaus = np.flatnonzero(design.closed[: design.plateaus])
    runs = np.unique(design.rows.run[plateaus])
    chosen = runs[np.unique(np.linspace(0, runs.size - 1, min(6, runs.size)).round().astype(int))]
    curves, cycles = [], []
    for index in np.unique(design.curve[plateaus]):
        rows = plateaus[design.curve[plateaus] == index]
        if design.rows.run[rows[0]] not in chosen:
            continue
        level, velocity = float(design.level[rows[0]]), design.rows.velocity[rows]
        curves.append(Curve(pressure=level, mean_pressure=level, velocity=velocity, torque=design.torque[rows]))
        cycles.append(float(design.rows.cycles[rows[0]]))
    fits = fit_curves(curves)
    values = np.stack([curve_fit.parameters.as_array() for curve_fit in fits])
    deviations = np.stack([curve_fit.standard_errors for curve_fit in fits])
    scale = np.maximum(np.median(np.abs(values), axis=0), 1e-9)
    cut = np.clip(values, 0.0, 10 * scale)
    return (
        np.array([curve_fit.pressure for curve_fit in fits]),
        np.array(cycles),
        cut,
        np.clip(deviations, 0.01 * scale, 30 * scale) + np.abs(values - cut),
    )


class IndeterminateError(Exception):
    """Raised where the data determine no baseline; the message names the missing data. It is the one expected end
    without a report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """The pooled fit without effects, its problem (with the noise and the law's sizes estimated), the fit of eq. 3 taken for
    exact under the same noise, and notes for the report."""

    problem: FitProblem
    fit: PooledFit
    exact: PooledFit
    notes: tuple[str, ...]


def missing_for_baseline(design: Design) -> str:
    """The reason why a campaign cannot have a pooled baseline (too few plateaus, impossible torques), as a sentence;
    empty where it can."""
    steady = design.rows.velocity[design.closed & design.rows.steady]
    if steady.size < criteria.FEWEST_ROWS:
        plateaus_found = f"there are {steady.size} plateaus of stationary tests under pressure"
        return f"{plateaus_found}, and at least {criteria.FEWEST_ROWS} are needed."
    usual, largest = design.usual_torque, float(np.abs(design.torque).max())
    if not (usual > 1e-6 and largest < 1e7):  # no clutch's
        return f"the torques (median {usual:.3g} Nm, largest {largest:.3g} Nm) are not possible: check the unit."
    return ""


def fit_baseline(design: Design) -> Baseline:
    """The pooled fit without effects, from several starts, and the noise estimated from its residuals, in alternation.
    Raises IndeterminateError."""
    frame = frame_of(design)
    start = starting_laws(design, frame)
    problem = FitProblem(design=design, noise=first_noise(design), priors=priors_of(design, start.theta, frame))
    # with more every curve is determined and one start is enough
    starts = (start, cautious_laws(design, start)) if design.plateaus < 8000 else (start,)
    first = _best_of(problem, starts, criteria.FEW_STEPS)
    problem = problem.with_noise(estimate_noise(design, first.residual, first.torque, problem.noise)[0])
    # with a noise that was only assumed the first fit may have ended in another valley
    second = _best_of(problem, starts, criteria.FEW_STEPS)
    return _with_its_noise(problem, _best_of(problem, (first.laws, second.laws), STEPS))


def _with_its_noise(problem: FitProblem, fitted: PooledFit) -> Baseline:
    """The fit continued to convergence under the noise that its residuals show."""
    noise, assumed = estimate_noise(problem.design, fitted.residual, fitted.torque, problem.noise)
    problem = replace(problem, noise=noise, fitted=fitted.torque)
    exact = fitted = fit(problem, fitted.laws)
    _require_weights(problem, fitted)
    known = set[LawSizes]()
    for turn in range(criteria.MOST_TURNS):
        # twice: the law lags by the C that was fitted beside it; eq. 3 alone may have it wrong by a factor of two
        if turn < 2:
            problem = _with_law(problem, fitted, _lagging_as(exact.laws, fitted.laws))
        gram = gram_of(problem, fitted)
        noise = _likeliest(gram, problem).noise(problem.noise)
        noise = replace(noise, run_gain=problem.noise.run_gain, curve_gain=likely_curve_gain(gram, noise.law))
        problem = problem.with_noise(noise)
        fitted = fit(problem, fitted.laws)
        if noise.law in known:
            break
        known.add(noise.law)
        residual = fitted.residual - law_torque(problem, fitted)
        noise, assumed = estimate_noise(problem.design, residual, fitted.torque, noise)
        problem = replace(problem, noise=noise, fitted=fitted.torque)
        fitted = fit(problem, fitted.laws)
        _require_weights(problem, fitted)
    exact = fit(problem.exact, exact.laws)
    # effects that read the law at another pressure, speed or state read it as it was found
    fitted = fit(problem, replace(fitted.laws, learned=learned_law(problem, fitted)))
    return Baseline(problem=problem, fit=fitted, exact=exact, notes=_notes(problem.design, assumed))


def _with_law(problem: FitProblem, fitted: PooledFit, laws: Laws) -> FitProblem:
    """The problem with the law's discrepancy linearised about `laws`; of its two forms, moving along speed with V_S or
    fixed, the one of higher evidence."""
    either = [law_discrepancy(problem.design, laws, moving=moving) for moving in (False, True)]
    laws_tried = {one.form: one for one in either}.values()  # one where V_S is anything
    problems = [replace(problem, law=LawTerms(one, one.columns(problem.design))) for one in laws_tried]
    return max(problems, key=lambda one: _likeliest(gram_of(one, fitted), one).evidence)


def _likeliest(gram: Gram, problem: FitProblem) -> Projected:
    """The projection of highest evidence over every second scatter of the runs' gains and all sizes of the law's
    discrepancy."""
    return max(projections_of(gram, problem.noise, GAINS[::2]), key=lambda one: one.evidence)


def _lagging_as(laws: Laws, other: Laws) -> Laws:
    """The laws with the attractor law C (lag of friction in loops) of `other`."""
    theta = laws.theta.copy()
    theta[KAPPA], theta[DRIFT:ATTRACTOR] = other.theta[KAPPA], other.theta[DRIFT:ATTRACTOR]
    return replace(laws, theta=theta)


def _require_weights(problem: FitProblem, fitted: PooledFit) -> None:
    """Raises IndeterminateError where the evidence of models could not be compared: the fit is not finite, or the
    readings have no noise."""
    design, deviation = problem.design, problem.noise.deviation
    finite = fitted.status is not FitStatus.NOT_FINITE
    if finite:  # else the rounding of a parameter changes torque by more than its usual size
        steepest = float(np.abs(fitted.prediction.jacobian(design)[:, problem.priors.free]).max())
        finite = bool(steepest * np.finfo(np.float64).eps < design.usual_torque)
    if not finite:
        raise IndeterminateError("the model cannot be fitted to these torques, pressures and speeds: check the units.")
    parts = [deviation[: design.plateaus], deviation[design.plateaus :]]
    noise = min(float(np.median(part)) for part in parts if part.size)
    if not noise >= criteria.LEAST_NOISE_SHARE * design.usual_torque:
        raise IndeterminateError(
            f"the readings have no noise ({noise:.1g} Nm about {design.usual_torque:.3g} Nm). Are they computed values? "
            "The diagnosis needs measured values."
        )


def _best_of(problem: FitProblem, starts: Sequence[Laws], steps: int) -> PooledFit:
    """The fit of least cost among those from all starts."""
    return min((fit(problem, laws, steps=steps) for laws in starts), key=lambda fitted: fitted.cost)


def _notes(design: Design, assumed: bool) -> tuple[str, ...]:
    """Sentences on what the design lacks (rows left out, noise that is assumed, speeds, oil temperature), for the
    report."""
    notes = list(design.notes)
    if assumed:
        notes.append("Too few plateaus to estimate the noise: 1 % of the torque is assumed.")
    speeds = _speeds(design).size
    if speeds < criteria.CURVE_SPEEDS:
        notes.append(
            f"{speeds} speed{'s' * (speeds > 1)} cannot show a Stribeck curve, so causes that depend on speed alone are not "
            "seen here: test more speeds."
        )
    if not design.facts.temperature_measured:
        notes.append(
            "No oil temperature was measured, so a slow change of it may look like another cause: measure it in every test."
        )
    return tuple(notes)
