"""Between stored rows and the values that the workflows think in."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy import Connection

from models.arrays import FloatArray
from models.degradation.severity import Block
from models.friction.criteria import ACCEPTABLE_MSE
from models.friction.identification import FitStatus, StribeckFit
from models.friction.stribeck import StribeckParameters
from service.errors import NotFoundError
from service.lives.history import ByPressure, Event, order
from service.lives.incoming_run import IncomingRun
from service.lives.run_analysis import Analysis, LevelFit, Value
from service.readers.units import RADIANS_PER_SECOND_PER_RPM
from service.schemas.clutch import ClutchIn
from service.settings import CODE_VERSION
from storage import adopted_models, clutches, fits, runs
from storage.clutches import ClutchRow
from storage.fits import FitRow
from storage.runs import RunInOrder, RunRow


def clutch(connection: Connection, clutch_id: str) -> ClutchRow:
    """The clutch, or NotFoundError."""
    found = clutches.get(connection, clutch_id)
    if found is None:
        raise _unknown(clutch_id)
    return found


def revision(connection: Connection, clutch_id: str) -> int:
    """The clutch's revision, which every change of its results moves on; or NotFoundError."""
    found = clutches.revision(connection, clutch_id)
    if found is None:
        raise _unknown(clutch_id)
    return found


def _unknown(clutch_id: str) -> NotFoundError:
    return NotFoundError(f"no clutch is known as {clutch_id!r}")


def run(connection: Connection, clutch_id: str, run_id: str) -> RunRow:
    """The run of a known clutch, or NotFoundError."""
    clutch(connection, clutch_id)
    found = runs.get(connection, clutch_id, run_id)
    if found is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no run {run_id!r}")
    return found


def record(row: ClutchRow) -> ClutchIn:
    """A clutch's record as it was registered."""
    return ClutchIn.model_validate(row.record)


def details(incoming: IncomingRun, analysis: Analysis) -> dict[str, Any]:
    """What is kept beside a run's channels: what was said of it, and its range of speeds [rad/s]."""
    found = dict(incoming.details) | {"origin": incoming.origin}
    return found | ({} if analysis.speed_range is None else {"speed_range": list(analysis.speed_range)})


def run_rows(connection: Connection, clutch_id: str) -> list[RunRow]:
    """All runs of a clutch by cycles."""
    return runs.page(connection, clutch_id)


def incoming(row: RunRow, columns: Mapping[str, FloatArray]) -> IncomingRun:
    """A stored run as it came in."""
    said: dict[str, Any] = {name: row.details[name] for name in ("duty", "event", "note") if name in row.details}
    return IncomingRun(
        kind=row.kind,
        cycles=row.cycles,
        run_id=row.run_id,
        content_sha256=row.content_sha256,
        started_at=row.started_at,
        origin=row.details["origin"],
        channels=columns,
        details=said,
    )


def events(connection: Connection, clutch_id: str) -> list[Event]:
    """All runs of a clutch as its history sees them, ordered; mean COF as the model in force corrects it."""
    cofs = fits.cofs_of_clutch(connection, clutch_id) | adopted_models.corrected_cofs(connection, clutch_id)
    return order([event(row, cofs.get(row.run_key, {})) for row in runs.in_order(connection, clutch_id)])


def levels(connection: Connection, clutch_id: str) -> dict[str, list[LevelFit]]:
    """All fits of a clutch by run_id."""
    names = {row.run_key: row.run_id for row in runs.in_order(connection, clutch_id)}
    return {
        names[key]: [level_fit(each) for each in found] for key, found in fits.of_clutch(connection, clutch_id).items()
    }


def event(row: RunInOrder, cofs: ByPressure) -> Event:
    """A stored run as the history sees it."""
    low, high = row.lowest_speed, row.highest_speed
    return Event(
        run_id=row.run_id,
        kind=row.kind,
        cycles=row.cycles,
        moment=moment(row.started_at, row.received_at),
        speed_range=None if low is None or high is None else (low, high),
        cofs=cofs,
        rebuild=row.event == "rebuild",
        shift=row.event not in (None, "rebuild"),
        duty=duty_block(row.cycles, row.duty_cycles, row.duty_energy_kj, row.duty_speed_rpm, row.duty_duration_s),
    )


def duty_block(
    end: float,
    cycles: float | None,
    energy_kj: float | None,
    speed_rpm: float | None,
    duration_s: float | None,
) -> Block | None:
    """A block of duty in SI units, None where a run is none."""
    if cycles is None:
        return None
    return Block(
        end=end,
        cycles=cycles,
        energy=None if energy_kj is None else 1000.0 * energy_kj,
        speed=None if speed_rpm is None else speed_rpm * RADIANS_PER_SECOND_PER_RPM,
        duration=duration_s,
    )


def moment(started_at: str | None, received_at: str) -> float:
    """When a run was made [s since 1970]: when it was started, or received where the rig did not say."""
    return datetime.fromisoformat(started_at or received_at).timestamp()


def fit_rows(levels: Sequence[LevelFit], cofs: ByPressure) -> list[FitRow]:
    """Fits as they are stored, with mean COF by pressure where a level can say it."""
    return [_fit_row(level, cofs.get(level.fit.pressure)) for level in levels]


def _fit_row(level: LevelFit, cof: Value | None) -> FitRow:
    fit = level.fit
    m_s, m_c, v_s, c_v = map(float, fit.parameters.as_array())
    return FitRow(
        pressure=fit.pressure,
        mean_pressure=level.mean_pressure,
        static_torque=m_s,
        coulomb_ratio=m_c,
        stribeck_velocity=v_s,
        viscous_coefficient=c_v,
        covariance=tuple(fit.covariance.ravel().tolist()),
        status=fit.status.value,
        undetermined=fit.undetermined,
        noise=fit.noise,
        mse_percent=fit.mse_percent,
        rmse=fit.rmse,
        points=fit.points,
        speeds=level.speeds,
        mean_cof=None if cof is None else cof[0],
        mean_cof_sd=None if cof is None else cof[1],
        message=fit.message,
        code_version=CODE_VERSION,
    )


def level_fit(row: FitRow) -> LevelFit:
    """The inverse of `fit_rows`, exactly."""
    return LevelFit(
        mean_pressure=row.mean_pressure,
        speeds=row.speeds,
        fit=StribeckFit(
            pressure=row.pressure,
            parameters=StribeckParameters(
                static_torque=row.static_torque,
                coulomb_ratio=row.coulomb_ratio,
                stribeck_velocity=row.stribeck_velocity,
                viscous_coefficient=row.viscous_coefficient,
            ),
            covariance=np.array(row.covariance, dtype=np.float64).reshape(4, 4),
            status=FitStatus(row.status),
            undetermined=row.undetermined,
            noise=row.noise,
            mse_percent=row.mse_percent,
            rmse=row.rmse,
            acceptable=row.mse_percent is not None and row.mse_percent < ACCEPTABLE_MSE,
            points=row.points,
            message=row.message,
        ),
    )
