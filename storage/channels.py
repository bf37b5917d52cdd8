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
    channels = {}
    for name, codec, length, data in connection.execute(_of_run, {"of_run": run_key}):
        try:
            channels[name] = decode_decimals(data, length) if codec == DECIMAL_CODEC else decode(data, codec, length)
        except DamagedData as error:
            raise DamagedData(f"channel {name} of run {run_key}: {error}") from error
    return channels


def samples(connection: Connection, clutch_id: str) -> dict[int, int]:
    """run_key -> how many samples its record has, of the runs of a clutch that are sampled records."""
    rows = connection.execute(_samples, {"of_clutch": clutch_id})
    return {run_key: length for run_key, length in rows}  # noqa: C416  (rows are no pairs to mypy)
