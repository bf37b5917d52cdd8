"""What a process and its children take: memory that they hold for themselves, watched, and time of the processor."""

import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

_PAGE = os.sysconf("SC_PAGE_SIZE")


def family(pid: int) -> list[int]:
    """A process and all that it has started, itself first; those that have ended by the time they are looked at left out."""
    found, waiting = [], [pid]
    while waiting:
        number = waiting.pop()
        try:
            for thread in Path(f"/proc/{number}/task").iterdir():
                waiting += map(int, (thread / "children").read_text(encoding="ascii").split())
        except (FileNotFoundError, ProcessLookupError):
            continue  # it has just ended
        found.append(number)
    return found


def held(pid: int) -> int:
    """Bytes of a process and its children: what they share with each other is counted once (`Pss` of /proc)."""
    return int(_total(pid, held_alone))


def resident(pid: int) -> int:
    """Bytes of a process in memory, 0 where it has just ended."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1]) * _PAGE
    except (FileNotFoundError, ProcessLookupError):
        return 0


def held_alone(pid: int) -> int:
    """Bytes of a process; of what it shares with others its part."""
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii")
    return 1024 * sum(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:"))


def processor_seconds(pid: int, *, waited: bool = True) -> float:
    """Time of the processor that a process has taken and, where these count, the children that it has waited for."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return sum(map(int, fields[11 : 15 if waited else 13])) / os.sysconf("SC_CLK_TCK")


def family_seconds(pid: int) -> float:
    """Time of the processor that a process and all that it has started have taken, the ended that it waited for too."""
    return _total(pid, processor_seconds)


def busy_seconds() -> float:
    """Seconds of the processors that the machine has worked since it was started."""
    user, nice, system, _, _, *interrupts = map(int, Path("/proc/stat").read_text(encoding="ascii").split()[1:9])
    return (user + nice + system + sum(interrupts[:2])) / os.sysconf("SC_CLK_TCK")


def _total(pid: int, of: Callable[[int], float]) -> float:
    total = 0.0
    for number in family(pid):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
            total += of(number)
    return total


def added(pid: int, work: Callable[[], object]) -> int:
    """By how many bytes a process and its children grow at most while some work is being done."""
    rest, seen, done = held(pid), [0], threading.Event()

    def watch() -> None:
        while not done.wait(0.02):
            seen.append(held(pid))

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        work()
    finally:
        done.set()
        watching.join()
    return max(seen) - rest
