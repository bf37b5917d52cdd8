"""What executors are asked to do in the tests: functions that other processes can import."""

import os
import signal
import time
from pathlib import Path

from threadpoolctl import threadpool_info


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


def pid(_: int) -> int:
    """The process's number, after a while."""
    time.sleep(0.05)
    return os.getpid()


def forever(_: int) -> None:
    """It does not end by itself."""
    time.sleep(600)
