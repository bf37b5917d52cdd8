"""Maps of a model's error: whitened residuals over speed and pressure and over cycles, and loops beside what models
predict. As in the models' RMSE (`report.report`), the likeliest gains of runs and curves are no error."""

from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.design.design import IntArray
from models.diagnosis.pooled_fit.baseline_fit import Baseline
from models.diagnosis.pooled_fit.gauss_newton import PooledFit
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import left_over

#: Speeds are gathered into at most this many bins, states into as many (resolution of a map).
MOST_BINS = 24
#: Loops shown: so many states by so many pressures, spread evenly.
SHOWN = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Maps:
    """Mean whitened residuals [-] before and after the extension; NaN where nothing was measured."""

    pressure: FloatArray  # axes: [p] Pa
    speed: FloatArray  # [s] rad/s
    cycles: FloatArray  # [c]
    speed_pressure_before: FloatArray  # [p, s]
    speed_pressure_after: FloatArray
    pressure_cycles_before: FloatArray  # [c, p]
    pressure_cycles_after: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopTrace:
    """A loop over one period: speed [n] rad/s, torque [n] Nm as measured, and the torque of baseline and extended
    model."""

    pressure: float
    cycles: float
    frequency: float
    speed: FloatArray
    measured: FloatArray
    baseline: FloatArray
    extended: FloatArray


def residual_maps(baseline: Baseline, problem: FitProblem, extended: PooledFit) -> Maps | None:
    """Maps of mean residual over noise on plateaus (on loops where there are no plateaus) of the closed clutch, by
    eq. 3 taken for exact and by the extended model beside the law; None without such rows."""
    design, noise = problem.design, problem.noise
    rows = np.flatnonzero(design.closed & (design.rows.steady | (design.plateaus == 0)))
    if rows.size == 0:
        return None
    speed = design.rows.velocity[rows] / design.facts.geometry.mean_radius
    levels, of_level = np.unique(design.level[rows], return_inverse=True)
    speeds, of_speed = _binned(speed)
    cycles, of_cycles = _binned(design.rows.cycles[rows])
    models = ((baseline.problem.exact, baseline.exact), (problem, extended))
    white = [left_over(*model)[rows] / noise.deviation[rows] for model in models]
    maps = {}
    for when, residual in zip(("before", "after"), white, strict=True):
        maps[f"speed_pressure_{when}"] = _means(residual, of_level, of_speed, (levels.size, speeds.size))
        maps[f"pressure_cycles_{when}"] = _means(residual, of_cycles, of_level, (cycles.size, levels.size))
    return Maps(pressure=levels, speed=speeds, cycles=cycles, **maps)


def _binned(values: FloatArray) -> tuple[FloatArray, IntArray]:
    """Middles of the bins [b], and each value's bin [n]; few distinct values are bins themselves."""
    distinct, index = np.unique(values, return_inverse=True)
    if distinct.size <= MOST_BINS:
        return distinct, np.asarray(index, dtype=np.intp)
    edges = np.linspace(distinct[0], distinct[-1], MOST_BINS + 1)
    bins = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, MOST_BINS - 1)
    return 0.5 * (edges[1:] + edges[:-1]), np.asarray(bins, dtype=np.intp)


def _means(values: FloatArray, row: IntArray, column: IntArray, shape: tuple[int, int]) -> FloatArray:
    """Means [rows, columns] of values [n] by row and column, NaN where there is none."""
    cell = row * shape[1] + column
    count = np.bincount(cell, minlength=shape[0] * shape[1])
    total = np.bincount(cell, weights=values, minlength=shape[0] * shape[1])
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape)


def loop_traces(baseline: Baseline, problem: FitProblem, extended: PooledFit) -> tuple[LoopTrace, ...]:
    """Traces of a few loops, fresh to worn and low to high pressure: a period's bins, as measured and by both
    models."""
    design = problem.design
    number = design.rows.loop
    loops = np.unique(number[design.plateaus :][design.closed[design.plateaus :]])
    if loops.size == 0:
        return ()
    first = np.array([np.flatnonzero(number == loop)[0] for loop in loops])
    states, levels = design.rows.cycles[first], design.level[first]
    chosen = [
        loop
        for loop, state, level in zip(loops, states, levels, strict=True)
        if state in _spread(np.unique(states)) and level in _spread(np.unique(levels))
    ]
    models = ((baseline.problem.exact, baseline.exact), (problem, extended))
    before, after = (design.torque - left_over(*model) for model in models)
    traces = []
    for loop in chosen:
        rows = np.flatnonzero(number == loop)
        at = int(rows[0])
        traces.append(
            LoopTrace(
                pressure=float(design.level[at]),
                cycles=float(design.rows.cycles[at]),
                frequency=float(design.rows.angular_frequency[at]) / (2 * np.pi),
                speed=design.rows.velocity[rows] / design.facts.geometry.mean_radius,
                measured=design.torque[rows],
                baseline=before[rows],
                extended=after[rows],
            )
        )
    return tuple(traces)


def _spread(values: FloatArray) -> FloatArray:
    """SHOWN of the ascending values or fewer, evenly, the first and the last included."""
    return np.asarray(values[np.unique(np.linspace(0, values.size - 1, SHOWN).round().astype(int))])
