"""A clutch's present life as the diagnosis sees it: its stored runs in SI units, within bounds on memory."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeAlias, TypeVar

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import (
    Campaign,
    DutyRun,
    DynamicRun,
    EventKind,
    MaintenanceEvent,
    Oil,
    StationaryRun,
)
from models.records.plateaus import cut_plateaus
from models.records.runs import Plateaus, Record
from service import records
from service.lives.history import Life, lives
from service.lives.incoming_run import sampled_record, stationary_plateaus
from service.lives.loop_analysis import DYNAMIC
from service.readers.units import CHANNELS
from service.schemas.clutch import ClutchIn
from storage import channels
from storage.engine.database import Database
from storage.runs import RunRow

STATIONARY = "stationary_stribeck"
#: Samples of sampled records that are kept in memory, 40 bytes each: of one record, and of all of a campaign's together.
MOST_OF_RECORD, MOST_OF_CAMPAIGN = 2_000_000, 6_000_000

Taken: TypeAlias = StationaryRun | DynamicRun | DutyRun | MaintenanceEvent
Kind = TypeVar("Kind", StationaryRun, DynamicRun, DutyRun, MaintenanceEvent)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stored:
    """The present life of a clutch, its runs in the order of its events, and what was left out of them.

    `life` is None where there are no runs.
    """

    record: ClutchIn
    life: Life | None = None
    taken: tuple[Taken, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def campaign(self) -> Campaign:
        """All of it, as the diagnosis takes it."""
        return campaign_of(self.record, self.taken)


def read_campaign(database: Database, clutch_id: str, *, last_run_key: int) -> Stored:
    """The present life by the runs up to `last_run_key`. Raises NotFoundError.

    Channels are read run by run: no transaction stays open for longer, for commits wait for it.
    """
    with database.reading() as connection:
        record = records.record(records.clutch(connection, clutch_id))
        known = {row.run_id: row for row in records.run_rows(connection, clutch_id) if row.run_key <= last_run_key}
        samples = channels.samples(connection, clutch_id)
        found = lives([event for event in records.events(connection, clutch_id) if event.run_id in known])
    if not found:
        return Stored(record=record)
    rows = [known[event.run_id] for event in found[-1].events]
    kept = _kept(rows, samples)
    taken: list[Taken] = []
    notes = []
    for row in rows:
        with database.reading() as connection:
            columns = channels.read(connection, row.run_key)
        try:
            taken.append(run_of(row, columns, origin=found[-1].origin, keep_record=row.run_key in kept))
        except ValueError as error:
            notes.append(f"{row.run_id} is left out: {error}")
    left_out = sum(1 for row in rows if row.kind == STATIONARY and row.run_key in samples and row.run_key not in kept)
    if left_out:
        notes.append(
            f"The raw records of {left_out} stationary tests are left out for their size; their plateaus count."
        )
    return Stored(record=record, life=found[-1], taken=tuple(taken), notes=tuple(notes))


def campaign_of(record: ClutchIn, taken: Sequence[Taken]) -> Campaign:
    """The campaign of these runs, in their order."""
    return Campaign(
        geometry=record.geometry.to_model(),
        oil=Oil(
            viscosity_40=record.oil.kinematic_viscosity_40c_cst * 1e-6,
            viscosity_100=record.oil.kinematic_viscosity_100c_cst * 1e-6,
        ),
        cof_fraction=record.end_of_life.cof_fraction,
        stationary=_of(StationaryRun, taken),
        dynamic=_of(DynamicRun, taken),
        duty=_of(DutyRun, taken),
        maintenance=_of(MaintenanceEvent, taken),
    )


def _of(kind: type[Kind], taken: Sequence[Taken]) -> tuple[Kind, ...]:
    return tuple(run for run in taken if isinstance(run, kind))


def _kept(rows: Sequence[RunRow], samples: Mapping[int, int]) -> set[int]:
    """The runs whose sampled records are kept: all, or every second, third ... where they would be too many."""
    sizes = [(row.run_key, samples[row.run_key]) for row in rows if row.run_key in samples]
    fitting = [(key, size) for key, size in sizes if size <= MOST_OF_RECORD]
    every = max(1, math.ceil(sum(size for _, size in fitting) / MOST_OF_CAMPAIGN))
    return {key for key, _ in fitting[::every]}


def run_of(row: RunRow, columns: Mapping[str, FloatArray], *, origin: float, keep_record: bool = True) -> Taken:
    """A stored run, its cycles counted from `origin`. Raises ValueError where its record holds no plateau."""
    said: dict[str, Any] = {"run_id": row.run_id, "cycles": row.cycles - origin, "moment": moment(row)}
    if row.kind == STATIONARY:
        return _stationary(columns, keep_record, said)
    if row.kind == DYNAMIC:
        return DynamicRun(**said, record=thinned(sampled_record(columns)))
    if row.kind == "maintenance":
        return MaintenanceEvent(**said, event=EventKind(row.details["event"]))
    duty = row.details["duty"]
    return DutyRun(
        **said,
        engagements=duty["cycles"],
        energy=_si(duty["energy_per_cycle_kj"], 1000.0),
        initial_speed=_si(duty["initial_speed_rpm"], CHANNELS["speed_rpm"].factor),
        maximum_pressure=_si(duty["maximum_pressure_bar"], CHANNELS["pressure_bar"].factor),
        record=sampled_record(columns) if columns and keep_record else None,
    )


def without_record(row: RunRow, origin: float) -> Taken:
    """A stored run whose sampled record is not read: one point of 1 bar, 1 rad/s and 1 Nm stands in for what it measured."""
    said: dict[str, Any] = {"run_id": row.run_id, "cycles": row.cycles - origin, "moment": moment(row)}
    one = np.ones(1)
    if row.kind == STATIONARY:
        return StationaryRun(**said, plateaus=Plateaus(pressure=1e5 * one, speed=one, torque=one))
    if row.kind == DYNAMIC:
        return DynamicRun(**said, record=Record(time=one, pressure=1e5 * one, speed=one, torque=one))
    return run_of(row, {}, origin=origin)


def _stationary(columns: Mapping[str, FloatArray], keep_record: bool, said: dict[str, Any]) -> StationaryRun:
    if "time_s" not in columns:
        return StationaryRun(**said, plateaus=stationary_plateaus(columns))
    record = sampled_record(columns)
    cut = cut_plateaus(record)
    return StationaryRun(
        **said,
        plateaus=cut.plateaus,
        time=tuple((0.5 * (cut.start + cut.stop)).tolist()),
        record=record if keep_record else None,
    )


def moment(row: RunRow) -> float | None:
    """When the run was started [s since 1970], None where the rig did not say."""
    return None if row.started_at is None else datetime.fromisoformat(row.started_at).timestamp()


def thinned(record: Record, most: int = MOST_OF_RECORD) -> Record:
    """The record, or the means of blocks of its samples where it has more than `most`."""
    size = math.ceil(record.time.size / most)
    if size == 1:
        return record
    rows = record.time.size // size * size

    def means(column: FloatArray) -> FloatArray:
        return np.asarray(column[:rows].reshape(-1, size).mean(axis=1), dtype=np.float64)

    return Record(
        time=means(record.time),
        pressure=means(record.pressure),
        speed=means(record.speed),
        torque=means(record.torque),
        oil_temperature=None if record.oil_temperature is None else means(record.oil_temperature),
    )


def _si(value: float | None, factor: float) -> float | None:
    return None if value is None else value * factor
