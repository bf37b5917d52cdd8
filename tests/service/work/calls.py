"""What the tests of the workers have called; each takes the database first."""

import os
import signal
import time
from pathlib import Path
from typing import NoReturn

from service.errors import FieldError, InvalidError
from service.logging import request_id
from storage import clutches
from storage.engine.database import Database


def ids(database: Database) -> list[str]:
    """The clutches that the worker's own connection sees."""
    with database.reading() as connection:
        return clutches.all_ids(connection)


def pid(_: Database) -> int:
    """The process that works."""
    return os.getpid()


def logged(_: Database, log: Path, name: str, gate: Path) -> str:
    """Write begin and end into a log, and wait between them until the gate is there."""
    with log.open("a") as file:
        file.write(f"+{name} ")
    deadline = time.monotonic() + 60
    while not gate.exists():
        if time.monotonic() > deadline:
            raise TimeoutError(f"{gate} was not made")
        time.sleep(0.005)
    with log.open("a") as file:
        file.write(f"-{name} ")
    return name


def request(_: Database) -> str:
    """The id of the request that the call is made for."""
    return request_id.get()


def refused(_: Database) -> NoReturn:
    """An error of the service with everything that it says."""
    raise InvalidError("wrong", errors=[FieldError(pointer="/a", code="c", message="m", row=3, value="v")], total=7)


def dies(_: Database, mark: Path, times: int) -> str:
    """End the process at once, as often as said; then answer."""
    with mark.open("a") as file:
        file.write("x")
    if len(mark.read_text()) <= times:
        os._exit(9)
    return "alive"


def stops(_: Database, mark: Path, times: int) -> str:
    """Have the process stand still, as often as said; then answer."""
    with mark.open("a") as file:
        file.write("x")
    if len(mark.read_text()) <= times:
        os.kill(os.getpid(), signal.SIGSTOP)
    return "alive"


def unsendable(_: Database) -> object:
    """What cannot be pickled."""
    return lambda: None
