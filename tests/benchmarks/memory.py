"""What memory a process and its children hold for themselves, watched while something happens."""

import threading
from collections.abc import Callable
from pathlib import Path


def held(pid: int) -> int:
    """Bytes of a process and its children: what they share with each other is counted once (`Pss` of /proc)."""
    total, waiting = 0, [pid]
    while waiting:
        process = Path(f"/proc/{waiting.pop()}")
        try:
            told = (process / "smaps_rollup").read_text(encoding="ascii")
            total += 1024 * sum(int(line.split()[1]) for line in told.splitlines() if line.startswith("Pss:"))
            for thread in (process / "task").iterdir():
                waiting += map(int, (thread / "children").read_text(encoding="ascii").split())
        except (FileNotFoundError, ProcessLookupError):
            continue  # it has just ended
    return total


def added(pid: int, work: Callable[[], object], every: float = 0.02) -> int:
    """By how many bytes a process and its children grow at most while some work is being done; looked at `every` s."""
    rest, seen, done = held(pid), [0], threading.Event()

    def watch() -> None:
        while not done.wait(every):
            seen.append(held(pid))

    watching = threading.Thread(target=watch)
    watching.start()
    try:
        work()
    finally:
        done.set()
        watching.join()
    return max(seen) - rest
