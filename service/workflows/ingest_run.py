"""A run comes in: fitted, stored, tracked, its remaining life foretold, in one transaction."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from sqlalchemy import Connection

from models.clutch import Geometry
from models.degradation.severity import Block
from service import records
from service.errors import ConflictError
from service.lives.history import ByPressure, Event, lives, nearest, order, reference_velocities
from service.lives.incoming_run import IncomingRun
from service.lives.loop_analysis import DYNAMIC, loops_of, refresh_loops
from service.lives.receipt import bar, fit_receipt, receipt
from service.lives.run_analysis import LATE, OTHER_PRESSURES, Analysis, Warned, analyse, mean_cofs
from service.settings import CODE_VERSION
from service.workflows.adopt_model import correct_newest, retrack_all
from service.workflows.update_tracks import retrack
from storage import adopted_models, channels, clutches, fits, runs
from storage.clutches import ClutchRow
from storage.engine.database import Database
from storage.runs import NewRun, RunRow


def ingest(database: Database, clutch_id: str, run: IncomingRun, *, received_at: str) -> tuple[dict[str, Any], bool]:
    """Take in a run; returns its receipt and whether it is new.

    The same run again gives the same receipt, marked a duplicate. Raises NotFoundError for an unknown clutch and
    ConflictError where other content is known under the run's name; then nothing has changed.
    """
    with database.reading() as connection:
        clutch = records.clutch(connection, clutch_id)
        known = runs.get(connection, clutch_id, run.run_id)
    if known is not None:
        return _repeat(known, run), False
    geometry = records.record(clutch).geometry.to_model()
    with ThreadPoolExecutor(1) as beside:  # deflating a long record lets its cutting run
        encoding = beside.submit(channels.encoded, run.channels)
        analysis = analyse(run, geometry)
        columns = encoding.result()
    if run.kind != DYNAMIC:  # whose loops are yet to be fitted; a long record need not be held twice
        run = replace(run, channels={})
    with database.writing() as connection:
        known = runs.get(connection, clutch_id, run.run_id)
        if known is not None:
            return _repeat(known, run), False
        return _store(connection, clutch, geometry, run, columns, analysis, received_at), True


def _repeat(known: RunRow, run: IncomingRun) -> dict[str, Any]:
    if known.content_sha256 != run.content_sha256:
        raise ConflictError(
            f"run_id {run.run_id!r} is known with other content: its sha256 is {known.content_sha256}, "
            f"that of the content sent is {run.content_sha256}"
        )
    return known.receipt | {"duplicate": True}


def _store(
    connection: Connection,
    clutch: ClutchRow,
    geometry: Geometry,
    run: IncomingRun,
    columns: channels.Encoded,
    analysis: Analysis,
    received_at: str,
) -> dict[str, Any]:
    before = records.events(connection, clutch.clutch_id)
    event = _event(run, analysis, received_at)
    cofs = _cofs(order([*before, event]), event, analysis, geometry)
    event = _event(run, analysis, received_at, cofs)
    ordered = order([*before, event])
    loops = (
        loops_of(connection, clutch.clutch_id, ordered, event, run.channels, geometry) if run.kind == DYNAMIC else []
    )
    answer = receipt(
        clutch.clutch_id,
        run,
        received_at=received_at,
        fits=[fit_receipt(level.fit, cofs.get(level.fit.pressure)) for level in analysis.fits],
        warnings=[*analysis.warnings, *_late(before, event), *_absent(ordered, event)],
        loops=loops,
    )
    run_key = runs.insert(
        connection,
        NewRun(
            clutch_id=clutch.clutch_id,
            run_id=run.run_id,
            kind=run.kind,
            cycles=run.cycles,
            started_at=run.started_at,
            received_at=received_at,
            content_sha256=run.content_sha256,
            details=records.details(run, analysis),
            receipt=answer,
            code_version=CODE_VERSION,
        ),
    )
    channels.write(connection, run_key, columns)
    fits.write(connection, run_key, records.fit_rows(analysis.fits, cofs))
    clutches.bump_revision(connection, clutch.clutch_id)
    if _changes_the_past(connection, clutch.clutch_id, ordered, event):
        retrack_all(connection, clutch)
    else:
        newest = correct_newest(connection, clutch, ordered, event)
        noticed = retrack(connection, clutch, [newest if each is event else each for each in ordered], newest=newest)
        if noticed and event is ordered[-1] and event.cofs and not _absent(ordered, event):
            answer["warnings"] += noticed
            runs.set_results(connection, run_key, records.details(run, analysis), answer, CODE_VERSION)
    if event.speed_range is not None:
        refresh_loops(connection, clutch.clutch_id, ordered, geometry, since=event)
    return answer


def _changes_the_past(connection: Connection, clutch_id: str, ordered: Sequence[Event], event: Event) -> bool:
    """Whether what was said of earlier or later tests no longer holds.

    A late test or rebuild may make another test the reference, and with it the protocol of all means; under an adopted
    model any late run may bear on the corrections of those after it, and a rebuild ends the model.
    """
    late = event is not ordered[-1]
    if adopted_models.current(connection, clutch_id) is not None and (late or event.rebuild):
        return True
    return late and (event.rebuild or event.speed_range is not None)


def _event(run: IncomingRun, analysis: Analysis, received_at: str, cofs: ByPressure | None = None) -> Event:
    return Event(
        run_id=run.run_id,
        kind=run.kind,
        cycles=run.cycles,
        moment=records.moment(run.started_at, received_at),
        speed_range=analysis.speed_range,
        cofs=cofs or {},
        rebuild=run.details.get("event") == "rebuild",
        shift=run.details.get("event") not in (None, "rebuild"),
        duty=_duty(run),
    )


def _duty(run: IncomingRun) -> Block | None:
    said = run.details.get("duty") or {}
    names = ("cycles", "energy_per_cycle_kj", "initial_speed_rpm", "engagement_duration_s")
    return records.duty_block(run.cycles, *(said.get(name) for name in names))


def _cofs(events: Sequence[Event], event: Event, analysis: Analysis, geometry: Geometry) -> ByPressure:
    """The run's mean COFs over the protocol of its life's first stationary test, which may be itself."""
    life = next(life for life in lives(events) if event in life.events)
    if life.speed_range is None:
        return {}
    return mean_cofs(analysis.fits, reference_velocities(life.speed_range, geometry), geometry)


def _absent(events: Sequence[Event], new: Event) -> list[Warned]:
    """A test none of whose pressures the reference test had cannot be compared with it."""
    life = next(life for life in lives(events) if new in life.events)
    if not new.cofs or any(nearest(level, new.cofs) is not None for level in life.reference):
        return []
    measured = ", ".join(f"{bar(level):g}" for level in sorted(life.reference))
    message = f"none of its pressures is one of the first stationary test's ({measured} bar): no track uses it"
    return [Warned(code=OTHER_PRESSURES, message=message)]


def _late(before: Sequence[Event], new: Event) -> list[Warned]:
    latest = max((event.cycles for event in before), default=0.0)
    if new.cycles >= latest:
        return []
    message = f"the run's {new.cycles:g} cycles lie before the latest known {latest:g}: all was tracked anew"
    return [Warned(code=LATE, message=message)]
