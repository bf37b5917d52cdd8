"""The toy format -> a table: a line `TOY1 torque[Nm],speed[rpm],...`, then rows of little-endian float64.

Runs in the reading process of `sandbox`.
"""

from pathlib import Path

import numpy as np

from service.errors import InvalidError
from service.readers.column_names import column_of
from service.readers.limits import Limits
from service.readers.table import Reading, Table


def read_table(path: Path, _: Reading, limits: Limits) -> Table:
    """The table of the whole file."""
    head, _separator, body = path.read_bytes().partition(b"\n")
    names = head.decode("utf-8", "replace").removeprefix("TOY1 ").split(",")
    limits.require_columns(len(names))
    if len(body) % (8 * len(names)):
        raise InvalidError(f"the toy file must hold whole rows of {8 * len(names)} bytes, got {len(body)} bytes")
    rows = np.frombuffer(body, dtype="<f8").reshape(-1, len(names))
    return Table(columns=tuple(map(column_of, names)), read=lambda taken: [rows[:, index] for index in taken])
