"""TDMS, MDF4 and Parquet files are read in a process of their own, with limits on its memory, time, output and reach.

The libraries that read them are large, and a broken or malicious file may make them loop, exhaust memory or crash: that
ends the reading process only. It can open the file, our code and a folder of its own, and no socket (`confinement`). It
returns one file: a line of JSON (the columns' lengths, or an error), then the columns as raw little-endian float64. Nothing
that came from the file is ever unpickled or evaluated.
"""

import importlib
import json
import math
import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from models.arrays import FloatArray
from service.columns import CHANNELS
from service.errors import BusyError, FieldError, InvalidError, ServiceError, TooLargeError
from service.readers.confinement import close_files, close_network_and_processes
from service.readers.detect import Format, is_packed, opened
from service.readers.limits import Limits

#: The module that reads each format, the package it needs, and the extra of ours that installs that package.
READERS = {
    Format.TDMS: ("service.readers.tdms", "nptdms", "tdms"),
    Format.MDF4: ("service.readers.mdf4", "asammdf", "mdf"),
    Format.PARQUET: ("service.readers.parquet", "pyarrow", "parquet"),
}

#: Bytes of the line of JSON that the reading process answers with.
_LONGEST_ANSWER = 1 << 16
_BLOCK = 1 << 20
#: Characters of a foreign library's message that ours quotes, and of a whole message.
_MOST_QUOTED, _LONGEST_DETAIL = 200, 4000
#: Files that the reading process has open at once. Chosen: importing the libraries takes a dozen.
_MOST_OPEN_FILES = 64
#: Added to the limit on reading, for the interpreter to start and import the library.
_STARTING_SECONDS = 10
#: Environment variables that the reading process gets; no others, so no keys.
_ENVIRONMENT = (
    "PATH",
    "PYTHONPATH",
    "LANG",
    "LC_ALL",
    "LD_LIBRARY_PATH",
    "XDG_CACHE_HOME",
    "MPLCONFIGDIR",
)


def read_isolated(kind: Format, path: Path, *, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    """The channels [n] of a TDMS, MDF4 or Parquet file in their own units, read in a process of its own.

    What is unpacked is kept beside the file meanwhile.
    Raises InvalidError where the file cannot be read, needs an extra that is not installed, or makes its reader crash or
    take too long; TooLargeError where it needs more memory than is allowed or holds more values; BusyError where somebody
    else ended its reader.
    """
    _require(kind)
    if not is_packed(path):
        return _run(kind, path, mapping, limits)
    with tempfile.NamedTemporaryFile(dir=path.parent) as plain:
        with opened(path, limits) as source:
            while block := source.read(_BLOCK):
                plain.write(block)
        plain.flush()
        return _run(kind, Path(plain.name), mapping, limits)


def _require(kind: Format) -> None:
    _, package, extra = READERS[kind]
    if find_spec(package) is None:
        message = f"{kind} is not read here: install clutchlife[{extra}]"
        raise InvalidError(message, errors=[FieldError(pointer="", code="format_not_installed", message=message)])


def _run(kind: Format, path: Path, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    request = {"kind": kind, "path": str(path.resolve()), "mapping": mapping, "limits": asdict(limits)}
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
                timeout=limits.seconds + _STARTING_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise _too_slow(kind, limits) from None
        if ended.returncode == -signal.SIGXCPU:
            raise _too_slow(kind, limits)
        if ended.returncode == -signal.SIGTERM:
            raise BusyError("the service is ending: send the file again in a little while")
        if ended.returncode:
            raise _unreadable(kind, f"its reader ended with {_ending(ended.returncode)}")
        result.seek(0)
        return _answer(result, kind, limits)


def _too_slow(kind: Format, limits: Limits) -> InvalidError:
    return _unreadable(kind, f"it took longer than {limits.seconds} s", "too_slow")


def _unreadable(kind: Format, why: str, code: str = "unreadable") -> InvalidError:
    message = f"the {kind} file cannot be read: {why}"
    return InvalidError(message, errors=[FieldError(pointer="", code=code, message=message)])


def _ending(code: int) -> str:
    try:
        return signal.Signals(-code).name if code < 0 else f"status {code}"
    except ValueError:
        return f"signal {-code}"


def _answer(result: BinaryIO, kind: Format, limits: Limits) -> dict[str, FloatArray]:
    """The columns that the reading process wrote; its answer is checked before it is used."""
    try:
        answer = json.loads(result.readline(_LONGEST_ANSWER))
        if "error" in answer:
            raise _error(answer["error"])
        lengths = {str(name): int(length) for name, length in answer["channels"].items()}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise _unreadable(kind, "its reader gave no answer") from None
    if not lengths.keys() <= CHANNELS.keys() or not 0 <= sum(lengths.values()) <= limits.most_values:
        raise _unreadable(kind, "its reader gave no answer")
    columns = {name: np.empty(max(0, length)) for name, length in lengths.items()}
    for column in columns.values():
        if result.readinto(column.data) != column.nbytes:  # type: ignore[attr-defined]
            raise _unreadable(kind, "its reader gave no answer")
    return columns


def _error(answer: Mapping[str, Any]) -> ServiceError:
    error_type = TooLargeError if answer["too_large"] else InvalidError
    errors = [FieldError(**error) for error in answer["errors"]]
    return error_type(str(answer["detail"]), errors=errors, total=int(answer["total"]))


# --- what follows runs in the reading process ---


def main() -> None:
    """Read the file that standard input names; write the answer to the open file whose number is the first argument."""
    request = json.load(sys.stdin)
    kind, limits = Format(request["kind"]), Limits(**request["limits"])
    with os.fdopen(int(sys.argv[1]), "wb") as result:
        _limit(limits)
        path = Path(request["path"])
        close_files(readable=[path], writable=[Path(tempfile.gettempdir())])
        try:
            reader = importlib.import_module(READERS[kind][0])  # whose libraries ask programs about the processor
            close_network_and_processes()
            columns: dict[str, FloatArray] = reader.read(path, request["mapping"], limits)
            _write(result, {"channels": {name: column.size for name, column in columns.items()}})
            for column in columns.values():
                result.write(np.ascontiguousarray(column, dtype="<f8").data)
        except ServiceError as error:
            _write_error(result, error)
        except MemoryError:
            _write_error(result, TooLargeError(f"the {kind} file needs more memory than reading a file may take"))
        except Exception as error:  # noqa: BLE001 (whatever a foreign library raises on a foreign file)
            _write_error(result, _unreadable(kind, f"{type(error).__name__}: {str(error)[:_MOST_QUOTED]}"))


def _limit(limits: Limits) -> None:
    for which, most, over in (
        (resource.RLIMIT_AS, limits.memory_bytes, 0),
        (resource.RLIMIT_CPU, math.ceil(limits.seconds), 1),  # first SIGXCPU, which names the cause, then SIGKILL
        (resource.RLIMIT_FSIZE, 8 * limits.most_values + _LONGEST_ANSWER, 0),
        (resource.RLIMIT_CORE, 0, 0),
        (resource.RLIMIT_NOFILE, _MOST_OPEN_FILES, 0),
    ):
        resource.setrlimit(which, (most, most + over))


def _write(result: BinaryIO, answer: Mapping[str, Any]) -> None:
    result.write(json.dumps(answer).encode() + b"\n")


def _write_error(result: BinaryIO, error: ServiceError) -> None:
    result.seek(0)
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
