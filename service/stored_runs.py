"""Stored runs as they were sent, each read in a transaction of its own when it is asked for."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from sqlalchemy import Connection

from service import records
from service.errors import NotFoundError
from service.lives.incoming_run import IncomingRun
from service.lives.model_correction import RunReader
from storage import channels, runs
from storage.engine.database import Database
from storage.runs import RunRow


def run(connection: Connection, clutch_id: str, run_id: str) -> RunRow:
    """The run of a known clutch, or NotFoundError."""
    records.clutch(connection, clutch_id)
    row = runs.get(connection, clutch_id, run_id)
    if row is None:
        raise NotFoundError(f"clutch {clutch_id!r} has no run {run_id!r}")
    return row


def run_reader(database: Database, clutch_id: str) -> RunReader:
    """The clutch's stored runs, each read in a transaction of its own when it is asked for: none stays open meanwhile."""

    def described(run_id: str) -> IncomingRun:
        with database.reading() as connection:
            return incoming(run(connection, clutch_id, run_id), {})

    def with_channels(run_id: str) -> IncomingRun:
        with database.reading() as connection:
            row = run(connection, clutch_id, run_id)
            return incoming(row, channels.read(connection, row.run_key))

    with database.reading() as connection:
        sampled = channels.samples(connection, clutch_id)
        names = {row.run_key: row.run_id for row in runs.in_order(connection, clutch_id)}
    return RunReader(
        read=with_channels,
        describe=described,
        sampled=frozenset(names[run_key] for run_key in sampled if run_key in names),
    )


def incoming(row: RunRow, columns: Mapping[str, NDArray[np.float64]]) -> IncomingRun:
    """A stored run as it came in."""
    return IncomingRun(
        kind=row.kind,
        cycles=row.cycles,
        run_id=row.run_id,
        content_sha256=row.content_sha256,
        started_at=row.started_at,
        origin=row.details["origin"],
        channels=columns,
        details={name: row.details[name] for name in ("duty", "event", "note") if name in row.details},
    )
