"""A life with all that was measured in it: the series of any quantity, at each pressure, speed or frequency."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from models.clutch import Geometry
from models.friction.slope import cof_slope
from service.columns import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM
from service.lives.assumptions import ALL_PRESSURES, Assumptions
from service.lives.criteria import FEWEST_SPEEDS
from service.lives.history import DYNAMIC, Life, Series, nearest, nearest_pressure
from service.lives.quantities.names import SLOPE, SLOPE_SPEEDS, Family, Quantity
from service.lives.quantities.parameters import parameter_series, tests_of
from service.lives.run_analysis import LevelFit, Value
from service.lives.tracks import States

#: What a receipt's loop calls the quantities of the lag and their deviations.
LOOP_COLUMNS = {
    "attractor": ("attractor_nm_s", "attractor_sd_nm_s"),
    "film_time": ("film_time_s", "film_time_sd_s"),
    "loop_area": ("loop_area_nm_m_s", "loop_area_sd_nm_m_s"),
}
#: Loops are of one frequency where it is the same to so many significant digits. Chosen: a rig keeps its frequency within a
#: few per cent, and a protocol's differ by more.
_DIGITS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredLife:
    """A life of a clutch with the fitted curves of its stationary tests and its receipts, both by run_id, and the rows of
    its engagements (`engagements.over_life`); `fraction` of the initial mean COF ends it where nothing else is said.
    `filters` are those of mean COF over all pressures where they were carried along the life already."""

    clutch_id: str
    life: Life
    assumptions: Assumptions
    geometry: Geometry
    fraction: float
    levels: Mapping[str, Sequence[LevelFit]]
    receipts: Mapping[str, dict[str, Any]]
    engagements: Sequence[Mapping[str, Any]] = ()
    filters: States = field(default_factory=dict)

    @property
    def tests(self) -> list[Sequence[LevelFit]]:
        """The fitted levels of each of the life's events, none where it is no test."""
        return tests_of(self.life, self.levels)

    def series(self, quantity: Quantity, speeds: Sequence[float] = SLOPE_SPEEDS) -> list[Series]:
        """The series of a quantity wherever it was measured; of a slope at `speeds` [rpm]."""
        match quantity.family:
            case Family.MEAN_COF:
                tracks = [self.life.pooled(self.assumptions), *self.mean_cofs().values()]
            case Family.PARAMETER:
                tracks = parameter_series(self.life, self.assumptions, self.tests, quantity.internal)
            case Family.SLOPE:
                tracks = [self._slopes(level, speed) for speed in speeds for level in self.life.reference]
            case Family.LAG:
                tracks = list(self._of_loops(quantity))
            case Family.ENGAGEMENT:
                tracks = [self._of_engagements(quantity)]
        return [series for series in tracks if series.measurements]

    def mean_cofs(self) -> dict[float, Series]:
        """Mean COF at each reference pressure [Pa]."""
        return {level: self.life.at(self.assumptions, level) for level in self.life.reference}

    def _of_engagements(self, quantity: Quantity) -> Series:
        estimates = {row["run_id"]: row["indicators"][quantity.internal] for row in self.engagements}
        values = [estimates.get(event.run_id) for event in self.life.events]
        at_events = [None if value is None else (value["value"], value["sd"]) for value in values]
        return self.life.series(self.assumptions, quantity.internal, ALL_PRESSURES, at_events)

    def _slopes(self, level: float, speed_rpm: float) -> Series:
        values = [self._slope(levels, level, speed_rpm) for levels in self.tests]
        series = self.life.series(self.assumptions, f"{SLOPE}@{speed_rpm:g}rpm", level, values)
        return replace(series, speed_rpm=speed_rpm)

    def _slope(self, levels: Sequence[LevelFit], level: float, speed_rpm: float) -> Value | None:
        curves = {curve.fit.pressure: curve for curve in curves_of(levels)}
        near = nearest_pressure(level, list(curves))
        return None if near is None else slope_of(curves[near], self.geometry, speed_rpm)

    def _of_loops(self, quantity: Quantity) -> Iterator[Series]:
        """Each pressure by itself, and never two frequencies in one series."""
        by_event = [
            self.receipts[event.run_id]["loops"] if event.kind == DYNAMIC and event.run_id in self.receipts else []
            for event in self.life.events
        ]
        loops = [loop for of_event in by_event for loop in of_event if loop["frequency_hz"] is not None]
        for frequency in sorted({rounded_frequency(loop["frequency_hz"]) for loop in loops}):
            values = [_values(of_event, LOOP_COLUMNS[quantity.internal], frequency) for of_event in by_event]
            levels: list[float] = []
            for pressure in sorted(pressure for of_event in values for pressure in of_event):
                if nearest_pressure(pressure, levels) is None:
                    levels.append(pressure)
            for level in levels:
                name = f"{quantity.internal}@{frequency:g}Hz"
                at_level = [nearest(level, of_event) for of_event in values]
                yield replace(self.life.series(self.assumptions, name, level, at_level), frequency_hz=frequency)


def curves_of(levels: Sequence[LevelFit]) -> list[LevelFit]:
    """The levels of a test that were measured at enough speeds for a curve."""
    return [fitted for fitted in levels if fitted.speeds >= FEWEST_SPEEDS]


def slope_of(curve: LevelFit, geometry: Geometry, speed_rpm: float) -> Value | None:
    """dμ/dv of a fitted curve at a speed > 0 and its standard error [s/m]; None of a curve without friction."""
    velocity = float(geometry.sliding_velocity(np.array(speed_rpm * RADIANS_PER_SECOND_PER_RPM)))
    slope = cof_slope(curve.fit, velocity, geometry.torque_per_cof(curve.mean_pressure))
    return None if slope is None else (slope.value, slope.sd)


def _values(loops: Sequence[Mapping[str, Any]], columns: tuple[str, str], frequency: float) -> dict[float, Value]:
    """A quantity of the loops of one frequency by pressure [Pa], the last of a pressure's; where it is determined."""
    name, deviation = columns
    return {
        loop["pressure_bar"] * PASCALS_PER_BAR: (loop[name], loop[deviation])
        for loop in loops
        if loop["frequency_hz"] is not None
        and rounded_frequency(loop["frequency_hz"]) == frequency
        and loop[name] is not None
        and loop[deviation] is not None
    }


def rounded_frequency(frequency: float) -> float:
    """A frequency > 0 [Hz] to _DIGITS significant digits."""
    return round(frequency, _DIGITS - 1 - math.floor(math.log10(frequency)))
