"""A dynamic Stribeck test: for each pressure the loop of torque over speed, its area, and how far friction lags.

A record holds several pressures one after another, each with one period and a half or more of a swinging speed. The last
whole periods of each give the loop area of eq. 8 (`loops.loop_area`) and, given the state's stationary curve, the
attractor C and the film time τ_1 of the two laws of lag (`loops.lag_laws`, `loops.lag_fit`). Which
law describes the loop better is stated where the likelihoods differ by enough; neither is thereby true.

Source: Ompusunggu, Janssens, Sas, ISRN Tribology 2013, 607279, sections 2.3.4 and 3.2.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from models.arrays import FloatArray
from models.clutch import Geometry
from models.friction.stribeck import torque as stationary_torque
from models.loops.criteria import FEWEST_SAMPLES
from models.loops.lag_fit import ATTRACTOR, SQUEEZE_FILM, LagFit, LagStatus, StationaryCurve, fit_lag
from models.loops.loop_area import Direction, Samples, area_of, clean_samples
from models.records.periods import Cycle, fit_cycle
from models.records.pressure_levels import level_width, levels_of, pressure_stretches
from models.records.runs import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionLoop:
    """The friction loop at one pressure of a dynamic test; `pressure` [Pa] names the level.

    frequency [Hz], periods, area and area_sd [Nm m/s] are None, 0, None and None where there is no whole period. attractor
    C [Nm/s] and film_time τ_1 [s] with their deviations are None where the record does not determine them; `better_law` is
    "attractor", "squeeze film" or None where neither is clearly better. `message` is a sentence.
    """

    pressure: float
    frequency: float | None = None
    periods: int = 0
    area: float | None = None
    area_sd: float | None = None
    direction: Direction = Direction.NONE
    attractor: float | None = None
    attractor_sd: float | None = None
    film_time: float | None = None
    film_time_sd: float | None = None
    better_law: str | None = None
    status: LagStatus
    message: str


def evaluate_loops(
    record: Record, geometry: Geometry, stationary: Mapping[float, StationaryCurve] | None
) -> tuple[FrictionLoop, ...]:
    """A loop for each stretch of constant pressure, in the record's order; empty where the pressure is never constant.

    `stationary` maps pressure levels [Pa] to the stationary curves measured in the clutch's present state; their covariance
    contributes to the lag's deviation. The curve nearest in pressure within a level's width is used; without one, a loop has
    area and direction but no lag. Times that run backwards are sorted.
    """
    record = record.take(np.argsort(record.time, kind="stable"))
    velocity, loops = geometry.sliding_velocity(record.speed), []
    for stretch in pressure_stretches(record.time, record.pressure):
        rows = slice(stretch.start, stretch.stop)
        level = float(levels_of(np.array([stretch.pressure]))[0])
        curve = _nearest(stationary, float(record.pressure[rows].mean()))
        loops.append(_loop(level, record.time[rows], velocity[rows], record.torque[rows], curve))
    return tuple(loops)


def _nearest(stationary: Mapping[float, StationaryCurve] | None, pressure: float) -> StationaryCurve | None:
    """The stationary curve of the same pressure level; None if none is near enough."""
    if not stationary:
        return None
    level = min(stationary, key=lambda candidate: abs(candidate - pressure))
    return stationary[level] if abs(level - pressure) <= level_width(pressure) else None


def _loop(
    level: float,
    time: FloatArray,
    velocity: FloatArray,
    torque: FloatArray,
    curve: StationaryCurve | None,
) -> FrictionLoop:
    """The friction loop of one pressure level: its area, and the lags of both laws beside a stationary curve."""
    if np.median(velocity) < 0:  # the same swing in the other direction: the model is odd, the area unchanged
        velocity, torque = -velocity, -torque
    cycle = fit_cycle(time, velocity)
    samples = None if isinstance(cycle, str) else clean_samples(cycle, time, torque)
    if isinstance(cycle, str) or samples is None or samples.phase.size < FEWEST_SAMPLES:
        return FrictionLoop(
            pressure=level,
            status=LagStatus.NO_PERIOD,
            message=cycle if isinstance(cycle, str) else "Too few samples lie in whole periods.",
        )
    area = area_of(cycle, samples)
    status, fits = _lags(cycle, samples, curve)
    attractor, film = fits if fits else (None, None)
    better = None if attractor is None or film is None else _better(attractor, film)
    return FrictionLoop(
        pressure=level,
        frequency=cycle.frequency,
        periods=cycle.periods,
        area=area.area,
        area_sd=area.area_sd,
        direction=area.direction,
        attractor=None if attractor is None or attractor.lag is None else 1 / attractor.lag,
        attractor_sd=None if attractor is None or attractor.lag is None else attractor.lag_sd / attractor.lag**2,
        film_time=None if film is None else film.lag,
        film_time_sd=None if film is None or film.lag is None else film.lag_sd,
        better_law=better,
        status=status,
        message=_message(status, samples.outliers, better),
    )


def _lags(
    cycle: Cycle, samples: Samples, curve: StationaryCurve | None
) -> tuple[LagStatus, tuple[LagFit, LagFit] | None]:
    """The fits of both laws of lag to a loop, or the status that explains why there are none. With fits, the status is
    the attractor's."""
    speed_over_a_swing = cycle.value(np.linspace(0.0, 2 * np.pi, 361))
    # where the stationary curve falls below 1 % of the loop's largest torque, lag has no meaning
    least = 0.01 * float(np.abs(samples.torque).max())
    if curve is None or stationary_torque(np.maximum(speed_over_a_swing, 0.0), curve.parameters).min() < least:
        return LagStatus.NO_CURVE, None
    if float(speed_over_a_swing.min()) < -0.02 * cycle.amplitude:  # of the swing
        return LagStatus.REVERSES, None
    attractor = fit_lag(ATTRACTOR, cycle, samples.phase, samples.torque, curve)
    film = fit_lag(SQUEEZE_FILM, cycle, samples.phase, samples.torque, curve)
    return attractor.status, (attractor, film)


def _better(attractor: LagFit, film: LagFit, telling: float = 5.0) -> str | None:
    """The law of higher log likelihood, if the difference is at least `telling` nats."""
    lead = attractor.log_likelihood - film.log_likelihood
    if abs(lead) < telling:
        return None
    return ATTRACTOR.name if lead > 0 else SQUEEZE_FILM.name


def _message(status: LagStatus, outliers: int, better: str | None) -> str:
    """The result of a loop's lag fit in a sentence or two for the report: its status, a lag law that describes the loop
    better, and how many samples were left out as outliers."""
    sentence = {
        LagStatus.DETERMINED: "The attractor is determined.",
        LagStatus.UNRESOLVED: "The lag is too small for this noise: the attractor C has only a lower bound.",
        LagStatus.AGAINST_THE_LAW: "The loop turns against the attractor law: is a channel delayed?",
        LagStatus.NO_CURVE: "No lag was fitted: there is no stationary test with such torques at this pressure.",
        LagStatus.REVERSES: "No lag was fitted, because the speed changes sign.",
        LagStatus.NO_PERIOD: "",
    }[status]
    parts = [sentence]
    if better is not None:
        parts.append(f"The {better} law describes the loop better.")
    if outliers:
        parts.append(f"{outliers} outlying samples were left out.")
    return " ".join(parts)
