"""Files that no other user of the machine may read, from the moment they are made: they hold what keys protect.

SQLite gives its log, and the index of its log, the mode of the database file. A file that is there keeps its mode: whoever
made it readable meant it.
"""

import os
from contextlib import suppress
from pathlib import Path

#: Its owner reads and writes, nobody else does either.
MODE = 0o600


def make_new(path: Path) -> None:
    """Make an empty file. Raises FileExistsError where something is there."""
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, MODE))


def make_if_missing(path: Path) -> None:
    """Make an empty file where nothing is there."""
    with suppress(FileExistsError):
        make_new(path)
