"""A database with copies of one clutch's life: what a request meets is the same, and only their number differs."""

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import httpx2
import sqlalchemy as sa

from storage.tables import (
    adopted_model,
    change,
    channel,
    clutch,
    diagnosis,
    filter_state,
    inspection,
    metadata,
    prediction,
    run,
)
from tests.support import serving

#: Columns that tell copies apart; keys of tables that nothing refers to are given anew.
_OF_CLUTCH, _OF_RUN = clutch.c.clutch_id.name, run.c.run_key.name
#: What no copy has.
_LEFT = {adopted_model, diagnosis, inspection}


def name(number: int) -> str:
    """The clutch's id."""
    return f"copy-{number:05}"


def life(path: Path, bodies: list[bytes]) -> None:
    """Post a life to a service on a new file."""
    with serving(path) as server, httpx2.Client(base_url=server.url, timeout=60) as http:
        http.post("/v1/clutches", json={"clutch_id": name(0)}).raise_for_status()
        for body in bodies:
            http.post(
                f"/v1/clutches/{name(0)}/runs", content=body, headers={"Content-Type": "application/json"}
            ).raise_for_status()


def kilobytes(path: Path) -> dict[str, float]:
    """What a life takes, by what it is: of each of its runs, and of the filters once."""
    engine = sa.create_engine(f"sqlite:///{path}")
    with engine.connect() as connection:
        runs = connection.execute(sa.select(sa.func.count()).select_from(run)).scalar_one()
        sizes = {
            title: connection.execute(sa.select(sa.func.sum(sa.func.length(column)))).scalar_one() / 1e3
            for title, column in (
                ("channels", channel.c.data),
                ("receipt", run.c.receipt),
                ("predictions", prediction.c.payload),
                ("filters", filter_state.c.arrays),
            )
        }
    engine.dispose()
    return {title: size if title == "filters" else size / runs for title, size in sizes.items()}


def multiply(source: Path, target: Path, count: int) -> None:
    """A new file with that life under `count` names, each a little better than the one before."""
    shutil.copyfile(source, target)
    engine = sa.create_engine(f"sqlite:///{target}")
    numbers = sa.Table("copies", sa.MetaData(), sa.Column("n", sa.Integer, primary_key=True), prefixes=["TEMPORARY"])
    with engine.begin() as connection:
        driver = connection.connection.driver_connection
        assert isinstance(driver, sqlite3.Connection)
        driver.create_function("named", 1, name)
        numbers.create(connection)
        connection.execute(sa.insert(numbers), [{"n": number} for number in range(1, count)])
        last = connection.execute(sa.select(sa.func.max(run.c.run_key))).scalar_one()
        for table in metadata.sorted_tables:
            columns = [column for column in table.columns if column is not change.c.change_key]
            if table in _LEFT or not {_OF_CLUTCH, _OF_RUN} & {column.name for column in columns}:
                continue
            values = [_of_copy(column, numbers.c.n, last) for column in columns]
            copies = sa.select(*values).select_from(table.join(numbers, sa.true()))
            connection.execute(sa.insert(table).from_select([column.name for column in columns], copies))
    engine.dispose()


def _of_copy(column: sa.Column[Any], number: sa.Column[int], runs: int) -> sa.ColumnElement[Any]:
    if column.name == _OF_CLUTCH:
        return sa.func.named(number)
    if column.name == _OF_RUN:
        return column + runs * number
    if column is clutch.c.record:
        return sa.func.json_set(column, f"$.{_OF_CLUTCH}", sa.func.named(number))
    return column + number if column is clutch.c.rank else column
