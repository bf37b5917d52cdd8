"""MATLAB files up to version 7 -> a table, by scipy: vectors, matrices and structs. Version 7.3 is HDF5 (`hdf5`).

Runs in the reading process of `sandbox`. Source: MathWorks, MAT-File Format.
"""

import io
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from scipy.io.matlab import MatlabFunction, MatlabOpaque, mat_struct

from service.readers.arrays import Leaf, table_of
from service.readers.limits import Limits
from service.readers.table import Reading, Table


def read_table(path: Path, reading: Reading, limits: Limits) -> Table:
    """The table of the file's variables."""
    variables = scipy.io.loadmat(io.BytesIO(path.read_bytes()), squeeze_me=True, struct_as_record=False)
    unread = [name for name, value in variables.items() if isinstance(value, MatlabOpaque | MatlabFunction)]
    named = {name: value for name, value in variables.items() if name not in unread and not name.startswith("__")}
    return table_of({name: _node(value) for name, value in named.items()}, reading, limits, tuple(map(str, unread)))


def _node(value: Any) -> Any:
    """A variable as a tree: a struct is a folder, an array of structs a folder of folders."""
    if isinstance(value, mat_struct):
        return {name: _node(getattr(value, name)) for name in value._fieldnames}  # noqa: SLF001 (scipy documents it so)
    if isinstance(value, np.ndarray) and value.dtype == object and value.size and isinstance(value.flat[0], mat_struct):
        nodes = [_node(item) for item in value.flat if isinstance(item, mat_struct)]
        return {str(node.get("label") or node.get("name") or index): node for index, node in enumerate(nodes, 1)}
    if isinstance(value, np.ndarray) and value.dtype.kind in "iufUOS":
        return value.tolist() if value.dtype.kind in "UOS" else Leaf(value)
    return value
