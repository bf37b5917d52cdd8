"""Analyses one run alone: fits its curves and loops, and notes what is odd.

`analyse` is the first step of every run's way in; `mean_cofs` turns a test's curves into mean COF over a protocol's speeds.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.criteria import NO_STATIC_TORQUE
from models.friction.identification import StribeckFit, StribeckFitStatus, fit_curves, mean_torques
from models.friction.measured_curve import MeasuredCurve
from models.friction.speed_protocol import protocol_speeds
from models.loops.lag_fit import StationaryCurve
from models.loops.loops import FrictionLoop, evaluate_loops
from models.records.cleaning import missing_samples
from models.records.criteria import UNLOADED
from models.records.plateaus import cut_plateaus
from models.records.runs import Curve, Plateaus, curves_by_pressure, loaded
from models.records.torque_filter import filtered_as_torque
from service.channels import PASCALS_PER_BAR, ZERO_CELSIUS
from service.clutch.criteria import FEWEST_SPEEDS, OTHER_OIL, POOR_FIT, WIDE_LEVEL
from service.clutch.engagements import EvaluatedEngagement, course_item, engagement_notices, evaluated
from service.clutch.incoming_run import IncomingRun, SampledChannels, sampled_record, stationary_plateaus
from service.errors import InvalidError, Notice

#: A value and its deviation.
Value = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelFit:
    """A pressure level's fit, the mean measured pressure [Pa] and the number of distinct speeds; `measured` points, for
    mean COF, if the fit leaves the static torque open or at zero."""

    fit: StribeckFit
    mean_pressure: float
    speeds: int
    measured: MeasuredCurve | None = None

    @classmethod
    def of(cls, fit: StribeckFit, curve: Curve) -> "LevelFit":
        """The level for a curve and its fit."""
        none_at_rest = fit.parameters.static_torque <= NO_STATIC_TORQUE * math.sqrt(float((curve.torque**2).mean()))
        open_at_rest = none_at_rest or "static_torque" in fit.undetermined
        return cls(
            fit=fit,
            mean_pressure=curve.mean_pressure,
            speeds=int(np.unique(curve.velocity).size),
            measured=MeasuredCurve.of(curve.velocity, curve.torque, fit.noise) if open_at_rest else None,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysis:
    """The results of one run by itself.

    Of a stationary test: `speed_range` [rad/s] under pressure, `oil_temperature` [K], its mean under pressure, and
    `oil_range` [K], which nine tenths of its plateaus lie within (None: not measured), `plateaus`, and the `times`
    [s] of their middles (None where each row was sent as a plateau). Of a block of duty that carries one:
    `engagement`.
    """

    fits: tuple[LevelFit, ...] = ()
    speed_range: tuple[float, float] | None = None
    oil_temperature: float | None = None
    oil_range: Value | None = None
    warnings: tuple[Notice, ...] = ()
    plateaus: Plateaus | None = None
    times: tuple[float, ...] | None = None
    engagement: EvaluatedEngagement | None = None

    def details_to_store(self, run: IncomingRun) -> dict[str, object]:
        """Fields stored with a run's channels: the other sent fields, its range of speeds [rad/s], its oil temperature
        [K], and the course of an engagement."""
        details = dict(run.details) | {"origin": run.origin}
        if run.file is not None:
            details["file"] = dict(run.file)
        if self.engagement is not None:
            return details | course_item(self.engagement)
        if self.speed_range is not None:
            details["speed_range"] = list(self.speed_range)
        if self.oil_temperature is not None:
            details["oil_temperature"] = self.oil_temperature
        if self.oil_range is not None:
            details["oil_range"] = list(self.oil_range)
        return details


def analyse(run: IncomingRun, geometry: Geometry, torque_filter: float) -> Analysis:
    """Fit a stationary test's curves, from its plateaus or its sampled record, or evaluate the engagement of a block of
    duty; other kinds and tests of the open clutch give neither. `torque_filter` [s]: the time constant of the torque
    channel's own low-pass, corrected for in a sampled test; an engagement is evaluated as recorded.

    Raises InvalidError if a sampled record holds no steady plateau.
    """
    if run.kind != "stationary_stribeck":
        engagement = evaluated(run, geometry)
        missing = missing_samples(run.channels["time_s"]) if "time_s" in run.channels else []
        notices = [*engagement_notices(engagement), *(Notice(code=code, message=message) for code, message in missing)]
        return Analysis(engagement=engagement, warnings=tuple(notices))
    if "time_s" not in run.channels:
        plateaus, notices = stationary_plateaus(run.channels), []
        if "torque_sd_nm" in run.channels and plateaus.torque_sd is None:
            message = "torque_sd_nm contains zeros, although every sensor has noise, so the fits do not use it"
            notices = [Notice(code="torque_sd_ignored", message=message)]
        return _analyse_stationary(plateaus, None, geometry, notices)
    try:
        cut = cut_plateaus(SampledChannels(run.channels), torque_filter)
    except ValueError as error:
        message = (
            f"time_s, pressure_bar, speed_rpm, torque_nm: {error} If each row of the file is a plateau, add time=none."
        )
        raise InvalidError.of(message, code="no_plateau", pointer="/channels/torque_nm") from None
    notices = [Notice(code=code, message=message) for code, message in cut.notes]
    times = tuple((0.5 * (cut.start + cut.stop)).tolist())
    return _analyse_stationary(cut.plateaus, times, geometry, notices)


def levels_of(plateaus: Plateaus, geometry: Geometry) -> tuple[LevelFit, ...]:
    """Fits of a stationary test's curves, in ascending order of pressure."""
    curves = curves_by_pressure(plateaus, geometry)
    return tuple(LevelFit.of(fit, curve) for fit, curve in zip(fit_curves(curves), curves, strict=True))


def loops_of(
    channels: Mapping[str, FloatArray], geometry: Geometry, torque_filter: float, levels: Sequence[LevelFit]
) -> tuple[FrictionLoop, ...]:
    """The friction loops of a dynamic test, with the lag relative to the curves of its stationary test, corrected for
    the torque channel's own filter of `torque_filter` [s]. The covariance of the curves makes the lag less certain, or
    unresolved.
    """
    curves = {level.fit.pressure: StationaryCurve.of(level.fit) for level in levels if level.speeds >= FEWEST_SPEEDS}
    return evaluate_loops(filtered_as_torque(sampled_record(channels), torque_filter), geometry, curves or None)


def _analyse_stationary(
    plateaus: Plateaus, times: tuple[float, ...] | None, geometry: Geometry, noticed: Sequence[Notice]
) -> Analysis:
    """The analysis of a stationary test's plateaus: fitted curves, speed range, oil, and warnings."""
    under_load = loaded(plateaus)
    noticed = [*_unloaded(plateaus, under_load), *noticed]
    if under_load is None:
        return Analysis(warnings=tuple(noticed), plateaus=plateaus, times=times)
    levels = levels_of(under_load, geometry)
    speed = np.abs(under_load.speed)
    low, high = float(speed.min()), float(speed.max())
    velocities = geometry.sliding_velocity(protocol_speeds(low, high)) if low < high else None
    cofs = {} if velocities is None else mean_cofs(levels, velocities, geometry)
    oil_range = _oil_range(under_load)
    warnings = [
        *_oil_moves(oil_range),
        *noticed,
        *(notice for level in levels for notice in _level_warnings(level, under_load)),
        *(notice for level in levels for notice in _fit_warnings(level)),
    ]
    warnings.extend(_without_mean([level for level in levels if level.fit.pressure not in cofs], bool(cofs)))
    return Analysis(
        fits=levels,
        speed_range=(low, high) if cofs else None,
        oil_temperature=None if under_load.oil_temperature is None else float(under_load.oil_temperature.mean()),
        oil_range=oil_range,
        warnings=tuple(warnings),
        plateaus=plateaus,
        times=times,
    )


def mean_cofs(
    levels: Sequence[LevelFit],
    velocities: FloatArray,
    geometry: Geometry,
    raised: Callable[[float], FloatArray] | None = None,
) -> dict[float, Value]:
    """Mean COF over the protocol's velocities [m] m/s with its standard deviation, by pressure [Pa], for levels that
    determine it: from the fitted curve, or from the measured points if the curve has no static torque.
    `raised(pressure)` is the ratio of friction to eq. 3 [m]."""
    usable = [level for level in levels if level.speeds >= FEWEST_SPEEDS]
    if not usable:
        return {}
    per_cof = np.array([geometry.torque_per_cof(level.mean_pressure) for level in usable])
    factor = np.ones((len(usable), velocities.size))
    if raised is not None:
        factor = np.stack([raised(level.mean_pressure) for level in usable])
    torques = mean_torques([level.fit for level in usable], velocities, factor)
    for place, level in enumerate(usable):
        if level.measured is not None:
            torques[place] = level.measured.mean(velocities, factor[place])
    values = (torques / per_cof[:, None]).tolist()
    return {
        level.fit.pressure: (cof, sd)
        for level, (cof, sd) in zip(usable, values, strict=True)
        if math.isfinite(cof) and 0 < sd < cof
    }


def _without_mean(levels: Sequence[LevelFit], others: bool) -> list[Notice]:
    """The warning that levels have no mean COF, with advice; without `others`, that the test does not count."""
    if not levels:
        return []
    few = all(level.speeds < FEWEST_SPEEDS for level in levels)
    advice = (
        f"test {FEWEST_SPEEDS} speeds or more"
        if few
        else "the mean torque there is not above zero by more than its uncertainty: check the torque's sign and its zero"
    )
    if not others:
        message = f"without a mean COF this test does not count for the remaining life: {advice}"
        return [Notice(code="no_mean_cof", message=message)]
    at = ", ".join(f"{level.fit.pressure / PASCALS_PER_BAR:g}" for level in levels)
    return [Notice(code="level_without_mean_cof", message=f"there is no mean COF at {at} bar: {advice}")]


def _level_warnings(level: LevelFit, plateaus: Plateaus) -> list[Notice]:
    """Warnings of levels with widely varying pressure: each may be several levels merged into one."""
    near = np.abs(plateaus.pressure - level.fit.pressure) <= WIDE_LEVEL * level.fit.pressure
    rows = int(np.count_nonzero(near))
    if rows >= level.fit.points:
        return []
    message = (
        f"at {level.fit.pressure / PASCALS_PER_BAR:g} bar the pressures scatter by more than {100 * WIDE_LEVEL:g} %. "
        "Were several pressures tested here? Keep them further apart"
    )
    return [Notice(code="wide_level", message=message)]


def _oil_range(plateaus: Plateaus) -> Value | None:
    """Between which temperatures [K] the oil is in nine tenths of a test's plateaus; None where it was not measured."""
    if plateaus.oil_temperature is None:
        return None
    low, high = np.quantile(plateaus.oil_temperature, [0.05, 0.95]).tolist()
    return low, high


def _oil_moves(oil_range: Value | None) -> list[Notice]:
    """The warning of a stationary test during which the oil temperature changes by more than the difference allowed
    between two comparable tests."""
    low, high = oil_range or (0.0, 0.0)
    if high - low <= OTHER_OIL:
        return []
    message = (
        f"the oil went from {low - ZERO_CELSIUS:.0f} to {high - ZERO_CELSIUS:.0f} °C within this test, so its curves mix "
        f"temperatures. First bring the oil to one temperature, within {OTHER_OIL:g} °C, and repeat the test"
    )
    return [Notice(code="oil_temperature_moves", message=message)]


def _unloaded(plateaus: Plateaus, under_load: Plateaus | None) -> list[Notice]:
    """The warning of plateaus without pressure, which no curve is fitted to."""
    below = f"below {UNLOADED / PASCALS_PER_BAR:g} bar"
    if under_load is None:
        message = (
            f"the clutch was open (all pressures {below}): no curve is fitted, and only a diagnosis uses this test"
        )
        return [Notice(code="open_clutch", message=message)]
    left_out = plateaus.torque.size - under_load.torque.size
    noun = "plateau" if left_out == 1 else "plateaus"
    message = f"left out of the fits: {left_out} {noun} {below}"
    return [Notice(code="unloaded_plateaus", message=message)] if left_out else []


def _fit_warnings(level: LevelFit) -> list[Notice]:
    """The warning of a curve that is undetermined or fits poorly."""
    fit, measured = level.fit, level.measured
    at = f"at {fit.pressure / PASCALS_PER_BAR:g} bar"
    if fit.status is StribeckFitStatus.UNDETERMINED:
        return [Notice(code="undetermined", message=f"{at}: {fit.message}")]
    scale = float(fit.parameters.static_torque) if measured is None else float(np.abs(measured.torque).max())
    poor = fit.rmse > POOR_FIT * scale
    if not fit.acceptable and fit.mse_percent is not None and poor:
        message = f"{at}: the fit is poor: MSE {fit.mse_percent:.3g} % (limit: 5 %), RMSE {fit.rmse:.3g} Nm"
        return [Notice(code="poor_fit", message=message)]
    return []
