"""`python -m tests.load`: eight rigs and twenty clients against a service in a process of its own; the table, as Markdown.

Exit code 1 where a demand of `report.demands` is not met.
"""

import argparse
import asyncio
import gc
import os
import platform
import sqlite3
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import httpx2

from models.rig.programme import WHOLE
from tests.benchmarks.diagnosis import post_life
from tests.load import beside, checks
from tests.load.beside import Beside, Processor
from tests.load.bodies import SAMPLES, TESTS, life
from tests.load.field import ALONE, Field
from tests.load.report import Loaded, demands, markdown
from tests.support import Server, serving

#: The clutch that is diagnosed all the time; states with a stationary and a dynamic test each.
DIAGNOSED, STATES = "diagnosed", 10
#: Clutches of a fleet whose remaining life a replay must not change.
_REPLAYED = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """The load's size; `tests` in a life and `samples` of a raw file are smaller only where a test asks for it."""

    seconds: float = 180.0
    rigs: int = 8
    clients: int = 20
    seed: int = 1
    raw: bool = False
    interval: float = 0.0
    tests: int = TESTS
    samples: int = SAMPLES
    states: int = STATES


def run(options: Options, folder: Path) -> Loaded:
    """The load, and what is left of it."""
    files = folder if options.raw else None
    lives = [
        life(options.seed + number, raw=files, tests=options.tests, samples=options.samples)
        for number in range(options.rigs)
    ]
    database = folder / "load.db"
    with serving(database) as server:
        with httpx2.Client(base_url=server.url, timeout=120) as http:
            post_life(http, DIAGNOSED, options.states, WHOLE)
        gc.collect()
        gc.freeze()  # the prepared bodies stay: no pause to look through them
        before = Processor.since_start(server.pid)
        field, noted = asyncio.run(_loaded(options, server, database, lives))
        processor = Processor.since_start(server.pid).minus(before)
        gc.unfreeze()
        return Loaded(
            seconds=options.seconds,
            raw=options.raw,
            counts=field.counts,
            beside=noted,
            processor=processor,
            losses=_wrong(options, field, server, database, folder),
        )


async def _loaded(options: Options, server: Server, database: Path, lives: list) -> tuple[Field, Beside]:  # type: ignore[type-arg]
    begin = asyncio.get_running_loop().time() + 0.5
    end = begin + options.seconds
    field = Field(
        port=server.port,
        lives=lives,
        rigs=options.rigs,
        clients=options.clients,
        seed=options.seed,
        interval=options.interval,
        begin=begin,
        end=end,
    )
    noted = Beside()
    await asyncio.gather(
        *field.tasks(),
        beside.diagnose(server.port, DIAGNOSED, end, noted),
        beside.refresh_fleets(database, begin, end, noted),
        beside.watch(server.pid, begin, end, noted),
    )
    await beside.refresh_once(database, noted)  # all clutches under what is known at the end
    return field, noted


def _wrong(options: Options, field: Field, server: Server, database: Path, folder: Path) -> list[str]:
    """What is lost, and what calm computing gives otherwise."""
    acknowledged = field.counts.acknowledged
    wrong = checks.losses(server.port, acknowledged)
    first = {f"load-{number}-000": field.fluid(number, 0) for number in range(options.rigs)}
    taught = [clutch_id for clutch_id in list(first)[: options.rigs - ALONE] if clutch_id in acknowledged]
    alone = {clutch_id: fluid for clutch_id, fluid in list(first.items())[-ALONE:] if clutch_id in acknowledged}
    wrong += checks.calm_differences(folder, server.port, alone, acknowledged)
    wrong += checks.replay_differences(database, server.port, taught[:_REPLAYED])
    return wrong


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.load", description=__doc__)
    parser.add_argument("--seconds", type=float, default=180.0)
    parser.add_argument("--rigs", type=int, default=8)
    parser.add_argument("--clients", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--interval", type=float, default=0.0, help="seconds from one run of a rig to its next, at least"
    )
    parser.add_argument("--raw", action=argparse.BooleanOptionalAction, default=False, help="raw files among the posts")
    options = Options(**vars(parser.parse_args()))
    with tempfile.TemporaryDirectory(prefix="clutchlife-load-") as folder:
        loaded = run(options, Path(folder))
    shown = "with" if options.raw else "without"
    print(f"### {options.rigs} rigs and {options.clients} clients for {options.seconds:g} s, {shown} raw files\n")
    print(
        f"Python {platform.python_version()}, SQLite {sqlite3.sqlite_version}, {os.cpu_count()} cores, seed {options.seed}\n"
    )
    print(markdown(loaded))
    return 0 if all(each.met for each in demands(loaded)) else 1


if __name__ == "__main__":
    sys.exit(main())
