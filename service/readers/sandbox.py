"""Foreign binary files are read in a process of their own, with limits on its memory, time and output.

The libraries that read TDMS, MDF4 and Parquet are large, and a broken or malicious file may make them loop, eat memory or
crash: then a process ends that nobody else lives in. It hands back one file: a line of JSON that says what follows, then the
columns as raw little-endian float64. Nothing that came from the file is ever unpickled or evaluated.
"""

import importlib
import json
import math
import os
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
from service.errors import FieldError, InvalidError, ServiceError, TooLargeError
from service.readers.detect import Format, is_packed, opened
from service.readers.limits import Limits
from service.readers.units import CHANNELS

#: Where each format is read, which package that needs, and the extra of ours that installs it.
READERS = {
    Format.TDMS: ("service.readers.tdms", "nptdms", "tdms"),
    Format.MDF4: ("service.readers.mdf4", "asammdf", "mdf"),
    Format.PARQUET: ("service.readers.parquet", "pyarrow", "parquet"),
}

_LONGEST_ANSWER = 1 << 16
_BLOCK = 1 << 20
_SHOWN = 200
_STARTING_SECONDS = 10
_PASSED_ON = (
    "PATH",
    "PYTHONPATH",
    "LANG",
    "LC_ALL",
    "HOME",
    "TMPDIR",
    "LD_LIBRARY_PATH",
    "XDG_CACHE_HOME",
    "MPLCONFIGDIR",
)


def read_isolated(kind: Format, path: Path, *, mapping: str | None, limits: Limits) -> dict[str, FloatArray]:
    """The channels [n] of a TDMS, MDF4 or Parquet file in their own units, read in a process of its own.

    Raises InvalidError where the file cannot be read, needs an extra that is not installed, or makes its reader crash or
    take too long; TooLargeError where it needs more memory than is allowed or holds more values.
    """
    _require(kind)
    if not is_packed(path):
        return _run(kind, path, mapping, limits)
    with tempfile.NamedTemporaryFile(prefix="clutchlife-") as plain:
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
    asked = {"kind": kind, "path": str(path.resolve()), "mapping": mapping, "limits": asdict(limits)}
    environment = {name: os.environ[name] for name in _PASSED_ON if name in os.environ}
    # Threads of their own would only reserve memory: the limit is on what is reserved.
    environment |= {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "NUMEXPR_MAX_THREADS": "1"}
    environment |= {"ARROW_DEFAULT_MEMORY_POOL": "system", "MALLOC_ARENA_MAX": "2", "PYTHONIOENCODING": "utf-8"}
    with tempfile.TemporaryFile(prefix="clutchlife-") as result:
        arguments = [sys.executable, "-P", "-W", "ignore", "-m", "service.readers.sandbox", str(result.fileno())]
        try:
            ended = subprocess.run(  # noqa: S603 (our own interpreter and module)
                arguments,
                input=json.dumps(asked).encode(),
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
    """What the reading process wrote, believed no further than it can be checked."""
    try:
        said = json.loads(result.readline(_LONGEST_ANSWER))
        if "error" in said:
            raise _error(said["error"])
        lengths = {str(name): int(length) for name, length in said["channels"].items()}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise _unreadable(kind, "its reader gave no answer") from None
    if not lengths.keys() <= CHANNELS.keys() or not 0 <= sum(lengths.values()) <= limits.most_values:
        raise _unreadable(kind, "its reader gave no answer")
    columns = {name: np.empty(max(0, length)) for name, length in lengths.items()}
    for column in columns.values():
        if result.readinto(column.data) != column.nbytes:  # type: ignore[attr-defined]
            raise _unreadable(kind, "its reader gave no answer")
    return columns


def _error(said: Mapping[str, Any]) -> ServiceError:
    sort = TooLargeError if said["too_large"] else InvalidError
    return sort(str(said["detail"]), errors=[FieldError(**each) for each in said["errors"]], total=int(said["total"]))


# --- what follows runs in the reading process ---


def main() -> None:
    """Read the file that standard input names and write the answer to the file that the first argument numbers."""
    asked = json.load(sys.stdin)
    kind, limits = Format(asked["kind"]), Limits(**asked["limits"])
    with os.fdopen(int(sys.argv[1]), "wb") as result:
        _limit(limits)
        try:
            reader = importlib.import_module(READERS[kind][0])
            columns: dict[str, FloatArray] = reader.read(Path(asked["path"]), asked["mapping"], limits)
            _write(result, {"channels": {name: column.size for name, column in columns.items()}})
            for column in columns.values():
                result.write(np.ascontiguousarray(column, dtype="<f8").data)
        except ServiceError as error:
            _write_error(result, error)
        except MemoryError:
            _write_error(result, TooLargeError(f"the {kind} file needs more memory than is allowed for reading one"))
        except Exception as error:  # noqa: BLE001 (whatever a foreign library raises on a foreign file)
            _write_error(result, _unreadable(kind, f"{type(error).__name__}: {str(error)[:_SHOWN]}"))


def _limit(limits: Limits) -> None:
    import resource

    for which, most, over in (
        (resource.RLIMIT_AS, limits.memory_bytes, 0),
        (resource.RLIMIT_CPU, math.ceil(limits.seconds), 1),  # SIGXCPU first, which says why; then SIGKILL
        (resource.RLIMIT_FSIZE, 8 * limits.most_values + _LONGEST_ANSWER, 0),
        (resource.RLIMIT_CORE, 0, 0),
    ):
        resource.setrlimit(which, (most, most + over))


def _write(result: BinaryIO, said: Mapping[str, Any]) -> None:
    result.write(json.dumps(said).encode() + b"\n")


def _write_error(result: BinaryIO, error: ServiceError) -> None:
    result.seek(0)
    result.truncate()
    said = {
        "too_large": isinstance(error, TooLargeError),
        "detail": error.detail[:4000],
        "errors": [asdict(each) for each in error.errors],
        "total": error.total,
    }
    _write(result, {"error": said})


if __name__ == "__main__":
    main()
