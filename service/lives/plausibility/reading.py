"""What a run shows of friction, in the few numbers that a slip would change: COF, pressures, speeds, oil temperature."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.records.criteria import UNLOADED
from service.lives.history import DYNAMIC, STATIONARY, Event
from service.lives.incoming_run import IncomingRun, SampledChannels
from service.lives.plausibility import criteria
from service.lives.run_analysis import Analysis

#: Bins of speed.
_BINS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """The rows of a run in SI units: pressure [n] Pa, speed [n] rad/s, torque [n] Nm, oil temperature [n] K or None."""

    pressure: FloatArray
    speed: FloatArray
    torque: FloatArray
    oil_temperature: FloatArray | None

    def loaded(self) -> "Columns":
        """The rows at which the clutch is pressed and slides."""
        fastest = float(np.abs(self.speed).max())
        rows = (self.pressure >= max(UNLOADED, 0.3 * float(self.pressure.max()))) & (
            np.abs(self.speed) >= 0.02 * fastest
        )
        oil = None if self.oil_temperature is None else self.oil_temperature[rows]
        return Columns(
            pressure=self.pressure[rows], speed=self.speed[rows], torque=self.torque[rows], oil_temperature=oil
        )

    def cof_by_speed(self, geometry: Geometry) -> tuple[FloatArray, FloatArray]:
        """Mean COF [b] in equal bins of speed that hold rows, positive where torque brakes, and its scatter [b] there."""
        cof = np.sign(self.speed) * self.torque / (self.pressure * geometry.torque_per_cof(1.0))
        speed = np.abs(self.speed)
        low, high = float(speed.min()), float(speed.max())
        bins = np.minimum(((speed - low) / max(high - low, 1e-9) * _BINS).astype(np.intp), _BINS - 1)
        rows = np.bincount(bins)
        mean = np.bincount(bins, weights=cof) / np.maximum(rows, 1)
        square = np.bincount(bins, weights=(cof - mean[bins]) ** 2) / np.maximum(rows, 1)
        return mean[rows > 0], np.sqrt(square[rows > 0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """A run as its likelihood is computed from; None where it does not show a value.

    `cof` [-] is the mean over the speeds, of either sign; `pressure` [Pa] and `speed` [rad/s] the highest, `oil` [K] the
    median; `torque` [Nm] the median where the clutch is open. `mean_cof`: by pressure, as the history compares it; `spread`:
    how far log COF of this kind of run is off a stationary test's. `declared_speed` [rad/s] is what a block of duty says of
    its engagements.
    """

    cycles: float
    cof: float | None = None
    mean_cof: Mapping[float, tuple[float, float]] | None = None
    spread: float = 0.0
    pressure: float | None = None
    speed: float | None = None
    oil: float | None = None
    torque: float | None = None
    declared_speed: float | None = None

    def scaled(self, *, pressure: float = 1.0, torque: float = 1.0, speed: float = 1.0) -> "Reading":
        """The run if its channels were so many times too large."""
        return replace(
            self,
            cof=None if self.cof is None else self.cof * pressure / torque,
            mean_cof=None if speed != 1.0 or self.mean_cof is None else _scaled(self.mean_cof, pressure, torque),
            pressure=None if self.pressure is None else self.pressure / pressure,
            speed=None if self.speed is None else self.speed / speed,
        )


def _scaled(
    values: Mapping[float, tuple[float, float]], pressure: float, torque: float
) -> dict[float, tuple[float, float]]:
    factor = pressure / torque
    return {level / pressure: (cof * factor, sd * factor) for level, (cof, sd) in values.items()}


def columns_of(run: IncomingRun, analysis: Analysis) -> Columns | None:
    """The rows of a run: the plateaus of a stationary test, the samples of another; None for a run without channels."""
    rows = analysis.plateaus
    if rows is not None:
        return Columns(
            pressure=rows.pressure, speed=rows.speed, torque=rows.torque, oil_temperature=rows.oil_temperature
        )
    if not run.channels:
        return None
    samples = SampledChannels(run.channels)
    return Columns(
        pressure=samples.pressure,
        speed=samples.speed,
        torque=samples.torque,
        oil_temperature=samples.oil_temperature,
    )


def reading_of(event: Event, columns: Columns | None, geometry: Geometry) -> Reading:
    """The reading of a run from its rows."""
    if columns is None:
        return Reading(cycles=event.cycles)
    oil = None if columns.oil_temperature is None else float(np.median(columns.oil_temperature))
    if float(columns.pressure.max()) < UNLOADED:
        return Reading(cycles=event.cycles, oil=oil, torque=float(np.median(np.abs(columns.torque))))
    rows = columns.loaded()
    if rows.torque.size == 0:
        return Reading(cycles=event.cycles, oil=oil)
    is_test = event.kind in (STATIONARY, DYNAMIC)
    declared_speed = None if event.duty is None else event.duty.speed
    return Reading(
        cycles=event.cycles,
        cof=float(rows.cof_by_speed(geometry)[0].mean()),
        mean_cof=dict(event.cofs) or None,
        spread={STATIONARY: 0.0, DYNAMIC: criteria.DYNAMIC_SD}.get(event.kind, criteria.ENGAGEMENT_SD),
        pressure=float(rows.pressure.max()) if is_test else None,
        speed=float(np.abs(rows.speed).max()) if is_test or declared_speed else None,
        declared_speed=declared_speed,
        oil=oil,
    )


def log_or_none(value: float | None) -> float | None:
    """The logarithm of a positive value, else None."""
    return math.log(value) if value is not None and value > 0 else None
