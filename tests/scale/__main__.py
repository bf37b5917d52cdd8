"""`make scale`: what requests and commands cost with many clutches in one file, beside few, as Markdown.

Both services run side by side and are asked in turn, so that what else the machine does falls on both.
"""

import argparse
import json
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx2

from models.rig import campaign
from service.run_files.simulated import simulated_body
from storage.engine.sqlite.database import back_up
from tests.benchmarks.memory import held
from tests.scale.copies import kilobytes, life, multiply, name
from tests.support import serving

FEW, ROUNDS = 10, 30
JSON = {"Content-Type": "application/json"}

#: Milliseconds by what was asked.
Times = defaultdict[str, list[float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a file of so many clutches costs: its bytes, bytes a second of a backup, bytes of the service that was asked."""

    size: int
    backup: float
    memory: int
    times: Times


def bodies(count: int) -> list[bytes]:
    """The stationary runs of one simulated life, tested past its end."""
    runs = campaign.simulate(1, stop_fraction=0.01, most_tests=count)
    return [json.dumps(simulated_body(run)).encode() for run in runs if run.plateaus is not None]


def timed(times: Times, title: str, work: Callable[[], httpx2.Response]) -> None:
    start = time.perf_counter()
    answer = work()
    times[title].append(1e3 * (time.perf_counter() - start))
    answer.raise_for_status()


def asked(http: httpx2.Client, runs: list[bytes], states: int, times: Times) -> Iterator[None]:
    """Runs of new clutches; then, of clutches that have so many, one run more and what pages ask; one step at a time."""

    def post(clutch: str, number: int) -> httpx2.Response:
        return http.post(f"/v1/clutches/{clutch}/runs", content=runs[number], headers=JSON)

    for clutch in ("new-1", "new-2", "new-3"):
        http.post("/v1/clutches", json={"clutch_id": clutch}).raise_for_status()
        for number in range(10):
            title = "POST a run to a clutch of 4 to 9" if number > 3 else "POST a run to a clutch of 0 to 3"
            timed(times, title, lambda c=clutch, n=number: post(c, n))  # type: ignore[misc]
            yield
    for number in range(ROUNDS):
        clutch = name(number % FEW)
        title = f"POST a run to a clutch of {states}"
        timed(times, title, lambda c=clutch, n=number: post(c, states + n // FEW))  # type: ignore[misc]
        for title, address in (
            ("GET remaining life", f"/v1/clutches/{clutch}/remaining-useful-life"),
            ("GET runs, 10 of them", f"/v1/clutches/{clutch}/runs?limit=10"),
            ("GET clutches, the first 10", "/v1/clutches?limit=10"),
            ("GET metrics", "/metrics"),
            ("GET readyz", "/readyz"),
        ):
            timed(times, title, lambda a=address: http.get(a))  # type: ignore[misc]
            yield


def backed_up(path: Path) -> float:
    """Bytes a second of a backup."""
    target = path.with_suffix(".copy")
    start = time.perf_counter()
    back_up(f"sqlite:///{path}", target)
    taken = time.perf_counter() - start
    target.unlink()
    return path.stat().st_size / taken


def side_by_side(paths: list[Path], runs: list[bytes], states: int) -> list[Found]:
    """What a service on each file costs, asked in turn."""
    backups = [backed_up(path) for path in paths]
    few, many = (serving(path) for path in paths)
    times: list[Times] = [defaultdict(list) for _ in paths]
    with few as first, many as second:
        clients = [httpx2.Client(base_url=server.url, timeout=60) for server in (first, second)]
        steps = [asked(http, runs, states, taken) for http, taken in zip(clients, times, strict=True)]
        for _ in zip(*steps, strict=True):
            pass
        taken = [held(server.pid) for server in (first, second)]
    return [
        Found(size=path.stat().st_size, backup=backup, memory=bytes_, times=each)
        for path, backup, bytes_, each in zip(paths, backups, taken, times, strict=True)
    ]


def main(clutches: int, states: int) -> None:
    """The table."""
    runs = bodies(states + ROUNDS)
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "one.db"
        life(source, runs[:states])
        sizes = kilobytes(source)
        paths = [Path(folder) / f"{count}.db" for count in (FEW, clutches)]
        for count, path in zip((FEW, clutches), paths, strict=True):
            multiply(source, path, count)
        few, many = side_by_side(paths, runs, states)
    print(f"\n| clutches of {states} stationary tests | {FEW} | {clutches} | ratio |\n|---|---|---|---|")
    for title in few.times:
        beside, here = statistics.median(few.times[title]), statistics.median(many.times[title])
        print(f"| {title}, ms | {beside:.2f} | {here:.2f} | {here / beside:.2f} |")
    for title, beside, here in (
        ("backup, MB/s", few.backup / 1e6, many.backup / 1e6),
        ("memory of the service and its workers, MB", few.memory / 1e6, many.memory / 1e6),
        ("the file, MB", few.size / 1e6, many.size / 1e6),
    ):
        print(f"| {title} | {beside:.0f} | {here:.0f} | {here / beside:.2f} |")
    filters = sizes.pop("filters")
    each = ", ".join(f"{title} {size:.1f} kB" for title, size in sizes.items())
    print(f"\nA run takes {each}, a clutch's filters {filters:.0f} kB.")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--clutches", type=int, default=1_000)
    parser.add_argument("--states", type=int, default=200, help="stationary tests of each")
    arguments = parser.parse_args()
    main(arguments.clutches, arguments.states)
