"""An outlying run: another clutch, a unit that was mistyped, a cable the wrong way round.

No effect is in one run alone, and a report that only says "cycles" sends an engineer through all of them. As an alternative,
one run of R has a curve of its own, Σ c_jk cos(jπv) cos(kπp) beside the baseline's, with normal c of some size,

    evidence = ln Σ_g mean_τ ∫ p(data | θ, c; g) p(θ) N(c; 0, τ²) d(θ, c) - ln R        [nats]

about the baseline that the other runs have.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from models.diagnosis.criteria import OUTLYING_DEVIATIONS, OUTLYING_FEWEST_RUNS, OUTLYING_SHARE
from models.diagnosis.design.design import Design
from models.diagnosis.explanations.evidence import projections_beside
from models.diagnosis.explanations.refit import refit_beside
from models.diagnosis.pooled_fit.gauss_newton import Fit, fit
from models.diagnosis.pooled_fit.gram import gram_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.run_scatter import without_likely_gains
from models.gaussian_evidence import log_gain, log_mean, log_sum

#: What to do about it.
ADVICE = "Check that run first."
#: Orders of the cosines over speed and pressure, and deviations τ of their coefficients, shares of the usual torque.
_SPEED, _PRESSURE, _SIZES = 4, 2, (0.1, 1.0)


def outlying_run(problem: FitProblem, fitted: Fit) -> str:
    """A sentence on the run whose error is far larger than the others', or nothing."""
    worst, left = _worst(problem, fitted)
    if worst is None:
        return ""
    design = problem.design
    here = design.rows.run == worst
    error, usual = (float(np.sqrt((left[rows] ** 2).mean())) for rows in (here, ~here))
    run = design.runs[worst]
    return (
        f"The run {run.run_id} at {run.cycles:,.0f} cycles is an outlier: the baseline's error there is {error:.2g} Nm RMS, "
        f"elsewhere {usual:.2g} Nm. {ADVICE}"
    )


def outlier_evidence(problem: FitProblem, fitted: Fit) -> float:
    """The formula above, of the run whose error is far larger than the others'; -inf where there is none."""
    worst, left = _worst(problem, fitted)
    if worst is None:
        return -np.inf
    design, deviation = problem.design, problem.noise.deviation
    here = design.rows.run == worst
    wide = max(float(np.sqrt(((left / deviation)[here] ** 2).mean())), 1.0)
    others = problem.with_noise(replace(problem.noise, deviation=np.where(here, wide * wide, 1.0) * deviation))
    columns = _own_curve(design, here)
    alone = fit(others, fitted.laws)
    coefficients = np.linalg.lstsq(columns[here], alone.residual[here], rcond=None)[0]
    beside = refit_beside(problem, alone, columns @ coefficients)
    if beside is None:
        return -np.inf
    gram = gram_of(problem, beside, columns)
    projections = projections_beside(gram, problem.noise)
    logs = [p.evidence + log_mean([log_gain(p.info, p.score, size) for size in _SIZES]) for p in projections]
    return log_sum(logs) - float(np.log(len(design.runs)))


def _own_curve(design: Design, here: NDArray[np.bool_]) -> FloatArray:
    """[N, m] Nm per unit: smooth in speed and pressure, in one run alone."""
    waves = [np.ones((here.size, 1))]
    for values, orders in ((design.rows.velocity, _SPEED), (design.rows.pressure, _PRESSURE)):
        unit = (values - values.min()) / max(float(np.ptp(values)), 1e-300)
        own = np.cos(np.pi * unit[:, None] * np.arange(orders + 1))
        waves.append((waves[-1][:, :, None] * own[:, None, :]).reshape(here.size, -1))
    return np.where(here, design.usual_torque, 0.0)[:, None] * waves[-1]


def _worst(problem: FitProblem, fitted: Fit) -> tuple[int | None, FloatArray]:
    """The run whose error is far larger than the others', if one is, and the error [N] Nm without what gains make of it."""
    design = problem.design
    left = without_likely_gains(problem, fitted)
    squares = (left / problem.noise.deviation) ** 2
    count = np.bincount(design.rows.run, minlength=len(design.runs))
    beyond = np.maximum(np.bincount(design.rows.run, weights=squares, minlength=len(design.runs)) - count, 0.0)
    worst = int(np.argmax(beyond))
    least = max(OUTLYING_SHARE * beyond.sum(), OUTLYING_DEVIATIONS**2 * count[worst])
    if np.count_nonzero(count) < OUTLYING_FEWEST_RUNS or beyond[worst] < least:
        return None, left
    return worst, left
