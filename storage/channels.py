"""The raw channels of a run, as they were sent: kept for ever and bit for bit, written once, never changed."""

from collections.abc import Mapping

import numpy as np
import sqlalchemy as sa
from numpy.typing import NDArray
from sqlalchemy import Connection, bindparam, select

from storage.codec import CODEC, decode, encode
from storage.errors import DamagedData
from storage.tables import channel

_insert = sa.insert(channel)
_of_run = (
    select(channel.c.name, channel.c.codec, channel.c.length, channel.c.data)
    .where(channel.c.run_key == bindparam("of_run"))
    .order_by(channel.c.position)
)


def write(connection: Connection, run_key: int, channels: Mapping[str, NDArray[np.float64]]) -> None:
    """Store the channels [n] of a run, order kept. Raises IntegrityError where the run has them already."""
    rows = [
        {
            "run_key": run_key,
            "name": name,
            "position": position,
            "codec": CODEC,
            "length": column.size,
            "data": encode(column),
        }
        for position, (name, column) in enumerate(channels.items())
    ]
    if rows:
        connection.execute(_insert, rows)


def read(connection: Connection, run_key: int) -> dict[str, NDArray[np.float64]]:
    """The channels of a run in the order they were sent, none for a run without. Raises DamagedData."""
    channels = {}
    for name, codec, length, data in connection.execute(_of_run, {"of_run": run_key}):
        try:
            channels[name] = decode(data, codec, length)
        except DamagedData as error:
            raise DamagedData(f"channel {name} of run {run_key}: {error}") from error
    return channels
