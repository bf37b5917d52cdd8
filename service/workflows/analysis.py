"""A run's own results, before its history is looked at: curves fitted, oddities noticed."""

from dataclasses import dataclass

import numpy as np

from models.clutch import Geometry
from models.identification import FitStatus, StribeckFit, fit_curves
from models.runs import Plateaus, curves_by_pressure
from service.formats.incoming import UNLOADED, IncomingRun, stationary_plateaus
from service.formats.units import PASCALS_PER_BAR

#: The warning of a run whose cycles lie before those of a run that came earlier.
LATE = "late_arrival"


@dataclass(frozen=True, slots=True, kw_only=True)
class Warned:
    """Something that was noticed and did not stop the run."""

    code: str
    message: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelFit:
    """A pressure level's fit, the pressure measured there on average [Pa], and how many distinct speeds it saw."""

    fit: StribeckFit
    mean_pressure: float
    speeds: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """What one run says by itself; `speed_range` [rad/s] is None for a run that holds no stationary test."""

    fits: tuple[LevelFit, ...] = ()
    speed_range: tuple[float, float] | None = None
    warnings: tuple[Warned, ...] = ()


def analyse(run: IncomingRun, geometry: Geometry) -> Analysis:
    """Fit a stationary test's curves; other kinds are kept as they are."""
    if run.kind == "stationary_stribeck" and "time_s" not in run.channels:
        return _analyse_stationary(run, stationary_plateaus(run.channels), geometry)
    if run.kind in ("stationary_stribeck", "dynamic_stribeck"):
        message = "sampled records are stored and not evaluated by this version; a replay by a later one evaluates them"
        return Analysis(warnings=(Warned(code="not_evaluated", message=message),))
    return Analysis()


def _analyse_stationary(run: IncomingRun, plateaus: Plateaus, geometry: Geometry) -> Analysis:
    curves = curves_by_pressure(plateaus, geometry)
    fits = fit_curves(curves)
    levels = tuple(
        LevelFit(fit=fit, mean_pressure=curve.mean_pressure, speeds=int(np.unique(curve.velocity).size))
        for fit, curve in zip(fits, curves, strict=True)
    )
    warnings = [*_row_warnings(run, plateaus), *(warned for fit in fits for warned in _fit_warnings(fit))]
    speed_range = (float(plateaus.speed.min()), float(plateaus.speed.max()))
    return Analysis(
        fits=levels,
        speed_range=speed_range if speed_range[0] < speed_range[1] else None,
        warnings=tuple(warnings),
    )


def _row_warnings(run: IncomingRun, plateaus: Plateaus) -> list[Warned]:
    found = []
    unloaded = run.channels["torque_nm"].size - plateaus.torque.size
    if unloaded:
        message = f"{unloaded} plateaus below {UNLOADED / PASCALS_PER_BAR:g} bar were left out of the fits"
        found.append(Warned(code="unloaded_plateaus", message=message))
    if "torque_sd_nm" in run.channels and plateaus.torque_sd is None:
        message = "torque_sd_nm holds zeros, which no sensor has: the fits were not weighted by it"
        found.append(Warned(code="torque_sd_ignored", message=message))
    return found


def _fit_warnings(fit: StribeckFit) -> list[Warned]:
    at = f"at {fit.pressure / PASCALS_PER_BAR:g} bar"
    if fit.status is FitStatus.UNDETERMINED:
        return [Warned(code="undetermined", message=f"{at}: {fit.message}")]
    if not fit.acceptable and fit.mse_percent is not None:
        message = f"{at}: the percentage MSE is {fit.mse_percent:.3g} %, 5 % or more, with an RMSE of {fit.rmse:.3g} Nm"
        return [Warned(code="poor_fit", message=message)]
    return []
