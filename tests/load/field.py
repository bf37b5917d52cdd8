"""The test field: rigs that post life after life, clients that ask once a second, and what is counted of them.

A rig begins at a moment of its own, and sends its next run when the last one's receipt has come (closed loop). A client's
questions are planned by the clock (open loop): each is measured from the moment at which it was to be sent, whether or not
its connection was free by then, so that a service that stands for a second is charged for all that would have been asked in
it.
"""

import asyncio
import itertools
import json
import random
from collections import Counter, defaultdict
from collections.abc import Awaitable, Sequence
from contextlib import closing
from dataclasses import dataclass, field

from tests.load.bodies import Post, SentLife, asked, registration
from tests.load.exchange import Answer, Line, LostError

#: What a client asks in each second, a quarter of a second apart.
ROUTES = ("remaining-useful-life", "degradation", "clutches", "runs")
LIST, LIVEZ = "clutches", "livez"
#: Seconds between two questions whether the service lives.
LIVEZ_EVERY = 0.1
#: Seconds after the end until which questions that were planned before it are still asked.
GRACE = 5.0
#: Rigs whose clutches have a fluid of their own each: no fleet teaches them, so that a fresh service answers the same.
ALONE = 2
#: Seconds that a rig waits after an error where the answer names none, before it sends the same run again.
_PAUSE = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Acknowledged:
    """A run whose receipt has come, and the hash in that."""

    post: Post
    sha256: str


@dataclass(slots=True)
class Counts:
    """All that is counted; times in seconds."""

    gets: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)
    posts: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    kinds: Counter[str] = field(default_factory=Counter)
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


@dataclass(slots=True)
class Field:
    """The field on the ports of the services that share a database, over which rigs and clients are spread, from `begin` to
    `end` by the clock of the event loop."""

    ports: Sequence[int]
    lives: Sequence[SentLife]
    rigs: int
    clients: int
    seed: int
    interval: float
    begin: float
    end: float
    alone: int = ALONE
    counts: Counts = field(default_factory=Counts)
    #: The clutch on each rig, None before the first.
    on_rigs: list[str | None] = field(init=False)

    def __post_init__(self) -> None:
        self.on_rigs = [None] * self.rigs

    def tasks(self) -> list[Awaitable[None]]:
        """Everything that runs until `end`."""
        rng = random.Random(self.seed)  # noqa: S311  (no secret)
        tasks: list[Awaitable[None]] = [self._rig(number, rng.random()) for number in range(self.rigs)]
        for number in range(self.clients):
            phase = rng.random()
            tasks += [self._client(number, phase, part) for part in range(len(ROUTES))]
        return [*tasks, self._livez()]

    def _port(self, number: int) -> int:
        return self.ports[number % len(self.ports)]

    # --- rigs ---

    async def _rig(self, number: int, phase: float) -> None:
        loop = asyncio.get_running_loop()
        with closing(Line(self._port(number))) as line:
            await _until(self.begin + phase * self.interval)  # rigs know nothing of each other
            for turn in itertools.count():
                clutch_id = f"load-{number}-{turn:03d}"
                if await self._sent(line, registration(clutch_id, self.fluid(number, turn)), "registration") is None:
                    return
                self.on_rigs[number] = clutch_id
                for post in self.life(number, turn).posts:
                    started = loop.time()
                    answer = await self._sent(line, post.request(clutch_id), "sampled" if post.sampled else "plain")
                    if answer is None:
                        self.counts.unanswered.add((clutch_id, post.run_id))
                        return
                    self._acknowledge(clutch_id, post, answer)
                    await _until(started + self.interval)

    def life(self, number: int, turn: int) -> SentLife:
        """The life that a rig posts at its so many-th turn."""
        return self.lives[(number + turn) % len(self.lives)]

    def fluid(self, number: int, turn: int) -> str:
        """The fluid of that clutch: the last rigs' clutches have each their own."""
        return f"ATF {number} {turn}" if number >= self.rigs - self.alone else "ATF"

    async def _sent(self, line: Line, request: bytes, what: str) -> Answer | None:
        """The good answer to a POST, which is sent again after an error; None where the time is over before."""
        loop = asyncio.get_running_loop()
        while loop.time() < self.end:
            started = loop.time()
            answer = await noted(line, request, f"POST {what}", self.counts.problems)
            self.counts.posts[what].append(loop.time() - started)
            if answer is not None and answer.status in (200, 201):
                return answer
            pause = _PAUSE if answer is None else float(answer.headers.get(b"retry-after", b"") or _PAUSE)
            await asyncio.sleep(pause)
        return None

    def _acknowledge(self, clutch_id: str, post: Post, answer: Answer) -> None:
        receipt = json.loads(answer.body)
        self.counts.acknowledged[clutch_id].append(Acknowledged(post=post, sha256=receipt["content_sha256"]))
        self.counts.held += receipt.get("state") == "held"
        self.counts.kinds["raw file" if post.raw else post.kind] += 1

    # --- clients ---

    async def _client(self, number: int, phase: float, part: int) -> None:
        """What a client asks of one route, on a connection of its own as a browser does.

        A dashboard names the answer that it has, a script does not.
        """
        tags, route, dashboard = dict[str, str](), ROUTES[part], number % 2 == 0
        with closing(Line(self._port(number + part))) as line:
            for tick in itertools.count():
                planned = self.begin + phase + tick + part / len(ROUTES)
                if planned >= self.end:
                    return
                if not await self._due(planned, route):
                    continue
                clutch_id = self.on_rigs[(number + tick) % self.rigs]
                if clutch_id is None:
                    continue
                address = "/v1/clutches" if route == LIST else f"/v1/clutches/{clutch_id}/{route}"
                known = tags.get(address) if dashboard else None
                request = asked(address) if known is None else asked(address, f"If-None-Match: {known}")
                answer = await self._timed(line, request, route, planned)
                if answer is not None and answer.etag is not None:
                    tags[address] = answer.etag

    async def _livez(self) -> None:
        request = asked("/livez")
        with closing(Line(self._port(0))) as line:
            for number in itertools.count():
                planned = self.begin + number * LIVEZ_EVERY
                if planned >= self.end:
                    return
                if await self._due(planned, LIVEZ):
                    await self._timed(line, request, LIVEZ, planned)

    async def _due(self, planned: float, route: str) -> bool:
        """Wait for the planned moment; False where the grace is over, the time so far then counts."""
        loop = asyncio.get_running_loop()
        if planned > loop.time():
            await _until(planned)
            self.counts.late = max(self.counts.late, loop.time() - planned)
        if loop.time() < self.end + GRACE:
            return True
        self.counts.unasked += 1
        self.counts.gets[route].append(loop.time() - planned)
        return False

    async def _timed(self, line: Line, request: bytes, route: str, planned: float) -> Answer | None:
        answer = await noted(line, request, f"GET {route}", self.counts.problems)
        self.counts.gets[route].append(asyncio.get_running_loop().time() - planned)
        if answer is not None:
            self.counts.statuses[route, answer.status] += 1
        return answer


async def noted(line: Line, request: bytes, what: str, problems: Counter[str]) -> Answer | None:
    """An answer; counts what was not 2xx or 304, by status and reason. None where no answer came."""
    try:
        answer = await line.ask(request)
    except TimeoutError:
        problems[f"{what}: no answer in time"] += 1
    except LostError as error:
        problems[f"{what}: connection lost ({error})"] += 1
    else:
        if not (200 <= answer.status < 300 or answer.status == 304):
            problems[f"{what}: {answer.status} {reason(answer)}"] += 1
        return answer
    return None


def reason(answer: Answer) -> str:
    """The detail of a problem, else its first bytes."""
    try:
        problem = json.loads(answer.body)
        return str(problem.get("detail") or problem.get("title"))[:120]
    except (ValueError, AttributeError):
        return answer.body[:80].decode(errors="replace")


async def _until(moment: float) -> None:
    """Sleep until a moment of the loop's clock."""
    remaining = moment - asyncio.get_running_loop().time()
    if remaining > 0:
        await asyncio.sleep(remaining)
