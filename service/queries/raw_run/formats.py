"""The body of one run as JSON or as Parquet, written to a file part by part: never the whole text in memory."""

import json
from collections.abc import Callable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

from pydantic_core import to_json

from models.arrays import FloatArray
from service.columns import CHANNELS
from service.errors import NotAcceptableError
from storage.encoding.json_text import to_text

#: Values that are written at once: as JSON some 150 kB, and a millisecond in which no other thread runs.
_VALUES = 1 << 13
#: Rows that Parquet keeps together, so that a reader may take a part. Chosen: 8 MB a channel.
_ROW_GROUP = 1 << 20
#: The package that writes Parquet, and the extra of ours that installs it.
_PACKAGE, _EXTRA = "pyarrow", "parquet"


class Writable(Protocol):
    """A file, or what packs into one."""

    def write(self, data: bytes, /) -> object:
        """Add bytes."""


#: A channel's values by its name, read when they are asked for.
Values = Callable[[str], FloatArray]


def write_json(file: Writable, head: Mapping[str, Any], names: tuple[str, ...], values: Values) -> None:
    """`head` as JSON with `channels` as its last field, numbers such that the same doubles are read from them."""
    file.write(to_text(head).encode()[:-1] + b',"channels":{')
    for index, name in enumerate(names):
        file.write((b"," if index else b"") + to_text(name).encode() + b":[")
        column = values(name)
        for start in range(0, column.size, _VALUES):
            file.write((b"," if start else b"") + to_json(column[start : start + _VALUES].tolist())[1:-1])
        file.write(b"]")
    file.write(b"}}")


def parquet_writer() -> str:
    """What writes Parquet here, with its version. Raises NotAcceptableError where nothing does."""
    try:
        return f"{_PACKAGE} {version(_PACKAGE)}"
    except PackageNotFoundError:
        message = f"runs are not given as Parquet here: pip install -e '.[{_EXTRA}]', or accept application/json"
        raise NotAcceptableError(message) from None


def write_parquet(path: Path, head: Mapping[str, Any], names: tuple[str, ...], values: Values) -> None:
    """A column a channel with its unit under `unit` of the field's metadata, and `head` as JSON under `clutchlife`."""
    parquet_writer()
    import pyarrow as arrow  # type: ignore[import-untyped]  # start-up time, optional package
    import pyarrow.parquet as parquet  # type: ignore[import-untyped]  # start-up time, optional package

    fields = [
        arrow.field(name, arrow.float64(), nullable=False, metadata={"unit": CHANNELS[name].unit}) for name in names
    ]
    schema = arrow.schema(fields, metadata={"clutchlife": json.dumps(head, allow_nan=False)})
    table = arrow.table([arrow.array(values(name)) for name in names], schema=schema)
    parquet.write_table(table, path, row_group_size=_ROW_GROUP, use_dictionary=False, compression="zstd")
