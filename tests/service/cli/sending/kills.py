"""A process that is killed before any of its operations on files: every open, rename, removal and new folder, and every
statement of a database."""

import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

_OPERATIONS = ("open", "os.rename", "os.remove", "os.mkdir", "os.truncate", "sqlite3.connect")


class KilledError(BaseException):
    """The process is gone; nothing catches it."""


class _Killer:
    """Counts operations on files below a folder; from the fatal one on, none is carried out."""

    def __init__(self) -> None:
        self.folder: str | None = None
        self.left = 0
        self.installed = False

    def __call__(self, event: str, arguments: tuple[object, ...]) -> None:
        if event in _OPERATIONS and self.folder is not None and str(arguments[0]).startswith(self.folder):
            self.count(event, arguments)

    def count(self, event: str, arguments: tuple[object, ...]) -> None:
        """An operation, which is not carried out where it is the fatal one or comes after it."""
        if self.folder is None:
            return
        if self.left == 0:
            raise KilledError(f"{event} {arguments}")
        self.left -= 1


_killer = _Killer()


class _Connection(sqlite3.Connection):
    """A database whose statements are operations on its file."""

    def execute(self, *arguments: Any) -> sqlite3.Cursor:
        _killer.count("statement", arguments)
        return super().execute(*arguments)

    def executemany(self, *arguments: Any) -> sqlite3.Cursor:
        _killer.count("statement", arguments)
        return super().executemany(*arguments)


_connect = sqlite3.connect


@contextmanager
def killed_before(operation: int, folder: object) -> Iterator[None]:
    """Kill what happens inside before its operation of that number, from 0."""
    if not _killer.installed:
        sys.addaudithook(_killer)
        _killer.installed = True
    _killer.folder, _killer.left = str(folder), operation
    sqlite3.connect = partial(_connect, factory=_Connection)  # type: ignore[assignment]
    try:
        yield
    finally:
        _killer.folder, sqlite3.connect = None, _connect


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
