"""What the tests of workers and executors have called, in processes that import it; a worker gives the database first."""

import os
import signal
import time
from pathlib import Path
from typing import NoReturn

from threadpoolctl import threadpool_info

from service.errors import FieldError, InvalidError
from service.logging import request_id
from storage import clutches
from storage.engine.database import Database
from tests.service.jobs.waiting import until


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


class OddError(Exception):
    """An error whose pickled form cannot be read."""

    def __init__(self, first: int, second: int) -> None:
        super().__init__(f"{first} is odd, {second} too")


def squared(number: int) -> float:
    """The square; an odd number's error cannot be pickled, and a negative number has one that can."""
    if number < 0:
        raise ValueError(f"{number} is negative")
    if number % 7 == 3:
        raise OddError(number, number)
    return float(number) ** 2 / 3.0


def slow_first(number: int) -> int:
    """The first input takes the longest."""
    time.sleep(1.0 if number == 0 else 0.0)
    return number


def threads(_: int) -> set[int]:
    """Threads of linear algebra's libraries in the process."""
    import numpy as np  # start-up time of the other tests' processes

    assert np.linalg.norm(np.eye(3)) > 1.0
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def killed_once(place: tuple[str, int]) -> int:
    """The process that computes the number 3 is killed, the first time."""
    folder, number = place
    mark = Path(folder) / "killed"
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02)
    return number


def killed_always(number: int) -> int:
    """The process that computes the number 3 is killed each time."""
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def forever(_: int) -> None:
    """It does not end by itself."""
    while True:
        time.sleep(600)
