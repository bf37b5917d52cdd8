"""Small record files in every format, written and read. The packages that write are those of the extras."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow  # type: ignore[import-untyped]
import pyarrow.parquet  # type: ignore[import-untyped]
from nptdms import ChannelObject, RootObject, TdmsWriter  # type: ignore[import-untyped]

from models.arrays import FloatArray
from service.readers.assemble import Channels
from service.readers.read_file import read_file, reading_of

UNITS = {"time_s": "s", "pressure_bar": "bar", "speed_rpm": "rpm", "torque_nm": "Nm", "oil_temperature_c": "°C"}


def record(rows: int = 2000, seed: int = 5) -> dict[str, FloatArray]:
    """A record of all five channels, as recorders round it."""
    rng = np.random.default_rng(seed)
    return {
        "time_s": np.round(np.arange(rows) * 1e-3, 3),
        "pressure_bar": np.round(5 + rng.normal(0, 0.01, rows), 4),
        "speed_rpm": np.round(1000 + rng.normal(0, 1, rows), 3),
        "torque_nm": np.round(20 + rng.normal(0, 0.1, rows), 5),
        "oil_temperature_c": np.round(85 + rng.normal(0, 0.1, rows), 3),
    }


def csv_text(
    columns: Mapping[str, FloatArray],
    *,
    separator: str = ",",
    decimal: str = ".",
    ending: str = "\n",
    number: str = "%.5f",
) -> str:
    """A CSV file's text with the names as they are given."""
    lines = [separator.join(columns)]
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines += [separator.join(number % value for value in row).replace(".", decimal) for row in rows]
    return ending.join(lines) + ending


def write_tdms(
    path: Path,
    columns: Mapping[str, FloatArray],
    *,
    units: Mapping[str, str] | None = None,
    properties: Mapping[str, float] | None = None,
    more: Mapping[str, FloatArray] | None = None,
) -> Path:
    """A TDMS file with a group `Rig`; `more` goes into a second one."""
    units = {} if units is None else units
    with TdmsWriter(path) as writer:
        objects = [RootObject()]
        for place, columns_there in (("Rig", columns), ("More", more or {})):
            for name, values in columns_there.items():
                channel_properties = dict(properties or {}) | ({"unit_string": units[name]} if name in units else {})
                objects.append(ChannelObject(place, name, values, properties=channel_properties))
        writer.write_segment(objects)
    return path


_WRITE_MDF = """
import sys, numpy
from asammdf import MDF, Signal
held = numpy.load(sys.argv[1])
units = dict(zip(held["names"].tolist(), held["units"].tolist()))
time = held["time"]
file = MDF(version=sys.argv[3])
for group in sorted({name.split("|")[0] for name in units}):
    file.append([
        Signal(held[name], time[: held[name].size], name=name.split("|")[1], unit=units[name])
        for name in units if name.split("|")[0] == group
    ], comment="rig")
file.save(sys.argv[2], overwrite=True, compression=int(sys.argv[4]))
"""


def write_mdf(
    path: Path,
    columns: Mapping[str, FloatArray],
    *,
    units: Mapping[str, str] | None = None,
    more: Mapping[str, FloatArray] | None = None,
    version: str = "4.10",
    compression: int = 0,
) -> Path:
    """An MDF file; `time_s` becomes the master channel. asammdf warns as it is imported, so it writes in its own process."""
    units = {} if units is None else units
    groups = {"a": {name: values for name, values in columns.items() if name != "time_s"}, "b": more or {}}
    arrays = {f"{group}|{name}": values for group, held in groups.items() for name, values in held.items()}
    unit_names = [units.get(name.partition("|")[2], "") for name in arrays]
    held = path.with_suffix(".npz")
    np.savez(held, names=list(arrays), units=unit_names, time=columns["time_s"], allow_pickle=False, **arrays)
    arguments = [sys.executable, "-W", "ignore", "-c", _WRITE_MDF, str(held), str(path), version, str(compression)]
    subprocess.run(arguments, check=True, capture_output=True)
    return path


def write_parquet(path: Path, columns: Mapping[str, object], *, units: Mapping[str, str] | None = None) -> Path:
    """A Parquet file, units in the fields' metadata."""
    units = {} if units is None else units
    arrays = [pyarrow.array(values) for values in columns.values()]
    fields = [
        pyarrow.field(name, array.type, metadata={"unit": units[name]} if name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    pyarrow.parquet.write_table(pyarrow.Table.from_arrays(arrays, schema=pyarrow.schema(fields)), path)
    return path


def read_content(
    folder: Path, content: str | bytes, mapping: str | None = None, *, name: str = "a.csv", **options: Any
) -> Channels:
    """What a file of that name with this content is read as; `options` of the reading beside its map."""
    path = folder / "posted"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_file(path, filename=name, reading=reading_of(mapping, **options))
