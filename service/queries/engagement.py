"""The engagement that a tracked clutch would give at any state of its degradation."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from models.clutch import Geometry
from models.engagements.capacity import capacity_of
from models.engagements.simulation import Drive, Engagement, PressureProfile, engage
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters
from models.prognosis.first_passage import weighted_quantiles
from service import records
from service.columns import CHANNELS, PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, whole
from service.errors import NotFoundError
from service.lives.assumptions import Assumptions
from service.lives.history import Event, Life, Series, lives_of
from service.lives.parameter_tracks import parameter_series, posterior_of, tests_of
from service.lives.run_analysis import LevelFit
from storage.engine.database import Database


def engaged(database: Database, clutch_id: str, at_cycles: float | None) -> dict[str, Any]:
    """The engagement that the tracked clutch would give at `at_cycles`, or now. Raises NotFoundError."""
    with database.reading() as connection:
        state, levels = records.state(connection, clutch_id), records.levels(connection, clutch_id)
    trace = engagement(clutch_id, state.events, state.assumptions(), levels, state.geometry, at_cycles=at_cycles)
    return {"clutch_id": clutch_id, "origin": state.record.origin, "simulated": True} | trace


def engagement(
    clutch_id: str,
    events: Sequence[Event],
    assumptions: Assumptions,
    fits: Mapping[str, Sequence[LevelFit]],
    geometry: Geometry,
    *,
    at_cycles: float | None,
) -> dict[str, Any]:
    """The trace in the public shape. Raises NotFoundError before the first stationary test with all parameters."""
    happened = [event for event in events if at_cycles is None or event.cycles <= at_cycles]
    history = lives_of(happened)
    if not history:
        raise NotFoundError("there is no stationary test by then, and so no clutch to engage")
    life = history[-1]
    cycles = happened[-1].cycles if at_cycles is None else at_cycles
    parameters = _parameters(clutch_id, life, assumptions, tests_of(life, fits), cycles)
    profile, drive = PressureProfile(), Drive()
    trace = engage(capacity_of(parameters), geometry.mean_radius, profile=profile, drive=drive)
    return {
        "at_cycles": whole(cycles),
        "model": dict(assumptions.model.name),
        "initial_speed_rpm": drive.speed / RADIANS_PER_SECOND_PER_RPM,
        "maximum_pressure_bar": profile.maximum / PASCALS_PER_BAR,
        "motor_torque_limit_nm": drive.limit,
        "engaged": trace.duration is not None,
        "duration_s": trace.duration,
        "energy_kj": trace.energy / 1000,
        "channels": _channels(trace),
    }


def _parameters(
    clutch_id: str, life: Life, assumptions: Assumptions, tests: Sequence[Sequence[LevelFit]], cycles: float
) -> dict[float, StribeckParameters]:
    """The tracked Stribeck parameters by pressure [Pa], each the median of its own eq. 6 at `cycles` since new."""
    at: dict[float, dict[str, float]] = {}
    for name in PARAMETER_NAMES:
        for series in parameter_series(life, assumptions, tests, name):
            if series.measurements:
                at.setdefault(series.pressure, {})[name] = _median(clutch_id, series, assumptions, cycles)
    complete = {level: values for level, values in at.items() if len(values) == len(PARAMETER_NAMES)}
    if not complete:
        raise NotFoundError("no stationary test determines all four Stribeck parameters by then")
    return {
        level: StribeckParameters(**{name: max(value, 0.0) for name, value in values.items()})
        for level, values in complete.items()
    }


def _median(clutch_id: str, series: Series, assumptions: Assumptions, cycles: float) -> float:
    posterior = posterior_of(clutch_id, series, assumptions)
    values = posterior.values(np.array([float(series.scale.progress(cycles))]))[0]
    return float(weighted_quantiles(values, posterior.weight, (0.5,))[0])


def _channels(trace: Engagement) -> dict[str, list[float]]:
    columns = {
        "time_s": trace.time,
        "pressure_bar": trace.pressure,
        "speed_rpm": trace.speed,
        "torque_nm": trace.torque,
    }
    channels = {name: (column / CHANNELS[name].factor).round(6).tolist() for name, column in columns.items()}
    return channels | {"motor_torque_nm": trace.motor_torque.round(6).tolist()}
