"""The baseline of a campaign: the pooled fit without effects, and the noise that its residuals show, in turns."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.diagnosis.baseline.laws import Laws
from models.diagnosis.baseline.prediction import frame_of
from models.diagnosis.criteria import (
    FEWEST_ROWS,
    FEWEST_SPEEDS,
    LEAST_NOISE_SHARE,
    LEAST_TORQUE,
    MANY_PLATEAUS,
    MOST_TORQUE,
)
from models.diagnosis.design.design import Design
from models.diagnosis.noise.estimate import estimate_noise, first_noise
from models.diagnosis.pooled_fit.gauss_newton import STEPS, Fit, FitStatus, fit
from models.diagnosis.pooled_fit.gram import gram_of
from models.diagnosis.pooled_fit.priors import priors_of
from models.diagnosis.pooled_fit.problem import FitProblem
from models.diagnosis.pooled_fit.projection import likely_curve_gain
from models.diagnosis.pooled_fit.starts import cautious_laws, starting_laws

#: Gauss-Newton steps after which starts are compared.
_ROUGH = 12


class IndeterminateError(Exception):
    """The data determine no baseline, and the message says what they lack: the one expected end without a report."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Baseline:
    """The pooled fit without effects, its problem (with the noise estimated), and notes for the report."""

    problem: FitProblem
    fit: Fit
    notes: tuple[str, ...]


def missing_for_baseline(design: Design) -> str:
    """What is missing for a pooled baseline, or nothing."""
    steady = design.rows.velocity[design.closed & design.rows.steady]
    if steady.size < FEWEST_ROWS:
        return f"there are {steady.size} plateaus of stationary tests under pressure, and at least {FEWEST_ROWS} are needed."
    speeds = np.unique(np.round(steady / float(steady.max()), 3)).size
    if speeds < FEWEST_SPEEDS:
        return f"there are {speeds} distinct speeds, and at least {FEWEST_SPEEDS} are needed for a Stribeck curve."
    usual, largest = design.usual_torque, float(np.abs(design.torque).max())
    if not (usual > LEAST_TORQUE and largest < MOST_TORQUE):
        return f"torques of {usual:.3g} Nm in the median and {largest:.3g} Nm at most are no clutch's."
    return ""


def fit_baseline(design: Design) -> Baseline:
    """The pooled fit from several starts, and the noise that its residuals show, in turns. Raises IndeterminateError."""
    frame = frame_of(design)
    start = starting_laws(design, frame)
    problem = FitProblem(design=design, noise=first_noise(design), priors=priors_of(design, start.theta, frame))
    starts = (start, cautious_laws(design, start)) if design.plateaus < MANY_PLATEAUS else (start,)
    first = _best_of(problem, starts, _ROUGH)
    problem, _ = _with_estimated_noise(problem, first)
    # with a noise that was only assumed the first fit may have ended in another valley
    second = _best_of(problem, starts, _ROUGH)
    return _with_its_noise(problem, _best_of(problem, (first.laws, second.laws), STEPS))


def _with_its_noise(problem: FitProblem, fitted: Fit) -> Baseline:
    """A fit followed to its end under the noise that its residuals show."""
    problem, assumed = _with_estimated_noise(replace(problem, fitted=fitted.torque), fitted)
    fitted = fit(problem, fitted.laws)
    _require_weights(problem, fitted)
    curve_gain = likely_curve_gain(gram_of(problem, fitted))
    if curve_gain > 0.0:
        problem = problem.with_noise(replace(problem.noise, curve_gain=curve_gain))
        fitted = fit(problem, fitted.laws)
    return Baseline(problem=problem, fit=fitted, notes=_notes(problem.design, assumed))


def _require_weights(problem: FitProblem, fitted: Fit) -> None:
    """Raise IndeterminateError where there is nothing that models could be weighed by."""
    design, deviation = problem.design, problem.noise.deviation
    finite = fitted.status is not FitStatus.NOT_FINITE
    if finite:  # else the rounding of a parameter changes torque by more than its usual size
        steepest = float(np.abs(fitted.prediction.jacobian(design)[:, problem.priors.free]).max())
        finite = bool(steepest * np.finfo(np.float64).eps < design.usual_torque)
    if not finite:
        raise IndeterminateError("no finite torque can be fitted to these numbers.")
    parts = [deviation[: design.plateaus], deviation[design.plateaus :]]
    noise = min(float(np.median(part)) for part in parts if part.size)
    if not noise >= LEAST_NOISE_SHARE * design.usual_torque:
        raise IndeterminateError(
            f"the readings hold no noise ({noise:.1g} Nm about {design.usual_torque:.3g} Nm), as those of a dead channel "
            "or of a formula do, and nothing can be weighed against it."
        )


def _best_of(problem: FitProblem, starts: Sequence[Laws], steps: int) -> Fit:
    return min((fit(problem, laws, steps=steps) for laws in starts), key=lambda fitted: fitted.cost)


def _with_estimated_noise(problem: FitProblem, fitted: Fit) -> tuple[FitProblem, bool]:
    """The problem with the noise that a fit's residuals show, and whether that had to be assumed."""
    noise, assumed = estimate_noise(problem.design, fitted.residual, fitted.torque, problem.noise)
    return problem.with_noise(noise), assumed


def _notes(design: Design, assumed: bool) -> tuple[str, ...]:
    notes = list(design.notes)
    if assumed:
        notes.append("Too few rows to estimate the noise: 1 % of the torque is assumed.")
    if not design.facts.temperature_measured:
        notes.append("No oil temperature was measured: any slow course of it competes with the other causes.")
    return tuple(notes)
