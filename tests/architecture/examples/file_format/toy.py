"""The toy format -> columns: a line `TOY1 torque[Nm],speed[rpm],...`, then rows of little-endian float64.

Runs in the reading process of `sandbox`.
"""

from pathlib import Path

import numpy as np

from models.arrays import FloatArray
from service.errors import InvalidError
from service.readers.column_names import choose
from service.readers.limits import Limits
from service.readers.recorder_columns import recorded_header, require_one_length


def read(path: Path, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    """The channels [n] that the map and the names give, in the channels' units."""
    head, _, body = path.read_bytes().partition(b"\n")
    names = head.decode("utf-8", "replace").removeprefix("TOY1 ").split(",")
    if len(body) % (8 * len(names)):
        raise InvalidError(f"the toy file must hold whole rows of {8 * len(names)} bytes, got {len(body)} bytes")
    rows = np.frombuffer(body, dtype="<f8").reshape(-1, len(names))
    taken = choose([recorded_header(name, None) for name in names], mapping)
    require_one_length({column.channel: len(rows) for column in taken}, limits)
    columns = {}
    for column in taken:
        columns[column.channel] = rows[:, column.index].copy()
        column.conversion.apply(columns[column.channel])
    return columns
