"""`python -m tests.lab.scale.replay`: a replay of many clutches in this process, in a pool, and on a Dask cluster of which
one worker is killed midway. Prints what each takes, and fails unless all three store the same rows.

Each begins with the same file: copies of one simulated life, whose results are those of the first copy until they are
computed again. Times of the processor are those of one core, whatever else runs on the machine.
"""

import argparse
import os
import resource
import shutil
import signal
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from service import repository
from service.changes.replay import clutch_ids, replay
from service.jobs.executor import executor_of
from storage.engine.database import Database
from storage.engine.opening import open_database
from storage.tables import clutch, corrected_cof, filter_state, fit, prediction, run
from storage.transfer import digest
from tests.lab.measuring import table
from tests.lab.scale.copies import bodies, life, multiply
from tests.service.jobs.clusters import local_cluster

#: The tables that hold results.
RESULTS = (clutch, run, fit, prediction, filter_state, corrected_cof)
PROFILED = 5

Digests = dict[str, tuple[int, str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What an executor took [s], and what it stored."""

    seconds: float
    stored: Digests


def source(path: Path, states: int, clutches: int) -> None:
    """A file with a life of so many stationary tests, under so many names."""
    life(f"sqlite:///{path}", bodies(states)[:states])
    multiply(f"sqlite:///{path}", clutches)


def replayed(path: Path, scheduler: str, advance: Callable[[int], object] = lambda _: None) -> Found:
    """A copy of the file replayed; `advance` hears of each clutch."""
    copy = path.with_name(f"{scheduler.partition(':')[0]}.db")
    shutil.copyfile(path, copy)
    with closing(open_database(f"sqlite:///{copy}")) as database:
        start = time.perf_counter()
        with executor_of(scheduler) as executor:
            for number, clutch_replayed in enumerate(replay(database, clutch_ids(database), executor), start=1):
                assert clutch_replayed.error is None, clutch_replayed
                advance(number)
        seconds = time.perf_counter() - start
        with database.reading() as connection:
            stored = {table.name: digest(connection, table) for table in RESULTS}
    copy.unlink()
    return Found(seconds=seconds, stored=stored)


def on_cluster(path: Path, clutches: int, workers: int) -> Found:
    """On a Dask cluster with a worker more, which is killed once a third of the clutches are done."""
    with local_cluster(workers + 1) as cluster:

        def kill_one(number: int) -> None:
            if number == clutches // 3:
                os.kill(cluster.workers[0].pid, signal.SIGKILL)

        found = replayed(path, cluster.address, kill_one)
        assert cluster.workers[0].wait(30) == -signal.SIGKILL
    return found


def costs(database: Database) -> dict[str, float]:
    """Milliseconds of the processor that a clutch takes, by step, in this process."""
    taken = dict.fromkeys(("load", "compute", "store"), 0.0)
    names = clutch_ids(database)[:PROFILED]
    for clutch_id in names:
        marks = [time.process_time()]
        with database.reading() as connection:
            state = repository.state(connection, clutch_id)
        recorded = repository.recorded(database, state, whole=True)
        marks.append(time.process_time())
        computed = repository.recomputed(recorded)
        marks.append(time.process_time())
        with database.writing() as connection:
            repository.store(connection, clutch_id, computed)
        marks.append(time.process_time())
        for step, began, ended in zip(taken, marks, marks[1:], strict=False):
            taken[step] += 1e3 * (ended - began) / len(names)
    return taken


def main(clutches: int, states: int, workers: int) -> None:
    """The table."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "source.db"
        source(path, states, clutches)
        with closing(open_database(f"sqlite:///{path}")) as database:
            costs(database)  # what is loaded and compiled once
            each = costs(database)
        before = time.process_time()
        local = replayed(path, "local")
        core = time.process_time() - before
        found = {"local": local, f"processes:{workers}": replayed(path, f"processes:{workers}")}
        found[f"Dask, {workers} workers and one that is killed"] = on_cluster(path, clutches, workers)
    times = {title: one.seconds for title, one in found.items()}
    rows = ((f"`{t}`", f"{s:.1f}", f"{clutches / s:.1f}", f"{local.seconds / s:.2f}") for t, s in times.items())
    print("\n".join(table((f"{clutches} clutches of {states} tests", "s", "clutches/s", "times local"), rows)))
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    steps = ", ".join(f"{step} {milliseconds:.1f} ms" for step, milliseconds in each.items())
    print(f"\nA clutch takes of a core: {steps}: {clutches / core:.1f} clutches/s/core in all, `local`.")
    print(f"A worker's part alone: {1e3 / each['compute']:.1f} clutches/s/core.")
    print(f"Processes beside took {children.ru_utime + children.ru_stime:.0f} s of the processor.")
    same = all(one.stored == local.stored for one in found.values())
    print(f"All three stored {'the same rows' if same else 'DIFFERENT rows'}.")
    if not same:
        raise SystemExit(1)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--clutches", type=int, default=300)
    parser.add_argument("--states", type=int, default=16, help="stationary tests of each")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    main(arguments.clutches, arguments.states, arguments.workers)
