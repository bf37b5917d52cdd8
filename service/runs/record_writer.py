"""A run's channels -> a record file: CSV, NI TDMS or ASAM MDF4, which `readers` reads back bit for bit.

Names and units are the public ones. TDMS and MDF4 need the packages of the extras.
"""

import warnings
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from models.arrays import FloatArray
from service.channels import CHANNELS
from service.readers.detect import Format
from service.readers.sandbox import not_installed

_ROWS = 50_000
_GROUP = "rig"


class RecordFormat(StrEnum):
    """The formats that can be written, by their names on the command line; JSON holds the complete run."""

    JSON = "json"
    CSV = "csv"
    TDMS = "tdms"
    MDF4 = "mdf4"

    @property
    def suffix(self) -> str:
        """The suffix of its files."""
        return ".mf4" if self is RecordFormat.MDF4 else f".{self.value}"


_NEEDING = {RecordFormat.TDMS: Format.TDMS, RecordFormat.MDF4: Format.MDF4}


def require_writer(kind: RecordFormat) -> None:
    """Raise ValueError, naming the extra to install, if the package that writes a format is missing."""
    needed = _NEEDING.get(kind)
    if needed and (missing := not_installed(needed, f"{needed} files cannot be written")):
        raise ValueError(missing)


def write_record(path: Path, kind: RecordFormat, channels: Mapping[str, FloatArray], head: Mapping[str, Any]) -> None:
    """Write channels [n] by public name into one CSV, TDMS or MDF4 file, atomically; `head` becomes its comment or
    properties. Raises ValueError where the package of the format is not installed.
    """
    require_writer(kind)
    partial = path.with_name(f".{path.stem}.part{path.suffix}")
    _WRITERS[kind](partial, channels, head)
    partial.replace(path)


def _write_csv(path: Path, channels: Mapping[str, FloatArray], head: Mapping[str, Any]) -> None:
    """Write CSV with the shortest decimals that give the same doubles, and a comment line before the header."""
    columns = list(channels.values())
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("# " + ", ".join(f"{name} {value}" for name, value in head.items()) + "\n")
        file.write(",".join(channels) + "\n")
        for start in range(0, columns[0].size, _ROWS):
            cells = [map(repr, column[start : start + _ROWS].tolist()) for column in columns]
            file.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))


def _write_tdms(path: Path, channels: Mapping[str, FloatArray], head: Mapping[str, Any]) -> None:
    """Write channels as a TDMS file, with `head` as its properties."""
    from nptdms import ChannelObject, RootObject, TdmsWriter  # type: ignore[import-untyped]  # start-up time, optional package

    objects = [RootObject(properties=dict(head))]
    for name, column in channels.items():
        objects.append(ChannelObject(_GROUP, name, column, properties={"unit_string": CHANNELS[name].unit}))
    with TdmsWriter(path) as writer:
        writer.write_segment(objects)


def _write_mdf4(path: Path, channels: Mapping[str, FloatArray], head: Mapping[str, Any]) -> None:
    """Write MDF4 with time as the master channel; plateaus, which have no time, are numbered."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asammdf's own imports warn
        from asammdf import MDF, Signal  # start-up time, optional package
        from asammdf.blocks import v4_constants as v4c  # start-up time, optional package

        rows = next(iter(channels.values())).size
        master = channels.get("time_s", np.arange(rows, dtype=np.float64))
        master_metadata = ("time", v4c.SYNC_TYPE_TIME) if "time_s" in channels else ("number", v4c.SYNC_TYPE_INDEX)
        signals = [
            Signal(column, master, name=name, unit=CHANNELS[name].unit, master_metadata=master_metadata)
            for name, column in channels.items()
            if name != "time_s"
        ]
        with MDF(version="4.10") as file:
            file.append(signals, comment=", ".join(f"{name} {value}" for name, value in head.items()))
            file.save(path, overwrite=True)


_WRITERS = {RecordFormat.CSV: _write_csv, RecordFormat.TDMS: _write_tdms, RecordFormat.MDF4: _write_mdf4}
