"""A run's record as a file, of whatever format -> checked columns by public channel name."""

from pathlib import Path

from models.arrays import FloatArray
from service.formats import isolation
from service.formats.columns import check_arrays
from service.formats.csv_file import read_csv
from service.formats.limits import LIMITS, Limits
from service.formats.sniffing import Format, opened, sniff


def read_file(
    path: Path, *, filename: str, mapping: str | None = None, limits: Limits = LIMITS
) -> dict[str, FloatArray]:
    """The channels [n] of a CSV, TDMS, MDF4 or Parquet file by public name, in the channels' units.

    `filename` is what the sender called it, `mapping` is `torque_nm:Mz,...`. Raises InvalidError and TooLargeError, and
    nothing else, whatever the file holds.
    """
    kind = sniff(path, filename, limits)
    if kind is not Format.CSV:
        columns = isolation.read_isolated(kind, path, mapping=mapping, limits=limits)
        check_arrays(columns)
        return columns
    with opened(path, limits) as source:
        columns, line_of = read_csv(source, mapping=mapping, limits=limits)
    check_arrays(columns, line_of=line_of)
    return columns
