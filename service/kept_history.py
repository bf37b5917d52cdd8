"""A clutch's history at its present revision: what was read before is kept in memory, and only what came since is read.

A run that is appended to the history, which changes nothing that was there, is stored with the revision that it follows.
From a history at an earlier revision the present one is reached where every revision in between is that of such a run. Any
other change (a run that is confirmed, corrected or withdrawn, a new level, a model that is adopted, a replay) leaves a gap:
then all is read again. So it does not matter which process or service stored the runs.

The filters' states are kept with the sample that was drawn of them, for which the next run asks again, at the revision with
which they were stored alone.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
from sqlalchemy import Connection

from models.friction.identification import StribeckFit, StribeckFitStatus
from models.friction.measured_curve import MeasuredCurve
from models.friction.stribeck import PARAMETER_NAMES, StribeckParameters
from service.clutch.analysis import LevelFit
from service.clutch.timeline import (
    ByPressure,
    Event,
    Shown,
    duty_block,
    maintenance_fields,
    moment_of,
    order,
    with_event,
)
from service.clutch.tracking import States
from storage import assumptions, clutches, results, runs
from storage.clutches import ClutchRow
from storage.engine.database import STATES, Database, kept_of
from storage.results import FitRow
from storage.runs import RunInOrder

#: What the details of a run that was appended say: the revision of the clutch that it follows.
FOLLOWS = "follows"
#: Bytes that a run takes in memory, a mean COF at one pressure, a number of a model's draws, and a fitted curve. Derived: of
#: the sizes of their objects, rounded up.
_RUN, _COF, _DRAW, _FIT = 1_500, 250, 32, 2_500
#: Columns of a stored fit that are a fit's own.
FIT_COLUMNS = ("pressure", "undetermined", "noise", "mse_percent", "rmse", "acceptable", "points", "message")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptHistory:
    """A clutch's history at a revision, kept in memory: accepted and held runs in order, the greatest key of its runs,
    and its approximate size [bytes]."""

    revision: int
    last_key: int
    new_levels: frozenset[str]
    events: tuple[Event, ...]
    held: tuple[Event, ...]
    size: int


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptFits:
    """The fits of all runs of a clutch at a revision, by run_id, and the greatest key of its runs."""

    revision: int
    last_key: int
    levels: Mapping[str, list[LevelFit]]


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptFilters:
    """The filters' states after the last run of a clutch at a revision, with the samples that were drawn of them."""

    revision: int
    filters: States


def history(connection: Connection, row: ClutchRow) -> KeptHistory:
    """The clutch's history at the revision of `row`, which the same transaction has read."""
    kept = kept_of(connection)
    if kept is None:  # what a transaction that writes has changed may be rolled back
        return _read(connection, row)
    name = ("history", row.clutch_id)
    before: KeptHistory | None = kept.get(name)
    if before is not None and before.revision == row.revision:
        return before
    now = None if before is None else _continued(connection, row, before)
    if now is None:
        now = _read(connection, row)
    kept.put(name, now, now.size)
    return now


def _read(connection: Connection, row: ClutchRow) -> KeptHistory:
    """The complete history, read from the database."""
    accepted, held = _events(connection, row, runs.in_history(connection, row.clutch_id))
    return KeptHistory(
        revision=row.revision,
        last_key=runs.last_key(connection, row.clutch_id),
        new_levels=_new_levels(row),
        events=order(accepted),
        held=order(held),
        size=_size([*accepted, *held]),
    )


def _continued(connection: Connection, row: ClutchRow, before: KeptHistory) -> KeptHistory | None:
    """The kept history with later runs appended; None if there was any other change."""
    appended = appended_since(connection, row.clutch_id, before.revision, before.last_key, row.revision)
    if appended is None or _new_levels(row) != before.new_levels:
        return None
    accepted, held = _events(connection, row, appended, beyond=before.last_key)
    return replace(
        before,
        revision=row.revision,
        last_key=appended[-1].run_key,
        events=reduce(with_event, accepted, before.events),
        held=reduce(with_event, held, before.held),
        size=before.size + _size([*accepted, *held]),
    )


def _size(events: Sequence[Event]) -> int:
    """The approximate memory of these events [bytes]."""
    each = (_RUN + _COF * len(event.cofs) + _DRAW * sum(map(len, event.under.values())) for event in events)
    return sum(each)


def appended_since(
    connection: Connection, clutch_id: str, revision: int, last_key: int, now: int
) -> list[RunInOrder] | None:
    """The runs appended between a revision and the present one, in order of arrival, given the greatest key at that
    revision; None if there was any other change."""
    if now <= revision:
        return None
    rows = sorted(runs.after_key(connection, clutch_id, last_key), key=lambda run: run.run_key)
    return rows if [run.follows for run in rows] == list(range(revision, now)) else None


def _events(
    connection: Connection, row: ClutchRow, rows: Sequence[RunInOrder], beyond: int = 0
) -> tuple[list[Event], list[Event]]:
    """The accepted runs as events, with mean COF as corrected by the model in force, and the held runs with the mean
    COFs that they would have; only runs with keys `beyond` that one."""
    runs.refuse_damaged_runs(connection, row.clutch_id, beyond)
    cofs = results.cofs_of(connection, row.clutch_id, beyond)
    corrected, new_levels = assumptions.corrected_cofs_of(connection, row.clutch_id, beyond), _new_levels(row)
    accepted, held = [], []
    for run in rows:
        event = event_of(run, cofs.get(run.run_key, {}))
        if run.state == runs.HELD:
            held.append(replace(event, confirmed=False))
            continue
        event = event.corrected(corrected.get(run.run_key))
        accepted.append(replace(event, new_level=True) if run.run_id in new_levels else event)
    return accepted, held


def levels(connection: Connection, clutch_id: str) -> dict[str, list[LevelFit]]:
    """The fits of all runs of a clutch, by run_id."""
    kept, revision = kept_of(connection), clutches.revision(connection, clutch_id)
    if kept is None or revision is None:
        return _levels(connection, clutch_id)
    name = ("fits", clutch_id)
    before: KeptFits | None = kept.get(name)
    if before is not None and before.revision == revision:
        return dict(before.levels)
    appended = None
    if before is not None:
        appended = appended_since(connection, clutch_id, before.revision, before.last_key, revision)
    if before is None or appended is None:
        own, last_key = _levels(connection, clutch_id), runs.last_key(connection, clutch_id)
    else:
        further = _levels(connection, clutch_id, beyond=before.last_key)
        own, last_key = {**before.levels, **further}, appended[-1].run_key
    now = KeptFits(revision=revision, last_key=last_key, levels=own)
    kept.put(name, now, _FIT * sum(map(len, own.values())))
    return dict(own)


def _levels(connection: Connection, clutch_id: str, beyond: int = 0) -> dict[str, list[LevelFit]]:
    """The fits of runs with keys `beyond` that one, in their order."""
    names = {run_key: run_id for run_id, run_key in runs.keys(connection, clutch_id).items()}
    of_runs = results.fits_of(connection, clutch_id, beyond)
    return {names[run_key]: [level_fit(row) for row in rows] for run_key, rows in of_runs.items()}


def filters(connection: Connection, row: ClutchRow) -> States | None:
    """The states kept at the revision of `row`; None if there are none."""
    kept = kept_of(connection, STATES)
    found: KeptFilters | None = None if kept is None else kept.get(row.clutch_id)
    return found.filters if found is not None and found.revision == row.revision else None


def keep_filters(database: Database, clutch_id: str, revision: int, filters: States) -> None:
    """Keep the states that were stored with a revision."""
    lean = {method: tracked.lean for method, tracked in filters.items()}
    database.kept[STATES].put(clutch_id, KeptFilters(revision=revision, filters=lean), _array_bytes(lean))


def _array_bytes(value: Any) -> int:
    """Bytes of all arrays in a value."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, dict):
        return sum(map(_array_bytes, value.values()))
    return sum(_array_bytes(getattr(value, field.name)) for field in fields(value)) if is_dataclass(value) else 0


def level_fit(row: FitRow) -> LevelFit:
    """A stored fit as a value, the exact inverse of `repository.fit_rows`."""
    fit = StribeckFit(
        **{name: getattr(row, name) for name in FIT_COLUMNS},
        parameters=StribeckParameters(**{name: getattr(row, name) for name in PARAMETER_NAMES}),
        covariance=np.reshape(row.covariance, (4, 4)),
        unbiased_covariance=np.reshape(row.unbiased_covariance, (4, 4)),
        status=StribeckFitStatus(row.status),
    )
    measured = None if row.measured is None else MeasuredCurve.of_columns(np.reshape(row.measured, (3, -1)), row.noise)
    return LevelFit(mean_pressure=row.mean_pressure, speeds=row.speeds, fit=fit, measured=measured)


def _new_levels(row: ClutchRow) -> frozenset[str]:
    return frozenset(row.summary.get("new_levels", ()))


def event_of(row: RunInOrder, cofs: ByPressure) -> Event:
    """A stored run as an event of the history."""
    low, high = row.lowest_speed, row.highest_speed
    moment, dated = moment_of(row.started_at, row.received_at)
    return Event(
        run_id=row.run_id,
        kind=row.kind,
        cycles=row.cycles,
        moment=moment,
        arrived=row.run_key,
        speed_range=None if low is None or high is None else (low, high),
        oil_temperature=row.oil_temperature,
        oil_range=None if row.coldest_oil is None or row.warmest_oil is None else (row.coldest_oil, row.warmest_oil),
        cofs=cofs,
        **maintenance_fields(row.event, row.reason),
        duty=duty_block(row.cycles, row.duty_cycles, row.duty_energy_kj, row.duty_speed_rpm, row.duty_duration_s),
        dated=dated,
        shown=None if row.shown is None else Shown.from_list(json.loads(row.shown)),
        confirmed=bool(row.doubted),
    )
