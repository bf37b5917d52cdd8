"""Apache Parquet -> columns, by pyarrow: units from the names, or from the fields' metadata under `unit`.

Runs in the reading process of `sandbox`. Source: apache/parquet-format.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet  # type: ignore[import-untyped]
import pyarrow.types as kinds  # type: ignore[import-untyped]

from models.arrays import FloatArray
from service.errors import FieldError, InvalidError
from service.readers.column_names import Header, Taken, choose
from service.readers.limits import Limits
from service.readers.recorder_columns import numbers, recorded_header, require_one_length


def read(path: Path, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    """The columns [n] that the map and the names choose, in their own units. A null is NaN, which is refused."""
    with parquet.ParquetFile(path, memory_map=True) as file:
        fields = list(file.schema_arrow)
        if len(fields) > limits.most_columns:
            raise InvalidError(f"a file must not have more than {limits.most_columns} columns, got {len(fields)}")
        taken = choose([_header(field) for field in fields], mapping)
        rows = file.metadata.num_rows
        require_one_length({column.channel: rows for column in taken}, limits)
        for column in taken:
            _require_numbers(column.channel, fields[column.index].type)
        columns = {column.channel: np.empty(rows) for column in taken}
        _fill(file, fields, taken, columns)
    for column in taken:
        if kinds.is_timestamp(fields[column.index].type):
            columns[column.channel] -= columns[column.channel][:1]
        else:
            column.conversion.apply(columns[column.channel])
    return columns


def _header(field: Any) -> Header:
    metadata = field.metadata or {}
    unit = next(
        (metadata[key].decode("utf-8", "replace") for key in (b"unit", b"units", b"Unit") if key in metadata), None
    )
    return recorded_header(field.name, "s" if kinds.is_timestamp(field.type) else unit)


def _require_numbers(channel: str, kind: Any) -> None:
    if kinds.is_integer(kind) or kinds.is_floating(kind) or (channel == "time_s" and kinds.is_timestamp(kind)):
        return
    message = f"{channel} must be numbers, got values of type {kind}"
    raise InvalidError(
        message, errors=[FieldError(pointer=f"/channels/{channel}", code="not_a_number", message=message)]
    )


def _fill(file: Any, fields: list[Any], taken: list[Taken], columns: dict[str, FloatArray]) -> None:
    start = 0
    first = None
    for batch in file.iter_batches(
        batch_size=65536, columns=[fields[column.index].name for column in taken], use_threads=False
    ):
        for column in taken:
            values = batch.column(fields[column.index].name).to_numpy(zero_copy_only=False)
            if values.dtype.kind == "M":
                first = values[0] if first is None else first
                values = (values - first) / np.timedelta64(1, "s")
            columns[column.channel][start : start + batch.num_rows] = numbers(column.channel, values)
        start += batch.num_rows
