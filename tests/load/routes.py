"""`python -m tests.load.routes`: what the polled routes cost beside an empty one of the same server, and a POST alone.

One keep-alive connection, one question at a time; all routes in turns, each turn in another order, so that what else the
machine does meets all alike. Exit code 1 where a demand is not met.
"""

import argparse
import gc
import multiprocessing
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

import uvicorn
from fastapi import Response
from threadpoolctl import threadpool_limits

from service.app import create_app
from service.settings import Settings
from tests.benchmarks.memory import family_seconds
from tests.load.bodies import Post, asked, life, registration
from tests.load.exchange import Blocking
from tests.support import free_port, wait_until_ready

#: Medians over that of the empty route, at most.
MOST_RATIO = {"GET remaining-useful-life, 304": 1.3, "GET remaining-useful-life": 1.6}
EMPTY, POST = "GET /empty", "POST a stationary run"
#: Rounds of all questions before those that are counted.
_WARM = 20


def serve(port: int, database: Path) -> None:
    """The service with an empty route beside its own: what the transport and the framework take of any answer."""
    threadpool_limits(limits=1, user_api="blas")
    app = create_app(Settings.from_environment(database=f"sqlite:///{database}"))

    @app.get("/empty")
    async def empty() -> Response:
        return Response()

    gc.collect()
    gc.freeze()
    uvicorn.run(app, port=port, log_level="warning", access_log=False, server_header=False)


@contextmanager
def started(database: Path) -> Iterator[tuple[int, int]]:
    """The port and the process of such a service."""
    port = free_port()
    process = multiprocessing.get_context("spawn").Process(target=serve, args=(port, database))
    process.start()
    assert process.pid is not None
    try:
        wait_until_ready(f"http://127.0.0.1:{port}", lambda: process.exitcode is not None)
        yield port, process.pid
    finally:
        process.terminate()
        process.join(30)


def prepared(line: Blocking, posts: Sequence[Post]) -> dict[str, bytes]:
    """A clutch with a life, and the questions for it, by name."""
    _must(line, registration("asked"))
    for post in posts:
        _must(line, post.request("asked"))
    address = "/v1/clutches/asked"
    life_now = _must(line, asked(f"{address}/remaining-useful-life"))
    return {
        EMPTY: asked("/empty"),
        "GET livez": asked("/livez"),
        "GET remaining-useful-life, 304": asked(f"{address}/remaining-useful-life", f"If-None-Match: {life_now}"),
        "GET remaining-useful-life": asked(f"{address}/remaining-useful-life"),
        "GET clutches": asked("/v1/clutches"),
        "GET degradation, computed before": asked(f"{address}/degradation"),
        "GET runs": asked(f"{address}/runs"),
    }


def get_times(line: Blocking, questions: Mapping[str, bytes], rounds: int) -> dict[str, list[float]]:
    """Times [s] by question, all in turns; the first rounds are not counted."""
    taken: dict[str, list[float]] = {name: [] for name in questions}
    names = list(questions)
    rng = random.Random(1)  # noqa: S311  (no secret)
    for number in range(-_WARM, rounds):
        rng.shuffle(names)  # what comes after a long answer finds other caches than what comes after a short one
        for name in names:
            started_at = time.perf_counter()
            answer = line.ask(questions[name])
            over = time.perf_counter() - started_at
            assert answer.status == (304 if name.endswith("304") else 200), (name, answer.status)
            if number >= 0:
                taken[name].append(over)
    return taken


def post_times(line: Blocking, pid: int, posts: Sequence[Post], lives: int) -> tuple[list[float], float]:
    """Times [s] of stationary runs, life after life, and the mean [s] of the processor."""
    taken = []
    before = family_seconds(pid)
    for number in range(lives):
        _must(line, registration(f"posted-{number}"))
        for post in posts:
            request = post.request(f"posted-{number}")
            started_at = time.perf_counter()
            answer = line.ask(request)
            taken.append(time.perf_counter() - started_at)
            assert answer.status == 201, answer.body
    return taken, (family_seconds(pid) - before) / len(taken)


def _must(line: Blocking, request: bytes) -> str:
    """The entity tag of an answer that is to be good, "" where it has none."""
    answer = line.ask(request)
    assert answer.status in (200, 201), answer.body
    return answer.etag or ""


def gets_table(taken: Mapping[str, Sequence[float]]) -> tuple[list[str], bool]:
    """Quantiles of each route, the ratio of its median to the empty one; whether the demands are met."""
    lines = ["| request | 10 %, ms | median | 90 % | times the empty route | demand |", "|---|---|---|---|---|---|"]
    met = True
    for name, times in taken.items():
        ratio, most = statistics.median(times) / statistics.median(taken[EMPTY]), MOST_RATIO.get(name)
        demand = "" if most is None else f"<= {most}: {'yes' if ratio <= most else '**no**'}"
        met &= most is None or ratio <= most
        lines.append(f"| {name} | {_quantiles(times)} | {ratio:.2f} | {demand} |")
    return lines, met


def _quantiles(times: Sequence[float]) -> str:
    tenths = statistics.quantiles(times, n=10)
    return " | ".join(f"{1e3 * tenths[index]:.2f}" for index in (0, 4, 8))


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.load.routes", description=__doc__)
    parser.add_argument("--rounds", type=int, default=300)
    parser.add_argument("--lives", type=int, default=3, help="lives of 40 stationary runs each that are posted")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    posts = life(options.seed).posts
    with (
        tempfile.TemporaryDirectory(prefix="clutchlife-routes-") as folder,
        started(Path(folder) / "routes.db") as (port, pid),
        closing(Blocking(port)) as line,
    ):
        lines, met = gets_table(get_times(line, prepared(line, posts), options.rounds))
        stationary = [post for post in posts if post.kind == "stationary_stribeck"]
        times, worked = post_times(line, pid, stationary, options.lives)
    print("\n".join(lines))
    print("\n| request | 10 %, ms | median | 90 % | of the processor, mean, ms |\n|---|---|---|---|---|")
    print(f"| {POST} | {_quantiles(times)} | {1e3 * worked:.1f} |")
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
