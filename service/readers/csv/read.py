"""CSV -> columns: the header rows of the first block say what the columns are, `table` reads the data rows of all blocks."""

import numpy as np

from models.arrays import FloatArray
from service.columns import LineOf
from service.errors import InvalidError
from service.readers.column_names import choose
from service.readers.csv.blocks import blocks
from service.readers.csv.header_rows import read_header_rows
from service.readers.csv.table import Table
from service.readers.detect import ByteSource
from service.readers.limits import Limits

#: Doubles of the array that is made and freed before the first block.
_WARM_UP_VALUES = 1 << 18


def read_csv(source: ByteSource, *, mapping: str | None, limits: Limits) -> tuple[dict[str, FloatArray], LineOf]:
    """A CSV file -> its channels in their own units [n], and the line of each row. Memory: the columns and a block.

    Raises InvalidError naming line and value, TooLargeError past the limits.
    """
    # Having freed one array of this size, malloc keeps smaller ones' pages: mapping them anew a block doubles the time.
    np.empty(_WARM_UP_VALUES)
    table = None
    for block in blocks(source):
        if table is None:
            layout = read_header_rows(block, limits)
            table = Table(layout, choose(layout.headers, mapping), limits)
            block = block[layout.start :]
        if block:
            table.add(block)
    if table is None:
        raise InvalidError("the file must not be empty")
    return table.columns(), table.lines.of
