"""`/runs/{run_id}`: the receipt of a run with its channels, all samples or few enough for a plot, as JSON or Parquet.

The entity tag needs the run's row alone, not the channels. The body is written to a file part by part, never the whole text
in memory, so that it may be made in another process than the one that answers.
"""

import gzip
import hashlib
import json
from collections.abc import Callable
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import IO, BinaryIO, Literal

from pydantic_core import to_json

from models.arrays import FloatArray
from models.records.decimation import extreme_rows
from service import repository
from service.api.run import Change, RunDescription
from service.channels import CHANNELS
from service.errors import NotAcceptableError, NotFoundError
from storage import changes, raw_columns
from storage.encoding import to_text
from storage.engine.database import Database
from storage.engine.errors import DamagedData

#: Values that are written at once: as JSON some 150 kB, and a millisecond in which no other thread runs.
_VALUES = 1 << 13
#: Rows that Parquet keeps together, so that a reader may take a part. Chosen: 8 MB a channel.
_ROW_GROUP = 1 << 20
#: The package that writes Parquet, and the extra of ours that installs it.
_PACKAGE, _EXTRA = "pyarrow", "parquet"


#: A channel's values by its name, read when they are asked for.
Values = Callable[[str], FloatArray]


def write_json(file: IO[bytes] | gzip.GzipFile, head: RunDescription, names: tuple[str, ...], values: Values) -> None:
    """Write `head` as JSON with `channels` as its last field; numbers are written such that they read back as the same
    doubles."""
    file.write(to_text(repository.json_of(head)).encode()[:-1] + b',"channels":{')
    for index, name in enumerate(names):
        file.write((b"," if index else b"") + to_text(name).encode() + b":[")
        column = values(name)
        for start in range(0, column.size, _VALUES):
            file.write((b"," if start else b"") + to_json(column[start : start + _VALUES].tolist())[1:-1])
        file.write(b"]")
    file.write(b"}}")


def parquet_writer() -> str:
    """The name and version of the library that writes Parquet. Raises NotAcceptableError if none is installed."""
    try:
        return f"{_PACKAGE} {version(_PACKAGE)}"
    except PackageNotFoundError:
        message = f"this service cannot write Parquet: run pip install -e '.[{_EXTRA}]', or ask for application/json"
        raise NotAcceptableError(message) from None


def write_parquet(path: Path, head: RunDescription, names: tuple[str, ...], values: Values) -> None:
    """Write one column per channel, its unit in the field's metadata as `unit`, and `head` as JSON in the file's as
    `clutchlife`."""
    parquet_writer()
    import pyarrow as arrow  # type: ignore[import-untyped]  # start-up time, optional package
    import pyarrow.parquet as parquet  # type: ignore[import-untyped]  # start-up time, optional package

    fields = [
        arrow.field(name, arrow.float64(), nullable=False, metadata={"unit": CHANNELS[name].unit}) for name in names
    ]
    schema = arrow.schema(fields, metadata={"clutchlife": json.dumps(repository.json_of(head), allow_nan=False)})
    table = arrow.table([arrow.array(values(name)) for name in names], schema=schema)
    parquet.write_table(table, path, row_group_size=_ROW_GROUP, use_dictionary=False, compression="zstd")


RawFormat = Literal["json", "parquet"]

#: The channel that samples have and plateaus do not.
_TIME = "time_s"
#: Part of the tags: raised when the same run is answered otherwise than by earlier releases.
_FORM = 1
#: How hard a body is compressed. Chosen: higher levels take twice the time for one hundredth less.
_LEVEL = 6


def entity_tag(
    database: Database, clutch_id: str, run_id: str, *, points: int | None, kind: RawFormat, compressed: bool = False
) -> str:
    """The tag that `write_run` will return if the run's receipt does not change meanwhile; no channel is read.

    Raises NotFoundError, and NotAcceptableError if the format cannot be written here.
    """
    _, head, _ = _look_up(database, clutch_id, run_id)
    return _tag(head, points, kind, compressed)


def _tag(head: RunDescription, points: int | None, kind: RawFormat, compressed: bool) -> str:
    """The entity tag from the hashes of the content, in the receipt and (if its file was read again) in the audit
    trail; no channel is read."""
    writer = parquet_writer() if kind == "parquet" else "json"
    content = to_text([_FORM, repository.json_of(head), points, writer, compressed])
    return f'"{hashlib.sha256(content.encode()).hexdigest()[:32]}"'


def write_run(
    database: Database,
    clutch_id: str,
    run_id: str,
    *,
    points: int | None,
    kind: RawFormat,
    path: Path,
    compressed: bool = False,
) -> str:
    """Write the response body to `path` and return its entity tag.

    `points`: as many samples of a sampled record at most, chosen by `decimation`; plateaus are written whole, and so is
    Parquet. `compressed`: JSON as a gzip file. Memory: one channel as it is stored and one decoded; for Parquet all decoded.
    Raises NotFoundError, and NotAcceptableError where the format is not written here.
    """
    run_key, head, names = _look_up(database, clutch_id, run_id)
    values = partial(_values, database, run_key)
    if kind == "parquet":
        write_parquet(path, head, names, values)
    else:
        with path.open("wb") as file, _packed(file) if compressed else file as body:
            write_json(body, head, names, _thinned(values, names, head.samples, points))
    return _tag(head, points, kind, compressed)


def file_sha256(database: Database, clutch_id: str, run_id: str) -> str:
    """The hash of the file from which a run was read. Raises NotFoundError where there is none."""
    with database.reading() as connection:
        file = repository.run(connection, clutch_id, run_id).details.get("file")
    if file is None:
        raise NotFoundError(f"run {run_id!r} was not sent as a file")
    return str(file["sha256"])


def copy_file(database: Database, clutch_id: str, run_id: str, *, path: Path) -> None:
    """Write the file from which a run was read to `path`, as it was sent. Raises NotFoundError if there is none, and
    DamagedData if the stored content differs from the one sent."""
    with database.reading() as connection:
        row = repository.run(connection, clutch_id, run_id)
        stored = raw_columns.file_of(connection, row.run_key)
    if stored is None:
        raise NotFoundError(f"run {run_id!r} was not sent as a file")
    with path.open("wb") as file:
        if stored.copy_to(file) != row.details["file"]["sha256"]:
            raise DamagedData(f"the file of run {run_id} differs from what was sent")


def _packed(file: BinaryIO) -> gzip.GzipFile:
    """A gzip writer into an open file, with reproducible bytes (no time stamp)."""
    return gzip.GzipFile(filename="", mode="wb", compresslevel=_LEVEL, fileobj=file, mtime=0)


def _look_up(database: Database, clutch_id: str, run_id: str) -> tuple[int, RunDescription, tuple[str, ...]]:
    """A stored run without its channels: its key, its description for the response, and its channels' names."""
    with database.reading() as connection:
        row = repository.run(connection, clutch_id, run_id)
        lengths = raw_columns.lengths(connection, row.run_key)
        trail = changes.page(connection, clutch_id, run_id=run_id)
    head = RunDescription(
        **dict(repository.receipt(row)),
        reading=row.details.get("file", {}).get("reading"),
        changes=[Change(**change.entry()) for change in trail],
        samples=max(lengths.values(), default=0),
    )
    return row.run_key, head, tuple(lengths)


def _values(database: Database, run_key: int, name: str) -> FloatArray:
    with database.reading() as connection:
        stored = raw_columns.stored(connection, run_key, name)
    return stored.values()


def _thinned(values: Values, names: tuple[str, ...], samples: int, points: int | None) -> Values:
    """The channels thinned for a plot; plateaus and short records keep all values."""
    if points is None or samples <= points or _TIME not in names:
        return values
    drawn = [name for name in names if name != _TIME]
    rows = extreme_rows(map(values, drawn), len(drawn), samples=samples, points=points)
    return lambda name: values(name)[rows]
