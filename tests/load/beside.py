"""What goes on beside the rigs and clients: a diagnosis after the other, fleets refreshed, memory watched."""

import asyncio
import os
import resource
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.benchmarks.memory import family, family_seconds, resident
from tests.load.bodies import posted
from tests.load.field import line, noted

#: Seconds between two looks at a diagnosis, between two refreshes, and between two looks at the memory.
LOOK_EVERY, REFRESH_EVERY, WATCH_EVERY = 0.5, 20.0, 1.0


@dataclass(slots=True)
class Beside:
    """What is noted of it; seconds and bytes."""

    diagnoses: list[float] = field(default_factory=list)
    refreshes: list[float] = field(default_factory=list)
    #: By second: the services alone, and with the processes that they have started.
    alone: list[int] = field(default_factory=list)
    together: list[int] = field(default_factory=list)
    problems: Counter[str] = field(default_factory=Counter)


async def diagnose(port: int, clutch_id: str, end: float, beside: Beside) -> None:
    """Have a clutch diagnosed, again and again, until the end."""
    loop = asyncio.get_running_loop()
    async with line(port) as http:
        question = posted(f"/v1/clutches/{clutch_id}/diagnoses", b"{}", Prefer="wait=0")
        while loop.time() < end:
            started = loop.time()
            answer = await noted(http, question, "POST diagnoses", beside.problems)
            if answer is None or answer.status_code not in (201, 202):
                await asyncio.sleep(LOOK_EVERY)
                continue
            report = answer.json()
            look = {"method": "GET", "url": answer.headers["location"]}
            while report["status"] == "running" and loop.time() < end:
                await asyncio.sleep(LOOK_EVERY)
                answer = await noted(http, look, "GET diagnoses", beside.problems)
                if answer is not None and answer.status_code == 200:
                    report = answer.json()
            if report["status"] == "finished":
                beside.diagnoses.append(loop.time() - started)
            elif report["status"] == "failed":
                beside.problems[f"diagnosis failed: {report.get('problem') or report.get('summary')}"] += 1


async def refresh_fleets(address: str, begin: float, end: float, beside: Beside) -> None:
    """Refresh the fleets every so many seconds until the end, in a process of its own."""
    loop = asyncio.get_running_loop()
    planned = begin + REFRESH_EVERY / 2
    while planned < end:
        await asyncio.sleep(max(0.0, planned - loop.time()))
        await refresh_once(address, beside)
        planned = max(planned + REFRESH_EVERY, loop.time())


async def refresh_once(address: str, beside: Beside) -> None:
    """The command that learns the fleets' priors again, waited for."""
    loop = asyncio.get_running_loop()
    started = loop.time()
    command = [sys.executable, "-m", "service.cli.main", "fleet", "refresh", "--database", address]
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(*command, stdout=pipe, stderr=pipe)
    _, errors = await process.communicate()
    beside.refreshes.append(loop.time() - started)
    if process.returncode != 0:
        beside.problems[f"fleet refresh ended with {process.returncode}: {errors[-160:].decode(errors='replace')}"] += 1


async def watch(pids: Sequence[int], begin: float, end: float, beside: Beside) -> None:
    """Resident memory of the services, alone and with their processes, once a second."""
    loop = asyncio.get_running_loop()
    planned = begin
    while planned < end:
        await asyncio.sleep(max(0.0, planned - loop.time()))
        beside.alone.append(sum(map(resident, pids)))
        beside.together.append(sum(resident(each) for pid in pids for each in family(pid)))
        planned += WATCH_EVERY


@dataclass(frozen=True, slots=True, kw_only=True)
class Processor:
    """Seconds of the processor since some moment: the generator, the services with their processes, the refreshes, and
    everything else on the machine."""

    generator: float
    service: float
    refreshes: float
    others: float

    @classmethod
    def since_start(cls, pids: Sequence[int]) -> "Processor":
        """Since each began, and the machine; only differences mean anything."""
        own, children = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
        service = sum(map(family_seconds, pids))
        generator, refreshes = own.ru_utime + own.ru_stime, children.ru_utime + children.ru_stime
        others = busy_seconds() - service - generator - refreshes
        return cls(generator=generator, service=service, refreshes=refreshes, others=others)

    def minus(self, before: "Processor") -> "Processor":
        """What was taken since `before`."""
        return Processor(**{name: getattr(self, name) - getattr(before, name) for name in self.__slots__})


def busy_seconds() -> float:
    """Seconds of the processors that the machine has worked since it was started."""
    user, nice, system, _, _, *interrupts = map(int, Path("/proc/stat").read_text(encoding="ascii").split()[1:9])
    return (user + nice + system + sum(interrupts[:2])) / os.sysconf("SC_CLK_TCK")
