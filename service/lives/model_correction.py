"""Mean COF freed of the artefacts of an extended model: taken off the plateaus, curves fitted anew.

A test is corrected with what was known when it was made: the runs before it in the order of the history. So the same
history gives the same corrections, in whatever order its runs arrived. Of a sampled record before it only the moment and
one point stand in, for to cut all of them at every new run would cost more than the run.
"""

import logging
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from sqlalchemy import Connection

from models.arrays import FloatArray
from models.diagnosis.campaign import Campaign, StationaryRun
from models.diagnosis.extension import Extension
from models.records.runs import loaded
from service import records
from service.lives.campaign import STATIONARY, Taken, campaign_of, run_of, without_record
from service.lives.history import Life, reference_velocities
from service.lives.run_analysis import Value, levels_of, mean_cofs
from service.schemas.clutch import ClutchIn
from storage import channels

_log = logging.getLogger("clutchlife")


def neighbours(connection: Connection, clutch_id: str, life: Life) -> list[Taken]:
    """The stored runs of a life in order, sampled records left out."""
    rows = {row.run_id: row for row in records.run_rows(connection, clutch_id)}
    samples = channels.samples(connection, clutch_id)
    return [
        without_record(rows[event.run_id], life.origin)
        if rows[event.run_id].run_key in samples
        else run_of(rows[event.run_id], channels.read(connection, rows[event.run_id].run_key), origin=life.origin)
        for event in life.events
    ]


def tests_of(connection: Connection, clutch_id: str, life: Life) -> Iterator[StationaryRun]:
    """The stationary tests of a life in order, one after the other, with their records."""
    for event in life.events:
        if event.kind != STATIONARY:
            continue
        row = records.run(connection, clutch_id, event.run_id)
        try:
            run = run_of(row, channels.read(connection, row.run_key), origin=life.origin)
        except ValueError as error:  # a record that this release cuts no longer
            _log.warning("%s: %s", row.run_id, error)
            continue
        if isinstance(run, StationaryRun):
            yield run


def corrected(
    extension: Extension, record: ClutchIn, life: Life, known: Sequence[Taken], tests: Iterable[StationaryRun]
) -> dict[str, dict[float, Value]]:
    """run_id -> pressure [Pa] -> mean COF and its deviation, of the `tests` from which the extension takes something.

    `known` are all runs of the life in order, as `neighbours` gives them.
    """
    if life.speed_range is None:
        return {}
    geometry = record.geometry.to_model()
    velocities = reference_velocities(life.speed_range, geometry)
    place = {run.run_id: index for index, run in enumerate(known)}
    found = {}
    for test in tests:
        artefact = _artefact(extension, test, campaign_of(record, known[: place[test.run_id]]))
        if artefact is None:
            continue
        freed = loaded(replace(test.plateaus, torque=test.plateaus.torque - artefact))
        cofs = {} if freed is None else mean_cofs(levels_of(freed, geometry), velocities, geometry)
        if cofs:
            found[test.run_id] = cofs
    return found


def _artefact(extension: Extension, run: StationaryRun, before: Campaign) -> FloatArray | None:
    """Torque [n] Nm to be taken off, None where there is none.

    A test must be taken in whatever an adopted model makes of it: where it makes nonsense, nothing is taken off.
    """
    try:
        found = extension.artefact(run, before)
        sensible = found.shape == run.plateaus.torque.shape and bool(np.isfinite(found).all())
    except (ArithmeticError, LookupError, ValueError):
        _log.exception("%s is not corrected", run.run_id)
        return None
    if not sensible:
        _log.error("%s is not corrected: its artefact is not finite or of another shape than its torque", run.run_id)
    return found if sensible and found.any() else None
