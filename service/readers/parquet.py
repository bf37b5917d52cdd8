"""Apache Parquet -> a table, by pyarrow: units from the names, or from the fields' metadata under `unit`.

Runs in the reading process of `sandbox`. Source: apache/parquet-format.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet  # type: ignore[import-untyped]
import pyarrow.types as kinds  # type: ignore[import-untyped]
from numpy.typing import NDArray

from service.errors import InvalidError
from service.readers.column_names import column_of
from service.readers.limits import Limits
from service.readers.table import Column, Reading, Table

_UNITS = (b"unit", b"units", b"Unit")


def read_table(path: Path, _: Reading, limits: Limits) -> Table:
    """The columns of the file. A null is NaN, which is refused."""
    file = parquet.ParquetFile(path, memory_map=True)
    fields = list(file.schema_arrow)
    if len(fields) > limits.most_columns:
        raise InvalidError(f"a file must not have more than {limits.most_columns} columns, got {len(fields)}")

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        # one at a time: memory is that of a column
        return [_values(file.read(columns=[fields[index].name], use_threads=False).column(0)) for index in taken]

    columns = [_column(field, file.metadata.num_rows) for field in fields]
    return Table(columns=tuple(columns), read=read)


def _column(field: Any, rows: int) -> Column:
    metadata = field.metadata or {}
    unit = next((metadata[key].decode("utf-8", "replace") for key in _UNITS if key in metadata), None)
    moment = kinds.is_temporal(field.type)
    column = column_of(field.name, None if moment else unit)
    return Column(column.name, "s" if moment else column.unit, "", column.title, rows)


def _values(column: Any) -> NDArray[Any]:
    kind = column.type.value_type if kinds.is_dictionary(column.type) else column.type
    if kinds.is_time(kind):
        whole = column.cast("int64" if kinds.is_time64(kind) else "int32").to_numpy()
        return np.asarray(whole.astype(f"timedelta64[{kind.unit}]"))
    if kinds.is_decimal(kind):
        column = column.cast("float64")
    values = column.to_numpy()
    return values.astype(np.float64) if values.dtype == np.float16 else np.asarray(values)
