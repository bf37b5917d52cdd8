"""What goes on beside the rigs and clients: a diagnosis after the other, fleets refreshed, memory watched."""

import asyncio
import os
import resource
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.memory import family, family_seconds, resident
from tests.load.bodies import posted
from tests.load.field import Counts, line, noted, until

#: Seconds between two looks at a diagnosis, between two refreshes, and between two looks at the memory.
LOOK_EVERY, REFRESH_EVERY, WATCH_EVERY = 0.5, 20.0, 1.0


async def diagnose(port: int, clutch_id: str, end: float, counts: Counts) -> None:
    """Have a clutch diagnosed, again and again, until the end."""
    loop = asyncio.get_running_loop()
    async with line(port) as http:
        question = posted(f"/v1/clutches/{clutch_id}/diagnoses", b"{}", Prefer="wait=0")
        while loop.time() < end:
            started = loop.time()
            answer = await noted(http, question, "POST diagnoses", counts.problems)
            if answer is None or answer.status_code not in (201, 202):
                await asyncio.sleep(LOOK_EVERY)
                continue
            report = answer.json()
            look = {"method": "GET", "url": answer.headers["location"]}
            while report["status"] == "running" and loop.time() < end:
                await asyncio.sleep(LOOK_EVERY)
                answer = await noted(http, look, "GET diagnoses", counts.problems)
                if answer is not None and answer.status_code == 200:
                    report = answer.json()
            if report["status"] == "finished":
                counts.diagnoses.append(loop.time() - started)
            elif report["status"] == "failed":
                counts.problems[f"diagnosis failed: {report.get('problem') or report.get('summary')}"] += 1


async def refresh_fleets(address: str, begin: float, end: float, counts: Counts) -> None:
    """Refresh the fleets every so many seconds until the end, in a process of its own."""
    planned = begin + REFRESH_EVERY / 2
    while planned < end:
        await until(planned)
        await refresh_once(address, counts)
        planned = max(planned + REFRESH_EVERY, asyncio.get_running_loop().time())


async def refresh_once(address: str, counts: Counts) -> None:
    """The command that learns the fleets' priors again, waited for."""
    loop = asyncio.get_running_loop()
    started = loop.time()
    command = [sys.executable, "-m", "service.cli.main", "fleet", "refresh", "--database", address]
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*command, stdout=pipe, stderr=pipe)
    _, errors = await process.communicate()
    counts.refreshes.append(loop.time() - started)
    if process.returncode != 0:
        counts.problems[f"fleet refresh ended with {process.returncode}: {errors[-160:].decode(errors='replace')}"] += 1


async def watch(pids: Sequence[int], begin: float, end: float, counts: Counts) -> None:
    """Resident memory of the services, alone and with their processes, once a second."""
    planned = begin
    while planned < end:
        await until(planned)
        counts.alone.append(sum(map(resident, pids)))
        counts.together.append(sum(resident(each) for pid in pids for each in family(pid)))
        planned += WATCH_EVERY


def worked(pids: Sequence[int]) -> dict[str, float]:
    """Seconds of the processor that the services with their processes, the generator, the refreshes, and everything else on
    the machine have taken since each began; only differences mean anything."""
    own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    taken = {
        "service": sum(map(family_seconds, pids)),
        "generator": own.ru_utime + own.ru_stime,
        "refreshes": children.ru_utime + children.ru_stime,
    }
    return taken | {"others": busy_seconds() - sum(taken.values())}


def busy_seconds() -> float:
    """Seconds of the processors that the machine has worked since it was started."""
    user, nice, system, _, _, *interrupts = map(int, Path("/proc/stat").read_text(encoding="ascii").split()[1:9])
    return (user + nice + system + sum(interrupts[:2])) / os.sysconf("SC_CLK_TCK")
