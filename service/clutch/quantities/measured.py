"""The quantities that are followed along a life: names, units, places, series of what was measured, and their eq. 6."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.identification import StribeckFit, cof_slope
from models.friction.stribeck import PARAMETER_NAMES
from models.prognosis.back_cast import BackCast
from models.prognosis.criteria import FEWEST_TESTS
from models.prognosis.first_passage import weighted_quantiles
from models.prognosis.slope_paths import PressureLevel, slope_paths
from models.tracking.filters.grid import Grid
from models.tracking.posterior import TrackPosterior, mixture
from service.api.life import ALIASES, LifeNumber
from service.api.over_life import MeasuredEngagement
from service.api.run import Evaluation, Loop
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, bar, whole
from service.clutch.analysis import LevelFit, Value
from service.clutch.assumptions import ALL_PRESSURES, MEAN_COF, Assumptions
from service.clutch.criteria import FEWEST_SPEEDS, TRAJECTORY_DRAWS, TRAJECTORY_LATTICE
from service.clutch.engagements import ALL_INDICATORS
from service.clutch.items import PARAMETER_UNITS
from service.clutch.recomputation import ClutchHistory
from service.clutch.timeline import DYNAMIC, Event, Life, Series, lives_until, nearest, nearest_pressure, order
from service.clutch.tracking import States, advance, drawn, step_rng
from service.errors import InvalidError, NotFoundError


class Family(StrEnum):
    """The source of a quantity: mean COF, a fitted parameter, a curve's slope, a friction loop, or an engagement."""

    MEAN_COF = "mean_cof"
    PARAMETER = "parameter"
    SLOPE = "slope"
    LAG = "lag"
    ENGAGEMENT = "engagement"


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A measured quantity: its public name, the name of its series, its unit and its family."""

    name: str
    internal: str
    unit: str
    family: Family


SLOPE = "slope"
#: The speeds [rpm] at which slopes are stated where nothing else is said. Chosen: where a driveline shudders, creeping.
SLOPE_SPEEDS = (50.0, 100.0, 500.0)

QUANTITIES: Mapping[str, Quantity] = {
    quantity.name: quantity
    for quantity in (
        Quantity(name=MEAN_COF, internal=MEAN_COF, unit="1", family=Family.MEAN_COF),
        *(
            Quantity(name=public, internal=internal, unit=unit, family=Family.PARAMETER)
            for internal, (public, unit) in PARAMETER_UNITS.items()
        ),
        Quantity(name=SLOPE, internal=SLOPE, unit="s/m", family=Family.SLOPE),
        Quantity(name="attractor", internal="attractor", unit="Nm/s", family=Family.LAG),
        Quantity(name="film_time", internal="film_time", unit="s", family=Family.LAG),
        Quantity(name="loop_area", internal="loop_area", unit="Nm·m/s", family=Family.LAG),
        *(
            Quantity(name=name, internal=name, unit=indicator.unit, family=Family.ENGAGEMENT)
            for name, indicator in ALL_INDICATORS.items()
        ),
    )
}
_BY_INTERNAL = {quantity.internal: quantity for quantity in QUANTITIES.values()}


def quantity_named(name: str) -> Quantity:
    """The quantity with this public name, alternative name in criteria, or parameter name without unit.

    Raises InvalidError for any other.
    """
    quantity = QUANTITIES.get(ALIASES.get(name, name)) or _BY_INTERNAL.get(name)
    if quantity is None:
        message = f"quantity must be one of {', '.join(QUANTITIES)}, got {name!r}"
        raise InvalidError.of(message, code="unknown", pointer="/query/quantity")
    return quantity


def place_of(series: Series) -> dict[str, float | None]:
    """The place of a series' measurements in an answer; null: over all pressures, or at no particular speed or
    frequency."""
    pressure = None if series.pressure == ALL_PRESSURES else bar(series.pressure)
    return {"pressure_bar": pressure, "speed_rpm": series.speed_rpm, "frequency_hz": series.frequency_hz}


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenLife:
    """A life (None: there was none yet), the assumptions for tracking it, its number from 1 on and the number of lives.

    `held`: the held runs that an answer about it leaves out: all, if it is about the present, else those of this life
    by then.
    """

    life: Life | None
    assumptions: Assumptions
    number: int
    of: int
    held: tuple[Event, ...]

    def item(self) -> LifeNumber:
        """The life's description in an answer."""
        return LifeNumber(
            number=self.number,
            of=self.of,
            from_cycles=None if self.life is None else whole(self.life.origin),
            rebuild=None if self.life is None else self.life.name or None,
        )


def chosen_life(state: ClutchHistory, number: int | None = None, at_cycles: float | None = None) -> ChosenLife:
    """Life `number` of a clutch (None: the one at `at_cycles`, or the present one), up to `at_cycles`.

    Each life is tracked under the model adopted for it. Raises NotFoundError if there is no such life.
    """
    lives = state.lives
    if number is not None and not 1 <= number <= len(lives):
        raise NotFoundError(f"the clutch has {len(lives)} lives, there is no life {number}")
    until = lives_until(lives, at_cycles)
    index = len(until) if number is None else number
    held_runs = _held_runs_of_life(state, index, at_cycles)
    if not 1 <= index <= len(until):
        life, assumptions = None, state.assumptions
    else:
        life, whole_life = until[index - 1], lives[index - 1]
        adopted = next((a for a in state.adoptions if a is not None and a.life == whole_life.name), None)
        under = state.extension if index == len(lives) else None if adopted is None else adopted.extension
        assumptions = state.assumptions_under(under, whole_life)
    return ChosenLife(life=life, assumptions=assumptions, number=max(index, 1), of=len(lives), held=held_runs)


def _held_runs_of_life(state: ClutchHistory, number: int, at_cycles: float | None) -> tuple[Event, ...]:
    """The held runs that an answer about life `number` at `at_cycles` (None: any) leaves out."""
    lives = state.lives
    now = at_cycles is None or not state.events or at_cycles >= state.events[-1].cycles
    if now and number >= len(lives):
        return state.held
    starts = {life.events[0].run_id for life in lives[1:]}
    names, place, held_runs = {event.run_id for event in state.held}, 1, []
    for event in order([*state.events, *state.held]):
        place += event.run_id in starts
        if event.run_id in names and place == max(number, 1) and (now or event.cycles <= (at_cycles or 0.0)):
            held_runs.append(event)
    return tuple(held_runs)


#: A series and a weighted sample of its eq. 6.
Track = tuple[Series, TrackPosterior]

_NODES, _ROWS, _LEVELS = TRAJECTORY_LATTICE
_GRID = Grid(nodes=_NODES, rows=_ROWS, levels=_LEVELS)


def posterior_of(series: Series, method: str = _GRID.name) -> TrackPosterior:
    """A weighted, reproducible sample of a series' eq. 6: by the exact filter on a lattice fit for plots, or by the
    named filter after all measurements."""
    if method != _GRID.name:
        runs = len(series.measurements)
        return drawn(method, series, advance(method, series, None, runs, back_cast=BackCast.nothing()))
    parts = []
    for weight, measurements in series.weighted:
        posteriors = {}
        for name, prior in series.priors(measurements[0]).items():
            state = _GRID.from_merged(prior, measurements)
            rng = step_rng(f"trajectory-{name}", series, len(measurements))
            posteriors[name] = _GRID.posterior(state, math.ceil(TRAJECTORY_DRAWS / len(series.weighted)), rng)
        parts.append((weight, series.assumptions.pooled(posteriors, measurements[0], series.scale)))
    return parts[0][1] if len(parts) == 1 else mixture(parts)


def tests_of(life: Life, fits: Mapping[str, Sequence[LevelFit]]) -> list[Sequence[LevelFit]]:
    """The fitted levels of each of a life's events; empty if the event is no test."""
    return [fits.get(event.run_id, ()) for event in life.events]


def parameter_series(
    life: Life, assumptions: Assumptions, tests: Sequence[Sequence[LevelFit]], name: str
) -> list[Series]:
    """The series of one Stribeck parameter at every reference pressure, from the fits that determine it."""
    column = PARAMETER_NAMES.index(name)
    values = [
        {
            fit.pressure: (float(getattr(fit.parameters, name)), fit.covariance.item(column, column) ** 0.5)
            for fit in (level.fit for level in levels)
            if name not in fit.undetermined
        }
        for levels in tests
    ]
    return [
        life.series(assumptions, name, level, [nearest(level, of_test) for of_test in values])
        for level in life.reference
    ]


def parameter_tracks(
    life: Life,
    assumptions: Assumptions,
    tests: Sequence[Sequence[LevelFit]],
    method: str = _GRID.name,
    pressures: Collection[float] | None = None,
) -> dict[tuple[str, float], Track]:
    """Tracks (eq. 6) of the Stribeck parameters at the reference pressures where they are known, by name and pressure
    [Pa]."""
    return {
        (name, series.pressure): (series, posterior_of(series, method))
        for name in PARAMETER_NAMES
        for series in parameter_series(life, assumptions, tests, name)
        if series.measurements and (pressures is None or series.pressure in pressures)
    }


def parameter_medians(
    life: Life, assumptions: Assumptions, fits: Mapping[str, Sequence[LevelFit]], cycles: FloatArray
) -> tuple[list[float], FloatArray]:
    """The reference pressures [p] Pa at which all Stribeck parameters have tracks, ascending, and the medians [4, p, k] of
    these at cycles since new [k]."""
    tracks = parameter_tracks(life, assumptions, tests_of(life, fits))
    levels = sorted(level for level in life.reference if all((name, level) in tracks for name in PARAMETER_NAMES))
    medians = np.empty((len(PARAMETER_NAMES), len(levels), cycles.size))
    for row, name in zip(medians, PARAMETER_NAMES, strict=True):
        for column, level in zip(row, levels, strict=True):
            series, posterior = tracks[name, level]
            values = posterior.values(series.scale.progress(cycles))
            column[:] = [weighted_quantiles(sample, posterior.weight, (0.5,))[0] for sample in values]
    return levels, medians


#: What a receipt's loop calls the quantities of the lag and their deviations.
LOOP_COLUMNS = {
    "attractor": ("attractor_nm_s", "attractor_sd_nm_s"),
    "film_time": ("film_time_s", "film_time_sd_s"),
    "loop_area": ("loop_area_nm_m_s", "loop_area_sd_nm_m_s"),
}
#: Loops are of one frequency where it is the same to so many significant digits. Chosen: a rig keeps its frequency within a
#: few per cent, and a protocol's differ by more.
_DIGITS = 2


@dataclass(frozen=True, kw_only=True)
class MeasuredLife:
    """A life of a clutch with the fitted curves of its stationary tests and its receipts, both by run_id, and the rows of
    its engagements (`engagements.over_life`); `fraction` of the initial mean COF ends it where nothing else is said.
    `filters` are those of mean COF over all pressures where they were carried along the life already."""

    life: Life
    assumptions: Assumptions
    geometry: Geometry
    fraction: float
    levels: Mapping[str, Sequence[LevelFit]]
    receipts: Mapping[str, Evaluation]
    engagements: Sequence[MeasuredEngagement] = ()
    filters: States = field(default_factory=dict)

    @cached_property
    def tests(self) -> list[Sequence[LevelFit]]:
        return tests_of(self.life, self.levels)

    @cached_property
    def determined(self) -> list[dict[float, StribeckFit]]:
        """The fits that determine all four parameters, by pressure [Pa], for each event."""
        return [
            {level.fit.pressure: level.fit for level in levels if not level.fit.undetermined} for levels in self.tests
        ]

    def series(self, quantity: Quantity, speeds: Sequence[float] = SLOPE_SPEEDS) -> list[Series]:
        """The series of a quantity at each place where it was measured; a slope's at `speeds` [rpm]."""
        match quantity.family:
            case Family.MEAN_COF:
                tracks = [self.life.pooled(self.assumptions), *self.mean_cofs().values()]
            case Family.PARAMETER:
                tracks = parameter_series(self.life, self.assumptions, self.tests, quantity.internal)
            case Family.SLOPE:
                tracks = [self._slopes(level, speed) for speed in speeds for level in self.life.reference]
            case Family.LAG:
                tracks = list(self._loop_series(quantity))
            case Family.ENGAGEMENT:
                tracks = [self._engagement_series(quantity)]
        return [series for series in tracks if series.measurements]

    def mean_cofs(self) -> dict[float, Series]:
        """Mean COF at each reference pressure [Pa]."""
        return {level: self.life.at(self.assumptions, level) for level in self.life.reference}

    def _engagement_series(self, quantity: Quantity) -> Series:
        """The series of an indicator over the engagements of the life."""
        estimates = {row.run_id: getattr(row.indicators, quantity.internal) for row in self.engagements}
        values = [estimates.get(event.run_id) for event in self.life.events]
        at_events = [None if value is None else (value.value, value.sd) for value in values]
        return self.life.series(self.assumptions, quantity.internal, ALL_PRESSURES, at_events)

    def _slopes(self, level: float, speed_rpm: float) -> Series:
        """The series of dμ/dv at a pressure level and speed over the tests of the life."""
        values = [self._slope(levels, level, speed_rpm) for levels in self.tests]
        series = self.life.series(self.assumptions, f"{SLOPE}@{speed_rpm:g}rpm", level, values)
        return replace(series, speed_rpm=speed_rpm)

    def _slope(self, levels: Sequence[LevelFit], level: float, speed_rpm: float) -> Value | None:
        """dμ/dv of one test at the curve nearest to a pressure level; None if none is near."""
        curves = {curve.fit.pressure: curve for curve in curves_of(levels)}
        near = nearest_pressure(level, list(curves))
        return None if near is None else slope_of(curves[near], self.geometry, speed_rpm)

    def _loop_series(self, quantity: Quantity) -> Iterator[Series]:
        """One series for each pressure and frequency of the friction loops."""
        by_event = [
            self.receipts[event.run_id].loops if event.kind == DYNAMIC and event.run_id in self.receipts else []
            for event in self.life.events
        ]
        measured = [loop.frequency_hz for of_event in by_event for loop in of_event]
        for frequency in sorted({rounded_frequency(each) for each in measured if each is not None}):
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
    """The levels of a test with enough speeds for a curve."""
    return [fitted for fitted in levels if fitted.speeds >= FEWEST_SPEEDS]


def slope_of(curve: LevelFit, geometry: Geometry, speed_rpm: float) -> Value | None:
    """dμ/dv of a fitted curve at a speed > 0, with its standard error [s/m]; None for a curve without friction."""
    velocity = float(geometry.sliding_velocity(np.array(speed_rpm * RADIANS_PER_SECOND_PER_RPM)))
    return cof_slope(curve.fit, velocity, geometry.torque_per_cof(curve.mean_pressure))


def _values(loops: Sequence[Loop], columns: tuple[str, str], frequency: float) -> dict[float, Value]:
    """A quantity of the loops at one frequency, by pressure [Pa]; of several loops at a pressure, the last that
    determines it."""
    name, deviation = columns
    return {
        loop.pressure_bar * PASCALS_PER_BAR: (value, sd)
        for loop in loops
        if loop.frequency_hz is not None
        and rounded_frequency(loop.frequency_hz) == frequency
        and (value := getattr(loop, name)) is not None
        and (sd := getattr(loop, deviation)) is not None
    }


def rounded_frequency(frequency: float) -> float:
    """A frequency > 0 [Hz] to _DIGITS significant digits."""
    return round(frequency, _DIGITS - 1 - math.floor(math.log10(frequency)))


#: Tracks of the parameters by name and pressure [Pa].
ParameterTracks = Mapping[tuple[str, float], Track]


def pressure_level(measured: MeasuredLife, tracks: ParameterTracks, direct: Track, pressure: float) -> PressureLevel:
    """The tracks at a reference pressure [Pa], and the tests whose fit determines all four parameters.

    `direct` is mean COF at that pressure. Raises KeyError where a parameter has no track there.
    """
    series, posterior = direct
    cycles, fits = [], []
    tests = list(zip(measured.life.events, measured.tests, strict=True))
    for event, determined in zip(measured.life.events, measured.determined, strict=True):
        near = pressure if pressure in determined else nearest_pressure(pressure, list(determined))
        if near is not None:
            cycles.append(event.cycles)
            fits.append(determined[near])
    # COF is torque over the pressure that was measured in the first test with COFs, so torque is made with the same pressure
    reference = next((levels for event, levels in tests if event.cofs and levels), ())
    measured_at = {level.fit.pressure: level.mean_pressure for level in reference}
    near = nearest_pressure(pressure, list(measured_at))
    return PressureLevel(
        progress=series.scale.progress(np.array(cycles)),
        parameters=np.array([fit.parameters.as_array() for fit in fits]),
        covariance=np.array([fit.unbiased_covariance for fit in fits]),
        parameter_tracks=[tracks[name, pressure][1] for name in PARAMETER_NAMES],
        cof_scatter=float(posterior.weight @ posterior.scatter) / series.measurements[0].value,
        torque_per_cof=measured.geometry.torque_per_cof(pressure if near is None else measured_at[near]),
    )


def slopes_along(
    measured: MeasuredLife, tracks: ParameterTracks, direct: Track, speed_rpm: float, progress: FloatArray
) -> FloatArray | None:
    """dμ/dv [k, n] at a speed and progress [k] in joint draws of the parameters at the pressure of the `direct` track of
    mean COF, the same each time; None with too few tests."""
    series, _ = direct
    if not all((name, series.pressure) in tracks for name in PARAMETER_NAMES):
        return None
    level = pressure_level(measured, tracks, direct, series.pressure)
    if np.unique(level.progress).size < FEWEST_TESTS:
        return None
    velocity = float(measured.geometry.sliding_velocity(np.array(speed_rpm * RADIANS_PER_SECOND_PER_RPM)))
    rng = step_rng(f"slope@{speed_rpm:g}rpm", series, level.progress.size)
    return slope_paths(level, velocity, progress, rng)
