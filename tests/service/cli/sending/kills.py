"""A process that is killed before any of its operations on files: every open, rename, removal and new folder."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_OPERATIONS = ("open", "os.rename", "os.remove", "os.mkdir", "os.truncate")


class KilledError(BaseException):
    """The process is gone; nothing catches it."""


class _Killer:
    """Counts operations on files below a folder; from the fatal one on, none is carried out."""

    def __init__(self) -> None:
        self.folder: str | None = None
        self.left = 0
        self.installed = False

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if self.folder is None or event not in _OPERATIONS or not str(arguments[0]).startswith(self.folder):
            return
        if self.left == 0:
            raise KilledError(f"{event} {arguments}")
        self.left -= 1


_killer = _Killer()


@contextmanager
def killed_before(operation: int, folder: object) -> Iterator[None]:
    """Kill what happens inside before its operation of that number, from 0."""
    if not _killer.installed:
        sys.addaudithook(_killer)
        _killer.installed = True
    _killer.folder, _killer.left = str(folder), operation
    try:
        yield
    finally:
        _killer.folder = None


def every_kill(folder_of: Callable[[int], object], act: Callable[[int], None]) -> Iterator[int]:
    """Carry out `act` once for each of its operations, killed before that; ends when it came through."""
    operation = 0
    while True:
        try:
            with killed_before(operation, folder_of(operation)):
                act(operation)
        except KilledError:
            yield operation
            operation += 1
        else:
            assert operation > 3, "hardly anything was done"
            return
