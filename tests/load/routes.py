"""`python -m tests.load.routes`: what the polled routes cost beside an empty one of the same server, and a POST alone.

One keep-alive connection, one question at a time; all routes in turns, each turn in another order, so that what else the
machine does meets all alike.
With `--against PATH` the same of another checkout in the same run, in the same turns. Exit code 1 where a demand is not met.
"""

import argparse
import os
import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from tests.benchmarks.memory import family_seconds
from tests.load.bodies import Post, asked, life, registration
from tests.load.exchange import Blocking
from tests.support import free_port, wait_until_ready

#: Medians over that of the empty route, at most.
MOST_RATIO = {"GET remaining-useful-life, 304": 1.3, "GET remaining-useful-life": 1.6}
EMPTY, POST = "GET /empty", "POST a stationary run"
#: The clutch that is asked for, and the one that is posted to, turn by turn a new life of it.
_ASKED, _POSTED = "asked", "posted"
_SCRIPT = Path(__file__).with_name("empty_route.py")
_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkout:
    """A checkout's service, the line to it, and the prepared questions by name."""

    name: str
    pid: int
    line: Blocking
    questions: Mapping[str, bytes]


@contextmanager
def started(root: Path, database: Path) -> Iterator[tuple[int, int]]:
    """The port and the process of a checkout's service with the empty route."""
    port = free_port()
    environment = os.environ | {"PYTHONPATH": str(root)}
    command = [sys.executable, "-P", str(_SCRIPT), str(port), str(database)]
    process = subprocess.Popen(command, cwd=root, env=environment)
    try:
        wait_until_ready(f"http://127.0.0.1:{port}", lambda: process.poll() is not None)
        yield port, process.pid
    finally:
        process.terminate()
        process.wait(30)


def prepared(name: str, port: int, pid: int, posts: Sequence[Post]) -> Checkout:
    """A clutch with a life, and the questions for it."""
    line = Blocking(port)
    _must(line, registration(_ASKED))
    for post in posts:
        _must(line, post.request(_ASKED))
    address = f"/v1/clutches/{_ASKED}"
    life_now = _must(line, asked(f"{address}/remaining-useful-life"))
    questions = {
        EMPTY: asked("/empty"),
        "GET livez": asked("/livez"),
        "GET remaining-useful-life, 304": asked(f"{address}/remaining-useful-life", f"If-None-Match: {life_now}"),
        "GET remaining-useful-life": asked(f"{address}/remaining-useful-life"),
        "GET clutches": asked("/v1/clutches"),
        "GET degradation, computed before": asked(f"{address}/degradation"),
        "GET runs": asked(f"{address}/runs"),
    }
    return Checkout(name=name, pid=pid, line=line, questions=questions)


def get_times(checkouts: Sequence[Checkout], rounds: int, warm: int = 20) -> dict[tuple[str, str], list[float]]:
    """Times [s] by checkout and question, all in turns; the first rounds are not counted."""
    taken: dict[tuple[str, str], list[float]] = {}
    asked_for = [(checkout, name) for checkout in checkouts for name in checkout.questions]
    rng = random.Random(1)  # noqa: S311  (no secret)
    for number in range(-warm, rounds):
        rng.shuffle(asked_for)  # what comes after a long answer finds other caches than what comes after a short one
        for checkout, name in asked_for:
            started_at = time.perf_counter()
            answer = checkout.line.ask(checkout.questions[name])
            over = time.perf_counter() - started_at
            assert answer.status == (304 if name.endswith("304") else 200), (name, answer.status)
            if number >= 0:
                taken.setdefault((checkout.name, name), []).append(over)
    return taken


def post_times(
    checkouts: Sequence[Checkout], posts: Sequence[Post], lives: int
) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Of stationary runs, by checkout: times [s], and the mean [s] of the processor.

    Life after life, each run to all checkouts in turns.
    """
    taken: dict[str, list[float]] = {checkout.name: [] for checkout in checkouts}
    before = {checkout.name: family_seconds(checkout.pid) for checkout in checkouts}
    for number in range(lives):
        clutch_id = f"{_POSTED}-{number}"
        for checkout in checkouts:
            _must(checkout.line, registration(clutch_id))
        for post in posts:
            request = post.request(clutch_id)
            for checkout in checkouts:
                started_at = time.perf_counter()
                answer = checkout.line.ask(request)
                taken[checkout.name].append(time.perf_counter() - started_at)
                assert answer.status == 201, answer.body
    count = lives * len(posts)
    return taken, {
        checkout.name: (family_seconds(checkout.pid) - before[checkout.name]) / count for checkout in checkouts
    }


def _must(line: Blocking, request: bytes) -> str:
    """The entity tag of an answer that is to be good, "" where it has none."""
    answer = line.ask(request)
    assert answer.status in (200, 201), answer.body
    return answer.etag or ""


def gets_table(checkouts: Sequence[Checkout], taken: Mapping[tuple[str, str], list[float]]) -> tuple[list[str], bool]:
    """Quantiles of each route, the ratio of its median to the empty one; whether the first checkout meets the demands."""
    lines = [
        "| checkout | request | 10 %, ms | median | 90 % | times the empty route | demand |",
        "|---|---|---|---|---|---|---|",
    ]
    met = True
    for checkout in checkouts:
        floor = statistics.median(taken[checkout.name, EMPTY])
        for name in checkout.questions:
            times = taken[checkout.name, name]
            ratio, most = statistics.median(times) / floor, MOST_RATIO.get(name)
            demand = "" if most is None else f"<= {most}: {'yes' if ratio <= most else '**no**'}"
            met &= checkout is not checkouts[0] or most is None or ratio <= most
            lines.append(f"| {checkout.name} | {name} | {_quantiles(times)} | {ratio:.2f} | {demand} |")
    return lines, met


def posts_table(
    checkouts: Sequence[Checkout], taken: Mapping[str, list[float]], processor: Mapping[str, float]
) -> list[str]:
    """Quantiles of a POST alone, what it takes of the processor, and the ratios to the other checkout."""
    lines = ["| checkout | request | 10 %, ms | median | 90 % | of the processor, mean, ms | times the other's |"]
    lines.append("|---|---|---|---|---|---|---|")
    other = checkouts[-1].name
    for checkout in checkouts:
        times, worked = taken[checkout.name], processor[checkout.name]
        median = statistics.median(times) / statistics.median(taken[other])
        ratio = f"{median:.2f}, of the processor {worked / processor[other]:.2f}" if len(checkouts) > 1 else ""
        lines.append(f"| {checkout.name} | {POST} | {_quantiles(times)} | {1e3 * worked:.1f} | {ratio} |")
    return lines


def _quantiles(times: Sequence[float]) -> str:
    tenths = statistics.quantiles(times, n=10)
    return " | ".join(f"{1e3 * tenths[index]:.2f}" for index in (0, 4, 8))


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.load.routes", description=__doc__)
    parser.add_argument("--against", type=Path, help="the root of another checkout")
    parser.add_argument("--rounds", type=int, default=300)
    parser.add_argument("--lives", type=int, default=3, help="lives of 40 stationary runs each that are posted")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    roots = {"this": _ROOT}
    if options.against is not None:
        roots["other"] = options.against.resolve()
    posts = life(options.seed).posts
    with tempfile.TemporaryDirectory(prefix="clutchlife-routes-") as folder, ExitStack() as stack:
        checkouts = []
        for name, root in roots.items():
            port, pid = stack.enter_context(started(root, Path(folder) / f"{name}.db"))
            checkouts.append(prepared(name, port, pid, posts))
        lines, met = gets_table(checkouts, get_times(checkouts, options.rounds))
        print("\n".join(lines) + "\n")
        stationary = [post for post in posts if post.kind == "stationary_stribeck"]
        print("\n".join(posts_table(checkouts, *post_times(checkouts, stationary, options.lives))))
        for checkout in checkouts:
            checkout.line.close()
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
