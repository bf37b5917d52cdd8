"""Apache Parquet -> a table, by pyarrow: units from the names, or from the fields' metadata under `unit`.

Runs in the reading process of `sandbox`. Source: apache/parquet-format.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet  # type: ignore[import-untyped]
import pyarrow.types as kinds  # type: ignore[import-untyped]
from numpy.typing import NDArray

from service.errors import MAX_QUOTED
from service.readers.arrays import Tree, parsed, refuse_counts, stated_unit, unit_of_array
from service.readers.column_names import column_of
from service.readers.limits import Limits
from service.readers.meanings import known_channel
from service.readers.numerals import is_stamp
from service.readers.table import FileColumn, Reading, Table

#: The name by which pandas writes an index that has none.
_INDEX = "__index_level_"


def read_table(path: Path, _: Reading, limits: Limits) -> Table:
    """The columns of the file. A null is NaN, which is refused."""
    file = parquet.ParquetFile(path, memory_map=True)
    fields = list(file.schema_arrow)
    limits.require_columns(len(fields))

    def read(taken: Mapping[int, str]) -> list[NDArray[Any]]:
        # one at a time: memory is that of a column
        columns = []
        for field in (fields[index] for index in taken):
            columns.append(_values(file.read(columns=[field.name], use_threads=False).column(0)))
            refuse_counts(field.name[:MAX_QUOTED], columns[-1], _stated(field.metadata))
        return columns

    file_metadata = _stated(file.schema_arrow.metadata)
    columns = [_column(field, file, file_metadata) for field in fields]
    return Table(columns=tuple(columns), read=read)


def _stated(metadata: Mapping[bytes, bytes] | None) -> Tree:
    """The file's metadata about its columns, as texts and folders, including those of pandas' `attrs`."""
    stated: dict[str, Any] = {}
    for key, value in (metadata or {}).items():
        decoded = parsed(value.decode("utf-8", "replace"))
        stated[key.decode("utf-8", "replace")] = decoded
        if key == b"PANDAS_ATTRS" and isinstance(decoded, dict):
            stated |= decoded
    return stated


def _column(field: Any, file: Any, beside: Mapping[str, Any]) -> FileColumn:
    moment = kinds.is_temporal(field.type)
    if known_channel(field.name) == "time_s" and kinds.is_large_string(field.type) | kinds.is_string(field.type):
        moment = any(is_stamp(str(batch[0][0])) for batch in islice(file.iter_batches(1, columns=[field.name]), 1))
    unit = unit_of_array(_stated(field.metadata)) or stated_unit(field.name, beside)
    column = replace(column_of(field.name, unit, moments=moment), rows=file.metadata.num_rows)
    return replace(column, title="") if field.name.startswith(_INDEX) else column


def _values(column: Any) -> NDArray[Any]:
    kind = column.type.value_type if kinds.is_dictionary(column.type) else column.type
    if kinds.is_time(kind):
        counts = column.cast("int64" if kinds.is_time64(kind) else "int32").to_numpy()
        return np.asarray(counts.astype(f"timedelta64[{kind.unit}]"))
    if kinds.is_decimal(kind):
        column = column.cast("float64")
    values = column.to_numpy()
    return values.astype(np.float64) if values.dtype == np.float16 else np.asarray(values)
