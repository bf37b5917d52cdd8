"""Formats with a library of their own are read in a process of their own, with limits on its memory, time, output and reach.

The libraries are large, and a broken or malicious file may make them loop, exhaust memory or crash: that ends the reading
process only. It loads its library first, and from then on it can open the file, our code and a folder of its own, and no
socket (`confinement`). It returns one file: a line of JSON (the columns' lengths and notices, a preview, or an error), then
the columns as raw little-endian float64. Nothing that came from the file is ever unpickled or evaluated.
"""

import importlib
import json
import math
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from service.channels import CHANNELS
from service.errors import BusyError, FieldError, InvalidError, Notice, ServiceError, TooLargeError, exit_text
from service.readers.assemble import Channels, to_channels
from service.readers.confinement import close_files, close_network_and_processes
from service.readers.detect import Format, is_packed, opened, overdue, too_slow
from service.readers.limits import Limits
from service.readers.preview import preview
from service.readers.suggest import Proposal, propose
from service.readers.table import ColumnChoice, Reading

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
#: Characters of a foreign library's message that ours quotes, and of a whole message.
_MAX_QUOTED, _LONGEST_DETAIL = 200, 4000
#: How C code ends on a file that it does not bear.
_CRASHES = (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT)
#: Files that the reading process has open at once. Chosen: importing the libraries takes a dozen.
_MAX_OPEN_FILES = 64
#: Environment variables that the reading process gets; no others, so no keys.
_ENVIRONMENT = ("PATH", "PYTHONPATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "XDG_CACHE_HOME", "MPLCONFIGDIR")


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


def not_installed(kind: Format, consequence: str) -> str | None:
    """None where a format's package is installed, else `consequence` (a format is not read here) and how to install it."""
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
    environment = {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}
    # Further threads would only reserve memory: the limit is on reserved memory.
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMEXPR_MAX_THREADS": "1"}
    environment |= {"ARROW_DEFAULT_MEMORY_POOL": "system", "MALLOC_ARENA_MAX": "2", "PYTHONIOENCODING": "utf-8"}
    with (
        tempfile.TemporaryFile(dir=path.parent) as result,
        tempfile.TemporaryDirectory(prefix="reader-", dir=path.parent) as folder,
    ):
        environment |= {"TMPDIR": folder, "HOME": folder}
        arguments = [sys.executable, "-P", "-W", "ignore", "-m", "service.readers.sandbox", str(result.fileno())]
        try:
            ended = subprocess.run(  # noqa: S603 (our own interpreter and module)
                arguments,
                input=json.dumps(request).encode(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[result.fileno()],
                env=environment,
                timeout=limits.wall_seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise overdue(kind, limits) from None
        result.seek(0)
        if result.read(len(_STARTED)) != _STARTED and ended.returncode != -signal.SIGTERM:
            raise BusyError(
                f"the program that reads {kind} files could not start ({exit_text(ended.returncode)}). The file is not the "
                "cause: send it again later. If this repeats, tell the operator of the service"
            )
        if ended.returncode == -signal.SIGXCPU:
            raise too_slow(kind, limits)
        if ended.returncode == -signal.SIGTERM:
            raise BusyError("the service is shutting down: send the file again later")
        if ended.returncode == -signal.SIGABRT and kind is Format.WORKBOOK:  # how a library in Rust ends without memory
            raise _too_much(kind)
        if -ended.returncode in _CRASHES:  # in the C code of its library, which is what the process is for
            crash = exit_text(ended.returncode)
            why = f"it is damaged or of another type (the library for it ended with {crash})"
            raise _unreadable(kind, why, "reader_crashed")
        if ended.returncode:
            raise _broken_off(kind, exit_text(ended.returncode))
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
    """What the reading process wrote; its answer is checked before it is used."""
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
    columns = {name: np.empty(max(0, length)) for name, length in lengths.items()}
    for column in columns.values():
        if result.readinto(column.data) != column.nbytes:  # type: ignore[attr-defined]
            raise _broken_off(kind, "no answer")
    return Channels(columns=columns, notices=notices, counts=counts, labels=labels)


def _reading(held: Mapping[str, Any]) -> Reading:
    """A reading as JSON has it."""
    mapping = {name: ColumnChoice(**choice) for name, choice in held["mapping"].items()}
    return Reading(**{**held, "mapping": mapping, "left_out": list(held["left_out"])})


def _error(answer: Mapping[str, Any]) -> ServiceError:
    error_type = TooLargeError if answer["too_large"] else InvalidError
    errors = [FieldError(**error) for error in answer["errors"]]
    return error_type(str(answer["detail"]), errors=errors, total=int(answer["total"]))


# --- what follows runs in the reading process ---


def main() -> None:
    """Read the file that standard input names; write the answer to the open file whose number is the first argument."""
    request = json.load(sys.stdin)
    kind, path, limits = Format(request["kind"]), Path(request["path"]), Limits(**request["limits"])
    reading = _reading(request["reading"])
    with os.fdopen(int(sys.argv[1]), "wb") as result:
        # whatever it loads, and asks of the system, before the doors close
        reader = importlib.import_module(READERS[kind][0])
        close_files(readable=[path], writable=[Path(tempfile.gettempdir())])
        close_network_and_processes()
        _limit(limits)
        result.write(_STARTED)
        result.flush()
        try:
            read_table = partial(reader.read_table, path, limits=limits)
            if request["answer"] == "suggestion":
                proposed = propose(read_table, reading, limits, request["filename"])
                _write(result, {"suggestion": proposed and asdict(proposed)})
            elif request["answer"] == "preview":
                _write(result, {"preview": preview(read_table(reading), reading)})
            else:
                _write_channels(result, to_channels(read_table(reading), reading, limits))
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
    _write(result, answer)
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
