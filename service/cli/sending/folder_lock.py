"""A lock that ends with its holder, however the holder ends: the system's lock on an open file."""

import errno
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Seconds between two looks at a lock that another process holds. Chosen: short beside a request.
_LOOK = 0.05
_HELD = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)


class HeldError(Exception):
    """Another process holds the lock."""


@contextmanager
def locked(path: Path, *, patience: float | None = None) -> Iterator[None]:
    """Hold the lock of the file at `path`, which is made; HeldError where another holds it for longer than `patience` [s].

    Without a patience it is waited for. Raises OSError where the file system keeps no locks.
    """
    deadline = None if patience is None else time.monotonic() + patience
    with path.open("ab") as file:
        while not _taken(file.fileno(), path):
            if deadline is not None and time.monotonic() + _LOOK > deadline:
                raise HeldError(str(path))
            time.sleep(_LOOK)
        yield


def _taken(handle: int, path: Path) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt  # only there

            os.lseek(handle, 0, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        else:
            import fcntl  # not on Windows

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _HELD:
            return False
        raise OSError(error.errno, f"{path} cannot be locked ({error.strerror}): choose a local folder") from error
    return True
