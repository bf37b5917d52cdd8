"""Prepares runs for the plausibility judgement: each run as sent, and with each possible mistake corrected.

Finds dead channels too (unplugged, railed, frozen). What a run shows of friction is taken from its rows when it comes in
(`shown_by`) and stored beside it; all else follows from the history.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from statistics import median_low

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.plausibility import criteria as odds
from models.plausibility.slips import Run, RunReading, Slip
from models.records.criteria import UNLOADED
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, ZERO_CELSIUS
from service.clutch.analysis import Analysis
from service.clutch.criteria import OTHER_OIL
from service.clutch.incoming_run import IncomingRun, SampledChannels
from service.clutch.timeline import DYNAMIC, STATIONARY, Event, Life, Shown, lives_of, pooled_value
from service.errors import Notice

# Mean COF of runs that are no stationary tests

#: Deviation of a dynamic test's and of an engagement's COF from a stationary test's mean. Chosen.
DYNAMIC_SD, ENGAGEMENT_SD = 0.03, 0.35
#: The same of a COF taken from the rows, where no curve was fitted. Chosen: on the rigs it is off by 1 to 3 %.
ROWS_SD = 0.05
#: The same where pressures are not the reference's, a unit of their logarithm: torque is not quite in proportion.
OTHER_PRESSURE_SD = 0.35
#: The same a kelvin of oil temperature beyond `lives.OTHER_OIL`. Chosen: some three times what Hersey's similarity
#: makes of the simulated rig's oil, 0.05 to 0.15 % a kelvin, for linings and additives differ.
OTHER_OIL_SD = 0.004

# Pressures, speeds and oil

#: Share of tests made at other pressures, speeds or oil temperatures than any other test; the deviation of the logarithm of
#: pressures and speeds that are the same. Chosen: a diagnosis advises such tests.
OTHER_PROTOCOL, SAME_PROTOCOL_SD = 0.05, 0.03
#: Highest pressure [Pa] and speed [rad/s] of a rig of which nothing is known, and the deviations of their logarithms.
#: Chosen: slow rigs are many.
PRESSURE, LOG_PRESSURE_SD, SPEED, LOG_SPEED_SD = 8e5, 1.2, 200.0, 2.0
#: Oil temperature [K] of a test and its deviation. Chosen: wet clutches are tested at 40 to 120 °C.
OIL, OIL_SD = 273.15 + 80.0, 25.0

# Dead channels (`dead_channels`). Chosen; an honest channel is far from each.

#: Rows below which nothing is said of a channel [-].
FEWEST_ROWS = 8
#: A channel whose middle 90 % differ by less than this share of its size stands still.
STILL = 2e-3
#: Speed whose middle 90 % differ by less than this share of the highest is no Stribeck test.
SPEED_STILL = 0.02
#: Highest over lowest loaded pressure from which torque must follow, and the least exponent of torque over pressure.
PRESSURE_SPAN, MIN_EXPONENT = 1.25, 0.4
#: Scatter of torque [-] at one speed and one pressure from which pressure was not one: loops and stick-slip are less.
SINGLE_LEVEL_SPREAD = 0.1
#: A mean COF below this is no friction where torque scatters about zero by half of itself and more.
NO_FRICTION = 0.004
#: Rows at exactly the highest torque, to this share of it, that are its sensor's limit [-], where so many of the other rows
#: have a torque of their own [-]: else ties are counts. Chosen: of 280 rows in steps of 0.1 Nm half have one, of 0.01 Nm
#: nine in ten.
AT_THE_LIMIT, SAME_TORQUE, OWN_TORQUE = 4, 1e-6, 0.8
#: Oil temperatures [K] that no sensor in oil shows: below what pours, above what K under the name of °C may be.
COLDEST, HOTTEST = 273.15 - 60.0, 273.15 + 450.0

#: An open clutch's drag as a COF: the mean of its logarithm, and the deviation. Chosen: some 3 % of a pressed one's torque.
LOG_DRAG = (math.log(0.003), 1.4)
#: Deviation of log COF of a torque that was measured while the pressure sensor was dead, for the pressure is not known.
PRESSED_SD = 0.5


#: No number is so improbable that its logarithm underflows.
_LEAST = -600.0
#: Bins of speed.
_BINS = 16


@dataclass(frozen=True, slots=True)
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
        return Columns(self.pressure[rows], self.speed[rows], self.torque[rows], oil)

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


def columns_of(run: IncomingRun, analysis: Analysis) -> Columns | None:
    """The rows of a run: the plateaus of a stationary test, the samples of another; None for a run without channels."""
    rows = analysis.plateaus or (SampledChannels(run.channels) if run.channels else None)
    return None if rows is None else Columns(rows.pressure, rows.speed, rows.torque, rows.oil_temperature)


def shown_by(columns: Columns | None, geometry: Geometry) -> Shown:
    """Friction, pressure, speed and oil temperature shown by the rows of a run."""
    if columns is None:
        return Shown()
    oil = None if columns.oil_temperature is None else float(np.median(columns.oil_temperature))
    if float(columns.pressure.max()) < UNLOADED:
        return Shown(oil=oil, open_torque=float(np.median(np.abs(columns.torque))))
    rows = columns.loaded()
    if rows.torque.size == 0:
        return Shown(oil=oil)
    return Shown(
        cof=float(rows.cof_by_speed(geometry)[0].mean()),
        pressure=float(rows.pressure.max()),
        speed=float(np.abs(rows.speed).max()),
        oil=oil,
    )


@dataclass(frozen=True, kw_only=True)
class _Comparison:
    """The basis of comparison for the runs of a life: all its tests, and the first of them at the usual pressures."""

    life: Life
    geometry: Geometry
    corrected: bool

    @cached_property
    def tests(self) -> list[Event]:
        """Tests with mean COFs."""
        return [event for event in self.life.events if event.cofs]

    @cached_property
    def reference(self) -> Event | None:
        """The test whose pressures are the basis for comparing COFs."""
        if not self.tests:
            return None
        usual = median_low([max(event.cofs) for event in self.tests])
        return next(event for event in self.tests if max(event.cofs) == usual)

    @cached_property
    def oil(self) -> float | None:
        """The usual oil temperature of tests [K]."""
        logged = [event.oil_temperature for event in self.tests if event.oil_temperature is not None]
        return median_low(logged) if logged else None

    def in_other_oil(self, event: Event) -> bool:
        """Whether a test's oil temperature is unusual, so that its COF does not belong to the course of COF."""
        if self.oil is None or event.oil_temperature is None:
            return False
        return abs(event.oil_temperature - self.oil) > OTHER_OIL

    def shows_course(self, event: Event) -> bool:
        """Whether a run's COF belongs to the course of COF: positive, and of a test in the usual oil."""
        if not event.cofs or self.in_other_oil(event):
            return False
        positive = min(event.cofs.values())[0] > 0.0  # then it is, whatever the pressures are
        return positive or self._compared(event, event.shown or Shown(), event.cofs) is not None

    def reading(self, event: Event, shown: Shown, cofs: Mapping[float, tuple[float, float]] | None) -> RunReading:
        """The reading of a run with this shown friction."""
        log_cof, spread = self._compared(event, shown, cofs) or (None, 0.0)
        protocol = self._log_protocol(event, shown)
        return RunReading(cycles=event.cycles, log_cof=log_cof, spread=spread, log_protocol=protocol)

    def _compared(
        self, event: Event, shown: Shown, mean_cof: Mapping[float, tuple[float, float]] | None
    ) -> tuple[float, float] | None:
        """log COF of a run on the scale of its life's tests, and its standard deviation; None if it shows no COF."""
        run_sd = {STATIONARY: 0.0, DYNAMIC: DYNAMIC_SD}.get(event.kind, ENGAGEMENT_SD)
        spread = math.hypot(run_sd, odds.STEP_SD if self.corrected else 0.0)
        first = self.reference
        if self.oil is not None and shown.oil is not None:
            beyond = max(abs(shown.oil - self.oil) - OTHER_OIL, 0.0)
            spread = math.hypot(spread, OTHER_OIL_SD * beyond)
        pooled = None
        if mean_cof and first is not None:
            pooled = event.pooled(first.cofs) if mean_cof is event.cofs else pooled_value(first.cofs, mean_cof)
        if pooled is not None and pooled[0] > 0:
            return math.log(pooled[0]), math.hypot(spread, pooled[1] / pooled[0])
        if mean_cof:
            cof = math.fsum(cof for cof, _ in mean_cof.values()) / len(mean_cof)
        else:
            cof, spread = shown.cof or 0.0, math.hypot(spread, ROWS_SD)
        if first is not None and shown.pressure is not None and event.kind in (STATIONARY, DYNAMIC):
            log_ratio = math.log(shown.pressure / max(first.cofs))
            spread = math.hypot(spread, OTHER_PRESSURE_SD * log_ratio)
        return (math.log(cof), spread) if cof > 0 else None

    @cached_property
    def usual(self) -> tuple["_Usual", "_Usual", "_Usual"]:
        """The distributions of log pressure, log speed and oil temperature of this life's tests."""
        shown = [event.shown for event in self.tests if event.shown is not None]
        return (
            _PRESSURE.with_tests(math.log(one.pressure) for one in shown if one.pressure),
            _SPEED.with_tests(math.log(one.speed) for one in shown if one.speed),
            _OIL.with_tests(one.oil for one in shown if one.oil is not None),
        )

    def _log_protocol(self, event: Event, shown: Shown) -> float:
        """The log density of a run's pressure, speed and oil temperature: equal to another test's of the life, or
        different."""
        is_test = event.kind in (STATIONARY, DYNAMIC)
        measured = event.shown if event.cofs and event.shown is not None else Shown()
        declared = None if event.duty is None else event.duty.speed
        pressure, speed, oil = self.usual
        total = 0.0
        if is_test and shown.pressure:
            total += pressure.log_of(
                math.log(shown.pressure), math.log(measured.pressure) if measured.pressure else None
            )
        if declared and shown.speed:
            total += _SPEED.with_tests([math.log(declared)]).log_of(math.log(shown.speed), None)
        elif is_test and shown.speed:
            total += speed.log_of(math.log(shown.speed), math.log(measured.speed) if measured.speed else None)
        if shown.oil is not None:
            total += oil.log_of(shown.oil, measured.oil)
        if shown.open_torque is not None and shown.open_torque > 0:  # an open clutch's drag
            total += _log_normal(self._pressed(shown), *LOG_DRAG)
        return total

    def _pressed(self, shown: Shown) -> float:
        """log COF that an open clutch's torque would mean if the clutch were pressed as in the reference test."""
        levels = [PRESSURE] if self.reference is None else list(self.reference.cofs)
        return math.log((shown.open_torque or 0.0) / self.geometry.torque_per_cof(sum(levels) / len(levels)))

    def slips(self, event: Event, shown: Shown) -> Iterator[Slip]:
        """The possible slips of a run's channels: a wrong unit, or a dead pressure channel."""
        share = math.log(odds.OTHER_UNIT / len(UNITS))
        if shown.cof is not None:
            for channel, unit, factor in UNITS:
                cofs = None if channel == "speed" else _scaled(event.cofs, channel, factor)
                likely = self.reading(event, _in_unit(shown, channel, factor), cofs)
                yield Slip(name=channel, log_prior=share, likely=likely, unit=unit)
        if shown.oil is not None:
            celsius = shown.oil - ZERO_CELSIUS
            for unit, oil in (("K", celsius), ("°F", (celsius - 32.0) / 1.8 + ZERO_CELSIUS)):
                likely = self.reading(event, replace(shown, oil=oil), event.cofs)
                yield Slip(name="oil", log_prior=share, likely=likely, unit=unit)
        if shown.open_torque is not None and shown.open_torque > 0:
            likely = self.reading(event, replace(shown, open_torque=None), None)
            pressed = replace(likely, log_cof=self._pressed(shown), spread=PRESSED_SD)
            yield Slip(name=DEAD_PRESSURE, log_prior=math.log(odds.OTHER_TEST), likely=pressed)


#: A pressure that says the clutch is open while it is pressed.
DEAD_PRESSURE = "dead_pressure"
#: Units in which a channel may have been sent: channel, the unit, and how many of it are one of ours.
UNITS = (
    ("pressure", "psi", 14.503_774),
    ("pressure", "kPa", 100.0),
    ("pressure", "MPa", 0.1),
    ("torque", "lbf ft", 0.737_562),
    ("torque", "lbf in", 8.850_746),
    ("torque", "kNm", 1e-3),
    ("torque", "kgf m", 0.101_972),
    ("torque", "Nmm", 1e3),
    ("speed", "rad/s", RADIANS_PER_SECOND_PER_RPM),
    ("speed", "1/s", 1 / 60),
)


def runs_of(events: Sequence[Event], geometry: Geometry, *, corrected: bool) -> list[Run]:
    """All runs of a clutch in the order of their history, both accepted and held.

    `corrected`: a model in force corrects the mean COFs of tests.
    """
    runs: list[Run] = []
    for life in lives_of(events):
        comparison = _Comparison(life=life, geometry=geometry, corrected=corrected)
        for event in life.events:
            shown = event.shown or Shown()
            runs.append(
                Run(
                    name=event.run_id,
                    kind=event.kind,
                    cycles=event.cycles,
                    reading=partial(comparison.reading, event, shown, event.cofs),
                    slips=tuple if event.shown is None else partial(comparison.slips, event, shown),
                    tests=comparison.shows_course(event),
                    block=None if event.duty is None or event.kind == RUN_IN else event.duty.cycles,
                    moment=event.moment if event.dated else None,
                    shift=event.shift,
                    rebuild=event.rebuild,
                    fixed=event.confirmed,
                )
            )
    return runs


RUN_IN = "run_in"


def _in_unit(shown: Shown, channel: str, factor: float) -> Shown:
    """A run's shown friction after a channel is divided by `factor`."""
    if channel == "speed":
        return replace(shown, speed=None if shown.speed is None else shown.speed / factor)
    if channel == "torque":
        return replace(shown, cof=None if shown.cof is None else shown.cof / factor)
    return replace(
        shown,
        cof=None if shown.cof is None else shown.cof * factor,
        pressure=None if shown.pressure is None else shown.pressure / factor,
    )


def _scaled(
    values: Mapping[float, tuple[float, float]], channel: str, factor: float
) -> dict[float, tuple[float, float]]:
    """Mean COF and deviation by pressure, as they would be if a channel had another unit."""
    level, cof = (factor, factor) if channel == "pressure" else (1.0, 1.0 / factor)
    return {pressure / level: (value * cof, sd * cof) for pressure, (value, sd) in values.items()}


@dataclass(frozen=True, slots=True)
class _Usual:
    """The distribution of a number among tests: prior mean and standard deviation, the standard deviation of repeated
    values, and the counts of tests by value, in tenths of that."""

    mean: float
    deviation: float
    same: float
    tests: Mapping[int, int] = field(default_factory=dict)

    def with_tests(self, values: Iterable[float]) -> "_Usual":
        """This distribution, updated with the values of tests."""
        places, first, count = np.unique(
            np.rint(10.0 * np.array(list(values)) / self.same), return_index=True, return_counts=True
        )
        in_order = np.argsort(first)
        return replace(
            self, tests=dict(zip(places[in_order].astype(int).tolist(), count[in_order].tolist(), strict=True))
        )

    def _place(self, value: float) -> int:
        return round(10.0 * value / self.same)

    def log_of(self, value: float, own: float | None) -> float:
        """The log density of a value: equal to that of another test (other than its `own` one; None: it has none), or
        different."""
        anywhere = _log_normal(value, self.mean, self.deviation)
        place = None if own is None else self._place(own)
        other_counts = {at: count - (at == place) for at, count in self.tests.items()}
        total = sum(other_counts.values())
        if total <= 0:
            return anywhere
        repeated = sum(
            count * math.exp(_log_normal(value, 0.1 * self.same * at, self.same)) for at, count in other_counts.items()
        )
        return math.log((1.0 - OTHER_PROTOCOL) * repeated / total + OTHER_PROTOCOL * math.exp(max(anywhere, _LEAST)))


_PRESSURE = _Usual(math.log(PRESSURE), LOG_PRESSURE_SD, SAME_PROTOCOL_SD)
_SPEED = _Usual(math.log(SPEED), LOG_SPEED_SD, SAME_PROTOCOL_SD)
_OIL = _Usual(OIL, OIL_SD, OTHER_OIL)


def _log_normal(value: float, mean: float, deviation: float) -> float:
    """Log density of a normal distribution."""
    return -0.5 * ((value - mean) / deviation) ** 2 - math.log(deviation * math.sqrt(2 * math.pi))


DEAD = "dead_channel"


def dead_channels(kind: str, columns: Columns, geometry: Geometry) -> list[Notice]:
    """Doubts about a run with channels that show no plausible signal."""
    return [Notice(code=DEAD, message=message) for message in _oddities(kind, columns, geometry)]


def _oddities(kind: str, columns: Columns, geometry: Geometry) -> Iterator[str]:
    """Sentences on readings that no working sensor gives."""
    yield from _oil(columns.oil_temperature)
    if columns.torque.size < FEWEST_ROWS:
        return
    if kind == DYNAMIC:
        yield from _speed_stands(columns.speed)
    torque = columns.torque[columns.pressure >= UNLOADED]
    if torque.size == 0:
        return
    level = float(np.median(torque))
    if torque.size >= FEWEST_ROWS and _spread(torque) <= STILL * abs(level):
        yield f"torque stays at {level:.4g} Nm although pressure or speed change: is the sensor connected?"
        return
    rows = columns.loaded()
    if rows.torque.size < FEWEST_ROWS:
        return
    cof = float(np.abs(rows.cof_by_speed(geometry)[0]).mean())
    mean, deviation = rows.torque.mean(), rows.torque.std()
    if cof < NO_FRICTION and deviation > 0.5 * abs(mean):
        noise = f"{mean:.3g} ± {deviation:.3g} Nm"
        yield f"torque is only noise ({noise}) under pressure: is the torque sensor connected?"
    elif kind in (STATIONARY, DYNAMIC):
        yield from _not_following(rows, geometry)
    if kind == STATIONARY:
        yield from _at_the_limit(rows)


def _at_the_limit(rows: Columns) -> Iterator[str]:
    """The sentence on torque that stays at its highest value at several speeds, so that it shows neither noise nor a
    curve."""
    size = np.abs(rows.torque)
    highest = float(size.max())
    at_limit = size >= (1.0 - SAME_TORQUE) * highest
    others = size[~at_limit]
    speeds = np.unique(np.abs(rows.speed[at_limit])).size
    if speeds < AT_THE_LIMIT or np.unique(others).size < OWN_TORQUE * others.size or others.size < AT_THE_LIMIT:
        return
    low, high = (
        f"{each / PASCALS_PER_BAR:.3g}" for each in (rows.pressure[at_limit].min(), rows.pressure[at_limit].max())
    )
    pressures = low if low == high else f"{low} to {high}"
    yield (
        f"torque is exactly {highest:.4g} Nm at {speeds} speeds at {pressures} bar, and never more: is that the limit of "
        "its sensor or amplifier?"
    )


def _not_following(rows: Columns, geometry: Geometry) -> Iterator[str]:
    """The sentence on torque that does not follow pressure, or scatters at one pressure as if that had varied."""
    low, high = np.quantile(rows.pressure, [0.02, 0.98]).tolist()
    span = f"{low / PASCALS_PER_BAR:.3g} to {high / PASCALS_PER_BAR:.3g} bar"
    if high > PRESSURE_SPAN * low:
        exponent, error = _exponent(rows)
        if exponent + 3 * error < MIN_EXPONENT:
            yield (
                f"torque grows as pressure to the power of {exponent:.2f} (from {span}), but about 1 is expected. "
                "Is a sensor disconnected, or does a column hold another channel?"
            )
        return
    cofs, spreads = rows.cof_by_speed(geometry)
    scatter = float(np.median(spreads / np.maximum(np.abs(cofs), 1e-12)))
    if scatter > SINGLE_LEVEL_SPREAD:
        yield (
            f"pressure stands at {high / PASCALS_PER_BAR:.3g} bar and torque at one speed scatters by {100 * scatter:.0f} "
            "%, as if pressure had varied: is the pressure sensor connected?"
        )


def _exponent(rows: Columns) -> tuple[float, float]:
    """The exponent of |torque| over pressure by least squares, and its standard error."""
    x, y = np.log(rows.pressure), np.log(np.maximum(np.abs(rows.torque), 1e-9))
    x, y = x - x.mean(), y - y.mean()
    square = float(x @ x)
    exponent = float(x @ y) / square
    left = y - exponent * x
    # neighbouring rows are alike: a sampled record has far fewer independent ones
    independent = min(x.size, 40)
    return exponent, float(np.sqrt(left @ left / x.size * x.size / (square * independent)))


def _speed_stands(speed: FloatArray) -> Iterator[str]:
    """The sentence on a speed that does not move in a dynamic test."""
    fastest = float(np.abs(speed).max())
    if not (fastest > 1.0 and _spread(speed) > SPEED_STILL * fastest):
        rpm = float(np.median(speed)) / RADIANS_PER_SECOND_PER_RPM
        yield f"speed stays at {rpm:.4g} rpm in a dynamic test: is the speed sensor connected?"


def _oil(temperature: FloatArray | None) -> Iterator[str]:
    """The sentence on an impossible oil temperature."""
    if temperature is None:
        return
    median = float(np.median(temperature))
    still_at_zero = temperature.size >= FEWEST_ROWS and bool((np.abs(temperature - ZERO_CELSIUS) < 1e-6).all())
    if still_at_zero or not COLDEST <= median <= HOTTEST:
        shown = f"{median - ZERO_CELSIUS:.4g} °C"
        yield f"oil temperature is {shown}, which is not possible in a test: is the sensor connected?"


def _spread(values: FloatArray) -> float:
    """The width of the middle 90 % of values."""
    low, high = np.quantile(values, [0.05, 0.95]).tolist()
    return float(high - low)
