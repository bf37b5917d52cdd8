"""A sampled record with fewer samples, for a plot: in each bin those where a channel is lowest or highest.

Each row that is kept is a sample as it was measured, with the values of all channels at its own time: the columns stay of
equal length and share one time base, so torque may be drawn over speed as well as over time.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray


def extreme_rows(columns: Iterable[FloatArray], count: int, *, samples: int, points: int) -> NDArray[np.intp]:
    """Rows [k] of `count` columns [samples] in ascending order, with each bin's lowest and highest sample of each column.

    The bins are of equal length but for the last one, as many as `points` allow and at least one; the first and the last
    row are kept. So k <= max(points, 2 count + 2). Of equal extremes the first is kept. `columns` are gone through once.
    """
    bins = max(1, (points - 2) // (2 * count))
    length = -(-samples // bins)  # rounded up
    keep = np.zeros(samples, dtype=np.bool_)
    keep[[0, -1]] = True
    for column in columns:
        for start, rows in _equal_bins(column, length):
            places = start + np.arange(len(rows)) * length
            keep[places + rows.argmin(axis=1)] = True
            keep[places + rows.argmax(axis=1)] = True
    return np.flatnonzero(keep)


def _equal_bins(column: FloatArray, length: int) -> Iterable[tuple[int, FloatArray]]:
    """First rows of the bins, and bins [b, length] of a column; the last, shorter one by itself."""
    whole_length = column.size // length * length
    if whole_length:
        yield 0, column[:whole_length].reshape(-1, length)
    if whole_length < column.size:
        yield whole_length, column[whole_length:].reshape(1, -1)
