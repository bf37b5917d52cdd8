"""Shared by `tdms`, `mdf4` and `parquet`: names, lengths and number types as recorders write them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from models.arrays import FloatArray
from service.errors import FieldError, InvalidError, TooLargeError
from service.readers.column_names import Header, Taken, header_of, with_unit
from service.readers.limits import Limits


def recorded_header(name: str, unit: str | None, group: str = "") -> Header:
    """The header of a recorded channel, whose unit may be in its name, in its properties, or both."""
    header = header_of(name)
    return with_unit(Header(header.name, header.unit, group), unit)


def require_one_length(lengths: Mapping[str, int], limits: Limits) -> None:
    """Raises InvalidError on channels of several rates, TooLargeError on too many values.

    `lengths`: rows by channel and its place in the file.
    """
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name} has {rows}" for name, rows in lengths.items())
        message = f"all channels that are taken must have one number of rows, got: {shown}"
        raise InvalidError(message, errors=[FieldError(pointer="", code="ragged", message=message)])
    if sum(lengths.values()) > limits.most_values:
        raise TooLargeError(f"a file must not hold more than {limits.most_values} values, got {sum(lengths.values())}")


def numbers(channel: str, values: NDArray[Any]) -> FloatArray:
    """Recorded values [n] as float64 [n]; points in time become seconds since the first.

    Raises InvalidError on any other type.
    """
    if values.ndim == 1 and values.dtype.kind in "iuf":
        return np.asarray(values, dtype=np.float64)
    if channel == "time_s" and values.ndim == 1 and values.dtype.kind == "M":
        since = (values - values[:1]).astype("timedelta64[ns]")
        return np.where(np.isnat(since), np.nan, since.astype(np.int64) * 1e-9)
    message = f"{channel} must be numbers, got values of type {values.dtype}"
    raise InvalidError(
        message, errors=[FieldError(pointer=f"/channels/{channel}", code="not_a_number", message=message)]
    )


def place(headers: Sequence[Header], column: Taken) -> str:
    """A taken channel and its name in the file, for a message."""
    return f"{column.channel} ({headers[column.index].shown()!r})"
