"""Starts of the pooled fit: the curves of a few states fitted one by one, and laws fitted through their parameters."""

from itertools import product

import numpy as np

from models.arrays import FloatArray
from models.degradation.general_order import progress_fraction
from models.diagnosis.baseline.criteria import USUAL_CURVATURE
from models.diagnosis.baseline.laws import (
    ATTRACTOR,
    BLOCK,
    FALL,
    KAPPA,
    LOG_CURVATURE,
    LOG_DECAY,
    POWERS,
    RATIO,
    Frame,
    Laws,
    falling_weight,
)
from models.diagnosis.design.design import Design
from models.friction.identification import fit_curves
from models.records.runs import Curve

#: So many stationary runs are fitted curve by curve.
MOST_RUNS = 6
_SCALES = (0.05, 0.15, 0.4, 1.2)
_EXPONENT = 0.8
_ROBUST_STEPS = 4
_LEAST_SHARE, _MOST_SHARE = 0.25, 0.6
_DECAYS = (0.25, 0.6, 1.5)


def starting_laws(design: Design, frame: Frame) -> Laws:
    """Laws through the curves' own fits."""
    pressure, cycles, values, deviations = _curve_values(design)
    theta = np.zeros(ATTRACTOR + frame.loop_pressures.size + POWERS)
    theta[KAPPA] = np.log(12 * design.usual_torque)
    high = (pressure - frame.lowest) / frame.span
    theta[FALL] = np.log(0.6 * frame.span), np.log(USUAL_CURVATURE)
    for k in range(4):
        best = np.inf
        for scale, decay in product(_SCALES, _DECAYS if k == RATIO and design.levels.size > 2 else (0.6,)):
            phi = scale * design.facts.life
            fall = falling_weight(high, frame.span, np.array([np.log(decay * frame.span), theta[LOG_CURVATURE]]))[0]
            first, second = (fall, 1 - fall) if k == RATIO else (1 - high, high)
            fresh, cost = _along(
                first, second, progress_fraction(cycles, phi, _EXPONENT), values[:, k], deviations[:, k]
            )
            if cost < best:
                best = cost
                theta[k * BLOCK : (k + 1) * BLOCK] = [
                    *fresh,
                    np.log(phi * np.expm1(np.log(2.0) / _EXPONENT)),
                    np.log(_EXPONENT),
                ]
                if k == RATIO:
                    theta[LOG_DECAY] = np.log(decay * frame.span)
    return Laws(theta=theta, frame=frame)


def cautious_laws(design: Design, start: Laws) -> Laws:
    """A second start that trusts the curves' fits less: fresh values near their usual size at both ends of the
    pressures, small shares, half of them at half the life. Where curves hardly determine a parameter, the first start
    may lie in another valley."""
    theta = start.theta.copy()
    for k in range(4):
        block = k * BLOCK
        usual = max(float(np.median(np.abs(theta[block : block + 2]))), 1e-12)
        theta[block : block + 2] = np.clip(theta[block : block + 2], _LEAST_SHARE * usual, None)
        theta[block + 2 : block + 4] = np.clip(theta[block + 2 : block + 4], -_MOST_SHARE, _MOST_SHARE)
        theta[block + 4 : block + BLOCK] = np.log(0.5 * design.facts.life), np.log(_EXPONENT)
    return Laws(theta=theta, frame=start.frame)


def _along(
    first: FloatArray, second: FloatArray, done: FloatArray, value: FloatArray, deviation: FloatArray
) -> tuple[list[float], float]:
    """Two fresh values and their shares, by robust ridge regression, and its cost: a curve's own fit may
    be far off where it hardly determines a parameter."""
    columns = np.stack([first, second, first * done, second * done], axis=1)
    scale = max(float(np.median(np.abs(value))), 1e-12)
    ridge = np.diag([1e-3, 1e-3, 0.1, 0.1]) / scale
    weight = 1 / deviation
    for _ in range(_ROBUST_STEPS):
        matrix = np.concatenate([columns * weight[:, None], ridge])
        solution = np.linalg.lstsq(matrix, np.concatenate([value * weight, np.zeros(4)]), rcond=None)[0]
        off = np.abs(value - columns @ solution) / deviation
        usual = max(float(np.median(off)), 0.3)
        weight = 1 / (deviation * np.sqrt(1 + (off / (2 * usual)) ** 2))
    cost = float(np.log1p((off / (2 * usual)) ** 2).sum()) + off.size * float(np.log(usual))
    u_1, u_2, lost_1, lost_2 = solution.tolist()
    least = 1e-2 * scale
    shares = [
        float(np.clip(lost / (u if abs(u) > least else least), -1.2, 3.0)) for u, lost in ((u_1, lost_1), (u_2, lost_2))
    ]
    return [u_1, u_2, *shares], cost


def _curve_values(design: Design) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Pressure [c], cycles [c], the four parameters [c, 4] and their deviations [c, 4] of the curves of a few runs."""
    plateaus = np.flatnonzero(design.closed[: design.plateaus])
    runs = np.unique(design.rows.run[plateaus])
    chosen = runs[np.unique(np.linspace(0, runs.size - 1, min(MOST_RUNS, runs.size)).round().astype(int))]
    curves, cycles = [], []
    for index in np.unique(design.curve[plateaus]):
        rows = plateaus[design.curve[plateaus] == index]
        if design.rows.run[rows[0]] not in chosen:
            continue
        level = float(design.level[rows[0]])
        curves.append(
            Curve(
                pressure=level,
                mean_pressure=level,
                velocity=design.rows.velocity[rows],
                torque=design.torque[rows],
            )
        )
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
