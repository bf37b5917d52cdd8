"""One service of a database at a time: a lock beside the file, `FILE-service`, which ends with its holder.

A second service would take the first one's diagnoses for those of a service that has died. Commands beside a service need no
such lock; they hold it only while they change what every service relies on: the schema, or the whole file.
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import BinaryIO

from storage.engine.errors import ServiceRuns, StorageUnavailable
from storage.engine.sqlite.private_files import MODE


@contextmanager
def service_lock(path: Path) -> Iterator[None]:
    """Hold the lock of the database at `path` inside.

    Raises ServiceRuns where another holds it, StorageUnavailable where its file cannot be made.
    """
    beside = path.with_name(f"{path.name}-service")
    with closing(_opened(beside)) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = file.read(20).decode(errors="replace").strip()
            raise ServiceRuns(
                f"{path}: a service uses this database already (process {holder or 'unknown'}): stop it first"
            ) from None
        file.truncate(0)
        file.write(str(os.getpid()).encode())
        file.flush()
        yield


def _opened(path: Path) -> BinaryIO:
    try:
        return open(os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, MODE), "rb+")  # noqa: PTH123  (a descriptor)
    except OSError as error:
        raise StorageUnavailable(f"{path}: the lock of the database cannot be opened ({error})") from error
