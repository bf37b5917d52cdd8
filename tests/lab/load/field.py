"""The test field: rigs that post life after life, clients that ask once a second, and what is counted of them.

Beside them a clutch is diagnosed again and again, fleets are refreshed, and memory is watched. Slow readers ask for a run's
file of some 15 MB and take nothing of it.

A rig begins at a moment of its own, and sends its next run when the last one's receipt has come (closed loop). A client's
questions are planned by the clock (open loop): each is measured from the moment at which it was to be sent, whether or not
its connection was free by then, so that a service that stands for a second is charged for all that would have been asked in
it.
"""

import asyncio
import itertools
import random
import socket
import sys
from collections import Counter, defaultdict
from collections.abc import AsyncIterator, Awaitable, Sequence
from dataclasses import dataclass, field

from httpx2 import AsyncClient, Limits, Response, TimeoutException, TransportError

from service.web.limits import TAKEN_SECONDS
from tests.lab.benchmarks.memory import family, resident
from tests.lab.load.bodies import SAMPLES, TESTS, Post, Request, posted, registration
from tests.support import Server

#: What a client asks in each second, a quarter of a second apart.
ROUTES = ("remaining-useful-life", "degradation", "clutches", "runs")
LIST, LIVEZ = "clutches", "livez"
#: Seconds between two questions whether the service lives.
LIVEZ_EVERY = 0.1
#: Seconds after the end until which questions that were planned before it are still asked.
GRACE = 5.0
#: Seconds that a rig waits after an error where the answer names none, before it sends the same run again.
_PAUSE = 1.0
#: The clutch that is diagnosed all the time.
DIAGNOSED = "diagnosed"
#: Seconds between two looks at a diagnosis, between two refreshes, and between two looks at the memory.
LOOK_EVERY, REFRESH_EVERY, WATCH_EVERY = 0.5, 20.0, 1.0
#: The file that slow readers ask for, and seconds after which each asks again: the service has cut it off before.
OTHER_ADDRESS = "127.0.0.2"
SLOWLY_READ, SLOW_SECONDS = "/v1/clutches/slowly-read/runs/file/file", TAKEN_SECONDS + 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledged:
    """A run whose receipt has come, and the hash in that."""

    post: Post
    sha256: str


@dataclass(frozen=True, kw_only=True)
class Options:
    """The load's size; `interval`: seconds from one run of a rig to its next, at least.

    Where a test asks for it, `tests` in a life, `samples` of a raw file and `states` of the diagnosed clutch are fewer, and
    services are forked off a loaded process (`loaded`). `slow` readers ask for a file and take nothing of it.
    `services` share a `database`, an address; empty: one service, on a file.
    """

    seconds: float = 180.0
    rigs: int = 8
    clients: int = 20
    seed: int = 1
    raw: bool = False
    interval: float = 0.52
    slow: int = 0
    tests: int = TESTS
    samples: int = SAMPLES
    states: int = 10
    loaded: bool = False
    services: int = 1
    database: str = ""

    @property
    def alone(self) -> int:
        """Rigs whose clutches have a fluid of their own each: no fleet teaches them, so that a fresh service which is sent
        their runs alone answers the same."""
        return max(2, self.rigs // 2) if self.database else 2


@dataclass(slots=True)
class Counts:
    """All that is counted of a load; times in seconds."""

    options: Options
    gets: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)
    posts: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    kinds: Counter[str] = field(default_factory=Counter)
    #: All that was not 2xx or 304, by status and reason.
    problems: Counter[str] = field(default_factory=Counter)
    #: Questions that were still to be asked when the grace was over; their times so far are among `gets`.
    unasked: int = 0
    #: By how much the generator itself was late at most.
    late: float = 0.0
    acknowledged: dict[str, list[Acknowledged]] = field(default_factory=lambda: defaultdict(list))
    #: Runs of which it is not known whether they are stored: no receipt came, and the time was over.
    unanswered: set[tuple[str, str]] = field(default_factory=set)
    #: Runs that the service has taken in and holds back from the tracks, where it does so.
    held: int = 0
    diagnoses: list[float] = field(default_factory=list)
    refreshes: list[float] = field(default_factory=list)
    #: How the answers to slow readers began, or that there was none.
    slow: Counter[str] = field(default_factory=Counter)
    #: Bytes by second: the services alone, and with the processes that they have started.
    alone: list[int] = field(default_factory=list)
    together: list[int] = field(default_factory=list)
    #: Of the processor, by who worked.
    worked: dict[str, float] = field(default_factory=dict)
    #: What is lost, or other than what calm computing gives.
    losses: list[str] = field(default_factory=list)

    @property
    def runs(self) -> int:
        """Runs acknowledged."""
        return sum(map(len, self.acknowledged.values()))

    @property
    def pace(self) -> float:
        """Runs acknowledged a second."""
        return self.runs / self.options.seconds


@dataclass(slots=True)
class Field:
    """The field on the services that share a database, over which rigs and clients are spread, from `begin` to `end` by the
    clock of the event loop."""

    options: Options
    servers: Sequence[Server]
    lives: Sequence[Sequence[Post]]
    begin: float
    end: float
    counts: Counts = field(init=False)
    #: The clutch on each rig, None before the first.
    on_rigs: list[str | None] = field(init=False)

    def __post_init__(self) -> None:
        self.counts = Counts(self.options)
        self.on_rigs = [None] * self.options.rigs

    def tasks(self) -> list[Awaitable[None]]:
        """Everything that runs until `end`."""
        rng = random.Random(self.options.seed)  # noqa: S311  (no secret)
        tasks: list[Awaitable[None]] = [self._rig(number, rng.random()) for number in range(self.options.rigs)]
        for number in range(self.options.clients):
            phase = rng.random()
            tasks += [self._client(number, phase, part) for part in range(len(ROUTES))]
        tasks += [self._read_slowly() for _ in range(self.options.slow)]
        return [*tasks, self._livez(), self._diagnose(), self._refresh_fleets(), self._watch()]

    def _line(self, number: int) -> AsyncClient:
        """A connection of one's own, closed before the service would close it, whose answers are not packed."""
        url = self.servers[number % len(self.servers)].url
        headers, limits = {"Accept-Encoding": "identity"}, Limits(max_connections=1, keepalive_expiry=2.0)
        return AsyncClient(base_url=url, timeout=60, headers=headers, limits=limits, verify=False)

    async def _noted(self, http: AsyncClient, request: Request, what: str) -> Response | None:
        """An answer; counts what was not 2xx or 304, by status and its first words. None where no answer came."""
        problems = self.counts.problems
        try:
            answer = await http.request(**request)
        except TimeoutException:
            problems[f"{what}: no answer in time"] += 1
        except TransportError as error:
            problems[f"{what}: connection lost ({error})"] += 1
        else:
            if not (answer.is_success or answer.status_code == 304):
                problems[f"{what}: {answer.status_code} {answer.text[:120]}"] += 1
            return answer
        return None

    # --- rigs ---

    async def _rig(self, number: int, phase: float) -> None:
        loop = asyncio.get_running_loop()
        async with self._line(number) as http:
            await _until(self.begin + phase * self.options.interval)  # rigs know nothing of each other
            for turn in itertools.count():
                clutch_id = f"load-{number}-{turn:03d}"
                if await self._sent(http, registration(clutch_id, self.fluid(number, turn)), "registration") is None:
                    return
                self.on_rigs[number] = clutch_id
                for post in self.lives[(number + turn) % len(self.lives)]:
                    started = loop.time()
                    answer = await self._sent(http, post.request(clutch_id), "sampled" if post.sampled else "plain")
                    if answer is None:
                        self.counts.unanswered.add((clutch_id, post.run_id))
                        return
                    receipt = answer.json()
                    self.counts.acknowledged[clutch_id].append(
                        Acknowledged(post=post, sha256=receipt["content_sha256"])
                    )
                    self.counts.held += receipt.get("state") == "held"
                    self.counts.kinds["raw file" if post.raw else post.kind] += 1
                    await _until(started + self.options.interval)

    def fluid(self, number: int, turn: int) -> str:
        """The fluid of that clutch: the last rigs' clutches have each their own."""
        return f"ATF {number} {turn}" if number >= self.options.rigs - self.options.alone else "ATF"

    async def _sent(self, http: AsyncClient, request: Request, what: str) -> Response | None:
        """The good answer to a POST, which is sent again after an error; None where the time is over before."""
        loop = asyncio.get_running_loop()
        while loop.time() < self.end:
            started = loop.time()
            answer = await self._noted(http, request, f"POST {what}")
            self.counts.posts[what].append(loop.time() - started)
            if answer is not None and answer.is_success:
                return answer
            pause = _PAUSE if answer is None else float(answer.headers.get("retry-after") or _PAUSE)
            await asyncio.sleep(pause)
        return None

    # --- clients ---

    async def _client(self, number: int, phase: float, part: int) -> None:
        """What a client asks of one route, on a connection of its own as a browser does.

        A dashboard names the answer that it has, a script does not.
        """
        tags, route, dashboard = dict[str, str](), ROUTES[part], number % 2 == 0
        async with self._line(number + part) as http:
            async for tick, planned in self._planned(route, phase + part / len(ROUTES), 1.0):
                clutch_id = self.on_rigs[(number + tick) % self.options.rigs]
                if clutch_id is None:
                    continue
                address = "/v1/clutches" if route == LIST else f"/v1/clutches/{clutch_id}/{route}"
                known = {"If-None-Match": tags[address]} if dashboard and address in tags else {}
                answer = await self._timed(http, address, route, planned, known)
                if answer is not None and "etag" in answer.headers:
                    tags[address] = answer.headers["etag"]

    async def _livez(self) -> None:
        async with self._line(0) as http:
            async for _, planned in self._planned(LIVEZ, 0.0, LIVEZ_EVERY):
                await self._timed(http, "/livez", LIVEZ, planned, {})

    async def _planned(self, route: str, phase: float, every: float) -> AsyncIterator[tuple[int, float]]:
        """The number and the moment of each question, once due, until the end; where the grace is over, the time so far
        counts instead."""
        loop = asyncio.get_running_loop()
        for number in itertools.count():
            planned = self.begin + phase + number * every
            if planned >= self.end:
                return
            if planned > loop.time():
                await _until(planned)
                self.counts.late = max(self.counts.late, loop.time() - planned)
            if loop.time() < self.end + GRACE:
                yield number, planned
            else:
                self.counts.unasked += 1
                self.counts.gets[route].append(loop.time() - planned)

    async def _timed(
        self, http: AsyncClient, address: str, route: str, planned: float, headers: dict[str, str]
    ) -> Response | None:
        request = {"method": "GET", "url": address, "headers": headers}
        answer = await self._noted(http, request, f"GET {route}")
        self.counts.gets[route].append(asyncio.get_running_loop().time() - planned)
        if answer is not None:
            self.counts.statuses[route, answer.status_code] += 1
        return answer

    # --- beside them ---

    async def _diagnose(self) -> None:
        """Have a clutch diagnosed, again and again."""
        loop = asyncio.get_running_loop()
        async with self._line(-1) as http:
            question = posted(f"/v1/clutches/{DIAGNOSED}/diagnoses", b"{}", Prefer="wait=0")
            while loop.time() < self.end:
                started = loop.time()
                answer = await self._noted(http, question, "POST diagnoses")
                if answer is None or answer.status_code not in (201, 202):
                    await asyncio.sleep(LOOK_EVERY)
                    continue
                report = answer.json()
                look = {"method": "GET", "url": answer.headers["location"]}
                while report["status"] == "running" and loop.time() < self.end:
                    await asyncio.sleep(LOOK_EVERY)
                    answer = await self._noted(http, look, "GET diagnoses")
                    if answer is not None and answer.status_code == 200:
                        report = answer.json()
                if report["status"] == "finished":
                    self.counts.diagnoses.append(loop.time() - started)
                elif report["status"] == "failed":
                    reason = report.get("problem") or report.get("summary")
                    self.counts.problems[f"diagnosis failed: {reason}"] += 1

    async def _refresh_fleets(self) -> None:
        """Refresh the fleets every so many seconds, in a process of its own."""
        planned = self.begin + REFRESH_EVERY / 2
        while planned < self.end:
            await _until(planned)
            await self.refresh_once()
            planned = max(planned + REFRESH_EVERY, asyncio.get_running_loop().time())

    async def refresh_once(self) -> None:
        """The command that learns the fleets' priors again, waited for."""
        loop = asyncio.get_running_loop()
        started, address = loop.time(), self.servers[0].address
        command = [sys.executable, "-m", "service.cli.main", "fleet", "refresh", "--database", address]
        pipe = asyncio.subprocess.PIPE
        process = await asyncio.create_subprocess_exec(*command, stdout=pipe, stderr=pipe)
        _, errors = await process.communicate()
        self.counts.refreshes.append(loop.time() - started)
        if process.returncode != 0:
            said = errors[-160:].decode(errors="replace")
            self.counts.problems[f"fleet refresh ended with {process.returncode}: {said}"] += 1

    async def _read_slowly(self) -> None:
        """Ask for a file and take nothing of it, again and again."""
        loop, request = asyncio.get_running_loop(), f"GET {SLOWLY_READ} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
        while loop.time() < self.end:
            with socket.socket() as line:
                line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 12)
                line.bind((OTHER_ADDRESS, 0))  # the rigs' address has a share of requests of its own
                line.setblocking(False)
                await loop.sock_connect(line, ("127.0.0.1", self.servers[0].port))
                await loop.sock_sendall(line, request)
                await asyncio.sleep(min(SLOW_SECONDS, self.end - loop.time()))
                try:
                    self.counts.slow[line.recv(12).decode()] += 1
                except OSError:
                    self.counts.slow["none"] += 1

    async def _watch(self) -> None:
        """Resident memory of the services, alone and with their processes, once a second."""
        planned, pids = self.begin, [server.pid for server in self.servers]
        while planned < self.end:
            await _until(planned)
            self.counts.alone.append(sum(map(resident, pids)))
            self.counts.together.append(sum(resident(each) for pid in pids for each in family(pid)))
            planned += WATCH_EVERY


async def _until(moment: float) -> None:
    """Sleep until a moment of the loop's clock; where it is over, others have their turn."""
    await asyncio.sleep(max(0.0, moment - asyncio.get_running_loop().time()))
