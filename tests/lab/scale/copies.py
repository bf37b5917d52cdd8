"""A database with copies of one clutch's life: what a request meets is the same, and only their number differs."""

import json
from contextlib import closing
from typing import Any

import sqlalchemy as sa

from models.rig import campaign
from service.api.clutch import ClutchIn
from service.changes.edit_clutch import register
from service.changes.ingest_run import ingest
from service.runs.json_run import read_run
from service.runs.simulated import simulated_body
from storage.dialects import TEXT
from storage.engine.opening import open_database
from storage.results import states_sum
from storage.rows import of_values
from storage.tables import CHECKSUM, change, channel, clutch, filter_state, metadata, prediction, run

AT = "2026-01-01T00:00:00+00:00"

#: Columns that tell copies apart; keys of tables that nothing refers to are given by the database.
_OF_CLUTCH, _OF_RUN = clutch.c.clutch_id.name, run.c.run_key.name
#: Tables whose rows no copy has.
_LEFT = {"adopted_model", "diagnosis", "inspection", "job"}


def name(number: int) -> str:
    """The clutch's id."""
    return f"copy-{number:05}"


def bodies(count: int) -> list[bytes]:
    """The stationary runs of one simulated life, tested past its end."""
    runs = campaign.simulate(1, stop_fraction=0.01, most_tests=count)
    return [json.dumps(simulated_body(run)).encode() for run in runs if run.plateaus is not None]


def life(address: str, runs: list[bytes]) -> None:
    """Take in a life, as a service would, on a new file or an empty database at an address."""
    with closing(open_database(address)) as database:
        register(database, ClutchIn(clutch_id=name(0)), created_at=AT)
        for body in runs:
            ingest(database, name(0), read_run(body), received_at=AT)


def kilobytes(address: str) -> dict[str, float]:
    """What a life takes, by what it is: of each of its runs, and of the filters once."""
    engine = sa.create_engine(address)
    with engine.connect() as connection:
        runs = connection.execute(sa.select(sa.func.count()).select_from(run)).scalar_one()
        sizes = {
            title: float(connection.execute(sa.select(sa.func.sum(sa.func.length(column)))).scalar_one()) / 1e3
            for title, column in (
                ("channels", channel.c.data),
                ("receipt", run.c.receipt),
                ("predictions", prediction.c.payload),
                ("filters", filter_state.c.arrays),
            )
        }
    engine.dispose()
    return {title: size if title == "filters" else size / runs for title, size in sizes.items()}


def multiply(address: str, count: int) -> None:
    """Put the life that a database holds under `count` names, each a little better than the one before."""
    engine = sa.create_engine(address)
    copies = sa.Table(
        "copies",
        sa.MetaData(),
        sa.Column("number", sa.Integer, primary_key=True),
        sa.Column("name", TEXT),
        prefixes=["TEMPORARY"],
    )
    with engine.begin() as connection:
        copies.create(connection)
        connection.execute(sa.insert(copies), [{"number": each, "name": name(each)} for each in range(1, count)])
        last = connection.execute(sa.select(sa.func.max(run.c.run_key))).scalar_one()
        for table in metadata.sorted_tables:
            columns = [column for column in table.columns if column is not change.c.change_key]
            if table.name in _LEFT or not {_OF_CLUTCH, _OF_RUN} & {column.name for column in columns}:
                continue
            values = [_of_copy(column, copies, last) for column in columns]
            rows = sa.select(*values).select_from(table.join(copies, sa.true()))
            connection.execute(sa.insert(table).from_select([column.name for column in columns], rows))
            if CHECKSUM in table.c:
                _seal(connection, table)
        sums = [{"at": each, "sum": states_sum(connection, each)} for each in map(name, range(count))]
        own = sa.update(clutch).where(clutch.c.clutch_id == sa.bindparam("at"))
        connection.execute(own.values(states_sum=sa.bindparam("sum")), sums)
        _seal(connection, clutch)
        if engine.dialect.name == "postgresql":  # keys were given here: the next is the sequence's
            greatest = sa.select(sa.func.max(run.c.run_key)).scalar_subquery()
            connection.execute(sa.select(sa.func.setval(sa.func.pg_get_serial_sequence("run", _OF_RUN), greatest)))
    with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
        connection.exec_driver_sql("ANALYZE" if engine.dialect.name == "sqlite" else "VACUUM ANALYZE")
    engine.dispose()


def _seal(connection: sa.Connection, table: sa.Table) -> None:
    """Give every row the checksum of what it holds, in one statement."""
    keys = list(table.primary_key)
    update = (
        sa.update(table)
        .where(*(key == sa.bindparam(f"at_{key.name}") for key in keys))
        .values({CHECKSUM: sa.bindparam("sum")})
    )
    seals = [
        {f"at_{key.name}": row[key.name] for key in keys} | {"sum": of_values(table, dict(row))}
        for row in connection.execute(sa.select(table)).mappings()
    ]
    if seals:
        connection.execute(update, seals)


def _of_copy(column: sa.Column[Any], copies: sa.Table, runs: int) -> sa.ColumnElement[Any]:
    if column.name == _OF_CLUTCH:
        return copies.c.name
    if column.name == _OF_RUN:
        return column + runs * copies.c.number
    if column.type is TEXT:  # records and receipts name their clutch
        return sa.func.replace(column, name(0), copies.c.name)
    return column + copies.c.number if column is clutch.c.rank else column
