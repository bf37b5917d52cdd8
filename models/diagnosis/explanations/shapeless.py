"""Alternatives that have no shape to be fitted: a line over the tests' clock, an outlying run, an oil temperature that
nobody measured.

A line is torque that oscillates while a test runs, with its own phase in every run; its power

    P(ω) = Σ_runs |Σ_i r_i m_i e^{-iωt_i}|² / Σ_i m_i²

with r the whitened residual of a run, its gain taken out, and m = 1/σ for an oscillation in Nm or M/σ for one in shares of
the torque, at the plateaus' own times: noise in proportion to torque would smear a line in a plain transform. Where there
is no line, P relative to its neighbourhood is a sum of exponential variables.

An outlying run is another clutch, a unit that was mistyped, a cable the wrong way round. No effect is in one run alone, and
a report that only says "cycles" sends an engineer through all of them. As an alternative, one run of R has a curve of its
own, Σ c_jk cos(jπv) cos(kπp) beside the baseline's, with normal c of some size,

    evidence = ln Σ_g mean_τ ∫ p(data | θ, c; g) p(θ) N(c; 0, τ²) d(θ, c) - ln R        [nats]

about the baseline that the other runs have.

An oil temperature that was not measured may follow any slow course, a different one in every test. In a test of duration T
the log of the viscosity may follow a_0 + Σ_k a_k cos(2πkt/T) + b_k sin(2πkt/T), k = 1 ... 4, with normal coefficients whose
deviations fall with k; in loops it is one number a test. The viscous term follows it. That is many columns and no single
amplitude to estimate, so it is judged by its marginal likelihood alone (`models.gaussian_evidence`), averaged over how
strongly temperature varies, from test to test and separately within a test, and over the gains' scatter, as every other
evidence is: what gains explain as well is no evidence of a temperature.
"""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter
from scipy.special import gammaincc, gammaincinv

from models.arrays import FloatArray
from models.diagnosis import criteria
from models.diagnosis.design.design import Design
from models.diagnosis.noise.covariance import Noise, whitened
from models.diagnosis.pooled_fit.gauss_newton import PooledFit, fit, refit_beside
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import coarse_projections, gram_of, left_over, projections_of
from models.gaussian_evidence import log_gain, log_mean, log_sum

#: Steps of half a cycle a test: the first (two and a half cycles), slower ones that it must exceed, and the size of a
#: neighbourhood.
_SLOWER = 3
#: Fewer plateaus in all, or in the longest run, show no line.
_FEWEST_IN_A_RUN = 32


def line_evidence(p_value: float) -> float:
    """Upper bound of the log Bayes factor [nats] of a line from the p-value of the highest one, 1/(-e p ln p) (Sellke,
    Bayarri and Berger, Am. Stat. 55 (2001) 62)."""
    rare = -float(np.log(max(p_value, 1e-300)))
    return rare - 1.0 - float(np.log(rare)) if rare > 1.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """The plateaus of one run as a time series: times [n] s from its start, pauses cut short; whitened residual [n]
    without the gain; weights m [n, 2]."""

    time: FloatArray
    left: FloatArray
    weights: FloatArray

    def power(self, first: int, last: int, spacing: float) -> FloatArray:
        """Spectral power P(ω) [last - first, 2] at angular frequencies `spacing` [rad/s] times first ... last - 1, for
        each of the two weights."""
        wave, step = np.exp(-1j * first * spacing * self.time), np.exp(-1j * spacing * self.time)
        sums, weighed = np.empty((last - first, 2), dtype=np.complex128), self.left[:, None] * self.weights
        for k in range(last - first):
            sums[k] = wave @ weighed
            wave *= step
        return np.asarray(np.abs(sums) ** 2 / np.maximum((self.weights**2).sum(axis=0), 1e-300), dtype=np.float64)


def highest_line(problem: FitProblem, residual: FloatArray) -> float:
    """The p-value of the highest spectral line in a residual [N] Nm, power summed over the runs, corrected for all the
    frequencies searched. The likely gains of curves are to be taken out before: at one pressure after the other they
    are steps at even times."""
    runs = _plateau_series(problem.design, problem.noise, residual)
    longest = max((run.time.size for run in runs), default=0)
    if sum(run.time.size for run in runs) < 64 or longest < _FEWEST_IN_A_RUN:
        return 1.0
    kept = [run for run in runs if run.time.size > 0.5 * longest]
    duration = float(np.median([run.time[-1] * run.time.size / (run.time.size - 1) for run in kept]))
    step = float(np.median([np.median(np.diff(run.time)) for run in kept]))
    last = min(int(duration / step), 4000) if step > 0.0 else 0
    if last < _FEWEST_IN_A_RUN:
        return 1.0
    # from two and a half cycles a test on, beside three slower steps
    power = np.sum([run.power(5 - _SLOWER, last, np.pi / duration) for run in kept], axis=0)
    # a line is above its neighbourhood: noise whose autocorrelation was misjudged is not
    middle = float(gammaincinv(len(kept), 0.5))
    for column in power.T:
        column /= np.maximum(median_filter(column, size=61, mode="reflect") / middle, 1.0)
    # ... and above everything slower: structure that is larger the slower it is has no period
    slower = np.maximum.accumulate(power, axis=0)[_SLOWER - 1 : -1]
    power = np.where(power[_SLOWER:] >= slower, power[_SLOWER:], 0.0)
    tests = 1.5 * power.size
    return min(1.0, tests * float(gammaincc(len(kept), power.max())))


def _plateau_series(design: Design, noise: Noise, residual: FloatArray) -> list[_Run]:
    """The plateaus of each stationary run as a time series of the whitened residual [N] Nm, without the run's gain."""
    steady = slice(0, design.plateaus)
    white = whitened(np.column_stack([residual, design.torque]), design, noise)[steady]
    runs = []
    for run in np.unique(design.rows.run[steady]):
        rows_of_run = np.flatnonzero(design.rows.run[steady] == run)
        left, along = white[rows_of_run].T
        deviation = noise.deviation[rows_of_run]
        steps = np.maximum(np.diff(design.rows.clock[rows_of_run], prepend=design.rows.clock[rows_of_run[0]]), 0.0)
        usual = float(np.median(steps[1:])) if rows_of_run.size > 1 else 0.0
        runs.append(
            _Run(
                time=np.cumsum(np.minimum(steps, 5.0 * usual)),  # longer pauses are shortened
                left=left - along * float(along @ left) / max(float(along @ along), 1e-300),
                weights=np.stack([1 / deviation, np.abs(design.torque[rows_of_run]) / deviation], axis=1),
            )
        )
    return runs


#: What to do about it.
ADVICE = "Check this run's cycles, clutch and sensors first."
#: Orders of the cosines over speed and pressure, and deviations τ of their coefficients, shares of the usual torque.
_SIZES = (0.1, 1.0)
#: Runs at most between which a fit may be bent, and the error from which it is, in deviations. Chosen: beside a test with
#: its torque reversed the others are off by 5 to 40.
_BENT_BETWEEN, _LOUD = 4, 5.0


def outlying_run(problem: FitProblem, fitted: PooledFit) -> str:
    """A sentence on the run whose error is far larger than the others'; empty if there is none."""
    worst, left = _worst(problem, fitted)
    if worst is None:
        return ""
    design = problem.design
    in_worst = design.rows.run == worst
    error, usual = (float(np.sqrt((left[rows] ** 2).mean())) for rows in (in_worst, ~in_worst))
    run = design.runs[worst]
    return (
        f"Run {run.run_id} at {run.cycles:,.0f} cycles does not fit the other runs: the model without effects misses its "
        f"torque by {error:.2g} Nm RMS, the torque of the others by {usual:.2g} Nm. {ADVICE}"
    )


def outlier_evidence(problem: FitProblem, fitted: PooledFit) -> float:
    """Log evidence [nats] that the run of far larger error has a curve of its own (the formula above); -inf where there
    is no such run."""
    worst, left = _worst(problem, fitted)
    if worst is None:
        return -np.inf
    design, deviation = problem.design, problem.noise.deviation
    in_worst = design.rows.run == worst
    wide = max(float(np.sqrt(((left / deviation)[in_worst] ** 2).mean())), 1.0)
    widened = problem.with_noise(replace(problem.noise, deviation=np.where(in_worst, wide * wide, 1.0) * deviation))
    columns = _own_curve(design, in_worst)
    alone = fit(widened, fitted.laws)
    coefficients = np.linalg.lstsq(columns[in_worst], alone.residual[in_worst], rcond=None)[0]
    refitted = refit_beside(problem, alone, columns @ coefficients)
    if refitted is None:
        return -np.inf
    gram = gram_of(problem, refitted, columns)
    projections = coarse_projections(gram, problem.noise)
    logs = [p.evidence + log_mean([log_gain(p.info, p.score, size) for size in _SIZES]) for p in projections]
    return log_sum(logs) - float(np.log(len(design.runs)))


def _own_curve(design: Design, here: NDArray[np.bool_]) -> FloatArray:
    """Basis [N, m] Nm per unit of one run's own curve: products of cosines over speed and pressure, 0 at the rows of
    other runs."""
    waves = [np.ones((here.size, 1))]
    for values, orders in ((design.rows.velocity, 4), (design.rows.pressure, 2)):
        unit = (values - values.min()) / max(float(np.ptp(values)), 1e-300)
        own = np.cos(np.pi * unit[:, None] * np.arange(orders + 1))
        waves.append((waves[-1][:, :, None] * own[:, None, :]).reshape(here.size, -1))
    return np.where(here, design.usual_torque, 0.0)[:, None] * waves[-1]


def _worst(problem: FitProblem, fitted: PooledFit) -> tuple[int | None, FloatArray]:
    """The index of the run whose error is far larger than the others', or None, and the residual [N] Nm minus gains and
    the law's discrepancy. If a run is so far off that the fit lies between it and the others, it is found as the run
    without which the others fit."""
    left = left_over(problem, fitted)
    if len(problem.design.runs) < 4:
        return None, left
    excess, count = _excess_squares(problem, left)
    worst, most = (
        int(np.argmax(excess)),
        0.4 * float(excess.sum()),
    )  # this share of all error beyond noise is the others'
    if excess[worst] < 2.0**2 * count[worst]:  # an RMS error of so many deviations
        return None, left
    if excess.sum() - excess[worst] <= most:
        return worst, left
    loud = [run for run in np.argsort(-excess)[:_BENT_BETWEEN].tolist() if excess[run] > _LOUD**2 * count[run]]
    without = {run: left_over(problem, fit(_left_out(problem, run), fitted.laws)) for run in loud}
    others = {run: float(np.delete(_excess_squares(problem, off)[0], run).sum()) for run, off in without.items()}
    best = min(others, key=others.__getitem__, default=None)
    return (None, left) if best is None or others[best] > most else (best, without[best])


def _excess_squares(problem: FitProblem, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Excess sum of squares of each run [R], Σ (error/deviation)² minus its number of rows and at least 0, and that
    number [R]; `left` is the error [N] Nm."""
    of, runs = problem.design.rows.run, len(problem.design.runs)
    count = np.bincount(of, minlength=runs).astype(np.float64)
    squares = np.bincount(of, weights=(left / problem.noise.deviation) ** 2, minlength=runs)
    return np.maximum(squares - count, 0.0), count


def _left_out(problem: FitProblem, run: int) -> FitProblem:
    """The problem with one run's deviations so large that its rows have no weight."""
    deviation = np.where(problem.design.rows.run == run, 1e6, 1.0) * problem.noise.deviation
    return problem.with_noise(replace(problem.noise, deviation=deviation))


def temperature_evidence(problem: FitProblem, fitted: PooledFit) -> float:
    """Log Bayes factor [nats] of an unmeasured, varying oil temperature over none."""
    columns, between, within = _courses(problem.design, fitted)
    gram = gram_of(problem, fitted, columns)
    projections = projections_of(gram, problem.noise)
    strengths = product(criteria.CHANGES_BETWEEN_TESTS, criteria.CHANGES_WITHIN_TESTS)
    # of ln ν by some 3 K, as ASTM D341 has it near 85 °C
    sds = [0.06 * (b * between + w * within) for b, w in strengths]
    gained = [p.evidence + log_mean([log_gain(p.info, p.score, sd) for sd in sds]) for p in projections]
    return log_sum(gained) - log_sum([projected.evidence for projected in projections])


def _courses(design: Design, fitted: PooledFit) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Changes of torque [N, m] Nm per unit of ln viscosity, constant in each test or cosines and sines of its clock,
    and their relative prior deviations [m] from test to test and [m] within a test."""
    viscous = fitted.prediction.change_at_rows(design, fitted.prediction.scene.viscous, before_lag=True)
    columns, relative = [], []
    for run in np.unique(design.rows.run):
        in_run = design.rows.run == run
        viscous_of_run = np.where(in_run, viscous, 0.0)
        columns.append(viscous_of_run)
        relative.append(0.0)
        if not design.rows.steady[in_run].all():
            continue
        turn = 2 * np.pi * design.rows.clock / max(float(np.ptp(design.rows.clock[in_run])), 1e-9)
        for k in range(1, 4 + 1):
            columns += [viscous_of_run * np.cos(k * turn), viscous_of_run * np.sin(k * turn)]
            relative += [1.0 / k, 1.0 / k]
    within = np.array(relative)
    return np.stack(columns, axis=1), np.where(within == 0, 1.0, 0.0), within
