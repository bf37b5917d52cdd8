"""A run's own results, before its history is looked at: curves fitted, oddities noticed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.identification import FitStatus, StribeckFit, fit_curves, mean_torques
from models.friction.speed_protocol import protocol_speeds
from models.records.criteria import UNLOADED
from models.records.plateaus import cut_plateaus
from models.records.runs import Plateaus, curves_by_pressure, loaded
from service.errors import FieldError, InvalidError
from service.lives.incoming_run import IncomingRun, SampledChannels, stationary_plateaus
from service.readers.units import PASCALS_PER_BAR

#: Warnings that hang on what was known when the run arrived: cycles before those of an earlier run, other pressures.
LATE, OTHER_PRESSURES = "late_arrival", "other_pressures"
NOTICED_ON_ARRIVAL = (LATE, OTHER_PRESSURES)


#: Four parameters cannot be told from fewer distinct speeds, and a mean over the protocol would be an extrapolation.
FEWEST_SPEEDS = 4
#: A level whose pressures lie further apart than this share is worth a warning.
WIDE_LEVEL = 0.06
#: A fit that misses by less than this share of the static torque (rms) is no poor one, whatever eq. 5 makes of a flat curve.
POOR = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Warned:
    """Something that was noticed and did not stop the run."""

    code: str
    message: str


#: A value and its deviation.
Value = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelFit:
    """A pressure level's fit, the pressure measured there on average [Pa], and how many distinct speeds it saw."""

    fit: StribeckFit
    mean_pressure: float
    speeds: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """What one run says by itself; `speed_range` [rad/s] is None for a run that holds no stationary test under pressure."""

    fits: tuple[LevelFit, ...] = ()
    speed_range: tuple[float, float] | None = None
    warnings: tuple[Warned, ...] = ()


def analyse(run: IncomingRun, geometry: Geometry) -> Analysis:
    """Fit a stationary test's curves, from its plateaus or from its sampled record; other kinds are kept as they are, and
    so is what was read with the clutch open.

    Raises InvalidError where a sampled record holds no steady plateau.
    """
    if run.kind != "stationary_stribeck":
        return Analysis()
    if "time_s" not in run.channels:
        plateaus = stationary_plateaus(run.channels)
        return _analyse_stationary(plateaus, geometry, _row_warnings(run, plateaus))
    try:
        cut = cut_plateaus(SampledChannels(run.channels))
    except ValueError as error:
        message = f"time_s, pressure_bar, speed_rpm, torque_nm: {error}"
        errors = [FieldError(pointer="/channels/torque_nm", code="no_plateau", message=message)]
        raise InvalidError(message, errors=errors) from None
    notes = [Warned(code=code, message=message) for code, message in cut.notes]
    return _analyse_stationary(cut.plateaus, geometry, notes)


def levels_of(plateaus: Plateaus, geometry: Geometry) -> tuple[LevelFit, ...]:
    """The curves of a stationary test fitted, pressures ascending."""
    curves = curves_by_pressure(plateaus, geometry)
    return tuple(
        LevelFit(fit=fit, mean_pressure=curve.mean_pressure, speeds=int(np.unique(curve.velocity).size))
        for fit, curve in zip(fit_curves(curves), curves, strict=True)
    )


def _analyse_stationary(plateaus: Plateaus, geometry: Geometry, noticed: Sequence[Warned]) -> Analysis:
    under_load = loaded(plateaus)
    noticed = [*_unloaded(plateaus, under_load), *noticed]
    if under_load is None:
        return Analysis(warnings=tuple(noticed))
    levels = levels_of(under_load, geometry)
    speed = np.abs(under_load.speed)
    low, high = float(speed.min()), float(speed.max())
    telling = low < high and mean_cofs(levels, geometry.sliding_velocity(protocol_speeds(low, high)), geometry)
    warnings = [
        *noticed,
        *(warned for level in levels for warned in _level_warnings(level, under_load)),
        *(warned for level in levels for warned in _fit_warnings(level.fit)),
    ]
    if not telling:
        message = "no pressure of this test says a mean COF: it sets no reference and no track uses it"
        warnings.append(Warned(code="no_mean_cof", message=message))
    return Analysis(fits=levels, speed_range=(low, high) if telling else None, warnings=tuple(warnings))


def mean_cofs(levels: Sequence[LevelFit], velocities: FloatArray, geometry: Geometry) -> dict[float, Value]:
    """Mean COF over the protocol's velocities [m] m/s and its deviation by pressure [Pa], where a level can say it."""
    telling = [level for level in levels if level.speeds >= FEWEST_SPEEDS]
    if not telling:
        return {}
    per_cof = np.array([geometry.torque_per_cof(level.mean_pressure) for level in telling])
    values = (mean_torques([level.fit for level in telling], velocities) / per_cof[:, None]).tolist()
    return {
        level.fit.pressure: (cof, sd)
        for level, (cof, sd) in zip(telling, values, strict=True)
        if math.isfinite(cof) and 0 < sd < cof
    }


def _level_warnings(level: LevelFit, plateaus: Plateaus) -> list[Warned]:
    """A level over whose rows the pressure varies widely may be several that ran together."""
    near = np.abs(plateaus.pressure - level.fit.pressure) <= WIDE_LEVEL * level.fit.pressure
    rows = int(np.count_nonzero(near))
    if rows >= level.fit.points:
        return []
    message = (
        f"at {level.fit.pressure / PASCALS_PER_BAR:g} bar: measured pressures scatter by more than {100 * WIDE_LEVEL:g} % "
        "within what was taken for one level; several may have run together"
    )
    return [Warned(code="wide_level", message=message)]


def _unloaded(plateaus: Plateaus, under_load: Plateaus | None) -> list[Warned]:
    below = f"below {UNLOADED / PASCALS_PER_BAR:g} bar"
    if under_load is None:
        message = (
            f"the clutch was open, all pressures lie {below}: no curve is fitted, no track uses it; a diagnosis does"
        )
        return [Warned(code="open_clutch", message=message)]
    left_out = plateaus.torque.size - under_load.torque.size
    message = f"{left_out} plateaus {below} were left out of the fits"
    return [Warned(code="unloaded_plateaus", message=message)] if left_out else []


def _row_warnings(run: IncomingRun, plateaus: Plateaus) -> list[Warned]:
    found = []
    if "torque_sd_nm" in run.channels and plateaus.torque_sd is None:
        message = "torque_sd_nm holds zeros, which no sensor has: the fits were not weighted by it"
        found.append(Warned(code="torque_sd_ignored", message=message))
    return found


def _fit_warnings(fit: StribeckFit) -> list[Warned]:
    at = f"at {fit.pressure / PASCALS_PER_BAR:g} bar"
    if fit.status is FitStatus.UNDETERMINED:
        return [Warned(code="undetermined", message=f"{at}: {fit.message}")]
    missed = fit.rmse > POOR * float(fit.parameters.static_torque)
    if not fit.acceptable and fit.mse_percent is not None and missed:
        message = f"{at}: the percentage MSE is {fit.mse_percent:.3g} %, 5 % or more, with an RMSE of {fit.rmse:.3g} Nm"
        return [Warned(code="poor_fit", message=message)]
    return []
