"""A clutch's present life as the diagnosis sees it: its runs in SI units, within bounds on memory."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TypeAlias, TypedDict, TypeVar

import numpy as np

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, DutyRun, DynamicRun, EventKind, MaintenanceEvent, Oil, StationaryRun
from models.records.plateaus import cut_plateaus
from models.records.runs import Plateaus, Record
from models.records.torque_filter import filtered_as_torque
from service.api.clutch import ClutchIn
from service.clutch.criteria import MAX_OF_CAMPAIGN, MAX_OF_RECORD
from service.clutch.incoming_run import IncomingRun, sampled_record, stationary_plateaus
from service.clutch.timeline import DYNAMIC, MAINTENANCE, STATIONARY, Life

CampaignRun: TypeAlias = StationaryRun | DynamicRun | DutyRun | MaintenanceEvent
Kind = TypeVar("Kind", StationaryRun, DynamicRun, DutyRun, MaintenanceEvent)


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosedLife:
    """The present life of a clutch, its runs in the order of its events, and notes on runs and records left out.

    `life` is None where there are no runs.
    """

    record: ClutchIn
    life: Life | None = None
    runs: tuple[CampaignRun, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def campaign(self) -> Campaign:
        """The runs as the campaign that the diagnosis takes."""
        return campaign_of(self.record, self.runs)


def campaign_of(record: ClutchIn, runs: Sequence[CampaignRun]) -> Campaign:
    """The campaign of these runs, in their order."""
    return Campaign(
        geometry=record.geometry.to_model(),
        oil=Oil(
            viscosity_40=record.oil.kinematic_viscosity_40c_cst * 1e-6,
            viscosity_100=record.oil.kinematic_viscosity_100c_cst * 1e-6,
        ),
        stationary=_runs_of_kind(StationaryRun, runs),
        dynamic=_runs_of_kind(DynamicRun, runs),
        duty=_runs_of_kind(DutyRun, runs),
        maintenance=_runs_of_kind(MaintenanceEvent, runs),
    )


def _runs_of_kind(kind: type[Kind], runs: Sequence[CampaignRun]) -> tuple[Kind, ...]:
    return tuple(run for run in runs if isinstance(run, kind))


def records_to_keep(run_ids: Sequence[str], samples: Mapping[str, int]) -> set[str]:
    """The runs whose sampled records are kept: all, or every second, third, … if they have too many samples together.
    `samples` is the number of samples of each sampled record."""
    sizes = [(run_id, samples[run_id]) for run_id in run_ids if run_id in samples]
    fitting = [(run_id, size) for run_id, size in sizes if size <= MAX_OF_RECORD]
    every = max(1, math.ceil(sum(size for _, size in fitting) / MAX_OF_CAMPAIGN))
    return {run_id for run_id, _ in fitting[::every]}


def run_of(run: IncomingRun, *, origin: float, torque_filter: float = 0.0, keep_record: bool = True) -> CampaignRun:
    """A run with its channels, its cycles counted from `origin`. Raises ValueError where its record holds no plateau.

    The torque channel's filter of `torque_filter` [s] is taken off tests that are sampled (`models.records.torque_filter`).
    """
    if run.kind == STATIONARY:
        return _stationary(run, origin, torque_filter, keep_record)
    if run.kind == DYNAMIC:
        record = filtered_as_torque(sampled_record(run.channels), torque_filter)
        return DynamicRun(**head_of(run, origin), record=thinned(record))
    if run.kind == MAINTENANCE:
        return MaintenanceEvent(**_when(run, origin), event=EventKind(run.details["event"]))
    duty = run.details["duty"]
    energy = None if duty["energy_per_cycle_kj"] is None else 1000.0 * duty["energy_per_cycle_kj"]
    return DutyRun(**_when(run, origin), engagements=duty["cycles"], energy=energy)


def without_record(run: IncomingRun, *, origin: float) -> CampaignRun:
    """A run with its sampled record left unread: one point of 1 bar, 1 rad/s and 1 Nm takes the place of its
    measurements."""
    point = np.ones(1)
    if run.kind == STATIONARY:
        return StationaryRun(**head_of(run, origin), plateaus=Plateaus(pressure=1e5 * point, speed=point, torque=point))
    if run.kind == DYNAMIC:
        record = Record(time=point, pressure=1e5 * point, speed=point, torque=point)
        return DynamicRun(**head_of(run, origin), record=record)
    return run_of(run, origin=origin)


class Moment(TypedDict):
    """The time of a run: cycles since the life's origin, and its start [s since 1970], None if not stated."""

    cycles: float
    moment: float | None


class TestHead(Moment):
    """The fields of every test: its name and its time."""

    run_id: str


def head_of(run: IncomingRun, origin: float) -> TestHead:
    """A test's name and time, with its cycles counted from `origin`."""
    return {"run_id": run.run_id, **_when(run, origin)}


def _when(run: IncomingRun, origin: float) -> Moment:
    """The cycles of a run in its life, and its moment if it is dated."""
    moment = None if run.started_at is None else datetime.fromisoformat(run.started_at).timestamp()
    return {"cycles": run.cycles - origin, "moment": moment}


def _stationary(run: IncomingRun, origin: float, torque_filter: float, keep_record: bool) -> StationaryRun:
    """A stationary run in SI units; the plateaus of a sampled record are cut first."""
    if "time_s" not in run.channels:
        return StationaryRun(**head_of(run, origin), plateaus=stationary_plateaus(run.channels))
    record = sampled_record(run.channels)
    cut = cut_plateaus(record, torque_filter)
    return StationaryRun(
        **head_of(run, origin),
        plateaus=cut.plateaus,
        time=tuple((0.5 * (cut.start + cut.stop)).tolist()),
        record=record if keep_record else None,
    )


def thinned(record: Record, most: int = MAX_OF_RECORD) -> Record:
    """The record, or block means of its samples if it has more than `most`."""
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
        plate_temperature=None if record.plate_temperature is None else means(record.plate_temperature),
    )
