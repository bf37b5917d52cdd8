"""A run's record as a file of any format -> checked columns by public channel name: detect, read, check."""

from pathlib import Path

from models.arrays import FloatArray
from service.columns import check_arrays
from service.readers import sandbox
from service.readers.csv.read import read_csv
from service.readers.detect import Format, opened, sniff
from service.readers.limits import LIMITS, Limits


def read_file(
    path: Path, *, filename: str, mapping: str | None = None, limits: Limits = LIMITS
) -> dict[str, FloatArray]:
    """The channels [n] of a CSV, TDMS, MDF4 or Parquet file by public name, in the channels' units.

    `filename` is the sender's name for it, `mapping` names columns (`torque_nm:Mz,...`). Raises InvalidError or
    TooLargeError, and nothing else, whatever the file holds; BusyError where the service is ending.
    """
    kind = sniff(path, filename, limits)
    if kind is not Format.CSV:
        columns = sandbox.read_isolated(kind, path, mapping=mapping, limits=limits)
        check_arrays(columns)
        return columns
    with opened(path, limits) as source:
        columns, line_of = read_csv(source, mapping=mapping, limits=limits)
    check_arrays(columns, line_of=line_of)
    return columns
