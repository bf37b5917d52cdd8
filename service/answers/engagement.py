"""`/engagement`: what a tracked clutch would give at any state of its degradation, and the measured ones beside it."""

from collections.abc import Mapping, Sequence

import numpy as np

from models.clutch import Geometry
from models.engagements.comparison import bin_means
from models.engagements.discrepancy import EngagementDiscrepancy, discrepancy
from models.engagements.measured import EngagementIndicators, trace_times
from models.engagements.simulation import Capacity, Drive, Engagement, PressureProfile, capacity_of, engage
from models.friction.stribeck import StribeckParameters
from service import repository
from service.api.over_life import (
    ComparedEngagement,
    EngagementChannels,
    EngagementOut,
    EngagementTrace,
    MeasuredEngagement,
    ModelledEngagement,
)
from service.channels import PASCALS_PER_BAR, RADIANS_PER_SECOND_PER_RPM, whole
from service.clutch.analysis import LevelFit
from service.clutch.assumptions import Assumptions
from service.clutch.condition import held_runs_left_out
from service.clutch.engagements import evaluated, public_channels
from service.clutch.incoming_run import IncomingRun
from service.clutch.quantities.measured import chosen_life, parameter_medians
from service.clutch.timeline import Life, lives_until
from service.errors import NotFoundError
from storage.engine.database import Database


def engaged(database: Database, clutch_id: str, at_cycles: float | None, run_id: str | None = None) -> EngagementOut:
    """The simulated engagement of the tracked clutch at `at_cycles` or now, and the measured engagements.

    `run_id`: the measured engagement to compare with the model (default: the newest of that life by then). Raises
    NotFoundError before the first stationary test with all parameters, and if the named run holds no such engagement.
    """
    with database.reading() as connection:
        state, levels = repository.state(connection, clutch_id), repository.levels(connection, clutch_id)
        measured = repository.engagements(connection, clutch_id)
    lives = lives_until(state.lives, at_cycles)
    if not lives:
        raise NotFoundError(
            "no engagement can be simulated: there is no stationary test up to these cycles. Ask for later cycles"
        )
    assumptions = state.assumptions
    cycles = lives[-1].events[-1].cycles if at_cycles is None else at_cycles
    row = _compared_row(measured, lives[-1], run_id)
    moments = [cycles] if row is None else [cycles, float(row.cycles)]
    capacities = [capacity_of(parameters) for parameters in _parameters(lives[-1], assumptions, levels, moments)]
    comparison = None
    if row is not None:
        run = repository.run_reader(database, clutch_id).read(row.run_id)
        comparison = _comparison(run, row, capacities[-1], state.geometry)
    held_count = len(chosen_life(state, at_cycles=at_cycles).held)
    profile, drive = PressureProfile(), Drive()  # those of the life test
    trace = engage(capacities[0], state.geometry.mean_radius, profile=profile, drive=drive)
    return EngagementOut(
        clutch_id=clutch_id,
        origin=state.record.origin,
        simulated=True,
        at_cycles=whole(cycles),
        model=assumptions.model.name,
        initial_speed_rpm=drive.speed / RADIANS_PER_SECOND_PER_RPM,
        maximum_pressure_bar=profile.maximum / PASCALS_PER_BAR,
        motor_torque_limit_nm=drive.limit,
        engaged=trace.duration is not None,
        duration_s=trace.duration,
        energy_kj=trace.energy / 1000,
        channels=EngagementChannels(**_course(trace), motor_torque_nm=trace.motor_torque.round(6).tolist()),
        measured=[*measured],
        compared=comparison,
        held_runs=held_count,
        warnings=held_runs_left_out(held_count),
    )


def _compared_row(measured: Sequence[MeasuredEngagement], life: Life, run_id: str | None) -> MeasuredEngagement | None:
    """The measured engagement to compare with the prediction: of the named run, or the newest one (None: the life has
    none)."""
    run_ids = {event.run_id for event in life.events}
    rows = [row for row in measured if row.run_id in run_ids]
    if run_id is None:
        return rows[-1] if rows else None
    row = next((row for row in rows if row.run_id == run_id), None)
    if row is None:
        raise NotFoundError(f"run {run_id!r} is no evaluated engagement of this life up to these cycles")
    return row


def _comparison(
    run: IncomingRun, row: MeasuredEngagement, capacity: Capacity, geometry: Geometry
) -> ComparedEngagement | None:
    """A measured engagement beside the model's; the model's part is null if the record lacks the drive's course."""
    engagement = evaluated(run, geometry)
    if not isinstance(engagement, EngagementIndicators):
        return None
    slip = engagement.slip
    at = trace_times(slip)
    columns = {"pressure_bar": slip.pressure, "speed_rpm": slip.speed, "torque_nm": slip.torque}
    means = {name: bin_means(slip.time, column, at) for name, column in columns.items()}
    differences = discrepancy(engagement, capacity, geometry.mean_radius)
    return ComparedEngagement(
        run_id=row.run_id,
        cycles=row.cycles,
        channels=EngagementTrace(**public_channels({"time_s": at - slip.contact} | means)),
        model=None if differences is None else _model_part(differences, slip.contact),
    )


def _model_part(found: EngagementDiscrepancy, contact: float) -> ModelledEngagement:
    """The model's engagement under the measured one's conditions, and the deviation between the two."""
    difference = found.stop_time_difference
    return ModelledEngagement(
        channels=EngagementTrace(**_course(found.trace, contact)),
        inertia_kg_m2=found.drive.inertia,
        motor_torque_limit_nm=found.drive.limit,
        stop_time_s=found.simulated_stop_time,
        torque_discrepancy=found.torque_share,
        stop_time_difference_s=None if difference is None else difference.value,
        stop_time_difference_sd_s=None if difference is None else difference.sd,
    )


def _parameters(
    life: Life, assumptions: Assumptions, fits: Mapping[str, Sequence[LevelFit]], moments: Sequence[float]
) -> list[dict[float, StribeckParameters]]:
    """The parameters by pressure [Pa] at each of several cycles since new; each is the median of its own track."""
    levels, medians = parameter_medians(life, assumptions, fits, np.array(moments))
    if not levels:
        raise NotFoundError(
            "no engagement can be simulated: no test up to these cycles determines all four Stribeck parameters. Send "
            "one over more speeds"
        )
    curves = np.maximum(medians, 0.0).T
    return [dict(zip(levels, map(StribeckParameters.from_array, at), strict=True)) for at in curves]


def _course(trace: Engagement, contact: float = 0.0) -> dict[str, list[float]]:
    """The channels of a simulated engagement, with time [s] counted from `contact`."""
    columns = {"time_s": trace.time - contact, "pressure_bar": trace.pressure, "speed_rpm": trace.speed}
    return public_channels(columns | {"torque_nm": trace.torque})
