"""Formats with a library of their own are read in a process of their own, with limits on its memory, time, output and reach.

The libraries are large, and a broken or malicious file may make them loop, exhaust memory or crash: that ends the reading
process only. It is a child of a process that has loaded the library (`zygote`); it can open the file, our code and a folder
of its own, and no socket (`confinement`). It returns one file: a line of JSON (the columns' lengths and notices, a preview,
or an error), then the columns as raw little-endian float64. Nothing that came from the file is ever unpickled or evaluated.
"""

import contextlib
import importlib
import json
import math
import os
import re
import resource
import signal
import socket
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import lru_cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from models.arrays import FloatArray
from service.channels import CHANNELS
from service.errors import BusyError, FieldError, InvalidError, Notice, ServiceError, TooLargeError, exit_text
from service.readers import zygote
from service.readers.assemble import Channels, to_channels
from service.readers.column_names import column_of
from service.readers.confinement import close_files, close_network_and_processes
from service.readers.detect import Format, is_packed, opened, overdue, too_slow
from service.readers.limits import LIMITS, Limits
from service.readers.preview import ShownTable, preview
from service.readers.suggest import Proposal, propose
from service.readers.table import ColumnChoice, Reading, Table

#: The module that reads each format, the package it needs, and the extra of ours that installs it ("": always there).
READERS = {
    Format.TDMS: ("service.readers.tdms", "nptdms", ""),
    Format.WORKBOOK: ("service.readers.workbook", "python_calamine", ""),
    Format.MATLAB: ("service.readers.matlab", "scipy", ""),
    Format.HDF5: ("service.readers.hdf5", "h5py", ""),
    Format.MDF4: ("service.readers.mdf4", "asammdf", "mdf"),
    Format.PARQUET: ("service.readers.parquet", "pyarrow", "parquet"),
}

#: What is asked of a file.
Answer = Literal["channels", "preview", "suggestion"]
#: Bytes of the line of JSON that the reading process answers with.
_LONGEST_ANSWER = 1 << 20
_BLOCK = 1 << 20
#: What the reading process writes first, when its library is loaded.
_STARTED = b"started\n"
#: Columns begin at a multiple of so many bytes, where numbers are read fastest.
_ALIGNED = 64
#: Characters of a foreign library's message that ours quotes, and of a whole message.
_MAX_QUOTED, _LONGEST_DETAIL = 200, 4000
#: How C code ends on a file that it does not bear.
_CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT)
#: Files that the reading process has open at once. Chosen: importing the libraries takes a dozen.
_MAX_OPEN_FILES = 64


def read_isolated(
    kind: Format, path: Path, answer: Answer, *, reading: Reading, limits: Limits, filename: str = ""
) -> Any:
    """The channels [n] of a file in their own units (`channels.Channels`), its preview or a suggestion, read in a process of
    its own.

    What is unpacked is kept beside the file meanwhile.
    Raises InvalidError where the file cannot be read, or makes its reader crash or take too long; TooLargeError where it
    needs more memory than is allowed or holds more values; BusyError where its reader is not installed or cannot start, is
    overdue without having used its time of a processor, or was ended by somebody else.
    """
    if missing := not_installed(kind, f"this service cannot read {kind} files"):
        raise BusyError(missing, errors=[FieldError(pointer="", code="format_not_installed", message=missing)])
    if not is_packed(path):
        return _run(kind, path, answer, reading, limits, filename)
    with opened(path, limits) as source, tempfile.NamedTemporaryFile(dir=path.parent) as plain:
        while block := source.read(_BLOCK):
            plain.write(block)
        plain.flush()
        return _run(kind, Path(plain.name), answer, reading, limits, filename)


def answered(
    read_table: Callable[[Reading], Table], reading: Reading, limits: Limits, answer: Answer, filename: str
) -> Channels | Proposal | ShownTable | None:
    """What is asked of a table, which `read_table` reads. Raises as reading does."""
    if answer == "suggestion":
        return propose(read_table, reading, limits, filename)
    table = read_table(reading)
    return preview(table, reading) if answer == "preview" else to_channels(table, reading, limits)


def not_installed(kind: Format, consequence: str) -> str | None:
    """None if a format's package is installed, else `consequence` (the format cannot be read here) and how to install
    it."""
    _, package, extra = READERS[kind]
    if find_spec(package) is not None:
        return None
    command = f"pip install -e '.[{extra}]'" if extra else "pip install -e ."
    return f"{consequence}, because a library is missing. To install it where the service runs: {command}"


def _run(kind: Format, path: Path, answer: Answer, reading: Reading, limits: Limits, filename: str) -> Any:
    request = {
        "kind": kind,
        "path": str(path.resolve()),
        "filename": filename,
        "answer": answer,
        "reading": asdict(reading),
        "limits": asdict(limits),
    }
    with (
        tempfile.TemporaryFile(dir=path.parent) as result,
        tempfile.TemporaryDirectory(prefix="reader-", dir=path.parent) as folder,
    ):
        try:
            ended = zygote.run(request | {"folder": folder}, result, limits.wall_seconds)
        except TimeoutError:
            raise overdue(kind, limits) from None
        result.seek(0)
        if result.read(len(_STARTED)) != _STARTED and ended != -signal.SIGTERM:
            raise BusyError(
                f"the program that reads {kind} files could not start ({exit_text(ended)}). The file is not the "
                "cause: send it again later. If this repeats, tell the operator of the service"
            )
        if ended == -signal.SIGXCPU:
            raise too_slow(kind, limits)
        if ended == -signal.SIGTERM:
            raise BusyError("the service is shutting down: send the file again later")
        if ended == -signal.SIGABRT and kind is Format.WORKBOOK:  # how a library in Rust ends without memory
            raise _too_much(kind)
        if -ended in _CRASHES:  # in the C code of its library, which is what the process is for
            crash = exit_text(ended)
            why = f"it is damaged or of another type (the library for it ended with {crash})"
            raise _unreadable(kind, why, "reader_crashed")
        if ended:
            raise _broken_off(kind, exit_text(ended))
        return _answer(result, kind, answer, limits)


def _unreadable(kind: Format, why: str, code: str = "unreadable") -> InvalidError:
    message = f"the {kind} file cannot be read: {why}"
    return InvalidError.of(message, code=code)


def _broken_off(kind: Format, how: str) -> InvalidError:
    return _unreadable(
        kind, f"the program that reads it broke off ({how}). Export the file again, or save it in another format"
    )


def _too_much(kind: Format) -> TooLargeError:
    return TooLargeError(f"reading the {kind} file takes more memory than the service allows: send it in smaller parts")


def _answer(result: BinaryIO, kind: Format, wanted: str, limits: Limits) -> Any:
    """The reading process's answer, checked before it is used."""
    try:
        answer = json.loads(result.readline(_LONGEST_ANSWER))
        if "error" in answer:
            raise _error(answer["error"])
        if wanted == "preview":
            return dict(answer["preview"])
        if wanted == "suggestion":
            held = answer["suggestion"]
            return held and Proposal(
                reading=_reading(held["reading"]),
                confidence=float(held["confidence"]),
                titles=tuple(map(str, held["titles"])),
            )
        lengths = {str(name): int(length) for name, length in answer["channels"].items()}
        notices = tuple(Notice(code=str(item["code"]), message=str(item["message"])) for item in answer["notices"])
        counts = bool(answer["counts"])
        labels = {str(name): str(text) for name, text in answer["labels"].items()}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise _broken_off(kind, "no answer") from None
    if not lengths.keys() <= CHANNELS.keys() or not 0 <= sum(lengths.values()) <= limits.most_values:
        raise _broken_off(kind, "no answer")
    values = _mapped(result, kind, sum(lengths.values()))
    ends = np.cumsum([*lengths.values()])
    columns = dict(zip(lengths, np.split(values, ends[:-1]), strict=True))
    return Channels(columns=columns, notices=notices, counts=counts, labels=labels)


def _mapped(result: BinaryIO, kind: Format, size: int) -> FloatArray:
    """The numbers [size] from the answer's present position on, as a memory map of the file with copy on write."""
    offset, end = result.tell(), result.seek(0, os.SEEK_END)
    if size <= 0 or offset % _ALIGNED or end < offset + 8 * size:
        raise _broken_off(kind, "no answer")
    return np.memmap(result, dtype="<f8", mode="c", offset=offset, shape=(size,)).view(np.ndarray)


def _reading(held: Mapping[str, Any]) -> Reading:
    """A reading from its JSON."""
    mapping = {name: ColumnChoice(**choice) for name, choice in held["mapping"].items()}
    return Reading(**{**held, "mapping": mapping, "left_out": list(held["left_out"])})


def _error(answer: Mapping[str, Any]) -> ServiceError:
    error_type = TooLargeError if answer["too_large"] else InvalidError
    errors = [FieldError(**error) for error in answer["errors"]]
    return error_type(str(answer["detail"]), errors=errors, total=int(answer["total"]))


# --- what follows runs in the reading process ---


def main() -> None:
    """The zygote process: forks a child for each file that arrives at the socket, whose number is the first argument."""
    with socket.socket(fileno=int(sys.argv[1])) as control:
        zygote.serve(control, _load, _read)


def _load(request: Mapping[str, Any]) -> None:
    """Load the module that reads a format, for this and further files; an error is reported later by the child."""
    with contextlib.suppress(Exception):
        importlib.import_module(READERS[Format(request["kind"])][0])
        _warm_up()


@lru_cache(maxsize=1)
def _warm_up() -> None:
    """Read a small table, so that compiling and imports at the first use are done once for all files: they take a third
    of the time for a record of a million values."""
    columns = tuple(map(column_of, ("Time [s]", "Pressure [bar]", "Speed [1/min]", "Torque [Nm]")))
    values = np.arange(1.0, 9.0)
    to_channels(Table(columns=columns, read=lambda taken: [values.copy() for _ in taken]), Reading(), LIMITS)


def _read(request: Mapping[str, Any], answer: int) -> None:
    """Read the requested file, in a child process, and write the answer to the open file `answer`."""
    sys.argv[1:] = [str(answer)]
    os.environ.update({"TMPDIR": request["folder"], "HOME": request["folder"]})
    tempfile.tempdir = request["folder"]
    kind, path, limits = Format(request["kind"]), Path(request["path"]), Limits(**request["limits"])
    reading = _reading(request["reading"])
    with os.fdopen(answer, "wb") as result:
        # whatever it loads, and asks of the system, before the doors close
        reader = importlib.import_module(READERS[kind][0])
        close_files(readable=[path], writable=[Path(tempfile.gettempdir())])
        close_network_and_processes()
        _limit(limits)
        result.write(_STARTED)
        result.flush()
        try:
            read_table = partial(reader.read_table, path, limits=limits)
            said = answered(read_table, reading, limits, request["answer"], request["filename"])
            if isinstance(said, Channels):
                _write_channels(result, said)
            else:
                _write(result, {request["answer"]: asdict(said) if isinstance(said, Proposal) else said})
        except ServiceError as error:
            _write_error(result, error)
        except MemoryError:
            _write_error(result, _too_much(kind))
        except BaseException as error:  # noqa: BLE001 (whatever a foreign library raises on a foreign file, Rust's panics too)
            message = re.sub(r"(/[\w.~+-]+)+/", "", str(error))  # without the places of this machine
            _write_error(result, _unreadable(kind, f"{type(error).__name__}: {message[:_MAX_QUOTED]}"))


def _write_channels(result: BinaryIO, channels: Channels) -> None:
    answer = {
        "channels": {name: column.size for name, column in channels.columns.items()},
        "notices": [asdict(notice) for notice in channels.notices],
        "counts": channels.counts,
        "labels": dict(channels.labels),
    }
    line = json.dumps(answer).encode()
    result.write(line + b" " * (-(len(_STARTED) + len(line) + 1) % _ALIGNED) + b"\n")
    for column in channels.columns.values():
        result.write(np.ascontiguousarray(column, dtype="<f8").data)


def _limit(limits: Limits) -> None:
    spent = resource.getrusage(resource.RUSAGE_SELF)
    loaded = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    seconds = math.ceil(limits.seconds + spent.ru_utime + spent.ru_stime)
    resource.setrlimit(
        resource.RLIMIT_CPU, (seconds, seconds + 1)
    )  # first SIGXCPU, which names the cause, then SIGKILL
    for which, most in (
        (resource.RLIMIT_AS, loaded + limits.memory_bytes),
        (resource.RLIMIT_FSIZE, 8 * limits.most_values + _LONGEST_ANSWER),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_NOFILE, _MAX_OPEN_FILES),
    ):
        resource.setrlimit(which, (most, most))


def _write(result: BinaryIO, answer: Mapping[str, Any]) -> None:
    result.write(json.dumps(answer).encode() + b"\n")


def _write_error(result: BinaryIO, error: ServiceError) -> None:
    result.seek(len(_STARTED))
    result.truncate()
    answer = {
        "too_large": isinstance(error, TooLargeError),
        "detail": error.detail[:_LONGEST_DETAIL],
        "errors": [asdict(field_error) for field_error in error.errors],
        "total": error.total,
    }
    _write(result, {"error": answer})


if __name__ == "__main__":
    main()
