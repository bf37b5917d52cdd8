"""`make load`: the rigs and clients of a test field against a service in a process of its own; the tables, as Markdown.

Without and with raw files among the posts, unless one is chosen. With `--services 4 --database postgresql` against one
service and then four on a PostgreSQL server that is started for it, or on the one at an address, whose database is empty;
half of the clutches are then of no fleet, and their answers compared with those of one service on a file.
Exit code 1 where a demand of `report.demands` is not met.
"""

import argparse
import asyncio
import gc
import os
import platform
import resource
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import httpx2

from models.rig.programme import WHOLE
from service.client.clutchlife import ClutchlifeError
from tests.lab.benchmarks.diagnosis import post_life
from tests.lab.benchmarks.memory import busy_seconds, family_seconds
from tests.lab.load import checks
from tests.lab.load.bodies import Post, life, long_file
from tests.lab.load.field import DIAGNOSED, Counts, Field, Options
from tests.lab.load.report import demands, markdown, paces
from tests.storage.engine.postgresql.server import postgresql_server
from tests.support import Server, serving

#: In place of an address: a server that is started for the load, whose commits are on the disk.
TEMPORARY = "postgresql"
#: Clutches of a fleet whose remaining life a replay must not change.
_REPLAYED = 2


def run(options: Options, folder: Path) -> Counts:
    """The load, and what is left of it."""
    lives = [
        life(options.seed + number, raw=folder if options.raw else None, tests=options.tests, samples=options.samples)
        for number in range(options.rigs)
    ]
    with ExitStack() as stack:
        database = options.database or folder / "load.db"
        servers = [stack.enter_context(serving(database, loaded=options.loaded)) for _ in range(options.services)]
        pids = [server.pid for server in servers]
        with httpx2.Client(base_url=servers[-1].url, timeout=120) as http:
            post_life(http, DIAGNOSED, options.states, WHOLE)
            if options.slow:
                http.post("/v1/clutches", json={"clutch_id": "slowly-read"}).raise_for_status()
                arguments = "kind=stationary_stribeck&cycles=0&filename=a.csv&run_id=file"
                answer = http.post(f"/v1/clutches/slowly-read/runs/file?{arguments}", content=long_file())
                answer.raise_for_status()
        gc.collect()
        gc.freeze()  # the prepared bodies are not looked through by the collector: it would delay what is sent meanwhile
        before = _worked(pids)
        field = asyncio.run(_loaded(options, servers, lives))
        field.counts.worked = {who: seconds - before[who] for who, seconds in _worked(pids).items()}
        gc.unfreeze()
        field.counts.losses = _wrong(field, servers[0], folder)
    return field.counts


async def _loaded(options: Options, servers: Sequence[Server], lives: Sequence[Sequence[Post]]) -> Field:
    begin = asyncio.get_running_loop().time() + 0.5
    field = Field(options=options, servers=servers, lives=lives, begin=begin, end=begin + options.seconds)
    await asyncio.gather(*field.tasks())
    await field.refresh_once()  # all clutches under what is known at the end
    return field


def _worked(pids: Sequence[int]) -> dict[str, float]:
    """Seconds of the processor that the services with their processes, the generator, the refreshes, and everything else on
    the machine have taken since each began; only differences mean anything."""
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    taken = {
        "service": sum(map(family_seconds, pids)),
        "generator": own.ru_utime + own.ru_stime,
        "refreshes": children.ru_utime + children.ru_stime,
    }
    return taken | {"others": busy_seconds() - sum(taken.values())}


def _wrong(field: Field, server: Server, folder: Path) -> list[str]:
    """What is lost, and what calm computing gives otherwise: of the first clutch of some rigs."""
    counts = field.counts
    first = [(number, f"load-{number}-000") for number in range(field.options.rigs)]
    posted = {clutch_id: field.fluid(number, 0) for number, clutch_id in first if clutch_id in counts.acknowledged}
    alone = dict(list(posted.items())[-field.options.alone :])
    taught = [clutch_id for clutch_id in posted if clutch_id not in alone][:_REPLAYED]
    asked_for: tuple[Callable[[], list[str]], ...] = (
        lambda: checks.losses(server, counts),
        lambda: checks.calm_differences(folder, server, alone, counts.acknowledged),
        lambda: checks.replay_differences(server, taught),
    )
    most = min(field.options.alone, field.options.rigs)
    wrong = [] if len(alone) == most else [f"runs of {len(alone)} clutches to be posted calmly, not of {most}"]
    for check in asked_for:
        try:
            wrong += check()
        except (httpx2.HTTPError, ClutchlifeError) as error:
            wrong.append(f"a check could not be made: {error}")
    return wrong


def report(options: Options) -> Counts:
    """Run and print."""
    with tempfile.TemporaryDirectory(prefix="clutchlife-load-") as folder:
        loaded = run(options, Path(folder))
    shown = "raw files among the posts" if options.raw else "no raw files"
    shown += f", {options.slow} slow readers" if options.slow else ""
    services = f", {options.services} services on PostgreSQL" if options.database else ""
    print(f"### {options.rigs} rigs and {options.clients} clients for {options.seconds:g} s, {shown}{services}\n")
    versions = f"Python {platform.python_version()}, SQLite {sqlite3.sqlite_version}"
    print(f"{versions}, {os.cpu_count()} cores, seed {options.seed}\n\n{markdown(loaded)}\n", flush=True)
    return loaded


def reports(options: Options) -> list[Counts]:
    """One service on a file; on PostgreSQL one service, then as many as are asked for, each on an empty database."""
    if options.database != TEMPORARY:
        return [report(options)]
    loads = []
    for services in sorted({1, options.services}):
        with postgresql_server(fsync="on", full_page_writes="on") as server:
            loads.append(report(replace(options, services=services, database=server.fresh())))
    print(f"{paces(loads)}\n", flush=True)
    return loads


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.lab.load", description=__doc__)
    for name, meaning in (
        ("seconds", "how long"),
        ("rigs", "that post"),
        ("clients", "that ask once a second"),
        ("seed", "of the lives, and of the moments in a second at which clients ask"),
        ("interval", "seconds from one run of a rig to its next, at least"),
        ("slow", "readers that ask for a run's file and take nothing of it"),
        ("services", "that share the database"),
        ("database", f"`{TEMPORARY}`: on a server that is started for it; or an address; left out: a file"),
    ):
        default = getattr(Options, name)
        parser.add_argument(f"--{name}", type=type(default), default=default, help=meaning)
    parser.add_argument(
        "--raw", action=argparse.BooleanOptionalAction, help="raw files among the posts; left out: both"
    )
    given = vars(parser.parse_args())
    chosen = given.pop("raw")
    options = Options(**given)
    if options.services > 1 and not options.database:
        parser.error("several services need a --database on PostgreSQL: one service uses a file at a time")
    variants = [False, True] if chosen is None else [chosen]
    loads = [load for raw in variants for load in reports(replace(options, raw=raw))]
    return 0 if all(each.met for load in loads for each in demands(load)) else 1


if __name__ == "__main__":
    sys.exit(main())
