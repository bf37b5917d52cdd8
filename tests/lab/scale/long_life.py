"""How requests grow with the tests of one life: `python -m tests.lab.scale.long_life`, the last table of `make scale`.

Two services run side by side, on a life of 100 tests and on one of 1,000, and are asked in turn: a run more, and what it
makes new. Ends with an error where a POST to the longer life takes more than MOST_TIMES as long, or its degradation more
than MOST_SECONDS, of the processor: by the clock it takes as much more as the machine has other work.
"""

import argparse
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator

import httpx2

from tests.lab.benchmarks.memory import family_seconds
from tests.lab.measuring import table
from tests.lab.scale.copies import bodies, life, name
from tests.support import Server, serving

SHORT, LONG, ROUNDS = 100, 1_000, 40
#: What a POST may take at LONG as a multiple of one at SHORT, and a degradation that is computed anew [s], of the processor.
MOST_TIMES, MOST_SECONDS = 1.5, 2.0
JSON = {"Content-Type": "application/json"}
POST, DEGRADATION = "POST a run", "GET degradation, the first after a POST"


Times = dict[str, list[tuple[float, float]]]


def asked(server: Server, runs: list[bytes], times: Times) -> Iterator[None]:
    """Runs, after each fifth of which degradation is asked for; by what is asked in ms by the clock, and of the processor in
    the service and its workers, one step at a time."""
    http = httpx2.Client(base_url=server.url, timeout=150)

    def timed(title: str, method: str, path: str, **request: object) -> None:
        before, start = family_seconds(server.pid), time.perf_counter()
        http.request(method, f"/v1/clutches/{name(0)}{path}", **request).raise_for_status()
        taken = time.perf_counter() - start
        times[title].append((1e3 * taken, 1e3 * (family_seconds(server.pid) - before)))

    for number, run in enumerate(runs):
        timed(POST, "POST", "/runs", content=run, headers=JSON)
        yield
        if number % 5 == 4:
            timed(DEGRADATION, "GET", "/degradation")
            yield
            timed("GET remaining life", "GET", "/remaining-useful-life")
            timed("GET runs, 10 of them", "GET", "/runs?limit=10")
            yield


def measured(short: int, long: int) -> list[dict[str, tuple[float, float]]]:
    """By what is asked, of lives of so many tests, the median in ms by the clock, and the mean of the processor, which is
    counted in hundredths of a second; the first requests, for which processes load what they need, are left out."""
    runs = bodies(long + ROUNDS)
    with tempfile.TemporaryDirectory() as folder:
        addresses = [f"sqlite:///{folder}/{tests}.db" for tests in (short, long)]
        for tests, address in zip((short, long), addresses, strict=True):
            life(address, runs[:tests])
        times: list[Times] = [defaultdict(list) for _ in addresses]
        with serving(addresses[0]) as first, serving(addresses[1]) as second:
            steps = [
                asked(server, runs[tests : tests + ROUNDS], taken)
                for server, tests, taken in zip((first, second), (short, long), times, strict=True)
            ]
            for _ in zip(*steps, strict=True):
                pass
    return [{title: _middle(each[len(each) // 5 :]) for title, each in taken.items()} for taken in times]


def _middle(times: list[tuple[float, float]]) -> tuple[float, float]:
    clock, processor = zip(*times, strict=True)
    return statistics.median(clock), statistics.mean(processor)


def main(short: int, long: int) -> None:
    """The table. Raises SystemExit where what is wanted is not met."""
    of_short, of_long = measured(short, long)
    rows = [
        (f"{title}, ms{of}", f"{few[k]:.1f}", f"{of_long[title][k]:.1f}", f"{of_long[title][k] / max(few[k], 0.1):.2f}")
        for title, few in of_short.items()
        for k, of in enumerate(("", " of the processor"))
    ]
    print("", *table(("one life of stationary tests, sqlite", short, long, "ratio"), rows), sep="\n")
    if of_long[POST][1] > MOST_TIMES * of_short[POST][1] or of_long[DEGRADATION][1] > 1e3 * MOST_SECONDS:
        raise SystemExit(
            f"wanted: a POST within {MOST_TIMES} times, a degradation within {MOST_SECONDS} s, of the processor"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--short", type=int, default=SHORT)
    parser.add_argument("--long", type=int, default=LONG)
    arguments = parser.parse_args()
    main(arguments.short, arguments.long)
