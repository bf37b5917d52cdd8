"""The raw channels of a run, as they were sent: kept bit for bit, written once, never changed."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import sqlalchemy as sa
from numpy.typing import NDArray
from sqlalchemy import Connection, bindparam, select

from storage.encoding.codec import CODEC, decode, encode
from storage.encoding.decimals import DECIMAL_CODEC, LONG, decode_decimals, encode_decimals
from storage.engine.errors import DamagedData
from storage.tables import channel, run

_insert = sa.insert(channel)
_of_run = (
    select(channel.c.name, channel.c.codec, channel.c.length, channel.c.data)
    .where(channel.c.run_key == bindparam("of_run"))
    .order_by(channel.c.position)
)
_lengths = (
    select(channel.c.name, channel.c.length)
    .where(channel.c.run_key == bindparam("of_run"))
    .order_by(channel.c.position)
)
_by_name = select(channel.c.codec, channel.c.length, channel.c.data).where(
    channel.c.run_key == bindparam("of_run"), channel.c.name == bindparam("wanted")
)
_samples = (
    select(channel.c.run_key, channel.c.length)
    .join(run, run.c.run_key == channel.c.run_key)
    .where(run.c.clutch_id == bindparam("of_clutch"), channel.c.name == "time_s")
)


@dataclass(frozen=True, slots=True)
class Encoded:
    """The channels of one run as they are stored, order kept: name, codec, length and bytes of each."""

    columns: tuple[tuple[str, str, int, bytearray], ...]


def encoded(channels: Mapping[str, NDArray[np.float64]]) -> Encoded:
    """The channels [n] of a run encoded. Slow for long records; needs no connection."""
    return Encoded(tuple((name, *_encoded(column)) for name, column in channels.items()))


def _encoded(column: NDArray[np.float64]) -> tuple[str, int, bytearray]:
    decimals = encode_decimals(column) if column.size >= LONG else None
    if decimals is not None:
        return DECIMAL_CODEC, column.size, decimals
    return CODEC, column.size, encode(column)


def write(connection: Connection, run_key: int, channels: Encoded) -> None:
    """Store the channels of a run. Raises IntegrityError where the run has them already."""
    rows = [
        {"run_key": run_key, "name": name, "position": position, "codec": codec, "length": length, "data": data}
        for position, (name, codec, length, data) in enumerate(channels.columns)
    ]
    if rows:
        connection.execute(_insert, rows)


def read(connection: Connection, run_key: int) -> dict[str, NDArray[np.float64]]:
    """The channels of a run in the order they were sent, none for a run without. Raises DamagedData."""
    rows = connection.execute(_of_run, {"of_run": run_key})
    return {name: _decoded(run_key, name, codec, length, data) for name, codec, length, data in rows}


def lengths(connection: Connection, run_key: int) -> dict[str, int]:
    """How many values each channel of a run has, in the order they were sent; no values are read."""
    rows = connection.execute(_lengths, {"of_run": run_key})
    return {name: length for name, length in rows}  # noqa: C416  (rows are no pairs to mypy)


@dataclass(frozen=True, slots=True)
class Stored:
    """One channel of a run as it is stored, to be decoded when no transaction is open any more."""

    run_key: int
    name: str
    codec: str
    length: int
    data: bytes

    def values(self) -> NDArray[np.float64]:
        """The channel [length]. Raises DamagedData."""
        return _decoded(self.run_key, self.name, self.codec, self.length, self.data)


def stored(connection: Connection, run_key: int, name: str) -> Stored:
    """One channel of a run, not decoded. Raises LookupError where the run has no such channel."""
    row = connection.execute(_by_name, {"of_run": run_key, "wanted": name}).first()
    if row is None:
        raise LookupError(f"run {run_key} has no channel {name}")
    return Stored(run_key, name, *row)


def _decoded(run_key: int, name: str, codec: str, length: int, data: bytes) -> NDArray[np.float64]:
    try:
        return decode_decimals(data, length) if codec == DECIMAL_CODEC else decode(data, codec, length)
    except DamagedData as error:
        raise DamagedData(f"channel {name} of run {run_key}: {error}") from error


def samples(connection: Connection, clutch_id: str) -> dict[int, int]:
    """run_key -> how many samples its record has, of the runs of a clutch that are sampled records."""
    rows = connection.execute(_samples, {"of_clutch": clutch_id})
    return {run_key: length for run_key, length in rows}  # noqa: C416  (rows are no pairs to mypy)
