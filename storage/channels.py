"""The raw channels of a run, as they were sent: kept for ever and bit for bit, written once, never changed."""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import sqlalchemy as sa
from numpy.typing import NDArray
from sqlalchemy import Connection, bindparam, select

from storage.codec import CODEC, decode, encode
from storage.errors import DamagedData
from storage.tables import channel, run

#: From so many values on, columns are encoded two at a time: deflating lets other threads run, and each takes memory.
_LONG = 1 << 17
_THREADS = 2

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


def write(connection: Connection, run_key: int, channels: Mapping[str, NDArray[np.float64]]) -> None:
    """Store the channels [n] of a run, order kept. Raises IntegrityError where the run has them already."""
    for several in _encoded(channels):
        rows = [
            {
                "run_key": run_key,
                "name": name,
                "position": position,
                "codec": CODEC,
                "length": channels[name].size,
                "data": data,
            }
            for position, name, data in several
        ]
        connection.execute(_insert, rows)


def _encoded(channels: Mapping[str, NDArray[np.float64]]) -> Iterator[list[tuple[int, str, bytes]]]:
    """Position, name and bytes of the channels: long ones two at a time, short ones all at once."""
    named = list(enumerate(channels))
    if sum(column.size for column in channels.values()) < _LONG:
        if named:
            yield [(position, name, encode(channels[name])) for position, name in named]
        return
    with ThreadPoolExecutor(_THREADS) as pool:
        for first in range(0, len(named), _THREADS):
            some = named[first : first + _THREADS]
            found = pool.map(encode, [channels[name] for _, name in some])
            yield [(position, name, data) for (position, name), data in zip(some, found, strict=True)]


def read(connection: Connection, run_key: int) -> dict[str, NDArray[np.float64]]:
    """The channels of a run in the order they were sent, none for a run without. Raises DamagedData."""
    channels = {}
    for name, codec, length, data in connection.execute(_of_run, {"of_run": run_key}):
        try:
            channels[name] = decode(data, codec, length)
        except DamagedData as error:
            raise DamagedData(f"channel {name} of run {run_key}: {error}") from error
    return channels


def samples(connection: Connection, clutch_id: str) -> dict[int, int]:
    """run_key -> how many samples its record has, of the runs of a clutch that are sampled records."""
    found = connection.execute(_samples, {"of_clutch": clutch_id})
    return {run_key: length for run_key, length in found}  # noqa: C416  (rows are no pairs to mypy)
