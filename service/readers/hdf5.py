"""HDF5, and MATLAB files of version 7.3 -> a table, by h5py: data sets by their paths, units and clocks from attributes.

Runs in the reading process of `sandbox`. Links to other files are not followed. Source: HDF5 File Format Specification.
"""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from service.readers.arrays import Leaf, Tree, table_of
from service.readers.limits import Limits
from service.readers.table import Reading, Table

#: Groups in groups, and objects of a file, that are looked at. Chosen: recorders have three and hundreds.
_DEEPEST, _MAX_OBJECTS = 8, 20_000


def read_table(path: Path, reading: Reading, limits: Limits) -> Table:
    """The table of the file's data sets."""
    file = h5py.File(path, "r")
    return table_of(_folder(file, 0, [_MAX_OBJECTS]), reading, limits)


def _folder(group: h5py.Group, depth: int, left: list[int]) -> Tree:
    tree: dict[str, Any] = dict(group.attrs.items())
    for name in group:
        left[0] -= 1
        if left[0] < 0 or name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        node = group[name]
        if isinstance(node, h5py.Group) and depth < _DEEPEST:
            tree[name] = _folder(node, depth + 1, left)
        elif isinstance(node, h5py.Dataset):
            tree[name] = _leaf(node)
    return tree


def _leaf(node: h5py.Dataset) -> Any:
    """A data set as an array, or as its text."""
    attributes = dict(node.attrs.items())
    if attributes.get("MATLAB_class") == b"char" and node.size < 1000:
        return "".join(map(chr, np.asarray(node).reshape(-1)))
    if h5py.check_string_dtype(node.dtype) and node.size < 1000:
        return [
            item.decode("utf-8", "replace") if isinstance(item, bytes) else item
            for item in np.asarray(node).reshape(-1)
        ]
    return Leaf(node, attributes, _times(node))


def _times(node: h5py.Dataset) -> Leaf | None:
    """The array to which a data set refers for its first dimension: a dimension scale, or by NetCDF's conventions.

    Source: HDF5 Dimension Scale Specification; CF Conventions, 5, coordinate systems.
    """
    scales = list(node.dims[0].values()) if node.ndim and not node.is_scale else []
    words = node.attrs.get("coordinates", "")
    named = words.split() if isinstance(words, str) else []
    scales += [held for name in named[:_DEEPEST] if isinstance(held := node.parent.get(name), h5py.Dataset)]
    return next((Leaf(scale, dict(scale.attrs.items())) for scale in scales if scale.shape == node.shape), None)
