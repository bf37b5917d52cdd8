"""The open database as the rest of the program holds it, whichever kind it is. Made by `opening`."""

from abc import ABC, abstractmethod
from contextlib import AbstractContextManager
from pathlib import Path

from sqlalchemy import Connection

from storage.engine.shared_answers import SharedAnswers
from storage.engine.watch import Watch


class Database(ABC):
    """An open database: its transactions, what is asked of it outside them, and its health. Threads share it.

    `url` is the address by which another process opens it, which may hold a password; `path` its file, None where it is on a
    server; `journal_mode` is SQLite's. `answers` are those that its services share, None where it has one service.
    """

    url: str
    path: Path | None
    journal_mode: str | None
    watch: Watch
    answers: SharedAnswers | None = None

    @abstractmethod
    def reading(self) -> AbstractContextManager[Connection]:
        """A connection that sees one state of the database until the block ends."""

    @abstractmethod
    def writing(self, *, of: str | None = None) -> AbstractContextManager[Connection]:
        """A connection that alone writes: committed when the block ends, rolled back on any exception.

        `of` names a clutch, or another thing of which alone the block writes: where the database can have several writers
        at once, it is then the only one of that thing. None: the only one of all.

        Raises DatabaseBusy where another writes for too long, StorageUnavailable where the database cannot be written.
        """

    @abstractmethod
    def faults(self, *, least_free: int) -> dict[str, str]:
        """What keeps the database (`database`) or its disk (`disk`) from being used, in words; empty where nothing does.

        `least_free` [byte] must be free on the disk. Nothing is written, and no lock is taken or waited for.
        """

    @abstractmethod
    def damage(self, connection: Connection) -> list[str]:
        """What is wrong with the content of the storage below the rows, in words; empty where nothing is."""

    @abstractmethod
    def close(self) -> None:
        """Close all connections; any later use raises StorageUnavailable. May be called twice."""
