"""Apache Parquet -> columns, by pyarrow: units from the names, or from the fields' metadata under `unit`.

Runs in the reading process of `isolation`. Source: apache/parquet-format.
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
    """The columns [n] that the map and the names tell, in their own units. A null is NaN, and refused as that."""
    with parquet.ParquetFile(path, memory_map=True) as file:
        fields = list(file.schema_arrow)
        if len(fields) > limits.most_columns:
            raise InvalidError(f"a file must not have more than {limits.most_columns} columns, got {len(fields)}")
        taken = choose([_header(field) for field in fields], mapping)
        rows = file.metadata.num_rows
        require_one_length({each.channel: rows for each in taken}, limits)
        for each in taken:
            _require_numbers(each.channel, fields[each.index].type)
        columns = {each.channel: np.empty(rows) for each in taken}
        _fill(file, fields, taken, columns)
    for each in taken:
        if kinds.is_timestamp(fields[each.index].type):
            columns[each.channel] -= columns[each.channel][:1]
        else:
            each.conversion.apply(columns[each.channel])
    return columns


def _header(field: Any) -> Header:
    said = field.metadata or {}
    unit = next((said[key].decode("utf-8", "replace") for key in (b"unit", b"units", b"Unit") if key in said), None)
    return recorded_header(field.name, "s" if kinds.is_timestamp(field.type) else unit)


def _require_numbers(channel: str, kind: Any) -> None:
    if kinds.is_integer(kind) or kinds.is_floating(kind) or (channel == "time_s" and kinds.is_timestamp(kind)):
        return
    message = f"{channel} must be numbers, got values of type {kind}"
    raise InvalidError(
        message, errors=[FieldError(pointer=f"/channels/{channel}", code="not_a_number", message=message)]
    )


def _fill(file: Any, fields: list[Any], taken: list[Taken], columns: dict[str, FloatArray]) -> None:
    at = 0
    first = None
    for batch in file.iter_batches(
        batch_size=65536, columns=[fields[each.index].name for each in taken], use_threads=False
    ):
        for each in taken:
            values = batch.column(fields[each.index].name).to_numpy(zero_copy_only=False)
            if values.dtype.kind == "M":
                first = values[0] if first is None else first
                values = (values - first) / np.timedelta64(1, "s")
            columns[each.channel][at : at + batch.num_rows] = numbers(each.channel, values)
        at += batch.num_rows
