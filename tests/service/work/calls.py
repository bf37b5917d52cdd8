"""What the tests of the workers have called; each takes the database first."""

import os
import time
from pathlib import Path
from typing import NoReturn

from service.errors import FieldError, InvalidError
from service.logging import request_id
from storage import clutches
from storage.engine.database import Database
from tests.service.work.waiting import until


def ids(database: Database) -> list[str]:
    """The clutches that the worker's own connection sees."""
    with database.reading() as connection:
        return clutches.all_ids(connection)


def pid(_: object) -> int:
    """The process that works, after a while: others have a call by then."""
    time.sleep(0.05)
    return os.getpid()


def logged(_: Database, log: Path, name: str, gate: Path) -> str:
    """Write begin and end into a log, and wait between them until the gate is there."""
    with log.open("a") as file:
        file.write(f"+{name} ")
    until(gate.exists)
    with log.open("a") as file:
        file.write(f"-{name} ")
    return name


def request(_: Database) -> str:
    """The id of the request that the call is made for."""
    return request_id.get()


def refused(_: Database) -> NoReturn:
    """An error of the service with everything that it says."""
    raise InvalidError("wrong", errors=[FieldError(pointer="/a", code="c", message="m", row=3, value="v")], total=7)


def signalled(_: Database, mark: Path, times: int, number: int) -> str:
    """Have the process end or stand still by a signal, as often as said; then answer."""
    with mark.open("a") as file:
        file.write("x")
    if len(mark.read_text()) <= times:
        os.kill(os.getpid(), number)
    return "alive"


def unsendable(_: Database) -> object:
    """What cannot be pickled."""
    return lambda: None
